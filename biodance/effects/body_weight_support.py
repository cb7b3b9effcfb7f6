"""Something lifts the person: a harness on a rope, a bungee to the ceiling, a helper who holds under the arms.

Signature: Fz lacks a part of the weight, less of it the higher the person is; the horizontal force points back under
the suspension. Look-alikes: a wrong body mass or a gain of Fz while the person stays at one height; a steady contact at
the same segment. Separated by squats, which change the height, and by weighing the person without the support.
"""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.records import Array
from biodance.spatial import wrench_of_force

ROPE = 2.0
"""m from the harness to the suspension: a ceiling of about 3 m."""


class BodyWeightSupport(Effect):
    """A mean lift ``force`` (N) on segment ``target`` from a rope of 2 m, and its ``stiffness`` (N/m): so much less
    per metre upwards.
    """

    name = "body_weight_support"
    parameters = (
        Parameter("force", "N", 100.0, "15-30 % of body weight in overground support (SciELO S1413-35552014000600572)"),
        Parameter("stiffness", "N/m", 150.0, "constant-force systems near 0, bungees some hundred newtons per metre"),
    )
    separated_by = "Squats: a spring gives back what it lifts when the person rises; a wrong mass does not."
    advice = (
        "Weigh the person without the support; measure the rope with a load cell, or record one trial with it slack."
    )

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return the pelvis and the trunk; the root's segment of other bodies."""
        return tuple(name for name in case.body.segments if name in ("pelvis", "trunk_head")) or case.body.segments[:1]

    def columns(self, case: Case) -> Array:
        """Return minus the wrench of the support: what it carries, the plates miss."""
        index = case.body.segment_index(self.target)
        com = case.phi[10 * index + 1 : 10 * index + 4] / case.phi[10 * index]
        point = case.poses.points([index], com[None])[:, 0]
        away = point - point.mean(axis=0)
        up = np.array([0.0, 0.0, 1.0])
        lift = up - away * (1 - up) / ROPE
        spring = -away[:, 2:] * up
        return -np.stack([wrench_of_force(force, point) for force in (lift, spring)], axis=2)

    def possible(self, theta: Array) -> bool:
        """Return whether the size is positive: a rope pulls."""
        return bool(theta[0] > 0)

    def possible_in(self, case: Case, theta: Array) -> bool:
        """Return whether the rope carries no more than the person weighs."""
        return bool(0 < theta[0] <= case.body.sip.mass.sum() * np.linalg.norm(case.body.gravity))


EFFECT = BodyWeightSupport

"""Something lifts the person: a harness on a rope, a bungee to the ceiling, a helper who holds under the arms."""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.words import About, CauseWords, CheckKind
from biodance.motion.kinematics import poses
from biodance.records import Array
from biodance.spatial import wrench_of_force

ROPE, _SHORTEST = 2.0, 0.5
"""m from the harness to the hook when the person stands upright: a ceiling of about 3 m; and at least."""


class BodyWeightSupport(Effect):
    """A rope from a hook that stays where it is to a point ``high`` m above the centre of mass of segment ``target``:
    it pulls with ``force`` (N) when the person stands upright under it, and with ``stiffness`` (N/m) more for every
    metre that it gets longer. The hook is ``aside_x``, ``aside_y`` m from the middle of the plates, the rope ``longer``
    (m) than `ROPE`.
    """

    name = "body_weight_support"
    parameters = (
        Parameter(
            "force",
            "N",
            100.0,
            "15-30 % of body weight in overground support (SciELO S1413-35552014000600572)",
            # N that matter: as a zero of a plate, 0.3 % of an adult's weight.
            least=2.0,
        ),
        Parameter("stiffness", "N/m", 150.0, "constant-force systems near 0, bungees some hundred newtons per metre"),
        Parameter("high", "m", 0.1, "from the hips' belt to the shoulders' straps of a harness"),
        Parameter("aside_x", "m", 0.1, "who hangs a rope hangs it over the plates"),
        Parameter("aside_y", "m", 0.1, "as the other axis"),
        Parameter("longer", "m", 0.4, "ceilings of 2.6 to 3.4 m"),
    )
    separated_by = "Squats: a spring gives back what it lifts when the person rises; a wrong mass does not."
    advice = (
        "Weigh the person without the support; measure the rope with a load cell, or record one trial with it slack."
    )
    about = About(
        what=(
            "Something lifts the person: a harness on a rope, a bungee to the ceiling, a helper who holds under the "
            "arms."
        ),
        signature=(
            "Fz lacks a part of the weight, less of it the higher the person is; the horizontal force points back "
            "under the suspension."
        ),
        look_alikes=(
            "A wrong body mass or a gain of Fz while the person stays at one height; a steady contact at the same "
            "segment."
        ),
        settled_by="Squats, which change the height, and by weighing the person without the support.",
    )
    words = CauseWords(
        "something that no plate measures carries {size}{between} at the {it}", "Record again without it.", "a support"
    )
    explains = (CheckKind.WEIGHT,)

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return the pelvis and the trunk; the root's segment of other bodies."""
        return tuple(name for name in case.body.segments if name in ("pelvis", "trunk_head")) or case.body.segments[:1]

    def added(self, case: Case, theta: Array) -> Array:
        """Return (T, 6) minus the wrench of the rope: what it carries, the plates miss."""
        force, stiffness, high, *aside, longer = theta
        point, upright = self._tied(case, high)
        rope = max(ROPE + longer, _SHORTEST)
        middle = np.mean([plate.centre[:2] for plate in case.trial.plates], axis=0)
        hook = np.array([*(middle + aside), upright + rope])
        length = np.linalg.norm(hook - point, axis=1)
        # Direction times tension: divided by the length once.
        pull = (force + stiffness * (length - rope)) / length
        return -wrench_of_force(pull[:, None] * (hook - point), point)

    def _tied(self, case: Case, high: float) -> tuple[Array, float]:
        """Return where the rope is tied (T, 3) m, and how high over the floor on a person who stands upright."""
        body, index = case.body, case.body.segment_index(self.target)
        place = case.phi[None, 10 * index + 1 : 10 * index + 4] / case.phi[10 * index] + [0.0, high, 0.0]
        standing = poses(body, body.neutral)
        soles = standing.points(list(range(len(body.segments))), body.boxes[:, 0])[0, :, 2].min()
        return case.poses.points([index], place)[:, 0], float(standing.points([index], place)[0, 0, 2] - soles)

    def possible(self, theta: Array) -> bool:
        """Return whether the size is positive: a rope pulls."""
        return bool(theta[0] > 0)

    def possible_in(self, case: Case, theta: Array) -> bool:
        """Return whether the rope carries no more than the person weighs, and is tied to its segment, not beyond its
        ends.
        """
        index = case.body.segment_index(self.target)
        low, high = case.body.boxes[index, :, 1]
        tied = case.phi[10 * index + 2] / case.phi[10 * index] + theta[2]
        weight = case.body.sip.mass.sum() * np.linalg.norm(case.body.gravity)
        return bool(0 < theta[0] <= weight and low <= tied <= high)


EFFECT = BodyWeightSupport

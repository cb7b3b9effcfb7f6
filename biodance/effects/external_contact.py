"""The person touches something that no plate measures: a rail, a helper's hand, the floor with the second foot."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Parameter, Transient
from biodance.effects._base.words import About, CauseWords, CheckKind
from biodance.records import Array
from biodance.spatial import wrench_of_force

_STEP, _FINE = 0.4, 0.15
"""s between the values of its course, to look for it and to size it: a hand comes and goes within about a second, and
takes hold within half of one.
"""


@dataclass(frozen=True)
class ExternalContact(Transient):
    """A steady ``force`` (x, y, z: N, lab axes) ON the person at the far end of segment ``target``, or ``place`` (m,
    segment axes) from it, which the plates lack.
    """

    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    step: float = _STEP

    name = "external_contact"
    prior = 0.02
    parameters = tuple(
        Parameter(
            f"force_{axis}",
            "N",
            10.0,
            "light touch of 1 N to tens of newtons (IJmker 2015)",
            # N that matter: as a zero of a plate, 0.3 % of an adult's weight.
            least=2.0,
        )
        for axis in "xyz"
    )
    separated_by = "The video: what is touched, and when."
    advice = "Repeat the trial without touching anything; or measure the rail with a plate of its own."
    about = About(
        what=(
            "The person touches something that no plate measures: a rail, a helper's hand, the floor with the second "
            "foot."
        ),
        signature=(
            "A force at one moving point of the body, so that only three of the six channels are free: the moment is "
            "the point times the force."
        ),
        look_alikes="Contact at a neighbouring segment; for a steady touch, offsets.",
        settled_by="The video, and by the rank of the residual.",
    )
    words = CauseWords(
        "something that no plate measures pushes the {it} with {size}{between}",
        "Record again, touching nothing.",
        "a touch",
    )
    explains = (CheckKind.WEIGHT, CheckKind.FORCES)

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return the segments that can touch something: those without a further segment, and the pelvis."""
        body = case.body
        inner = {body.place_on_segment(j)[0] for j in body.segment_joint[: len(body.segments)] if j >= 0}
        return tuple(name for i, name in enumerate(body.segments) if i not in inner or i == 0)

    def columns(self, case: Case) -> Array:
        """Return minus the wrench of a unit force at the contact point: what another support carries, the plates
        miss.
        """
        index = case.body.segment_index(self.target)
        low, high = case.body.boxes[index]
        far = 0.5 * (low + high)
        far[1] = low[1] if index else 0.0
        # The far end at the middle of the lower face; the root's own middle.
        point = case.poses.points([index], (far + self.place)[None])[:, 0]
        return -np.stack([wrench_of_force(axis, point) for axis in np.eye(3)], axis=2)

    def local(self, case: Case) -> Array | None:
        """Return the contact as a force that comes and goes: cubic splines through values every ``step`` s; None for
        the root, which hands and feet are not: its forces would explain anything that hangs on the middle of the body.
        """
        if case.body.segment_index(self.target) == 0:
            return None
        time = case.motion.time
        knots = time[0] + self.step * np.arange(int((time[-1] - time[0]) / self.step) + 2)
        # Spline through unit values: column k is the course of knot k.
        course = CubicSpline(knots, np.eye(knots.size))(time)
        # (T, 6, knots, 3): coefficients knot by knot, its three forces together.
        return (self.columns(case)[:, :, None, :] * course[:, None, :, None]).reshape(time.size, 6, -1)

    def beside(self, place: Array) -> "ExternalContact":
        """Return the contact ``place`` (3,) m from the far end of its segment, in the segment's axes."""
        x, y, z = map(float, place)
        return replace(self, place=(x, y, z))

    def at_full_rate(self) -> "ExternalContact":
        """Return the contact with a value of its course every `_FINE` s."""
        return replace(self, step=_FINE)


EFFECT = ExternalContact

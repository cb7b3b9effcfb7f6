"""Something heavy is carried on a segment: a cuff, an orthosis, a bag."""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.words import About, CauseWords, CheckKind
from biodance.records import Array
from biodance.spatial import point_mass

_BESIDE = 0.2
"""m that a load may hang beside the segment that carries it."""


class AddedMass(Effect):
    """A point ``mass`` (kg) at ``place`` (x, y, z: m from the CoM of the segment in the table, segment axes; a
    report counts it from the segment's proximal joint) on segment ``target``.
    """

    name = "added_mass"
    prior = 0.02
    parameters = (
        Parameter(
            "mass",
            "kg",
            1.0,
            "0.5-8 kg loads; 2.4 kg on the arm in Bonnet 2016",
            # kg that matter: half of what a clinic scale and clothes leave.
            least=0.1,
        ),
        *(Parameter(f"place_{axis}", "m", 0.05, "half the width of a limb (segment boxes)") for axis in "xyz"),
    )
    separated_by = "Move the loaded segment alone, the rest standing still; repeat the session without the load."
    advice = (
        "Weigh the load; its size is surest beside a reference session without it. Its place counts from the segment's "
        "proximal joint centre (x forward, y up, z right)."
    )
    about = About(
        what="Something heavy is carried on a segment: a cuff, an orthosis, a bag.",
        signature=(
            "The ten columns of that segment's regressor in the proportions of a point mass; it depends on posture, "
            "speed and acceleration of the segment."
        ),
        look_alikes=(
            "An error of the table for that segment; near the body's centre a wrong body mass; on the foot, the shank."
        ),
        settled_by="Moving that segment alone, by a reference session without the load, and by the scale.",
    )
    words = CauseWords("the {it} carries {size}{between} that nobody declared", "Take it off, or declare it.", "a load")
    explains = (CheckKind.WEIGHT, CheckKind.FORCES)

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return every segment."""
        return case.body.segments

    def added(self, case: Case, theta: Array) -> Array:
        """Return (T, 6) the wrench that the load needs."""
        load = point_mass(theta[0], self.origin(case)[1:] + np.asarray(theta[1:4]))
        return case.needed_by(load, case.body.segment_index(self.target))

    def reported(self, case: Case, theta: Array, sd: Array) -> tuple[tuple[str, float, float, str], ...]:
        """Return the place from the joint of the segment, from where everything else counts, instead of its CoM."""
        return super().reported(case, theta + self.origin(case), sd)

    def origin(self, case: Case) -> Array:
        """Return (4,) no mass, and the CoM that its place is counted from, in the segment's joint frame."""
        index = case.body.segment_index(self.target)
        table = case.phi[10 * index : 10 * index + 4]
        # No mass, and the centre of mass h / m.
        return np.append(0.0, table[1:] / table[0])

    def possible(self, theta: Array) -> bool:
        """Return whether the size is positive: a load weighs something."""
        return bool(theta[0] > 0)

    def possible_in(self, case: Case, theta: Array) -> bool:
        """Return whether the load weighs something and lies at the segment, `_BESIDE` outside its box at most."""
        index = case.body.segment_index(self.target)
        place = self.origin(case)[1:] + np.asarray(theta[1:4])
        low, high = case.body.boxes[index]
        return self.possible(theta) and bool(np.all((place > low - _BESIDE) & (place < high + _BESIDE)))


EFFECT = AddedMass

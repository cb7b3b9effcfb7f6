"""A load whose contents move is carried: a bottle, a water bag, a rucksack that swings."""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.oscillator import oscillator_wrench, point_motion, relative_motion
from biodance.effects._base.words import About, CauseWords, CheckKind
from biodance.records import Array
from biodance.spatial import point_mass

_FREQUENCY = 1.5
"""Hz: open vessels of 10 to 30 cm slosh at 1 to 2.5 Hz (w² = pi g / length, deep water)."""
_RANGE = (0.7, 3.0)
"""Hz: from a bath to a cup."""
_CARRIERS = ("pelvis", "trunk_head", "right_forearm_hand", "left_forearm_hand")
_LEAST = 0.1
"""kg that matter: as an added mass."""


class SloshingLoad(Effect):
    """A load of ``mass`` (kg) behind (trunk, pelvis) or at the end of (arms) segment ``target``, of which ``sloshing``
    (kg) moves freely in the horizontal plane at its own ``frequency`` (Hz), ``high`` m above the middle of the back or
    the far end.
    """

    name = "sloshing_load"
    parameters = (
        Parameter("mass", "kg", 2.0, "1-4 kg: hydration bags, bottles, shopping", least=_LEAST),
        Parameter(
            "sloshing",
            "kg",
            1.0,
            "about half of the liquid in a half-filled vessel moves (first mode of a rectangular tank)",
            least=_LEAST,
        ),
        Parameter(
            "frequency",
            "Hz",
            0.3,
            "vessels of 10 to 30 cm: 2.5 to 1.4 Hz; what is fitted is the difference from `FREQUENCY`",
        ),
        Parameter("high", "m", 0.1, "a bag hangs between loins and shoulders"),
    )
    separated_by = "A sudden stop and five seconds of standing still: the load goes on swinging, the person does not."
    advice = "Take the load off, or empty it, and repeat one trial."
    about = About(
        what="A load whose contents move is carried: a bottle, a water bag, a rucksack that swings.",
        signature=(
            "A carried mass, and beside it a horizontal force that goes on swinging at its own slow frequency when "
            "the person stops."
        ),
        look_alikes="A rigid load on the same segment while the person moves slowly; drift of posture.",
        settled_by="A sudden stop followed by five seconds of standing still: what rings down there is not the person.",
    )
    words = CauseWords(
        "a load of {size}{between} sloshes at the {it}", "Take it off, or declare it.", "a sloshing load"
    )
    explains = (CheckKind.WEIGHT,)

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return the segments that carry bags and bottles; every segment of a body that has none of these."""
        return tuple(name for name in case.body.segments if name in _CARRIERS) or case.body.segments

    def columns(self, case: Case) -> Array:
        """Return the wrench per kilogram carried, and per kilogram that sloshes; nothing for frequency and place of
        what is not there.
        """
        rigid, sloshing = self._parts(case, _FREQUENCY, 0.0)
        return np.stack([rigid, sloshing, np.zeros_like(rigid), np.zeros_like(rigid)], axis=2)

    def added(self, case: Case, theta: Array) -> Array:
        """Return (T, 6) the wrench of a load that sloshes at the frequency asked for, within `RANGE`."""
        rigid, sloshing = self._parts(case, _frequency(theta), float(theta[3]))
        return np.asarray(theta[0] * rigid + theta[1] * sloshing)

    def _parts(self, case: Case, frequency: float, high: float) -> tuple[Array, Array]:
        """Return the wrenches (T, 6) per kilogram carried and per kilogram that sloshes."""
        index = case.body.segment_index(self.target)
        local = carried_at(case, index) + high * np.eye(3)[1]
        rigid = case.needed_by(point_mass(1.0, local), index)
        place, acceleration = point_motion(case, index, local)
        x, relative = relative_motion(acceleration, case.motion.rate, frequency=frequency, damping=0.08)
        # Only what moves in the horizontal plane sloshes.
        level = np.array([1.0, 1.0, 0.0])
        return rigid, oscillator_wrench(place, acceleration, (x * level, relative * level), gravity=case.body.gravity)

    def reported(self, case: Case, theta: Array, sd: Array) -> tuple[tuple[str, float, float, str], ...]:
        """Return the frequency itself instead of its difference."""
        mass, sloshing, _, high = super().reported(case, theta, sd)
        return mass, sloshing, ("frequency", _frequency(theta), float(sd[2]), "Hz"), high

    def possible(self, theta: Array) -> bool:
        """Return whether what moves in the load weighs something, and no more than the load, of which it is a part."""
        return bool(0 < theta[1] <= theta[0])

    def possible_in(self, case: Case, theta: Array) -> bool:
        """Return whether the load hangs at its segment, not beyond its ends."""
        index = case.body.segment_index(self.target)
        low, high = case.body.boxes[index, :, 1]
        return self.possible(theta) and bool(low <= carried_at(case, index)[1] + theta[3] <= high)


def _frequency(theta: Array) -> float:
    return float(np.clip(_FREQUENCY + theta[2], *_RANGE))


def carried_at(case: Case, index: int) -> Array:
    """Return where a load sits (3,) m in a segment's frame: the middle of the back of trunk and pelvis, the far end
    of others.
    """
    low, high = case.body.boxes[index]
    place = np.array(0.5 * (low + high))
    if case.body.segments[index] in ("pelvis", "trunk_head"):
        place[0] = low[0]
    else:
        place[1] = low[1]
    return place


EFFECT = SloshingLoad

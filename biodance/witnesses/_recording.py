"""One trial as witnesses look at it: where each foot was, which steps fell on which plate, which way the person went.

The steps are sorted from the markers, not from the forces: a plate that lies elsewhere than the file says, or whose
force comes late, must not hide the very steps that show it.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from biodance.errors import BiodanceError
from biodance.lab.markers.sets import FAMILY, landmark, read_marker_set
from biodance.lab.weight import is_still
from biodance.motion.contact.footing import inside
from biodance.motion.contact.soles import OUTLINE
from biodance.records import SIDES, Array, Index, Markers, Plate, Trial, Wrench, runs
from biodance.records.arrays import rate_of
from biodance.settings import COP_FORCE
from biodance.spatial import zero_moment_point

ONSET = 20.0
"""N of vertical force from which a foot counts as down (Zeni et al. 2008, doi:10.1016/j.gaitpost.2007.07.007)."""
_SHORTEST, _LONGEST = 0.2, 2.5
"""s that one foot stands on a plate in a step."""
_RAISED = 0.05
"""m that a plate stands out above the lowest one: what sticks out over a stair hangs in the air."""
_BESIDE = 0.04
"""m: a sole that reaches farther over the edge is half beside the plate: its centre of pressure says nothing."""
_LEVEL = 0.005
"""m: plates side by side differ by less in height."""
_STILL, _EVEN = 0.5, 0.35
"""m/s against the ground or belt of a foot that stands; the other one swings faster."""
_BELT = 0.25
"""m/s of a standing foot from which a belt carries it; slower ones pivot."""
_LIFTED = 0.06
"""m of a foot above its lowest place in the trial from which it cannot stand."""
_FLAT = 0.03
"""m of both markers above their lowest place of a foot that stands on a belt."""
_UNSEEN = 0.05
"""s over which a marker that was not seen is believed to go on straight."""


_KEPT = 64
"""Sets of times at which a foot's place is kept."""


@dataclass(frozen=True, eq=False)
class FootPath:
    """One foot: ``time`` (T,) s; ``heel``, ``toe`` (T, 3) m of its markers, lab frame, NaN = not seen; ``centred``
    False: its only toe marker is on one edge, and the line to it is not that of the foot.
    """

    side: str
    time: Array
    heel: Array
    toe: Array
    centred: bool = True
    _known: dict[bytes, tuple[Array, Array]] = field(default_factory=dict, init=False, repr=False)
    _drifts: dict[bytes, Array] = field(default_factory=dict, init=False, repr=False)

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return heel and toe (n, 3) m at other times (n,) s; NaN beside frames in which they were not seen.

        It is kept: witnesses are asked for the same times again and again, of recordings whose plates were altered.
        """
        key = time.tobytes()
        if key not in self._known:
            if len(self._known) >= _KEPT:
                self._known.pop(next(iter(self._known)))
            self._known[key] = _between(self.time, self.heel, time), _between(self.time, self.toe, time)
        return self._known[key]

    def outline(self, time: Array) -> Array:
        """Return the sole (n, P, 2) m seen from above, from heel and toe marker."""
        heel, toe = (path[:, :2] for path in self.at(time))
        ahead = toe - heel
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        return heel[:, None] + OUTLINE[:, :1] * ahead[:, None] + OUTLINE[:, 1:] * left[:, None]

    def axes(self, time: float) -> Array:
        """Return the horizontal unit vectors (2, 2) from heel to toe marker and outwards of it, at ``time`` s."""
        heel, toe = (path[0, :2] for path in self.at(np.array([time])))
        ahead = (toe - heel) / np.linalg.norm(toe - heel)
        return np.stack([ahead, np.array([ahead[1], -ahead[0]]) * (1.0 if self.side == "right" else -1.0)])

    def in_foot(self, time: Array, point: Array) -> tuple[Array, Array, Array]:
        """Return how far ``point`` (n, 2) m lies ahead of the heel marker and outwards of the line to the toe marker,
        m (n,), and the horizontal distance of the two markers (n,) m.
        """
        heel, toe = (path[:, :2] for path in self.at(time))
        length = np.linalg.norm(toe - heel, axis=1)
        ahead = (toe - heel) / length[:, None]
        out = np.stack([ahead[:, 1], -ahead[:, 0]], axis=1) * (1.0 if self.side == "right" else -1.0)
        return np.sum((point - heel) * ahead, axis=1), np.sum((point - heel) * out, axis=1), length

    @property
    def rate(self) -> float:
        """Hz of the markers."""
        return rate_of(self.time)

    @cached_property
    def velocity(self) -> Array:
        """(T, 3) m/s of the middle between the two markers."""
        if self.time.size < 2:
            return np.zeros((self.time.size, 3))
        return np.gradient((self.heel + self.toe) / 2, self.time, axis=0)

    @cached_property
    def pointing(self) -> Array:
        """(3,) m from heel to toe marker, the median over the trial."""
        return np.asarray(np.nanmedian(self.toe - self.heel, axis=0))

    def drift(self, time: Array) -> Array:
        """Return the median velocity (3,) m/s at some times: that of the belt a foot stands on, or nearly none. It is
        kept, like the places.
        """
        key = time.tobytes()
        if key not in self._drifts:
            if len(self._drifts) >= _KEPT:
                self._drifts.pop(next(iter(self._drifts)))
            velocity = _between(self.time, self.velocity, time)
            known = velocity[np.isfinite(velocity).all(axis=1)]
            self._drifts[key] = np.median(known, axis=0) if len(known) else np.full(3, np.nan)
        return self._drifts[key]


@dataclass(frozen=True)
class FootStep:
    """One foot alone on one plate: ``plate`` its name; ``side``; ``middle`` s, a time at which it stands; ``overhang``
    m that the sole may reach over the edge; ``heel_first`` whether the heel came down first; ``beside`` the plates on
    which the rest of it stands, where plates lie edge to edge (belts); ``mixed`` whether the other foot treads on the
    plate, too, before or after it swings.
    """

    plate: str
    side: str
    middle: float
    overhang: float
    heel_first: bool
    beside: tuple[str, ...] = ()
    mixed: bool = False

    @property
    def name(self) -> str:
        """The step in words."""
        return f"{self.side} foot on {self.plate} at {self.middle:.2f} s"


@dataclass(frozen=True, eq=False)
class SeenTrial:
    """One ``trial`` with the declared ``mass`` kg of the person (NaN = unknown), both ``feet`` (none where their
    markers are missing), the ``steps`` on its plates, the ``pelvis`` (T, 3) m at marker times (None = not seen), and
    whether somebody stands ``still`` throughout.
    """

    trial: Trial
    mass: float
    feet: tuple[FootPath, ...]
    steps: tuple[FootStep, ...]
    pelvis: Array | None
    still: bool
    _stances: dict[FootStep, slice | None] = field(default_factory=dict, init=False, repr=False)

    def plate(self, name: str) -> Plate:
        """Return the plate of that name."""
        return next(plate for plate in self.trial.plates if plate.name == name)

    def foot(self, side: str) -> FootPath:
        """Return the foot of that side."""
        return next(foot for foot in self.feet if foot.side == side)

    def stance(self, step: FootStep) -> slice | None:
        """Return the samples of a step's plate while the foot stands on it; None where the force does not show it."""
        if step not in self._stances:
            self._stances[step] = self._stance(step)
        return self._stances[step]

    def _stance(self, step: FootStep) -> slice | None:
        wrench = self.plate(step.plate).wrench
        here = [run for run in runs(wrench.force[:, 2] > ONSET) if wrench.time[run[0]] <= step.middle]
        if not here or wrench.time[here[-1][1] - 1] < step.middle:
            return None
        return slice(*here[-1])

    def under(self, step: FootStep) -> Wrench:
        """Return the wrench under the foot of a step, at its plate's times: with that of the plates ``beside`` it,
        which is the foot's alone while the other one swings.
        """
        own = self.plate(step.plate).wrench
        if not step.beside:
            return own
        value = np.array(own.value)
        for other in (self.plate(name).wrench for name in step.beside):
            value += np.stack([np.interp(own.time, other.time, column) for column in other.value.T], axis=1)
        return Wrench(own.time, value)

    def pressure(self, step: FootStep, part: slice | Index) -> Array:
        """Return the centre of pressure (n, 2) m under the foot of a step at some of its plate's samples; NaN where
        nearly nothing presses.
        """
        value, height = self.under(step).value[part], self.plate(step.plate).height
        return zero_moment_point(value, height=height, threshold=COP_FORCE)[:, :2]

    @cached_property
    def total(self) -> Wrench:
        """Total wrench of all plates."""
        return self.trial.wrench

    def swings(self, step: FootStep, time: Array) -> NDArray[np.bool_]:
        """Return (n,) whether the other foot swings at some ``time`` (n,) s while this one stands."""
        other = next(foot for foot in self.feet if foot.side != step.side)
        belt = self.foot(step.side).drift(np.linspace(step.middle - 0.1, step.middle + 0.1, 5))
        off = np.linalg.norm(_between(other.time, other.velocity, time) - belt, axis=1)
        return np.asarray(np.nan_to_num(off, nan=0.0) > _STILL)

    def belt(self, step: FootStep) -> Array | None:
        """Return the velocity (2,) m/s of the belt that carries the foot of a step; None on the ground."""
        drift = self.foot(step.side).drift(np.linspace(step.middle - 0.1, step.middle + 0.1, 5))[:2]
        return drift if np.linalg.norm(drift) > _BELT else None

    @property
    def seconds(self) -> float:
        """Time s that one foot stands alone on a plate."""
        parts = [(self.plate(step.plate).wrench.time, self.stance(step)) for step in self.steps]
        return float(sum(time[part.stop - 1] - time[part.start] for time, part in parts if part is not None))

    def pelvis_at(self, time: Array) -> Array:
        """Return where (n, 3) m the pelvis is at times (n,) s; NaN where it was not seen."""
        if self.pelvis is None or self.trial.markers is None:
            return np.full((len(time), 3), np.nan)
        return _between(self.trial.markers.time, self.pelvis, time)


def recording(trial: Trial, *, mass: float = float("nan")) -> SeenTrial:
    """Return a trial as witnesses look at it; as read (forces at their own rate) it says most.

    ``mass`` kg as declared, NaN = unknown. Without foot markers or plates there are no steps; nothing is raised.
    """
    known = tuple(dict.fromkeys(filter(None, (trial.marker_set, *FAMILY.files()))))
    feet = _feet(trial.markers, known)
    lowest = min((plate.height for plate in trial.plates), default=0.0)
    steps = tuple(
        step
        for plate in trial.plates
        for step in _steps(plate, trial.plates, feet, raised=plate.height > lowest + _RAISED)
        if feet
    )
    pelvis = _pelvis(trial.markers, known)
    steps = tuple(sorted(steps, key=lambda step: step.middle))
    return SeenTrial(trial, mass, feet, steps, pelvis, is_still(trial))


def _between(known: Array, path: Array, time: Array) -> Array:
    """Return a path (T, n) at other times, straight between frames; NaN where no frame near is known."""
    seen = np.isfinite(path).all(axis=1)
    if not seen.any():
        return np.full((len(time), path.shape[1]), np.nan)
    at, values = known[seen], path[seen]
    out = np.stack([np.interp(time, at, column) for column in values.T], axis=1)
    after = np.clip(np.searchsorted(at, time), 0, at.size - 1)
    near = np.minimum(np.abs(time - at[after]), np.abs(time - at[np.maximum(after - 1, 0)]))
    out[near > _UNSEEN] = np.nan
    return out


def _feet(markers: Markers | None, known: tuple[str, ...]) -> tuple[FootPath, ...]:
    """Return both feet by the landmarks heel and toe of the first of the ``known`` marker sets that has all four; ()
    without.
    """
    if markers is None or not markers.time.size:
        return ()
    for name in known:
        found = {(s, p): _landmark(markers, name, f"{s}_{p}") for s in SIDES for p in ("heel", "toe")}
        places = {key: path for key, path in found.items() if path is not None and np.isfinite(path).any()}
        if len(places) == len(found):
            return tuple(
                FootPath(s, markers.time, places[s, "heel"], toe, _is_centred(markers, name, s, toe))
                for s, toe in ((s, places[s, "toe"]) for s in SIDES)
            )
    return ()


def _is_centred(markers: Markers, set_name: str, side: str, toe: Array) -> bool:
    """Return whether a toe (T, 3) m is more than the marker on one edge of the foot alone, standing in for it."""
    edges = [_landmark(markers, set_name, f"{side}_toe_{edge}") for edge in ("medial", "lateral")]
    return not any(edge is not None and np.array_equal(toe, edge, equal_nan=True) for edge in edges)


def _landmark(markers: Markers, set_name: str, name: str) -> Array | None:
    try:
        return landmark(markers, read_marker_set(set_name), name)
    except BiodanceError:
        return None


def _pelvis(markers: Markers | None, known: tuple[str, ...]) -> Array | None:
    """Return the middle (T, 3) m of the front and back of the pelvis; None where no ``known`` set has them."""
    for name in known if markers is not None else ():
        assert markers is not None
        right, left, back = (_landmark(markers, name, place) for place in ("right_asis", "left_asis", "mid_psis"))
        if right is not None and left is not None and back is not None:
            middle = ((right + left) / 2 + back) / 2
            return middle if np.isfinite(middle).any() else None
    return None


def _steps(plate: Plate, plates: tuple[Plate, ...], feet: tuple[FootPath, ...], *, raised: bool) -> list[FootStep]:
    """Return the steps on one plate: one foot stands wholly over it while it is loaded, the other one is not on it."""
    found = []
    wrench = plate.wrench
    for start, stop in runs(wrench.force[:, 2] > ONSET):
        first, last = wrench.time[start], wrench.time[stop - 1]
        if not _SHORTEST <= last - first <= _LONGEST:
            continue
        time = np.linspace(first + 0.25 * (last - first), first + 0.7 * (last - first), 10)
        over = {foot.side: _over(plate, foot, time, raised=raised) for foot in feet}
        on = [foot for foot in feet if over[foot.side] > -_BESIDE and _stands(foot, time)]
        belt = on[0].drift(time) if on else np.zeros(3)
        if len(on) != 1:
            continue
        others = [foot for foot in feet if foot not in on]
        mixed = any(_treads(plate, foot, np.linspace(first, last, 30), belt) for foot in others)
        if mixed and any(_treads(plate, foot, time, belt) for foot in others):
            continue
        near = _neighbours(plate, plates) if mixed or over[on[0].side] < 0 else []
        beside = tuple(one.name for one in near) if mixed or _carry(near, time) else ()
        if mixed and not beside:
            continue
        overhang = 0.0 if beside else max(0.0, -over[on[0].side])
        heel_first = _heel_first(on[0], first)
        found.append(FootStep(plate.name, on[0].side, float(time[5]), overhang, heel_first, beside, mixed))
    return found


def _neighbours(plate: Plate, plates: tuple[Plate, ...]) -> list[Plate]:
    """Return the plates of the same height whose edges come so near to those of one that a foot stands on both."""
    share = np.linspace(0.0, 1.0, 20)[:, None]
    sides = zip(plate.corners, np.roll(plate.corners, -1, axis=0), strict=True)
    edge = np.concatenate([a + share * (b - a) for a, b in sides])[None, :, :2]
    level = [one for one in plates if one is not plate and abs(one.height - plate.height) < _LEVEL]
    return [one for one in level if inside(one, edge).max() > -_BESIDE]


def _carry(plates: list[Plate], time: Array) -> bool:
    """Return whether plates carry a load at most of some times."""
    force = [np.interp(time, one.wrench.time, one.wrench.force[:, 2]) for one in plates if one.wrench.time.size]
    return bool(force) and float(np.median(np.sum(force, axis=0))) > ONSET


def _over(plate: Plate, foot: FootPath, time: Array, *, raised: bool) -> float:
    """Return how far the sole is inside the plate, m: its outermost point (its middle on a ``raised`` plate), the
    median over times; negative outside.
    """
    distance = inside(plate, foot.outline(time))
    distance = distance.mean(axis=1) if raised else distance.min(axis=1)
    return float(np.nanmedian(distance)) if np.isfinite(distance).any() else -np.inf


def _stands(foot: FootPath, time: Array) -> bool:
    """Return whether a foot stands at most of some times: on the ground, or flat on a belt that moves evenly."""
    drift = foot.drift(time)
    off = np.linalg.norm(_between(foot.time, foot.velocity, time) - drift, axis=1)
    known = np.isfinite(off)
    if not known.any() or np.median(off[known]) > _EVEN or abs(drift[2]) > _EVEN:
        return False
    heights = zip(foot.at(time), (foot.heel, foot.toe), strict=True)
    flat = all(np.nanmedian(path[:, 2]) < np.nanmin(whole[:, 2]) + _FLAT for path, whole in heights)
    return bool(np.linalg.norm(drift) < _STILL or flat)


def _treads(plate: Plate, foot: FootPath, time: Array, belt: Array) -> bool:
    """Return whether any part of a foot is over the plate, low and no faster than the ground (``belt`` (3,) m/s), at
    a tenth of some times (n,) s of a contact.
    """
    with np.errstate(invalid="ignore"):
        near = (inside(plate, foot.outline(time)) > 0.01).any(axis=1)
        slow = np.linalg.norm(_between(foot.time, foot.velocity, time) - belt, axis=1) < _STILL
        low = np.minimum(*(path[:, 2] for path in foot.at(time)))
        lowest = min(np.nanmin(foot.heel[:, 2]), np.nanmin(foot.toe[:, 2]))
    return bool((near & slow & (low < lowest + _LIFTED)).mean() >= 0.1)


def _heel_first(foot: FootPath, first: float) -> bool:
    """Return whether the toe is farther above its standing height than the heel when a contact begins."""
    at = np.array([first])
    heel, toe = (path[0, 2] for path in foot.at(at))
    flat = np.abs(foot.velocity[:, 2]) < 0.1
    if not flat.any():
        return False
    rest = [np.nanmedian(path[flat, 2]) for path in (foot.heel, foot.toe)]
    return bool(toe - rest[1] > heel - rest[0] + 0.01)

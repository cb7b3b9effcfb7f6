"""One trial as observers look at it: where each foot was, which steps fell on which plate, which way the person went.

The steps are sorted from the markers, not from the forces: a plate that lies elsewhere than the file says, or whose
force comes late, must not hide the very steps that show it.
"""

from collections.abc import Hashable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.effects.body_mass import WRONG
from biodance.lab.markers.sets import FAMILY
from biodance.lab.markers.upright import is_still
from biodance.motion.newton import LagAndMass, Trunk, trunk_of
from biodance.motion.soles import inside
from biodance.observations._feet import FootPath, Track, feet_of, median_known, pelvis_path, pressed_between, track_of
from biodance.records import Array, Index, LeftOutSpan, Plate, Trial, Wrench, runs
from biodance.settings import COP_FORCE
from biodance.spatial import zero_moment_point

_DECLARED = 0.01  # share of the mass by which careful declarations are wrong: clothes, shoes, another day
ONSET = 20.0
"""N of vertical force from which a foot counts as down (Zeni et al. 2008, doi:10.1016/j.gaitpost.2007.07.007)."""
_SHORTEST, _LONGEST = 0.2, 2.5
"""s that one foot stands on a plate in a step."""
_RAISED = 0.05
"""m that a plate stands out above the lowest one: what sticks out over a stair hangs in the air."""
_BESIDE = 0.04
"""m: a sole that reaches farther over the edge is half beside the plate: its centre of pressure says nothing."""
_OUTLINE = 0.01
"""m to which a sole is known that is drawn from two markers."""
_STILL, _EVEN = 0.5, 0.35
"""m/s against the ground or belt of a foot that stands; the other one swings faster."""
_BELT = 0.25
"""m/s of a standing foot from which a belt carries it; slower ones pivot."""
_LIFTED = 0.06
"""m of a foot above its lowest place in the trial from which it cannot stand."""
_FLAT = 0.03
"""m of both markers above their lowest place of a foot that stands on a belt."""
_LEVEL = 0.005
"""m: plates side by side differ by less in height."""


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
    """One ``trial`` with the ``mass`` kg of the person (NaN = unknown), both ``feet`` (none where their markers are
    missing), the ``steps`` on its plates, the ``pelvis`` (T, 3) m at marker times (None = not seen), and whether
    somebody stands ``still`` throughout; the ``trunk``, against which the plates weigh and time (None = not seen);
    ``declared`` False: nobody said the mass, so that the plates can be held against each other alone; ``half`` when a
    foot may stand partly beside a plate whose place the file does not tell. ``kept`` holds what several observers ask
    for.
    """

    trial: Trial
    mass: float
    feet: tuple[FootPath, ...]
    steps: tuple[FootStep, ...]
    pelvis: Array | None
    still: bool
    trunk: Trunk | None = None
    declared: bool = True
    half: tuple[LeftOutSpan, ...] = ()
    kept: dict[Hashable, Any] = field(default_factory=dict, init=False, repr=False)

    def plate(self, name: str) -> Plate:
        """Return the plate of that name."""
        return next(plate for plate in self.trial.plates if plate.name == name)

    def foot(self, side: str) -> FootPath:
        """Return the foot of that side."""
        return next(foot for foot in self.feet if foot.side == side)

    def stance(self, step: FootStep) -> slice | None:
        """Return the samples of a step's plate while the foot stands on it; None where the force does not show it."""
        time = self.plate(step.plate).wrench.time
        runs_on = self._contacts[step.plate]
        last = int(np.searchsorted(time[runs_on[:, 0]], step.middle, side="right")) - 1
        if last < 0 or time[runs_on[last, 1] - 1] < step.middle:
            return None
        return slice(*map(int, runs_on[last]))

    @cached_property
    def _contacts(self) -> dict[str, Index]:
        """(n, 2) first sample and end of every contact with each plate."""
        each = ((plate.name, runs(plate.wrench.force[:, 2] > ONSET)) for plate in self.trial.plates)
        return {name: np.array(found, dtype=int).reshape(-1, 2) for name, found in each}

    def under(self, step: FootStep, part: slice | Index) -> dict[str, Array]:
        """Return by plate the wrench (n, 6) about the lab origin that carries the foot of a step at some of its plate's
        samples: that of the plates ``beside`` it, too, which is the foot's alone while the other one swings.
        """
        own = self.plate(step.plate).wrench
        time, found = own.time[part], {step.plate: own.value[part]}
        for name in step.beside:
            other = self.plate(name).wrench
            found[name] = np.stack([np.interp(time, other.time, column) for column in other.value.T], axis=1)
        return found

    def pressure(self, step: FootStep, wrench: Array) -> Array:
        """Return the centre of pressure (n, 2) m of a wrench (n, 6) under the foot of a step; NaN where nearly nothing
        presses.
        """
        return zero_moment_point(wrench, height=self.plate(step.plate).height, threshold=COP_FORCE)[:, :2]

    @cached_property
    def total(self) -> Wrench:
        """Total wrench of all plates."""
        return self.trial.wrench

    @cached_property
    def newton(self) -> LagAndMass | None:
        """What Newton tells of the total force beside the trunk; None where the trial does not hold it."""
        if self.trunk is None or not self.one_clock:
            return None
        settings = self.trial.settings
        return self.trunk.beside(self.total, gravity=settings.gravity, sway=settings.standing.sway)

    @property
    def mass_doubt(self) -> float:
        """Standard deviation of the mass, kg."""
        return (_DECLARED if self.declared else WRONG) * self.mass

    @property
    def one_clock(self) -> bool:
        """Whether all plates share one time base, so that their forces add."""
        time = self.trial.plates[0].wrench.time
        return all(np.array_equal(plate.wrench.time, time) for plate in self.trial.plates)

    def swings(self, step: FootStep, time: Array) -> NDArray[np.bool_]:
        """Return (n,) whether the other foot swings at some ``time`` (n,) s while this one stands."""
        other = next(foot for foot in self.feet if foot.side != step.side)
        belt = self.foot(step.side).drift(np.linspace(step.middle - 0.1, step.middle + 0.1, 5))
        off = np.linalg.norm(other.velocity_at(time) - belt, axis=1)
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

    @cached_property
    def whole(self) -> bool:
        """Whether nothing of the feet of somebody who stands still reaches beyond the plates, or, where a plate's place
        is not known, the pressure lies between them, as far as it is known: what stands beside is not measured.
        """
        plates = [plate for plate in self.trial.plates if plate.placed]
        if self.half:
            return False
        if not self.feet or len(plates) < len(self.trial.plates):
            return self.pelvis is None or pressed_between(self.feet, self.total, self.pelvis)
        soles = [foot.outline(np.linspace(foot.time[0], foot.time[-1], 10)) for foot in self.feet]
        within = [np.max([inside(plate, sole) for plate in plates], axis=0).min(axis=1) for sole in soles]
        return all(not np.nanmedian(one) < -_OUTLINE for one in within if np.isfinite(one).any())

    @cached_property
    def pelvis_track(self) -> Track:
        """The pelvis where it was seen."""
        if self.pelvis is None or self.trial.markers is None:
            return Track(np.empty(0), np.empty((3, 0)))
        return track_of(self.trial.markers.time, self.pelvis)


def recording(
    trial: Trial, *, mass: float = float("nan"), declared: bool = True, half: tuple[LeftOutSpan, ...] = ()
) -> SeenTrial:
    """Return a trial as observers look at it; as read (forces at their own rate) it says most.

    ``mass`` kg as ``declared``, or as guessed; NaN = unknown. ``half`` spans in which a foot may stand partly beside a
    plate whose place the file does not tell (`Contact.half`): they hold no step. Feet and pelvis are found by the
    trial's marker set, and by the known ones where it has none. Without foot markers or plates there are no steps;
    nothing is raised.
    """
    known = (trial.marker_set,) if trial.marker_set else tuple(FAMILY.files())
    feet = feet_of(trial.markers, known)
    lowest = min((plate.height for plate in trial.plates), default=0.0)
    steps = tuple(
        step
        for plate in trial.plates
        for step in _steps(plate, trial.plates, feet, raised=plate.height > lowest + _RAISED)
        if feet
    )
    pelvis = pelvis_path(trial.markers, known)
    beside = {step for step in steps for one in half if one.side == step.side and one.start <= step.middle <= one.end}
    steps = tuple(sorted((step for step in steps if step not in beside), key=lambda step: step.middle))
    return SeenTrial(trial, mass, feet, steps, pelvis, is_still(trial), trunk_of(trial, mass=mass), declared, half)


def _steps(plate: Plate, plates: tuple[Plate, ...], feet: tuple[FootPath, ...], *, raised: bool) -> list[FootStep]:
    """Return the steps on one plate: one foot stands wholly over it while it is loaded, the other one is not on it."""
    time = plate.wrench.time
    contacts = ((time[start], time[stop - 1]) for start, stop in runs(plate.wrench.force[:, 2] > ONSET))
    lasting = [(first, last) for first, last in contacts if _SHORTEST <= last - first <= _LONGEST]
    found = (_step(plate, plates, feet, first, last, raised=raised) for first, last in lasting)
    return [step for step in found if step is not None]


def _step(
    plate: Plate, plates: tuple[Plate, ...], feet: tuple[FootPath, ...], first: float, last: float, *, raised: bool
) -> FootStep | None:
    """Return the step of one contact from ``first`` to ``last`` s; None where not just one foot stands there."""
    time = np.linspace(first + 0.25 * (last - first), first + 0.7 * (last - first), 10)
    over = {foot.side: _over(plate, foot, time, raised=raised) for foot in feet if _stands(foot, time)}
    on = [foot for foot in feet if over.get(foot.side, -np.inf) > -_BESIDE]
    if len(on) != 1:
        return None
    (foot,), belt = on, on[0].drift(time)

    def beside_it(when: Array) -> bool:
        return plate.placed and any(_treads(plate, one, when, belt) for one in feet if one is not foot)

    mixed = beside_it(np.linspace(first, last, 30))
    if mixed and beside_it(time):
        return None
    near = _neighbours(plate, plates) if mixed or over[foot.side] < 0 else []
    loads = [np.interp(time, one.wrench.time, one.wrench.force[:, 2]) for one in near if one.wrench.time.size]
    carry = bool(loads) and float(np.median(np.sum(loads, axis=0))) > ONSET
    beside = tuple(one.name for one in near) if mixed or carry else ()
    if mixed and not beside:
        return None
    overhang = 0.0 if beside or not plate.placed else max(0.0, -over[foot.side])
    return FootStep(plate.name, foot.side, float(time[5]), overhang, _heel_first(foot, first), beside, mixed)


def _neighbours(plate: Plate, plates: tuple[Plate, ...]) -> list[Plate]:
    """Return the plates of the same height so near to one that a foot stands on both; none if it is not placed."""
    if not plate.placed:
        return []
    share = np.linspace(0.0, 1.0, 20)[:, None]
    sides = zip(plate.corners, np.roll(plate.corners, -1, axis=0), strict=True)
    edge = np.concatenate([a + share * (b - a) for a, b in sides])[None, :, :2]
    level = [one for one in plates if one is not plate and abs(one.height - plate.height) < _LEVEL]
    return [one for one in level if inside(one, edge).max() > -_BESIDE]


def _over(plate: Plate, foot: FootPath, time: Array, *, raised: bool) -> float:
    """Return how far (m) the sole is inside the plate, its middle on a ``raised`` one: median; negative outside."""
    distance = inside(plate, foot.outline(time))
    distance = distance.mean(axis=1) if raised else distance.min(axis=1)
    return float(np.nanmedian(distance)) if np.isfinite(distance).any() else -np.inf


def _stands(foot: FootPath, time: Array) -> bool:
    """Return whether a foot stands at most of some times: on the ground, or flat on a belt that moves evenly."""
    drift = median_known(velocity := foot.velocity_at(time))
    off = np.linalg.norm(velocity - drift, axis=1)
    known = np.isfinite(off)
    if not known.any() or np.median(off[known]) > _EVEN or abs(drift[2]) > _EVEN:
        return False
    return bool(np.linalg.norm(drift) < _STILL) or all(
        np.nanmedian(path[:, 2]) < lowest + _FLAT for path, lowest in zip(foot.at(time), foot.lowest, strict=True)
    )


def _treads(plate: Plate, foot: FootPath, time: Array, belt: Array) -> bool:
    """Return whether a foot is over the plate, low and no faster than its ``belt``, at a tenth of some times (n,) s."""
    with np.errstate(invalid="ignore"):
        near = (inside(plate, foot.outline(time)) > 0.01).any(axis=1)
        slow = np.linalg.norm(foot.velocity_at(time) - belt, axis=1) < _STILL
        low = np.minimum(*(path[:, 2] for path in foot.at(time)))
    return bool((near & slow & (low < foot.lowest.min() + _LIFTED)).mean() >= 0.1)


def _heel_first(foot: FootPath, first: float) -> bool:
    """Return whether the front is farther above its standing height than the heel when a contact begins."""
    heel, front = (path[0, 2] for path in foot.at(np.array([first])))
    return bool(front - foot.resting[1] > heel - foot.resting[0] + 0.01)

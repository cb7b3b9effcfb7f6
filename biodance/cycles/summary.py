"""All good repetitions of one kind in a session: what is drawn, averaged and told of them over all its trials."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import chain
from typing import Protocol, TypeVar

import numpy as np

from biodance.cycles.curves import CurveGroup, CycleCurve, group_curves
from biodance.cycles.cut import Cycle
from biodance.cycles.keys import KeyValue, key_values
from biodance.cycles.lifts import LIFT_UNITS
from biodance.cycles.movement import TrialMovement
from biodance.cycles.strides import STRIDE_UNITS, Stride, mean_values
from biodance.records import SIDES, grouped
from biodance.uncertainty.visits import change_of_mean, visit_mean

_TURNS = 20.0
"""deg that the pelvis turns from the beginning of a gait cycle to its end from which this is no straight walking."""
_MIXED = 1.2
"""Times the slowest trial's speed beyond which the curves of the fastest one are of another way of walking: all of them
change with speed (Schwartz et al. 2008, doi:10.1016/j.jbiomech.2008.03.015).
"""
_FEWEST = 4
"""Repetitions of a curve without which none of them stands out."""
_FAR = 4.0
"""Times the middle distance to the median curve from which a curve stands out."""
_LEAST: Mapping[str, float] = {"deg": 20.0, "N·m/kg": 0.6, "W/kg": 2.0, "%": 25.0, "m": 0.15}
"""The same at least, by unit: what a step differs from the others without any fault."""


class LeftOutBecause(Enum):
    """Why a curve of a repetition counts in no mean."""

    SHARED_PLATE = "shared_plate"
    """Both feet stood on one plate for a part of it, so that no plate tells what this foot carried."""
    SPIKE = "spike"
    """It leaves all others of its kind far behind: a marker or a plate jumped."""
    TURN = "turn"
    """The person turned: its angles are not those of straight walking."""


class _OfCycle(Protocol):
    @property
    def cycle(self) -> Cycle: ...


_Of = TypeVar("_Of", bound=_OfCycle)


@dataclass(frozen=True)
class LeftOutCurve:
    """A ``quantity`` ("" = all of them, "loads" = moments, powers and ground reaction) of a ``cycle`` that counts in no
    mean, and ``because`` of what.
    """

    cycle: Cycle
    quantity: str
    because: LeftOutBecause


@dataclass(frozen=True)
class Spread:
    """``mean``, standard deviation ``sd`` (NaN for one) and ``count`` of values."""

    mean: float
    sd: float
    count: int


@dataclass(frozen=True)
class KeySummary:
    """A key value of both sides: its ``quantity``, which ``key`` of it, ``unit``; ``right`` and ``left`` over all good
    repetitions (None = no value); ``difference`` right less left with its 95 % interval ``ci95`` by the scatter between
    repetitions (None for fewer than three); ``symmetry`` %, see `symmetry_index` (NaN where it means nothing);
    ``beside`` the same by side as another program has it; ``middle`` of trunk and pelvis where both sides move alike.
    """

    quantity: str
    key: str
    unit: str
    right: Spread | None
    left: Spread | None
    difference: float
    ci95: tuple[float, float] | None
    symmetry: float
    beside: Mapping[str, Spread]
    middle: Spread | None = None

    @property
    def name(self) -> str:
        """``knee_flexion_maximum``, or the quantity alone."""
        return f"{self.quantity}_{self.key}" if self.key else self.quantity


def symmetry_index(right: float, left: float) -> float:
    """Return the difference of the sides in % of their mean, positive where the right one is larger (Robinson et al.
    1987); NaN where the sides have different signs or both are zero.
    """
    return 200 * (right - left) / (right + left) if right * left > 0 else float("nan")


@dataclass(frozen=True, eq=False)
class Repetitions:
    """All good repetitions of one ``kind`` in a session, over all its trials.

    ``cycles`` all that were found; ``curves`` and ``strides`` of those that count; ``left_out`` what does not, and why;
    ``file_curves`` plug-in gait's own angles over the same cycles.
    """

    kind: str
    cycles: tuple[Cycle, ...]
    curves: tuple[CycleCurve, ...]
    strides: tuple[Stride, ...]
    left_out: tuple[LeftOutCurve, ...] = ()
    file_curves: tuple[CycleCurve, ...] = ()

    @cached_property
    def good(self) -> tuple[Cycle, ...]:
        """The cycles that count."""
        out = {one.cycle for one in self.left_out if not one.quantity}
        return tuple(one for one in self.cycles if one not in out)

    @cached_property
    def trials(self) -> tuple[str, ...]:
        """The trials that these are of."""
        return tuple(dict.fromkeys(one.trial for one in self.good))

    @cached_property
    def groups(self) -> tuple[CurveGroup, ...]:
        """The curves of each quantity and side together, with mean and sd."""
        return group_curves(self.curves)

    @cached_property
    def file_groups(self) -> tuple[CurveGroup, ...]:
        """The same of the other program's angles."""
        return group_curves(self.file_curves)

    @cached_property
    def key_values(self) -> tuple[KeyValue, ...]:
        """The key values of every repetition."""
        return key_values(self.curves)

    @cached_property
    def keys(self) -> tuple[KeySummary, ...]:
        """The key values of both sides beside each other."""
        both = (self.key_values, key_values(self.file_curves))
        ours, theirs = (grouped(((one.quantity, one.key), one) for one in values) for values in both)
        return tuple(_summary(some, theirs.get(about, ())) for about, some in ours.items())

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of every value of its strides, squats or rises."""
        return STRIDE_UNITS if self.kind == "gait" else LIFT_UNITS

    @property
    def runs(self) -> bool:
        """Whether most strides have a flight."""
        return 2 * sum("flight_time" in one.values for one in self.strides) > len(self.strides)

    @cached_property
    def speeds(self) -> tuple[float, float] | None:
        """The slowest and the fastest trial's mean speed, m/s, where they are too far apart for one mean to be of both;
        else None.
        """
        values = [mean_values([s for s in self.strides if s.cycle.trial == trial]) for trial in self.trials]
        speeds = [one["speed"][0] for one in values if "speed" in one]
        return (min(speeds), max(speeds)) if speeds and max(speeds) > _MIXED * min(speeds) else None

    def off(self, side: str) -> Spread | None:
        """Return when the foot of a ``side`` leaves the ground, % of its gait cycle; of other kinds `Cycle.off`."""
        return spread([one.off_percent for one in self.good if one.side in (side, "both")])

    def spatiotemporal(self, side: str = "both") -> dict[str, Spread]:
        """Return the values of strides, or of squats and rises, by name, in ``units``."""
        return {name: Spread(*values) for name, values in mean_values(self.strides, side, units=self.units).items()}


def spread(values: Iterable[float]) -> Spread | None:
    """Return mean, sd and number of the values that are known; None without one."""
    known = np.array([one for one in values if np.isfinite(one)])
    if not known.size:
        return None
    return Spread(float(known.mean()), float(known.std(ddof=1)) if known.size > 1 else float("nan"), known.size)


def _summary(some: Sequence[KeyValue], theirs: Sequence[KeyValue]) -> KeySummary:
    """Return one key value of both sides."""
    sides = {side: np.array([one.value for one in some if one.side == side]) for side in SIDES}
    right, left = (spread(sides[side]) for side in SIDES)
    first, difference, ci95, symmetry = some[0], float("nan"), None, float("nan")
    if right and left:
        # Right less left: from the left mean to the right one.
        change = change_of_mean(visit_mean(sides["left"]), visit_mean(sides["right"]))
        difference, ci95 = change.value, change.interval
        symmetry = symmetry_index(right.mean, left.mean) if first.unit != "deg" or first.key == "range" else np.nan
    beside = {side: found for side in SIDES if (found := spread(one.value for one in theirs if one.side == side))}
    middle = spread(one.value for one in some if one.side == "middle")
    return KeySummary(first.quantity, first.key, first.unit, right, left, difference, ci95, symmetry, beside, middle)


def repetitions_of(kind: str, trials: Sequence[TrialMovement]) -> Repetitions:
    """Return all repetitions of a ``kind`` in the ``trials`` of a session, with what counts in no mean set apart.

    A turn leaves out the whole cycle; a spike the curve in which it is: its largest distance to the median curve is
    `_FAR` times that of the middle one and beyond `_LEAST` (compare Sangeux and Polak 2015,
    doi:10.1016/j.gaitpost.2014.12.004, who rank strides by it); a plate under both feet the loads of a gait cycle.
    """
    cycles = tuple(one for trial in trials for one in trial.cycles if one.kind == kind)
    turned = _turned(trials) if kind == "gait" else []
    curves = _counted((trial.curves for trial in trials), kind, turned)
    values = _counted(((*trial.strides, *trial.lifts) for trial in trials), kind, turned)
    theirs = _counted((trial.file_curves for trial in trials), kind, turned)
    shared = [one for trial in trials for one in trial.shared if one.kind == kind and one not in turned]
    of_one = grouped(((one.quantity, one.side), one) for one in curves)
    spikes = [one for same in of_one.values() for one in _spikes(same)]
    left_out = (
        *(LeftOutCurve(one, "", LeftOutBecause.TURN) for one in turned),
        *(LeftOutCurve(one, "loads", LeftOutBecause.SHARED_PLATE) for one in shared),
        *(LeftOutCurve(one.cycle, one.quantity, LeftOutBecause.SPIKE) for one in spikes),
    )
    kept = tuple(one for one in curves if one not in spikes)
    return Repetitions(kind, cycles, kept, values, left_out, theirs)


def _counted(some: Iterable[Iterable[_Of]], kind: str, turned: Sequence[Cycle]) -> tuple[_Of, ...]:
    """Return what is of cycles of a ``kind``, without those of cycles that were ``turned``."""
    return tuple(one for one in chain.from_iterable(some) if one.cycle.kind == kind and one.cycle not in turned)


def _turned(trials: Sequence[TrialMovement]) -> list[Cycle]:
    """Return the gait cycles during which the pelvis turns."""
    curves = [one for trial in trials for one in trial.curves if one.quantity == "pelvis_rotation"]
    known = [(one.cycle, one.value[np.isfinite(one.value)]) for one in curves if one.cycle.kind == "gait"]
    # Wrapped: a turn through 180 degrees is no jump.
    return [cycle for cycle, way in known if way.size and abs((way[-1] - way[0] + 180) % 360 - 180) > _TURNS]


def _spikes(same: Sequence[CycleCurve]) -> list[CycleCurve]:
    """Return the curves of one quantity and side that leave the others far behind."""
    if len(same) < _FEWEST or same[0].unit not in _LEAST or same[0].quantity.startswith("centre_of_mass"):
        return []
    values = np.stack([one.value for one in same])
    known = np.isfinite(values).any(axis=0)
    # Largest distance over the cycle to the median curve of all.
    apart = np.nan_to_num(np.abs(values[:, known] - np.nanmedian(values[:, known], axis=0))).max(axis=1, initial=0.0)
    far = max(_LEAST[same[0].unit], _FAR * float(np.median(apart)))
    return [one for one, size in zip(same, apart, strict=True) if size > far]

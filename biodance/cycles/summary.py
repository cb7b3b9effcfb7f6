"""Key values, one number of one cycle, as the largest knee flexion, a peak moment or a stride's length; and all good
repetitions of one kind in a session: what is drawn, averaged and told of them over all its trials.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np

from biodance.body.tables.error_sizes import error_size
from biodance.cycles import TrialMovement
from biodance.cycles.curves import CurveGroup, CycleCurve, group_curves
from biodance.cycles.cut import PERCENT, Cycle
from biodance.cycles.strides import LIFT_UNITS, STRIDE_UNITS, Stride, mean_values
from biodance.lab.plates.faults import GAIN
from biodance.records import SIDES, grouped
from biodance.uncertainty.visits import change_of_mean, visit_mean

ANGLE_PANELS = (
    *("pelvis_tilt", "pelvis_obliquity", "pelvis_rotation", "hip_flexion", "hip_adduction", "hip_rotation"),
    *("knee_flexion", "ankle_dorsiflexion", "foot_progression", "trunk_flexion", "trunk_bending", "trunk_rotation"),
)
"""Angles that are shown and of which key values are told."""
LOAD_PANELS = (
    *("hip_flexion_moment", "knee_flexion_moment", "ankle_dorsiflexion_moment", "hip_adduction_moment"),
    *("hip_power", "knee_power", "ankle_power"),
)
"""The same of moments and powers."""
GROUND_PEAKS = ("ground_reaction_up", "ground_reaction_forward")
"""Ground reactions (% of body weight) of which peaks are told."""
_VALLEY = 1.0
"""% of body weight by which the valley lies below both vertical peaks at least: less is one peak, as in running."""
_KNOWN = 0.8  # Share of a cycle that must be known for its peaks
_OF_STANCE = "foot_progression"  # Its mean while the foot stands is told
_INSTANTS: Mapping[str, tuple[str, str]] = {
    "gait": ("at_strike", "at_off"),
    "squat": ("at_start", "at_lowest"),
    "sit_to_stand": ("at_start", "at_seat_off"),
    "jump": ("at_start", "at_take_off"),
}
"""What the beginning and ``Cycle.off`` of each kind of cycle are called."""
_OF_A_FOOT = ("step_length", "step_time", "stance", "margin_aside", "margin_ahead", "contact_time")
"""Spatio-temporal values that each foot has of its own; all others are told of the person."""
_TURN_OF: Mapping[str, str] = {"ankle": "ankle_dorsiflexion"}
"""Joint -> the angle that tells how fast it turns, where it is not its flexion."""


_Curve = tuple[Cycle, str, str]  # Cycle, side and quantity of a curve, or its joint


@dataclass(frozen=True)
class KeyValue:
    """One number of one ``cycle``: its ``quantity``, which ``key`` of it ("maximum", "minimum", "range", "mean", a
    peak, or the instant; "" where the quantity is a number), ``side``, ``value`` in ``unit``; ``sd`` what the inertial
    parameters, or the gain of the plates, leave uncertain in it; ``rate`` 1/s: how fast the joint turns there (rad/s,
    powers), or one over the cycle's duration (spatio-temporal values); of an angle ``span`` deg that it goes through in
    the cycle, and ``beside`` deg, the root of the sum of squares of what the other angles of its joint go through.
    """

    cycle: Cycle
    quantity: str
    key: str
    side: str
    unit: str
    value: float
    sd: float = 0.0
    rate: float = 0.0
    span: float = 0.0
    beside: float = 0.0

    @property
    def name(self) -> str:
        """``knee_flexion_maximum``, or the quantity alone."""
        return f"{self.quantity}_{self.key}" if self.key else self.quantity


def key_values(curves: Sequence[CycleCurve]) -> tuple[KeyValue, ...]:
    """Return the key values of all cycles: of angles (deg) maximum, minimum, range and the values at both instants of
    the cycle; of moments (N·m/kg) and powers (W/kg) maximum and minimum; of the ground reaction (%) its peaks.

    A curve of which less than `_KNOWN` is known has none.
    """
    angles = {(one.cycle, one.side, one.quantity): one for one in curves if one.unit == "deg"}
    spans: dict[_Curve, dict[str, float]] = {}
    for (cycle, side, name), one in angles.items():
        spans.setdefault((cycle, side, name.partition("_")[0]), {})[name] = _span(one)
    found: list[KeyValue] = []
    for one in curves:
        if one.quantity == _OF_STANCE:
            stands = one.value[(one.cycle.off_percent if one.cycle.kind == "gait" else 100.0) >= PERCENT]
            if np.isfinite(stands).any():
                found.append(_key(one, "mean", float(np.nanmean(stands))))
        elif one.quantity in GROUND_PEAKS:
            found += _of_ground(one)
        elif np.isfinite(one.value).mean() <= _KNOWN:
            continue
        elif one.quantity in ANGLE_PANELS:
            found += _of_angle(one, spans)
        elif one.quantity in LOAD_PANELS:
            found += _of_load(one, angles)
    return tuple(found)


def _key(one: CycleCurve, key: str, value: float, **more: float) -> KeyValue:
    return KeyValue(one.cycle, one.quantity, key, one.side, one.unit, value, **more)


def _span(one: CycleCurve) -> float:
    """Return what a curve goes through in its cycle; 0 where nothing of it is known."""
    known = one.value[np.isfinite(one.value)]
    return float(np.ptp(known)) if known.size else 0.0


def _of_angle(one: CycleCurve, spans: Mapping[_Curve, Mapping[str, float]]) -> Iterator[KeyValue]:
    """Yield its key values; ``spans`` by cycle, side and joint what each angle goes through."""
    of_joint, span = spans[one.cycle, one.side, one.quantity.partition("_")[0]], _span(one)
    beside = float(np.linalg.norm([size for name, size in of_joint.items() if name != one.quantity]))
    found = {"maximum": float(np.nanmax(one.value)), "minimum": float(np.nanmin(one.value)), "range": span}
    for key, at in zip(_INSTANTS[one.cycle.kind], (0.0, one.cycle.off_percent), strict=True):
        found[key] = float(np.interp(at, PERCENT, one.value))
    yield from (_key(one, key, value, span=span, beside=beside) for key, value in found.items() if np.isfinite(value))


def _of_load(one: CycleCurve, angles: Mapping[_Curve, CycleCurve]) -> Iterator[KeyValue]:
    """Yield both extremes with their uncertainty, and how fast the joint turns there if it is a power."""
    joint = one.quantity.partition("_")[0]
    turn = angles.get((one.cycle, one.side, _TURN_OF.get(joint, f"{joint}_flexion"))) if one.unit == "W/kg" else None
    turning = None if turn is None else np.abs(np.gradient(np.radians(turn.value), turn.cycle.times()))
    for key, at in (("maximum", int(np.nanargmax(one.value))), ("minimum", int(np.nanargmin(one.value)))):
        rate = 0.0 if turning is None else float(turning[at])
        sd, rate = np.nan_to_num([one.sd[at], rate]).tolist()
        yield _key(one, key, float(one.value[at]), sd=sd, rate=rate)


def _of_ground(one: CycleCurve) -> Iterator[KeyValue]:
    """Yield the peaks of the ground reaction on a foot whose whole stance is known.

    Forwards the lowest value below zero (braking) and the highest above it (pushing); upwards the largest value in each
    half of the stance and the valley between them, or one maximum where nothing is `_VALLEY` below both.
    """
    stance = one.value[one.cycle.off_percent >= PERCENT]
    if stance.size < 2 or not np.isfinite(stance).all():
        return
    low, high, half = stance.min(), stance.max(), stance.size // 2
    first, second = int(stance[:half].argmax()), half + int(stance[half:].argmax())
    valley = stance[first : second + 1].min()
    if one.quantity == "ground_reaction_forward":
        found = {"braking_peak": low} if low < 0 else {}
        found |= {"pushing_peak": high} if high > 0 else {}
    elif valley > min(stance[first], stance[second]) - _VALLEY:
        found = {"maximum": high}
    else:
        found = {"first_peak": stance[first], "valley": valley, "second_peak": stance[second]}
    # The reading is proportional to the gain: its sd is a share of the value.
    gain = error_size(GAIN.name, "Fz" if one.quantity == "ground_reaction_up" else "Fx")
    yield from (_key(one, key, float(value), sd=gain * abs(float(value))) for key, value in found.items())


def stride_values(strides: Sequence[Stride], *, leading: str) -> tuple[KeyValue, ...]:
    """Return the spatio-temporal values of all strides: step length, step time and stance of each foot; all others
    once, under the side "both", from the strides of the ``leading`` foot: those of the other one share their time and
    would count twice.
    """
    return tuple(
        KeyValue(
            one.cycle,
            name,
            "",
            one.cycle.side if name in _OF_A_FOOT else "both",
            STRIDE_UNITS[name],
            value,
            rate=1 / one.cycle.duration,
        )
        for one in strides
        for name, value in one.values.items()
        if name in _OF_A_FOOT or one.cycle.side == leading
    )


def leading_foot(visits: Sequence[Sequence[Stride]]) -> str:
    """Return the side, "right" or "left", of which the visit with fewest strides has most."""
    least = {side: min(sum(one.cycle.side == side for one in some) for some in visits) for side in SIDES}
    return max(SIDES, key=least.__getitem__)


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
    """Both feet may have stood on one plate for a part of it, so that no plate tells what this foot carried."""
    SPIKE = "spike"
    """It leaves all others of its kind far behind: a marker or a plate jumped."""
    TURN = "turn"
    """The person turned: its angles are not those of straight walking."""


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
    ``beside`` the same by side as another program has it, ``conventional`` of the conventional gait model, computed
    here; ``middle`` of trunk and pelvis where both sides move alike.
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
    conventional: Mapping[str, Spread]
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
    ``file_curves`` plug-in gait's own angles over the same cycles, ``conventional_curves`` those of the conventional
    gait model, computed here.
    """

    kind: str
    cycles: tuple[Cycle, ...]
    curves: tuple[CycleCurve, ...]
    strides: tuple[Stride, ...]
    left_out: tuple[LeftOutCurve, ...] = ()
    file_curves: tuple[CycleCurve, ...] = ()
    conventional_curves: tuple[CycleCurve, ...] = ()

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
    def conventional_groups(self) -> tuple[CurveGroup, ...]:
        """The same of the conventional gait model."""
        return group_curves(self.conventional_curves)

    @property
    def beside(self) -> tuple[CurveGroup, ...]:
        """Plug-in gait's angles from the files, where they hold none as computed here."""
        return self.file_groups or self.conventional_groups

    @cached_property
    def key_values(self) -> tuple[KeyValue, ...]:
        """The key values of every repetition."""
        return key_values(self.curves)

    @cached_property
    def keys(self) -> tuple[KeySummary, ...]:
        """The key values of both sides beside each other."""
        three = (self.key_values, key_values(self.file_curves), key_values(self.conventional_curves))
        ours, theirs, usual = (grouped(((one.quantity, one.key), one) for one in values) for values in three)
        return tuple(_summary(some, theirs.get(about, ()), usual.get(about, ())) for about, some in ours.items())

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of every value of its strides, squats or rises."""
        return STRIDE_UNITS if self.kind == "gait" else LIFT_UNITS

    @property
    def runs(self) -> bool:
        """Whether these are strides, most of which have a flight: a jump has one, too."""
        return self.kind == "gait" and 2 * sum("flight_time" in one.values for one in self.strides) > len(self.strides)

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


def _by_side(values: Sequence[KeyValue]) -> dict[str, Spread]:
    """Return mean, sd and number of a key value of each side that has one."""
    return {side: found for side in SIDES if (found := spread(one.value for one in values if one.side == side))}


def _summary(some: Sequence[KeyValue], theirs: Sequence[KeyValue], usual: Sequence[KeyValue]) -> KeySummary:
    """Return one key value of both sides."""
    sides = {side: np.array([one.value for one in some if one.side == side]) for side in SIDES}
    right, left = (spread(sides[side]) for side in SIDES)
    first, difference, ci95, symmetry = some[0], float("nan"), None, float("nan")
    if right and left:
        # Right less left: from the left mean to the right one.
        change = change_of_mean(visit_mean(sides["left"]), visit_mean(sides["right"]))
        difference, ci95 = change.value, change.interval
        symmetry = symmetry_index(right.mean, left.mean) if first.unit != "deg" or first.key == "range" else np.nan
    middle = spread(one.value for one in some if one.side == "middle")
    others = _by_side(theirs), _by_side(usual)
    return KeySummary(first.quantity, first.key, first.unit, right, left, difference, ci95, symmetry, *others, middle)


def repetitions_of(kind: str, trials: Sequence[TrialMovement]) -> Repetitions:
    """Return all repetitions of a ``kind`` in the ``trials`` of a session, with what counts in no mean set apart.

    A turn leaves out the whole cycle; a spike the curve in which it is: its largest distance to the median curve, taken
    in the size and offset that are nearest, is `_FAR` times that of the middle one and beyond `_LEAST` (compare Sangeux
    and Polak 2015, doi:10.1016/j.gaitpost.2014.12.004, who rank strides by the distance itself); a plate under both
    feet the loads of a gait cycle.
    """
    cycles = tuple(one for trial in trials for one in trial.cycles if one.kind == kind)
    turned = _turned(trials) if kind == "gait" else []

    def counted(*names: str) -> tuple[Any, ...]:
        every = (one for trial in trials for name in names for one in getattr(trial, name))
        return tuple(one for one in every if one.cycle.kind == kind and one.cycle not in turned)

    curves, values = counted("curves"), counted("strides", "lifts")
    shared = [one for trial in trials for one in trial.shared if one.kind == kind and one not in turned]
    of_one = grouped(((one.quantity, one.side), one) for one in curves)
    spikes = [one for same in of_one.values() for one in _spikes(same)]
    left_out = (
        *(LeftOutCurve(one, "", LeftOutBecause.TURN) for one in turned),
        *(LeftOutCurve(one, "loads", LeftOutBecause.SHARED_PLATE) for one in shared),
        *(LeftOutCurve(one.cycle, one.quantity, LeftOutBecause.SPIKE) for one in spikes),
    )
    kept = tuple(one for one in curves if one not in spikes)
    return Repetitions(kind, cycles, kept, values, left_out, counted("file_curves"), counted("conventional_curves"))


def _turned(trials: Sequence[TrialMovement]) -> list[Cycle]:
    """Return the gait cycles during which the pelvis turns."""
    curves = [one for trial in trials for one in trial.curves if one.quantity == "pelvis_rotation"]
    known = [(one.cycle, one.value[np.isfinite(one.value)]) for one in curves if one.cycle.kind == "gait"]
    # Wrapped: a turn through 180 degrees is no jump.
    return [cycle for cycle, way in known if way.size and abs((way[-1] - way[0] + 180) % 360 - 180) > _TURNS]


def _spikes(same: Sequence[CycleCurve]) -> list[CycleCurve]:
    """Return the curves of one quantity and side that leave the others far behind, whatever size and offset they have:
    a deeper squat is no spike.
    """
    if len(same) < _FEWEST or same[0].unit not in _LEAST or same[0].quantity.startswith("centre_of_mass"):
        return []
    values = np.stack([one.value for one in same])
    known = np.isfinite(values).any(axis=0)
    median, apart = np.nanmedian(values[:, known], axis=0), np.zeros(len(same))
    for k, value in enumerate(values[:, known]):
        own = np.isfinite(value)
        if own.any():
            # Least squares on the median curve and a constant; the largest distance over the cycle that is left.
            usual = np.column_stack([median[own], np.ones(own.sum())])
            apart[k] = np.abs(value[own] - usual @ np.linalg.lstsq(usual, value[own], rcond=None)[0]).max()
    far = max(_LEAST[same[0].unit], _FAR * float(np.median(apart)))
    return [one for one, size in zip(same, apart, strict=True) if size > far]

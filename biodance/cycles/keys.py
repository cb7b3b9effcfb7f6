"""Key values of cycles: one number of one cycle, as the largest knee flexion, a peak moment or a stride's length."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from biodance.body.tables.error_sizes import error_size
from biodance.cycles.curves import CycleCurve
from biodance.cycles.cut import PERCENT, Cycle
from biodance.cycles.strides import STRIDE_UNITS, Stride
from biodance.lab.plates.faults import GAIN
from biodance.records import SIDES

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
_TURNS: Mapping[str, str] = {"ankle": "ankle_dorsiflexion"}
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
    turn = angles.get((one.cycle, one.side, _TURNS.get(joint, f"{joint}_flexion"))) if one.unit == "W/kg" else None
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

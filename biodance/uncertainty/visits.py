"""Two visits beside each other: how far a mean over strides is known, what placing the markers anew adds, and which of
many changes chance does not explain.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.body.tables.error_sizes import error_size, joint_size
from biodance.records import Array
from biodance.settings import STANDARD_GRAVITY

FEWEST_STRIDES = 3
"""Strides of a visit without which nothing is said of a change."""
FALSE_DISCOVERIES = 0.05
"""Share of the changes told that may be chance (Benjamini-Hochberg)."""
_COVERAGE = 0.95


@dataclass(frozen=True)
class VisitMean:
    """What one visit says of one quantity: ``mean`` over ``count`` strides, its standard error ``error`` over these,
    with ``freedom`` degrees of freedom, and ``systematic``, the standard deviation of what all its strides share
    (placing of the markers, inertial parameters). NaN = not known.
    """

    mean: float
    error: float
    count: int
    freedom: float
    systematic: float = 0.0

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % interval of the mean within the visit, without what all strides share; None of fewer than three
        strides.
        """
        if self.count < FEWEST_STRIDES:
            return None
        from scipy.stats import t as student  # takes most of a second to import

        half = float(student.ppf((1 + _COVERAGE) / 2, self.freedom)) * self.error
        return self.mean - half, self.mean + half


@dataclass(frozen=True)
class MeanChange:
    """A later mean less an earlier one: ``value``, its 95 % ``interval`` and ``p`` of a change at least as large if
    nothing had changed; both None where a visit has fewer than three strides.
    """

    value: float
    interval: tuple[float, float] | None
    p: float | None


def visit_mean(values: Array, *, systematic: float = 0.0) -> VisitMean:
    """Return what a visit says of a quantity of which its strides have ``values`` (n,)."""
    count = values.size
    error = float(np.std(values, ddof=1) / np.sqrt(count)) if count > 1 else float("nan")
    return VisitMean(float(np.mean(values)), error, count, count - 1.0, systematic)


def change_of_mean(earlier: VisitMean, later: VisitMean) -> MeanChange:
    """Return the later mean less the earlier one.

    Notes
    -----
    V = sum over both visits of (error^2 + systematic^2). The interval is Student's with the degrees of freedom of
    Welch and Satterthwaite, V^2 / sum(error^4 / freedom): what strides share has no freedom of its own, its size is
    taken as known.
    """
    from scipy.stats import t as student

    value = later.mean - earlier.mean
    if min(earlier.count, later.count) < FEWEST_STRIDES:
        return MeanChange(value, None, None)
    both = (earlier, later)
    variance = sum(one.error**2 + one.systematic**2 for one in both)
    if variance <= 0:
        return MeanChange(value, (value, value), 1.0 if value == 0 else 0.0)
    # Welch-Satterthwaite: only errors that were estimated from strides have degrees of freedom.
    scatter = sum(one.error**4 / one.freedom for one in both)
    freedom = variance**2 / scatter if scatter > 0 else float("inf")
    sd = float(np.sqrt(variance))
    half = float(student.ppf((1 + _COVERAGE) / 2, freedom)) * sd
    return MeanChange(value, (value - half, value + half), float(2 * student.sf(abs(value) / sd, freedom)))


def beyond_chance(p: Sequence[float | None]) -> NDArray[np.bool_]:
    """Return (n,) which of many changes are told: of these at most `FALSE_DISCOVERIES` are expected to be chance
    (Benjamini and Hochberg 1995, doi:10.1111/j.2517-6161.1995.tb02031.x). Those without ``p`` are not tested.
    """
    tested = np.array([one is not None for one in p], dtype=bool)
    told = np.zeros(tested.size, dtype=bool)
    if tested.any():
        from scipy.stats import false_discovery_control

        known = np.array([one for one in p if one is not None])
        told[tested] = false_discovery_control(known) <= FALSE_DISCOVERIES
    return told


@dataclass(frozen=True, kw_only=True)
class KeyKind:
    """What of a key value says how far placing the markers anew moves it: its ``quantity``, ``key`` and ``unit``; the
    means over the cycles of a visit of ``rate`` 1/s (how fast the joint of a power turns, rad/s; one over the stride
    time), ``span`` deg that the angle goes through and ``beside`` deg that the other angles of its joint go through.
    """

    quantity: str
    key: str
    unit: str
    rate: float = 0.0
    span: float = 0.0
    beside: float = 0.0


_LEVER: Mapping[str, float] = {"hip": 0.3, "knee": 0.3, "ankle": 0.15}
"""m, about how far from its joint the markers lie that tell how a segment turns."""
_SKIN: Mapping[str, float] = {"pelvis": 0.12, "trunk": 0.2}
"""m, about how far from its middle the four markers of a segment lie whose skin goes with the limbs."""
_LIMB_TURNS = 1.0
"""rad, about what a hip or a shoulder goes through in a cycle."""
_INWARD = 5.0
"""% of body weight that the ground pushes a walking foot inwards at the most: of 22 legs of eleven people of three
laboratories the mean curves reach 5.3 on average, 2.8 to 9.2 (docs/benchmarks/movement.md).
"""
_EVENT = 0.009
"""s by which strikes differ from those that another program found in the same files (docs/benchmarks/movement.md)."""


def placement_sizes() -> Mapping[str, float]:
    """Return the standard deviations with which `placement_sd` counts, by name: m, rad, m/rad, s."""
    return {
        "frame": error_size("frame_turn", "any"),
        "knee axis": error_size("axis_turn", "knee medial marker", state="before"),
        **{joint: joint_size("joint_centre", joint) for joint in _LEVER},
        "marker": error_size("soft_tissue", "marker"),
        "skin": error_size("slide", "marker"),
        "event": _EVENT,
    }


def placement_sd(of: KeyKind) -> float:
    """Return the standard deviation that placing the markers anew at each visit gives a key value, in its unit; 0 where
    the placing cancels.

    Notes
    -----
    With turn = ``frame_turn``, centre = ``joint_centre``, marker = ``soft_tissue`` of sizes.csv (each with its source):

    - An angle (deg) is one frame against the laboratory (pelvis, foot progression), n = 1, or one against another, n =
      2. Turned frames shift it by turn sqrt(n), the rotation of the hip also by ``axis_turn``, and mix the other angles
      of its joint into it by turn sqrt(n) beside; a joint centre that lies elsewhere drifts by 2 sin(span / 2) centre,
      which turns a segment by that over the lever of its markers. Skin over pelvis and trunk goes with the limbs by
      ``slide``, each of four markers by itself. A range has no shift.
    - A moment (N·m/kg) changes by the weight of 1 kg times centre at the most, a power (W/kg) by that times ``rate``.
    - A stride's length changes by marker, a step's length and width, of two feet, and a margin by sqrt(2) marker, a
      speed by marker times ``rate``. Stance (% of the stride) and the times of a step, on the ground and in the air
      change by `_EVENT`, double support by sqrt(2) of it; stride time and cadence, from one strike of a foot to its
      next, by nothing.
    - The ground reaction forwards changes by turn `_INWARD`: forwards is where the markers say that the pelvis goes.
    """
    if of.unit == "deg":
        return _of_angle(of)
    if of.unit in ("N·m/kg", "W/kg"):
        joint = of.quantity.partition("_")[0]
        # m g d for 1 kg; a power is this moment times the joint's rate.
        return STANDARD_GRAVITY * placement_sizes()[joint] * (of.rate if of.unit == "W/kg" else 1.0)
    marker, two = placement_sizes()["marker"], float(np.sqrt(2))
    sizes = {
        "stride_length": marker,
        "speed": marker * of.rate,
        "step_length": two * marker,
        "step_width": two * marker,
        "margin_aside": two * marker,
        "margin_ahead": two * marker,
        "step_time": _EVENT,
        "contact_time": _EVENT,
        "flight_time": _EVENT,
        # An error of time in % of the stride: 100 dt over the stride time (`rate` = 1 / stride time).
        "stance": 100 * _EVENT * of.rate,
        "double_support": 100 * two * _EVENT * of.rate,
        "ground_reaction_forward": placement_sizes()["frame"] * _INWARD,
    }
    return sizes.get(of.quantity, 0.0)


def _of_angle(of: KeyKind) -> float:
    joint = of.quantity.partition("_")[0]
    size = placement_sizes()
    turn = size["frame"] * float(np.sqrt(1 if joint in ("pelvis", "foot") else 2))
    parts = [turn * of.beside]
    if joint in _LEVER:
        # Chord of the circle on which the wrong centre travels while the joint goes through its range.
        drift = 2 * np.sin(np.radians(of.span) / 2) * size[joint]
        parts.append(float(np.degrees(drift / _LEVER[joint])))
    if joint in _SKIN:
        # Skin at four independent markers: their mean over lever has half the size of one.
        parts.append(float(np.degrees(size["skin"] * _LIMB_TURNS / (2 * _SKIN[joint]))))
    if of.key != "range":
        parts.append(float(np.degrees(turn)))
        if of.quantity == "hip_rotation":
            parts.append(float(np.degrees(size["knee axis"])))
    return float(np.linalg.norm(parts))

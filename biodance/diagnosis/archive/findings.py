"""What is wrong with a plate, in words: it changed, it is off, it wanders, something lay on it."""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from biodance.diagnosis.archive.changes import ALARM, ALL, Change, History
from biodance.diagnosis.archive.conditions import ConditionEffect
from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES

_HORIZONTAL = ("offset_x", "offset_y")
"""What may wander; vertically a difference from visit to visit may be the declared mass."""
_SURE = 3.0
"""Standard deviations from which on a level is not what the file says."""


@dataclass(frozen=True)
class PlateLevel:
    """A quantity of a plate as it is now (after its last change): ``value``, ``sd``; ``between`` its standard deviation
    from visit to visit; ``visits`` that tell it; ``taken_off`` share of the trials in which the reader saw and
    subtracted it.
    """

    quantity: str
    value: float
    sd: float
    between: float
    visits: int
    taken_off: float


@dataclass(frozen=True)
class PlateFinding:
    """What is wrong with a plate: ``effect`` and ``target`` as in `biodance.effects`, and what to know in words."""

    effect: str
    target: str
    text: str
    quantity: str
    value: float
    interval: tuple[float, float]


def said(quantity: str, value: float) -> str:
    """Return a value of a quantity as a person says it, with its sign."""
    factor, unit, digits = {"m": (1e3, "mm", 1), "s": (1e3, "ms", 1), "1": (1e2, "%", 2), "N": (1.0, "N", 1)}[
        PLATE_QUANTITIES[quantity].unit
    ]
    shown = round(factor * value, digits) + 0.0  # no minus before zero
    return f"{shown:+.{digits}f} {unit}".replace("-", "−")


def changed_finding(change: Change, taken_off: float) -> PlateFinding:
    """Return a change as a finding."""
    known, low, high = PLATE_QUANTITIES[change.quantity], *change.interval
    when = change.visit.date or f"visit {change.visit.name}"
    first, last = (one.date or one.name for one in (change.earliest, change.latest))
    between = f" (95 %: between {first} and {last})" if first != last else ""
    together = " of all plates together" if change.plate == ALL else ""
    mended = " The reader sees it on the empty plate and takes it off." if taken_off > 0.9 else ""
    text = (
        f"{_WORDS[change.quantity]}{together} changed from {said(change.quantity, change.before)} to "
        f"{said(change.quantity, change.after)} on {when}{between}; "
        f"step {said(change.quantity, change.after - change.before)}, "
        f"95 % interval {said(change.quantity, low)} to {said(change.quantity, high)}.{mended}"
    )
    return PlateFinding(
        known.effect, known.target, text, change.quantity, change.after - change.before, change.interval
    )


_WORDS = {
    "place_x": "The place along x of the laboratory",
    "place_y": "The place along y of the laboratory",
    "gain": "What it weighs",
    "offset_x": "What it reads along x without load",
    "offset_y": "What it reads along y without load",
    "offset_z": "What it reads vertically without load",
    "delay": "The delay of the forces",
}


def condition_finding(one: ConditionEffect) -> PlateFinding:
    """Return what a kind of trial reads as a finding."""
    known, shared = PLATE_QUANTITIES[one.quantity], one.shared
    kilograms = f" ({shared.mean / 9.80665:+.2f} kg)".replace("-", "−") if one.quantity == "offset_z" else ""
    what = (
        " Something of that weight lies on the plate in these trials and was not zeroed (a pad, a mat): zero the plate "
        "with it on, or take its weight off."
        if one.quantity == "offset_z" and shared.mean > 0
        else ""
    )
    text = (
        f"Trials with {one.factor} {one.level} read {said(one.quantity, shared.mean)}{kilograms} more than those with "
        f"{one.factor} {one.base} of the same visits, in {len(one.persons)} of {len(one.visits)} persons "
        f"(95 % interval {said(one.quantity, shared.interval[0])} to {said(one.quantity, shared.interval[1])}; "
        f"standard deviation between persons {said(one.quantity, shared.spread)[1:]}).{what}"
    )
    return PlateFinding(known.effect, known.target, text, one.quantity, shared.mean, shared.interval)


def wrong_findings(level: PlateLevel) -> list[PlateFinding]:
    """Return a level that is not what the file says: certain, and large enough to matter."""
    known = PLATE_QUANTITIES[level.quantity]
    half = 1.96 * level.sd
    certain = abs(level.value) > _SURE * level.sd and abs(level.value) - half > known.matters
    if not certain or level.visits < 2 or level.taken_off > 0.5:
        return []
    interval = (level.value - half, level.value + half)
    text = (
        f"{_WORDS[level.quantity]} is off by {said(level.quantity, level.value)} over {level.visits} visits (95 % "
        f"interval {said(level.quantity, interval[0])} to {said(level.quantity, interval[1])})."
    )
    return [PlateFinding(known.effect, known.target, text, level.quantity, level.value, interval)]


def wandering_findings(plate: str, level: PlateLevel, one: History) -> list[PlateFinding]:
    """Return an offset that differs from day to day more than within a day, and is not taken off."""
    known, series = PLATE_QUANTITIES[level.quantity], one.series
    rows = series.design[:, series.plates.index(plate)] != 0
    if (
        level.quantity not in _HORIZONTAL
        or level.taken_off > 0.5
        or level.visits < 3
        or level.between < known.matters / 2
    ):
        return []
    left = (series.value - one.columns @ one.fitted.beta)[rows]
    free = left.size - np.linalg.matrix_rank(one.columns[rows])
    ratio = float(np.sum((left / series.sd[rows]) ** 2)) / max(1, free)
    if free < 1 or fdtrc(free, 60, ratio) > ALARM * known.share:
        return []
    low, high = series.value[rows].min(), series.value[rows].max()
    text = (
        f"{_WORDS[level.quantity]} wanders from day to day: {said(level.quantity, low)} to "
        f"{said(level.quantity, high)}, standard deviation between visits {said(level.quantity, level.between)[1:]}. "
        f"Zero the plate before every session and record it empty."
    )
    return [PlateFinding(known.effect, known.target, text, level.quantity, level.between, (float(low), float(high)))]

"""The plates of a laboratory judged from what all its visits say: a card per plate, what changed, who stands out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from biodance.diagnosis.archive.candidates import ALL
from biodance.diagnosis.archive.changes import ALARM, Change, History, Stranger, history
from biodance.diagnosis.archive.conditions import ConditionEffect, condition_effects, without_conditions
from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES, PlateEvidence, PlateVisit, in_order
from biodance.diagnosis.archive.series import series_of
from biodance.settings import STANDARD_GRAVITY
from biodance.threads import one_thread

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
    return f"{shown:{'+' if shown else ''}.{digits}f} {unit}".replace("-", "−")


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
    kilograms = f" ({shared.mean / STANDARD_GRAVITY:+.2f} kg)".replace("-", "−") if one.quantity == "offset_z" else ""
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


@dataclass(frozen=True, eq=False)
class PlateCard:
    """One plate over time."""

    plate: str
    visits: int
    levels: tuple[PlateLevel, ...]
    changes: tuple[Change, ...]
    findings: tuple[PlateFinding, ...]


@dataclass(frozen=True, eq=False)
class ArchiveJudgement:
    """What the visits of a laboratory say together.

    Parameters
    ----------
    visits : tuple of PlateVisit
        In order of their date, else of their name.
    plates : tuple of PlateCard
        By name.
    conditions : tuple of ConditionEffect
        What kinds of trial read that is not the plate's.
    strangers : tuple of Stranger
        People and visits unlike the others by what matters.
    histories : tuple of History
        Of every quantity that was seen.
    """

    visits: tuple[PlateVisit, ...]
    plates: tuple[PlateCard, ...]
    conditions: tuple[ConditionEffect, ...]
    strangers: tuple[Stranger, ...]
    histories: tuple[History, ...]

    @property
    def findings(self) -> tuple[PlateFinding, ...]:
        """Of all plates."""
        return tuple(finding for card in self.plates for finding in card.findings)


@one_thread()
def judge_archive(observations: Sequence[PlateEvidence]) -> ArchiveJudgement:
    """Return what the observations of an archive say about its plates, kinds of trial and people; none gives an empty
    judgement.
    """
    visits = in_order(observations)
    conditions = condition_effects(observations)
    base = without_conditions(observations, conditions)
    quantities = [name for name in PLATE_QUANTITIES if any(one.quantity == name for one in base)]
    histories = tuple(history(series_of(name, base, visits)) for name in quantities)
    plates = sorted({plate for one in observations for plate in one.plates})
    cards = tuple(_card(plate, base, histories, conditions) for plate in plates)
    every = (one for some in histories for one in some.strangers)
    strangers = tuple(one for one in every if abs(one.value) >= PLATE_QUANTITIES[one.quantity].matters)
    return ArchiveJudgement(visits, cards, conditions, strangers, histories)


def _card(
    plate: str,
    observations: Sequence[PlateEvidence],
    histories: tuple[History, ...],
    conditions: tuple[ConditionEffect, ...],
) -> PlateCard:
    """Return the card of one plate."""
    own = [one for one in histories if plate in one.series.plates]
    levels = tuple(_level(plate, one, observations) for one in own)
    changes = tuple(change for one in own for change in one.changes if change.plate in (plate, ALL))
    findings = [
        changed_finding(change, _taken_off(plate, change.quantity, observations))
        for change in changes
        if change.matters and not _follows(change, changes)
    ]
    findings += [condition_finding(one) for one in conditions if plate in one.plate.split("+")]
    for level, one in zip(levels, own, strict=True):
        if not any(change.matters and change.quantity == level.quantity for change in changes):
            findings += wrong_findings(level)
        findings += wandering_findings(plate, level, one)
    seen = {one.visit for one in observations if plate in one.plates}
    return PlateCard(plate, len(seen), levels, changes, tuple(findings))


def _follows(change: Change, others: tuple[Change, ...]) -> bool:
    """Return whether a change of place follows from one of the delay: a late pressure lags behind the foot."""
    if not change.quantity.startswith("place"):
        return False
    late = [one for one in others if one.quantity == "delay" and one.matters]
    return any(change.earliest.when <= one.latest.when and one.earliest.when <= change.latest.when for one in late)


def _taken_off(plate: str, quantity: str, observations: Sequence[PlateEvidence]) -> float:
    some = [one.taken_off for one in observations if one.quantity == quantity and plate in one.plates]
    return float(np.mean(some)) if some else 0.0


def _level(plate: str, one: History, observations: Sequence[PlateEvidence]) -> PlateLevel:
    rows = one.series.design[:, one.series.plates.index(plate)] != 0
    value, error = one.level(plate)
    sd = float(np.hypot(error, PLATE_QUANTITIES[one.series.quantity].norm))
    between = float(np.hypot(one.fitted.between, one.fitted.alone))
    visits = int(np.unique(one.series.visit[rows]).size)
    return PlateLevel(
        one.series.quantity, value, sd, between, visits, _taken_off(plate, one.series.quantity, observations)
    )

"""The plates of a laboratory judged from what all its visits say: a card per plate, what changed, who stands out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from biodance.diagnosis.archive.changes import ALL, Change, History, Stranger, history
from biodance.diagnosis.archive.conditions import ConditionEffect, condition_effects, without_conditions
from biodance.diagnosis.archive.findings import (
    PlateFinding,
    PlateLevel,
    changed_finding,
    condition_finding,
    wandering_findings,
    wrong_findings,
)
from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES, PlateEvidence, PlateVisit, in_order
from biodance.diagnosis.archive.series import series_of
from biodance.threads import one_thread


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
        People and visits unlike the others.
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
def judge(observations: Sequence[PlateEvidence]) -> ArchiveJudgement:
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
    strangers = tuple(one for some in histories for one in some.strangers)
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
    """Return whether a change of place follows from one of the delay at the same date: a late pressure lags behind the
    foot that rolls on.
    """
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

"""What one recording says of a plate, in numbers that need no body model, and which quantities there are."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from biodance.effects import Quantity
from biodance.effects.plate_gain import PlateGain
from biodance.effects.plate_offset import PlateOffset
from biodance.effects.plate_position import PlatePosition
from biodance.effects.time_delay import TimeDelay
from biodance.errors import UnknownName

PLATE_QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {one.name: one for kind in (PlatePosition, PlateGain, PlateOffset, TimeDelay) for one in kind.followed}
)
"""By name; what of each cause is followed over time stands in its own file."""


@dataclass(frozen=True)
class PlateVisit:
    """One visit of one person: its ``name``, the ``person``, and the ``date`` (ISO 8601, "" = not known)."""

    name: str
    person: str
    date: str = ""

    @property
    def when(self) -> tuple[str, str]:
        """What visits are ordered by."""
        return self.date, self.name


@dataclass(frozen=True)
class PlateEvidence:
    """What one trial says of one quantity.

    Parameters
    ----------
    quantity : str
        Of `PLATE_QUANTITIES`.
    plates : mapping
        Which plates read it, and with which share: a person who stands with one foot on each of two plates says half of
        each gain. Usually ``{"plate1": 1.0}``.
    value, sd : float
        In the quantity's unit; ``sd`` is what another trial of the same visit may differ by.
    visit : PlateVisit
        Whose.
    trial : str
        Its name.
    conditions : mapping
        What the trial was (``surface`` -> ``Foam``), where trials of one visit differ in it.
    taken_off : bool
        The reader saw it on the empty plate and subtracted it: results do not suffer.
    """

    quantity: str
    plates: Mapping[str, float]
    value: float
    sd: float
    visit: PlateVisit
    trial: str
    conditions: Mapping[str, str] = field(default_factory=dict)
    taken_off: bool = False

    def __post_init__(self) -> None:
        if self.quantity not in PLATE_QUANTITIES:
            raise UnknownName.of("quantity of a plate", self.quantity, list(PLATE_QUANTITIES))
        if not self.sd > 0:
            raise ValueError(f"PlateEvidence {self.quantity} of {self.trial}: sd = {self.sd} must be positive.")


def in_order(observations: Iterable[PlateEvidence]) -> tuple[PlateVisit, ...]:
    """Return the visits, each once, by date where all have one, else by name."""
    visits = {one.visit for one in observations}
    dated = all(visit.date for visit in visits)
    return tuple(sorted(visits, key=lambda visit: (visit.date if dated else "", visit.name)))


def daily_rows(observations: Sequence[PlateEvidence]) -> list[dict[str, Any]]:
    """Return one row for each visit and plate that it stood on alone; a quantity that nothing saw is None.

    Keys: ``date``, ``visit``, ``person``, ``plate``; ``place_x_m``, ``place_x_sd_m``, ``place_x_trials`` and so for
    every quantity, the unit as suffix (gain without); ``offset_taken_off`` whether the reader subtracted the offsets.
    """
    plates = sorted({plate for one in observations for plate in one.plates})
    rows, by_visit = [], dict[PlateVisit, list[PlateEvidence]]()
    for one in observations:
        by_visit.setdefault(one.visit, []).append(one)
    for visit in in_order(observations):
        own = by_visit[visit]
        for plate in plates:
            some = [
                one for one in own if plate in one.plates and max(one.plates.values()) / sum(one.plates.values()) > 0.9
            ]
            if some:
                row: dict[str, Any] = {
                    "date": visit.date, "visit": visit.name, "person": visit.person, "plate": plate
                }  # fmt: skip
                for name in PLATE_QUANTITIES:
                    row |= _cells(name, [one for one in some if one.quantity == name])
                row["offset_taken_off"] = all(one.taken_off for one in some if one.quantity.startswith("offset"))
                rows.append(row)
    return rows


def _cells(name: str, some: Sequence[PlateEvidence]) -> dict[str, Any]:
    """Return mean, standard error and number of trials of one quantity."""
    suffix = {"1": "", "m": "_m", "s": "_s", "N": "_n"}[PLATE_QUANTITIES[name].unit]
    if not some:
        return {f"{name}{suffix}": None, f"{name}_sd{suffix}": None, f"{name}_trials": 0}
    # Weighted mean with 1 / sd²; its variance is the inverse of the sum of the weights.
    weight = np.array([one.sd**-2.0 for one in some])
    mean = float(weight @ np.array([one.value for one in some]) / weight.sum())
    return {f"{name}{suffix}": mean, f"{name}_sd{suffix}": float(weight.sum() ** -0.5), f"{name}_trials": len(some)}

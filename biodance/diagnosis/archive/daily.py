"""The table that a laboratory keeps: what every visit said of every plate."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from biodance.diagnosis.archive.quantities import PLATE_QUANTITIES, PlateEvidence, in_order


def daily_rows(observations: Sequence[PlateEvidence]) -> list[dict[str, Any]]:
    """Return one row for each visit and plate that it stood on alone; a quantity that nothing saw is None.

    Keys: ``date``, ``visit``, ``person``, ``plate``; ``place_x_m``, ``place_x_sd_m``, ``place_x_trials`` and so for
    every quantity, the unit as suffix (gain without); ``offset_taken_off`` whether the reader subtracted the offsets.
    """
    plates = sorted({plate for one in observations for plate in one.plates})
    rows = []
    for visit in in_order(observations):
        own = [one for one in observations if one.visit == visit]
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
    weight = np.array([one.sd**-2.0 for one in some])
    mean = float(weight @ np.array([one.value for one in some]) / weight.sum())
    return {f"{name}{suffix}": mean, f"{name}_sd{suffix}": float(weight.sum() ** -0.5), f"{name}_trials": len(some)}

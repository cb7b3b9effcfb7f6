"""What ordinary steps say of the plates they fall on: their place, the delay of the force, what they weigh.

The witnesses (`biodance.witnesses`) tell how far the pressure lies from where it is in a foot; which way a plate would
have to be moved for it is asked of them by altering the recording. All steps of a trial on one plate are put together
by weighted least squares.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from biodance.diagnosis.archive.quantities import LabVisit, PlateEvidence
from biodance.records import Array, Trial
from biodance.witnesses import Observation, Recording, observe, possible_causes, recording, traces

_PLACE, _ONSET, _WEIGHT = ("foot_across", "foot_along"), "force_onset", "stride_force"
_BLIND = 0.03
"""m: a direction in which steps know a plate's place no better is not told."""


def of_steps(
    trial: Trial, visit: LabVisit, kind: Mapping[str, str], mass: float, labels: Mapping[str, str]
) -> list[PlateEvidence]:
    """Return what the steps of a trial say of every plate; none where the feet have no markers or no step fell on a
    plate. ``mass`` kg as declared, NaN = not known; ``labels`` plate -> by what it is known again.
    """
    seen = recording(trial, mass=mass)
    if not seen.steps:
        return []
    names = (*_PLACE, _ONSET, *((_WEIGHT,) if np.isfinite(mass) else ()))
    found = observe(seen, names)
    out = []
    for plate in dict.fromkeys(step.plate for step in seen.steps):
        own = tuple(one for one in found if one.plate == plate)
        for quantity, value, sd in (
            *_place(seen, plate, tuple(one for one in own if one.witness in _PLACE)),
            *_mean("delay", [one for one in own if one.witness == _ONSET], relative=False),
            *_mean("gain", [one for one in own if one.witness == _WEIGHT], relative=True),
        ):
            out.append(PlateEvidence(quantity, {labels[plate]: 1.0}, value, sd, visit, trial.name, kind, "steps"))
    return out


def _mean(quantity: str, own: Sequence[Observation], *, relative: bool) -> list[tuple[str, float, float]]:
    """Return the weighted mean of what steps say beyond what is expected, as a share of it where ``relative``."""
    if not own:
        return []
    scale = np.array([one.expected if relative else 1.0 for one in own])
    value = np.array([one.value - one.expected for one in own]) / scale
    weight = (scale / np.array([one.sd for one in own])) ** 2
    return [(quantity, float(weight @ value / weight.sum()), float(weight.sum() ** -0.5))]


def _place(seen: Recording, plate: str, own: tuple[Observation, ...]) -> list[tuple[str, float, float]]:
    """Return how far the plate lies from where the file says, along x and y of the laboratory, as far as steps know it."""
    if not own:
        return []
    causes = {one.target: one for one in possible_causes(seen) if one.effect == "plate_position"}
    columns = np.column_stack([traces(seen, own, causes[f"{plate}:{axis}"], _PLACE) for axis in "xy"])
    sd = np.array([one.sd for one in own])
    value = np.array([one.value - one.expected for one in own])
    place, error = _solved(columns / sd[:, None], value / sd)
    return [(f"place_{axis}", float(place[i]), float(error[i])) for i, axis in enumerate("xy") if error[i] < _BLIND]


def _solved(rows: Array, value: Array) -> tuple[Array, Array]:
    """Return the least squares of white ``rows`` (n, 2) and the standard errors; a direction that no row sees has a
    metre.
    """
    known = rows.T @ rows + np.eye(2)
    covariance = np.linalg.inv(known)
    return covariance @ rows.T @ value, np.sqrt(np.diag(covariance))

"""What ordinary steps say of the plates they fall on: their place, the delay of the force, what they weigh.

Observations (`biodance.observations`) tell how far the pressure lies from where it is in a foot; which way a plate
would have to be moved for it, their sensitivities say. Where a person's own foot has the pressure is unknown and the
same in all steps of that foot: all steps of a visit, on all plates, are solved together, so that left
and right, there and back tell the foot from the plate.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from biodance.diagnosis.archive.quantities import PlateEvidence, PlateVisit
from biodance.effects.plate_position import PlatePosition
from biodance.observations import Observation, SeenTrial, observe, sensitivities
from biodance.records import Array

_PLACE, _ONSET, _WEIGHT = ("foot_across", "foot_along"), "force_onset", "stride_force"
_BLIND = 0.03
"""m: a direction in which steps know a plate's place no better is not told."""
_UNKNOWN = 0.3
"""m: what is known of a plate's place before any step."""
_TAIL, _ROUNDS = 4.0, 15
"""Degrees of freedom of a step's own error, as in `inference.scales`: one step in twenty is odd."""


@dataclass(frozen=True, eq=False)
class StepRow:
    """What one step says of its ``plate``: ``value`` m beyond what is expected, with ``sd`` m of its own; it would be
    ``direction`` @ shift if the plate lay (x, y) m elsewhere; ``parts`` m sd of what it shares with other steps of the
    visit, by name.
    """

    plate: str
    direction: Array
    value: float
    sd: float
    parts: Mapping[str, float]


def step_rows(seen: SeenTrial, labels: Mapping[str, str]) -> list[StepRow]:
    """Return what the steps of a trial say of the places of its plates; ``labels`` plate -> by what it is known
    again.
    """
    out = []
    found = observe(seen, _PLACE)
    for plate in dict.fromkeys(step.plate for step in seen.steps):
        own = tuple(one for one in found if one.plate == plate)
        if own:
            shifts = [sensitivities(seen, own, PlatePosition.name, f"{plate}:{axis}", "shift") for axis in "xy"]
            out += [
                StepRow(
                    labels[plate],
                    column,
                    one.value - one.expected,
                    one.sd,
                    {name: size for name, size in one.norms.items() if name.startswith("person ")},
                )
                for one, column in zip(own, np.column_stack(shifts), strict=True)
            ]
    return out


def plate_places(rows: Sequence[StepRow]) -> dict[str, tuple[Array, Array]]:
    """Return place (2,) m along x and y of the laboratory beside where the file says, and its standard deviation, of
    every plate that the steps of one visit fell on.

    The most probable places beside what a person's feet do (normal, of the size of each part) under errors of steps
    with heavy tails: an odd step loses its weight (Lange, Little and Taylor 1989, doi:10.1080/01621459.1989.10478852).
    """
    plates, parts = sorted({row.plate for row in rows}), sorted({name for row in rows for name in row.parts})
    sd, value = np.array([row.sd for row in rows]), np.array([row.value for row in rows])
    columns = np.zeros((len(rows), 2 * len(plates) + len(parts)))
    for i, row in enumerate(rows):
        at = 2 * plates.index(row.plate)
        columns[i, at : at + 2] = row.direction
        for name, size in row.parts.items():
            columns[i, 2 * len(plates) + parts.index(name)] = size
    prior = np.diag([_UNKNOWN**-2.0] * (2 * len(plates)) + [1.0] * len(parts))
    weight = sd**-2
    for _ in range(_ROUNDS):
        # Normal equations with the prior's precision: places nearly free, parts of unit size.
        covariance = np.linalg.inv(columns.T @ (weight[:, None] * columns) + prior)
        found = covariance @ columns.T @ (weight * value)
        # Student's weights.
        weight = sd**-2 * (_TAIL + 1) / (_TAIL + ((value - columns @ found) / sd) ** 2)
    error = np.sqrt(np.diag(covariance))
    return {plate: (found[2 * i : 2 * i + 2], error[2 * i : 2 * i + 2]) for i, plate in enumerate(plates)}


def placed(rows: Sequence[StepRow], visit: PlateVisit, trial: str) -> list[PlateEvidence]:
    """Return the places that the steps of a visit know as evidence, named after ``trial``."""
    return [
        PlateEvidence(f"place_{axis}", {plate: 1.0}, float(place[i]), float(error[i]), visit, trial)
        for plate, (place, error) in (plate_places(rows) if rows else {}).items()
        for i, axis in enumerate("xy")
        if error[i] < _BLIND
    ]


def of_steps(
    seen: SeenTrial, visit: PlateVisit, kind: Mapping[str, str], labels: Mapping[str, str]
) -> list[PlateEvidence]:
    """Return delay and weight that the steps of a trial say of every plate; none where the feet have no markers or no
    step fell on a plate.
    """
    found = observe(seen, (_ONSET, *((_WEIGHT,) if np.isfinite(seen.mass) else ())))
    out = []
    for plate in dict.fromkeys(step.plate for step in seen.steps):
        own = [one for one in found if one.plate == plate]
        for quantity, value, sd in (
            *_mean("delay", [one for one in own if one.observer == _ONSET], relative=False),
            *_mean("gain", [one for one in own if one.observer == _WEIGHT], relative=True),
        ):
            name = seen.trial.name
            out.append(PlateEvidence(quantity, {labels[plate]: 1.0}, value, sd, visit, name, kind))
    return out


def _mean(quantity: str, own: Sequence[Observation], *, relative: bool) -> list[tuple[str, float, float]]:
    """Return the weighted mean of what steps say beyond what is expected, as a share of it where ``relative``."""
    if not own:
        return []
    scale = np.array([one.expected if relative else 1.0 for one in own])
    value = np.array([one.value - one.expected for one in own]) / scale
    # Precision of the relative value: (scale / sd)².
    weight = (scale / np.array([one.sd for one in own])) ** 2
    return [(quantity, float(weight @ value / weight.sum()), float(weight.sum() ** -0.5))]

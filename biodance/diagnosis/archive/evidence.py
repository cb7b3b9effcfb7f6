"""What the recordings of one visit say of its plates without any model of a body: the empty plate, quiet standing,
the declared mass, and ordinary steps.

The empty plate is what a plate reads at its unloaded end, before the reader takes it off. A person who stands still is
not accelerated: the mean horizontal force is the plates' own. What the plates weigh less what was declared is their
gain where the empty plate was seen, else a vertical offset, for then nobody can tell the two apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from biodance.diagnosis.archive.quantities import PlateEvidence, PlateVisit
from biodance.diagnosis.archive.walking import StepRow, of_steps, placed, step_rows
from biodance.lab.markers.upright import is_still, standing_mass
from biodance.lab.plates.decode import block_means, find_baseline
from biodance.observations import recording
from biodance.records import Array, Plate, Trial

_LOADED = 20.0
"""N: mean vertical force from which on somebody stands on a plate."""
_WEIGHS = 0.3
"""N: what the reading of an empty plate, or of a person who stands still, may differ by from trial to trial."""
_SWAY_SPEED = 0.02
"""m/s by which the centre of mass may be faster at the end of quiet standing than at its beginning."""
_LONGEST = 60.0
"""s of standing beyond which the mean force gets no better."""
_AGAIN = 0.001
"""What two weighings of one person differ by."""
_SHORTEST = 1.5
"""s of quiet standing from which on its mean horizontal force is used."""
AXES = "xyz"
_ROUND = 0.02
"""m to which the sides of a plate are rounded, to know it again."""


def plate_evidence(
    trials: Sequence[Trial],
    visit: PlateVisit,
    *,
    mass: float = float("nan"),
    conditions: Mapping[str, Mapping[str, str]] | None = None,
) -> tuple[PlateEvidence, ...]:
    """Return what the trials of a visit say of their plates; nothing of the place of one that no file places.

    Parameters
    ----------
    trials : sequence of Trial
        As read.
    visit : PlateVisit
        Whose they are.
    mass : float
        Declared, kg; NaN where nobody declared it.
    conditions : mapping
        Trial -> what it was, where trials of the visit differ in it.
    """
    found: list[PlateEvidence] = []
    rows: list[StepRow] = []
    empty = _of_visit(trials)
    for trial in trials:
        kind = (conditions or {}).get(trial.name, {})
        for plate in trial.plates:
            found += _of_empty(plate, trial, visit, kind)
        if trial.plates and (trial.markers is None or is_still(trial)):
            found += _of_standing(trial, visit, kind, mass, empty)
        elif trial.plates:
            labels = {plate.name: plate_label(plate) for plate in trial.plates}
            seen = recording(trial, mass=mass)
            found += of_steps(seen, visit, kind, labels)
            unknown = {labels[plate.name] for plate in trial.plates if not plate.placed}
            rows += [row for row in step_rows(seen, labels) if row.plate not in unknown]
    return (*found, *placed(rows, visit, "all steps"))


def plate_label(plate: Plate) -> str:
    """Return by what a plate is known again in other visits: its name and its sides, ``plate1 (460 x 500 mm)``; in a
    table that does not place it, its columns: what encloses the pressure of a trial is another rectangle in the next.
    """
    if plate.columns:
        return f"{plate.columns} (place unknown)"
    if not np.isfinite(plate.corners).all():
        return f"{plate.name} (of unknown size)"
    sides = sorted(np.linalg.norm(plate.corners[[1, 2]] - plate.corners[:2], axis=1).tolist())
    first, second = (1000 * _ROUND * round(side / _ROUND) for side in sides)
    return f"{plate.name} ({first:.0f} x {second:.0f} mm)"


def plainly_named(observations: Sequence[PlateEvidence]) -> tuple[PlateEvidence, ...]:
    """Return the observations with plates by their names alone where an archive has one plate of that name."""
    labels = {label for one in observations for label in one.plates}
    names = [label.partition(" (")[0] for label in labels]
    short = {
        label: name if names.count(name) == 1 else label for label in labels for name in [label.partition(" (")[0]]
    }
    return tuple(
        replace(one, plates={short[label]: part for label, part in one.plates.items()}) for one in observations
    )


def _of_visit(trials: Sequence[Trial]) -> dict[str, float]:
    """Return what each plate that was seen empty in a visit then reads vertically, N: the middle of its trials."""
    seen: dict[str, list[float]] = {}
    for trial in trials:
        for plate in trial.plates:
            if (reads := _empty(plate)) is not None:
                seen.setdefault(plate_label(plate), []).append(float(reads[2]))
    return {name: float(np.median(values)) for name, values in seen.items()}


def _empty(plate: Plate) -> Array | None:
    """Return (3,) N what a plate reads where it is unloaded, with what the reader took off; None where it never is."""
    force = plate.wrench.force
    rate = plate.wrench.rate
    if len(force) < 2 or not np.isfinite(rate) or not np.isfinite(force).all():
        return None
    found = find_baseline(force[:, 2], zero=None, rate=rate)
    if found.stop <= found.start:
        means, _ = block_means(force[:, 2], rate)
        return plate.zero if np.abs(means).max() < _LOADED and plate.tared else None
    return np.asarray(plate.zero + force[found.start : found.stop].mean(axis=0))


def _of_empty(plate: Plate, trial: Trial, visit: PlateVisit, kind: Mapping[str, str]) -> list[PlateEvidence]:
    reads = _empty(plate)
    if reads is None:
        return []
    taken, share = plate.tared or float(np.abs(reads).max()) < _WEIGHS, {plate_label(plate): 1.0}
    return [
        PlateEvidence(f"offset_{axis}", share, float(value), _WEIGHS, visit, trial.name, kind, taken)
        for axis, value in zip(AXES, reads, strict=True)
    ]


def _of_standing(
    trial: Trial, visit: PlateVisit, kind: Mapping[str, str], mass: float, empty: Mapping[str, float]
) -> list[PlateEvidence]:
    """Return what quiet standing says: horizontal offsets of plates that were never seen empty, and the weight."""
    on = [plate for plate in trial.plates if plate.wrench.force[:, 2].mean() > _LOADED]
    weighed = standing_mass(trial)
    if weighed is None or not on:
        return []
    found = []
    unknown = [name for plate in on if (name := plate_label(plate)) not in empty]
    seconds = float(trial.plates[0].wrench.time[-1] - trial.plates[0].wrench.time[0])
    if unknown and seconds >= _SHORTEST:
        mean = np.sum([plate.wrench.force.mean(axis=0) for plate in on], axis=0)
        # Mean force = m (v1 - v0) / T: two independent speeds, hence sqrt(2).
        sd = float(np.hypot(_WEIGHS, np.sqrt(2) * weighed * _SWAY_SPEED / min(seconds, _LONGEST)))
        share = dict.fromkeys(unknown, 1.0)
        found += [
            PlateEvidence(f"offset_{axis}", share, float(value), sd, visit, trial.name, kind)
            for axis, value in zip(AXES[:2], mean[:2], strict=True)
        ]
    if np.isfinite(mass):
        kept = sum(empty.get(plate_label(plate), 0.0) - plate.zero[2] for plate in on)  # still in what it weighs
        net = weighed - kept / trial.settings.gravity if not unknown else weighed
        found.append(_weighed(trial, visit, kind, mass, net, on, unknown))
    return found


def _weighed(
    trial: Trial,
    visit: PlateVisit,
    kind: Mapping[str, str],
    mass: float,
    weighed: float,
    on: list[Plate],
    unknown: list[str],
) -> PlateEvidence:
    """Return what the plates weigh against what was declared."""
    if unknown:
        value, share = (weighed - mass) * trial.settings.gravity, dict.fromkeys(unknown, 1.0)
        return PlateEvidence("offset_z", share, value, _WEIGHS, visit, trial.name, kind)
    vertical = np.array([plate.wrench.force[:, 2].mean() for plate in on])
    share = {plate_label(plate): float(part) for plate, part in zip(on, vertical / vertical.sum(), strict=True)}
    return PlateEvidence("gain", share, weighed / mass - 1, _AGAIN, visit, trial.name, kind)

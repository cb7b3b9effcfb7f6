"""Faults that begin in the middle of a recording, for the stream that must name them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from biodance.records import Array, Markers, Trial, Wrench


def _of_plate(trial: Trial, at: float, change: Callable[[Array, int], None]) -> tuple[Trial, str]:
    """Return the trial with one plate changed from ``at`` s on: that which bears most in the second after it."""
    load = [p.wrench.value[(p.wrench.time >= at) & (p.wrench.time < at + 1), 2].sum() for p in trial.plates]
    plate = trial.plates[int(np.argmax(load))]
    value = np.array(plate.wrench.value)
    change(value, int(np.searchsorted(plate.wrench.time, at)))
    changed = replace(plate, wrench=Wrench(plate.wrench.time, value))
    return replace(trial, plates=tuple(changed if p is plate else p for p in trial.plates)), plate.name


def offset(trial: Trial, at: float) -> tuple[Trial, str, str]:
    """Return the trial whose plate reads 30 N too much from ``at`` s on, with target and effect that name it."""

    def push(value: Array, row: int) -> None:
        value[row:, 2] += 30.0

    return *_of_plate(trial, at, push), "plate_offset"


def silent(trial: Trial, at: float) -> tuple[Trial, str, str]:
    """Return the trial whose plate says the same from ``at`` s on, with target and effect that name it."""

    def silence(value: Array, row: int) -> None:
        value[row:] = value[row - 1]

    return *_of_plate(trial, at, silence), "plate_gone"


def _with_markers(trial: Trial, xyz: Array) -> Trial:
    assert trial.markers is not None
    return replace(trial, markers=Markers(trial.markers.names, trial.markers.time, xyz))


def exchanged(trial: Trial, at: float) -> tuple[Trial, str, str]:
    """Return the trial whose pelvis labels are exchanged from ``at`` s on, with target and effect that name it."""
    assert trial.markers is not None
    xyz, rows = np.array(trial.markers.xyz), trial.markers.time >= at
    left, right = (trial.markers.names.index(name) for name in ("LASI", "RASI"))
    xyz[rows, left], xyz[rows, right] = trial.markers.xyz[rows, right], trial.markers.xyz[rows, left]
    return _with_markers(trial, xyz), "LASI/RASI", "labels_swapped"


def moved(trial: Trial, at: float) -> tuple[Trial, str, str]:
    """Return the trial whose knee marker sits 0.12 m lower from ``at`` s on, with target and effect that name it."""
    assert trial.markers is not None
    xyz, rows = np.array(trial.markers.xyz), trial.markers.time >= at
    xyz[rows, trial.markers.names.index("LKNE"), 2] -= 0.12
    return _with_markers(trial, xyz), "LKNE", "marker_misplaced"


FAULTS = (offset, silent, exchanged, moved)

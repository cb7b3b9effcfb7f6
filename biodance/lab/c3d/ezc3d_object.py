"""Trials to and from the objects of ezc3d, for those who work with that library.

Both ways lead through a C3D file in a temporary folder: the object that comes out is what ezc3d reads of a file that
biodance wrote, the trial that comes out passed the same door, with the same decisions and refusals, as any recording.
"""

import tempfile
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.c3d.read import read_c3d
from biodance.lab.c3d.subject import as_written
from biodance.lab.c3d.write import PlateRecording, write_c3d
from biodance.lab.plates.corners import plate_axes
from biodance.records import Plate, Role, Trial
from biodance.spatial import wrench_about_point

if TYPE_CHECKING:
    import ezc3d


def to_ezc3d(trial: Trial) -> "ezc3d.c3d":
    """Return a trial as an ``ezc3d.c3d`` object: mm, N, N·mm, float32; z up; force plates as TYPE 2 about their surface
    centres.

    The force in a plate's axes is the ground's action on the subject, so that ezc3d's ``extract_forceplat_data`` gives
    the reaction.

    Raises
    ------
    BiodanceError
        Markers and plates have rates that do not fit, or a wrench is not finite; there is nothing to write.
    """
    import ezc3d

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trial.c3d"
        write_trial(trial, path)
        return ezc3d.c3d(str(path))


def write_trial(trial: Trial, path: Path) -> None:
    """Write a trial as a C3D file: as `to_ezc3d` says; what it does not hold (other analog channels, events) is left
    out.

    Raises
    ------
    BiodanceError
        Markers and plates have rates that do not fit, a wrench is not finite, or the file exists.
    """
    plates = [plate_recording(plate) for plate in trial.plates]
    rate = trial.plates[0].wrench.rate if trial.plates else 0.0
    said = {"PROCESSING": as_written(trial.measurements)} if trial.measurements else None
    first = trial.source.first_frame
    write_c3d(path, markers=trial.markers, plates=plates, analog_rate=rate, first_frame=first, parameters=said)


def from_ezc3d(file: "ezc3d.c3d", *, name: str = "trial", role: Role = "fit", subject: str | None = None) -> Trial:
    """Return the trial in an ``ezc3d.c3d`` object, read as a file that holds the same; the object stays as it is.

    ``subject`` chooses the person where the labels' prefixes name several.

    Raises
    ------
    FileRefused
        ezc3d cannot write the object, or what it writes cannot be trusted (`read_c3d` says why).
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.c3d"
        try:
            deepcopy(file).write(str(path))  # writing changes the lists of labels
        except (ArithmeticError, LookupError, TypeError, ValueError, RuntimeError, OSError) as error:
            raise FileRefused(
                f"{name}: ezc3d cannot write this object ({error}). Give an object that it could save as a file."
            ) from error
        trial = read_c3d(path, role=role, subject=subject)
    return replace(trial, source=replace(trial.source, path=Path(f"{name}.c3d"), format="ezc3d object"))


def plate_recording(plate: Plate) -> PlateRecording:
    """Return what a plate of TYPE 2 records: the wrench in its own axes, about the centre of its surface."""
    axes, wrench = plate_axes(plate.corners), wrench_about_point(plate.wrench.value, plate.centre)
    return PlateRecording(2, plate.corners, np.zeros(3), np.hstack([wrench[:, :3] @ axes, wrench[:, 3:] @ axes]))

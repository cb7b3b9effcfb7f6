"""Markers and registered plates written as an ordinary session: one C3D file with both, the static trial and
session.toml beside it.
"""

import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from biodance.errors import SessionRefused
from biodance.lab.c3d.write import PlateRecording, write_c3d
from biodance.lab.session.file import FILES
from biodance.lab.session.results_folder import made_folder
from biodance.records import Array, Markers, Plate, Session, Trial
from biodance.spatial import wrench_about_point

MARK = "registration.json"
"""Name of the file that says that a folder was written by `biodance register`."""
_BESIDE = (".mp", ".vsk", ".enf", ".toml")
"""What belongs to a session beside its recordings."""


def registered_folder(folder: Path, *, force: bool) -> Path:
    """Return the folder for a registered session, which is missing, empty, or with ``force`` an earlier one; nothing is
    made or removed yet.

    Raises
    ------
    SessionRefused
        It is a file, or holds files: others' always, those of an earlier registration without ``force``.
    """
    if folder.exists() and not folder.is_dir():
        raise SessionRefused(f"{folder}: is a file; a session needs a folder. Choose another name.")
    files = sorted(folder.iterdir()) if folder.is_dir() else []
    if files and not (folder / MARK).is_file():
        raise SessionRefused(
            f"{folder}: holds files that biodance did not write ({files[0].name}). Choose another name."
        )
    if files and not force:
        raise SessionRefused(f"{folder}: holds an earlier registration. Choose another name, or --force.")
    return folder


def write_registered(
    folder: Path, session: Session, trial: Trial, plates: Sequence[Plate], *, said: Mapping[str, Any]
) -> Path:
    """Write ``trial`` (as read, any format) with ``plates`` in the room and on the markers' clock into ``folder``, the
    static trials and the subject's files of its ``session`` beside it, and what was ``said`` of the plates as
    `registration.json`; return the C3D file. An earlier registration in the folder is replaced.

    Frames of markers that the plates do not cover are left out, as C3D holds no unknown force.

    Raises
    ------
    SessionRefused
        The two share no time.
    """
    assert trial.markers is not None
    markers, recordings, rate = _common(trial.markers, plates)
    _emptied(made_folder(folder))
    path = folder / f"{trial.source.path.stem}.c3d"
    first = trial.source.first_frame + int(np.searchsorted(trial.markers.time, markers.time[0]))
    measures = {name: value if "mass" in name.lower() else 1000.0 * value for name, value in trial.measurements.items()}
    write_c3d(
        path,
        markers=markers,
        plates=recordings,
        analog_rate=rate,
        parameters={"PROCESSING": dict(measures)} if measures else None,
        first_frame=first,
    )
    own = trial.source.path.parent
    for static in session.of_role("static"):
        if static.source.path != trial.source.path:
            shutil.copyfile(static.source.path, folder / static.source.path.name)
    for file in sorted(own.iterdir()):
        if file.is_file() and file.suffix.lower() in _BESIDE:
            shutil.copyfile(file, folder / file.name)
    for name in FILES:
        if (own.resolve().parent / name).is_file() and not (folder / name).exists():
            shutil.copyfile(own.resolve().parent / name, folder / name)
    (folder / MARK).write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")
    return path


def _emptied(folder: Path) -> None:
    """Remove what an earlier registration wrote."""
    if (folder / MARK).is_file():
        for file in folder.iterdir():
            if file.is_file() and (file.suffix == ".c3d" or file.name in FILES or file.name == MARK):
                file.unlink()


def _common(markers: Markers, plates: Sequence[Plate]) -> tuple[Markers, list[PlateRecording], float]:
    """Return the markers within the plates' time and what the plates record at a whole multiple of their rate."""
    from scipy.interpolate import make_interp_spline

    time = plates[0].wrench.time
    many = max(1, round(plates[0].wrench.rate / markers.rate))
    step = 1.0 / markers.rate
    kept = np.flatnonzero((markers.time >= time[0]) & (markers.time + (many - 1) / many * step <= time[-1]))
    if kept.size < 2:
        raise SessionRefused("Markers and plates share no time, so there is nothing to write.")
    seen = Markers(markers.names, markers.time[kept], markers.xyz[kept])
    fine = (seen.time[:, None] + step / many * np.arange(many)).ravel()
    recordings = []
    for plate in plates:
        value = make_interp_spline(time, plate.wrench.value, k=3)(fine)
        recordings.append(_recording(plate.corners, np.asarray(value)))
    return seen, recordings, many * markers.rate


def _recording(corners: Array, value: Array) -> PlateRecording:
    """Return a plate of TYPE 2, z down, from the wrench (S, 6) about the room's origin."""
    right, up = corners[[0, 3]].mean(axis=0) - corners[[1, 2]].mean(axis=0), corners[[0, 1]].mean(axis=0)
    y = up - corners[[2, 3]].mean(axis=0)
    if np.cross(right, y)[2] > 0:
        corners = corners[[1, 0, 3, 2]]
        right = -right
    x = right / np.linalg.norm(right)
    z = np.cross(x, y)
    z = z / np.linalg.norm(z)
    turn = np.stack([x, np.cross(z, x), z], axis=1)
    local = wrench_about_point(value, corners.mean(axis=0))
    channels = np.concatenate([local[:, :3] @ turn, local[:, 3:] @ turn], axis=1)
    return PlateRecording(2, corners, np.zeros(3), channels)

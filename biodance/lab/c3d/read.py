"""Read a C3D file into a Trial: metres, z up, markers of one subject, plates as wrenches, every decision said."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.c3d.raw import RawC3d, metres_per_unit, read_raw
from biodance.lab.c3d.subject import MarkerLabels, marker_labels, measurements_of, poses_only
from biodance.lab.c3d.vertical import turn_to_z_up
from biodance.lab.markers.sets import recognise
from biodance.records import Array, Markers, Plate, Role, Source, Trial


def read_c3d(path: str | Path, *, role: Role = "fit", subject: str | None = None) -> Trial:
    """Read one C3D file: markers in m with z up (time starts at 0), force plates as ground-on-subject wrenches about
    the lab origin.

    Parameters
    ----------
    path : str or pathlib.Path
        The file.
    role : {"fit", "static", "validate", "check", "skip"}
        What it is for.
    subject : str, optional
        Chooses the person by the prefix of the labels, needed only where a file holds several.

    Returns
    -------
    Trial
        ``history`` and ``warnings`` say what was decided: reader, units, axes, labels, gaps, plates.

    Raises
    ------
    FileRefused
        The file is missing, damaged or contradicts itself; holds several subjects and none was chosen; its unit of
        length or its rate is not known; holds segment poses and neither points nor channels.

    References
    ----------
    The C3D file format user guide, c3d.org.

    Examples
    --------
    >>> biodance.read_c3d("visit/static.c3d", role="static").markers
    Markers(39 markers, 301 frames at 100 Hz, 3.00 s)
    """
    raw = read_raw(path)
    poses = poses_only(raw)
    if poses and not raw.analog.size:
        raise FileRefused(poses)
    labels = marker_labels(raw, subject=subject)
    markers, metres, turn, axes_history, axes_warnings = _in_lab(raw, labels)
    measures, measure_history, measure_warnings = measurements_of(raw)
    plates, plate_warnings = _plates(raw, metres, turn, markers, measures.get("Bodymass"))
    marker_set = recognise(markers.names) if markers is not None else None
    warnings = (
        *raw.warnings,
        *([poses] if poses else []),
        *labels.warnings,
        *axes_warnings,
        *measure_warnings,
        *plate_warnings,
    )
    return Trial(
        name=raw.path.stem,
        role=role,
        markers=markers,
        plates=plates,
        source=Source(
            raw.path, raw.sha256, "C3D", raw.rate if markers is not None else math.nan, raw.analog_rate, raw.first_frame
        ),
        marker_set=marker_set.name if marker_set is not None else "",
        measurements=measures,
        history=(*_read(raw), *labels.history, *axes_history, *_gaps(markers), *measure_history),
        warnings=warnings,
    )


def file_frame(raw: RawC3d, *, subject: str | None = None) -> tuple[float, Array]:
    """Return the file's unit of length in m and lab_R_file (3, 3), as `read_c3d` takes them.

    Raises
    ------
    FileRefused
        As `read_c3d`.
    """
    return _in_lab(raw, marker_labels(raw, subject=subject))[1:3]


def _in_lab(raw: RawC3d, labels: MarkerLabels) -> tuple[Markers | None, float, Array, tuple[str, ...], tuple[str, ...]]:
    """Return the markers in m in the lab frame, the file's unit of length in m, lab_R_file (3, 3), what was decided
    and what is doubtful.
    """
    all_in_order = labels.columns == tuple(range(raw.points.shape[1]))
    points = raw.points if all_in_order else raw.points[:, list(labels.columns)]
    metres, units, doubts = metres_per_unit(raw.parameters, points, where=str(raw.path))
    own = _markers(raw, labels, points)
    turn, axes, doubtful = turn_to_z_up(raw, own)
    markers = None if own is None else replace(own, xyz=_turned(own.xyz, metres * turn))
    return markers, metres, turn, (*units, *axes), (*doubts, *doubtful)


def _turned(points: Array, axes: Array) -> Array:
    """Return ``points @ axes.T``, read-only, for axes (3, 3) of which each has one component that is not zero."""
    turned = np.empty_like(points)
    for row, axis in enumerate(axes):
        (only,) = np.flatnonzero(axis)
        np.multiply(points[..., only], axis[only], out=turned[..., row])
    turned.setflags(write=False)
    return turned


def _read(raw: RawC3d) -> tuple[str, ...]:
    rate = f" at {raw.rate:g} Hz" if math.isfinite(raw.rate) else ""
    analog = (
        f", {raw.analog.shape[1]} analog channels at {raw.analog_rate:g} Hz"
        if raw.analog.size
        else ", no analog channels"
    )
    frames = f"{len(raw.points)} frames{rate} from frame {raw.first_frame} on"
    return (f"Read {frames}, {raw.points.shape[1]} points{analog}.",)


def _markers(raw: RawC3d, labels: MarkerLabels, points: Array) -> Markers | None:
    """Return the markers in file units and axes; None if the file has none that was ever seen."""
    if not labels.columns or not np.isfinite(points).any():
        return None
    if not math.isfinite(raw.rate) and len(points) > 1:
        raise FileRefused(
            f"{raw.path}: the frame rate is 0, so its {len(points)} frames have no time. Write POINT:RATE and read it "
            f"again."
        )
    return Markers(labels.names, np.arange(len(points)) / (raw.rate if math.isfinite(raw.rate) else 1.0), points)


def _plates(
    raw: RawC3d, metres: float, turn: Array, markers: Markers | None, body_mass: float | None
) -> tuple[tuple[Plate, ...], tuple[str, ...]]:
    from biodance.lab.plates.read import read_plates

    return read_plates(raw, metres=metres, turn=turn, markers=markers, body_mass=body_mass)


def _gaps(markers: Markers | None) -> tuple[str, ...]:
    """Say how much of the markers was not seen, and which never were."""
    if markers is None:
        return ("No markers.",)
    share = 1.0 - markers.seen.mean()
    never = [name for name, seen in zip(markers.names, np.any(markers.seen, axis=0), strict=True) if not seen]
    missing = f"; never seen: {', '.join(never)}" if never else ""
    return (f"{len(markers.names)} markers, {100 * share:.2g} % of their samples not seen{missing}.",)

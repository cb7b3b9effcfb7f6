"""C3D: markers, analog channels and force plates in one binary file."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.c3d.layout import parameter_numbers, texts
from biodance.lab.c3d.raw import RawC3d, metres_per_unit, read_raw
from biodance.lab.c3d.subject import MarkerLabels, marker_labels, measurements_of, poses_only
from biodance.lab.markers.sets import MarkerSet, recognise
from biodance.lab.markers.upright import axis_to_head, clear_axis, extents, turn_to
from biodance.lab.plates import Told
from biodance.lab.plates.decode import is_rectangle
from biodance.lab.plates.read import read_plates
from biodance.records import Array, Markers, Role, Source, Trial, spread_frames

NAME = "C3D"
EXTENSIONS = (".c3d",)
PREFERENCE = 0
FOLLOWS_TOLD = True


def sniff(head: bytes) -> bool:
    """Return whether the head names a parameter block (2..127) and has the key of C3D files."""
    # Second byte of every C3D file
    return len(head) >= 2 and head[1] == 0x50 and 2 <= head[0] <= 127 and b"\x00" in head


_CLOUD = 6  # Markers that show how a body lies
_AXES = "XYZ"


def read_c3d(path: str | Path, *, role: Role = "fit", subject: str | None = None, told: Told | None = None) -> Trial:
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
    told : Told, optional
        What the analyst says of the plates and of the body mass; it comes before what the file says.

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
    known = recognise(labels.names)
    markers, metres, turn, axes_history, axes_warnings = _in_lab(raw, labels, known)
    measures, measure_history, measure_warnings = measurements_of(raw)
    told = told or Told()
    mass = measures.get("Bodymass") if told.mass is None else told.mass
    read = read_plates(raw, metres=metres, turn=turn, markers=markers, body_mass=mass, told=told.plates)
    rate = raw.rate if markers is not None else math.nan
    worn = known.name if known is not None and markers is not None else ""
    source = Source(raw.path, raw.sha256, "C3D", rate, raw.analog_rate, raw.first_frame)
    timed = f" at {raw.rate:g} Hz" if math.isfinite(raw.rate) else ""
    channels = f"{raw.analog.shape[1]} analog channels at {raw.analog_rate:g} Hz"
    frames = f"{len(raw.points)} frames{timed} from frame {raw.first_frame} on"
    held = f"Read {frames}, {raw.points.shape[1]} points, {channels if raw.analog.size else 'no analog channels'}."
    history = (held, *raw.history, *labels.history, *axes_history, _seen(markers), *measure_history)
    odd = (*raw.warnings, *([poses] if poses else []), *labels.warnings, *axes_warnings)
    warnings = (*odd, *measure_warnings, *read.warnings)
    seen = (raw.path.stem, role, markers, read.plates, source, worn, measures)
    return Trial(*seen, (*history, *read.history), warnings, defects=read.defects)


read = read_c3d


def file_frame(raw: RawC3d, *, subject: str | None = None) -> tuple[float, Array]:
    """Return the file's unit of length in m and lab_R_file (3, 3), as `read_c3d` takes them.

    Raises
    ------
    FileRefused
        As `read_c3d`.
    """
    labels = marker_labels(raw, subject=subject)
    return _in_lab(raw, labels, recognise(labels.names))[1:3]


def _in_lab(
    raw: RawC3d, labels: MarkerLabels, known: MarkerSet | None
) -> tuple[Markers | None, float, Array, tuple[str, ...], tuple[str, ...]]:
    """Return the markers in m in the lab, metres per unit, lab_R_file (3, 3), what was decided, and doubts."""
    all_in_order = labels.columns == tuple(range(raw.points.shape[1]))
    points = raw.points if all_in_order else raw.points[:, list(labels.columns)]
    metres, units, doubts = metres_per_unit(raw.parameters, points, where=str(raw.path))
    own = _markers(raw, labels, points)
    turn, axes, doubtful = _turn_to_z_up(raw, own, known)
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


def _seen(markers: Markers | None) -> str:
    """Say how much of the markers was not seen, and which never were."""
    if markers is None:
        return "No markers."
    share = 1.0 - markers.seen.mean()
    never = [name for name, seen in zip(markers.names, np.any(markers.seen, axis=0), strict=True) if not seen]
    missing = f"; never seen: {', '.join(never)}" if never else ""
    return f"{len(markers.names)} markers, {100 * share:.2g} % of their samples not seen{missing}."


def _turn_to_z_up(
    raw: RawC3d, markers: Markers | None, known: MarkerSet | None
) -> tuple[Array, tuple[str, ...], tuple[str, ...]]:
    """Return the rotation lab_R_file (3, 3) that makes z point up, history and warnings."""
    floor, declared = _floor(raw, markers), _declared(raw, markers)
    body = axis_to_head(markers, known) if markers else None
    witnesses = {"the plates": floor, "the markers from feet to head": body, "POINT:Y_SCREEN": declared}
    if floor is None and declared is not None and declared[2] == 1:
        witnesses = {name: witnesses[name] for name in ("POINT:Y_SCREEN", "the markers from feet to head")}
    by, chosen = next(((name, axis) for name, axis in witnesses.items() if axis is not None), ("", np.eye(3)[2]))
    if not by:
        _refuse_lying(markers, raw)
        history, warnings = ["Nothing says which way is up; z assumed."], ["Nothing says which way is up; z assumed."]
    else:
        says = "says" if by == "POINT:Y_SCREEN" else "say"
        history, warnings = [f"Up is {_name(chosen)} in the file, as {by} {says}."], []
    for who, direction in witnesses.items():
        if direction is not None and not np.array_equal(direction, chosen):
            line = (
                f"Up is {_name(chosen)} by {by}, but {_name(direction)} by {who}; the former was taken. Look at "
                f"the person in the report."
            )
            (history if who == "POINT:Y_SCREEN" else warnings).append(line)
    turn = turn_to(chosen)
    if not np.array_equal(turn, np.eye(3)):
        history.append(f"Everything was turned so that z points up: {_name(chosen)} of the file became +Z.")
    return turn, tuple(history), tuple(warnings)


def _refuse_lying(markers: Markers | None, raw: RawC3d) -> None:
    """Refuse a file in which nothing says which way is up and the markers are far longer along x or y than along z."""
    if markers is None or len(markers.names) < _CLOUD:
        return
    sides = extents(markers.xyz, _CLOUD)
    if not len(sides):
        return
    extent = np.median(sides, axis=0)
    longest = int(np.argmax(extent))
    if longest != 2 and extent[longest] > 1.5 * extent[2]:
        raise FileRefused(
            f"{raw.path}: nothing says which way is up (no plates, no POINT:Y_SCREEN, no labels of head and feet), and "
            f"along {_AXES[longest]} the markers are {extent[longest] / extent[2]:.1f} times as long as along Z. Write "
            f"the upward axis into POINT:Y_SCREEN (for example +{_AXES[longest]}), or name the markers' set with "
            f"--markers FILE."
        )


def _name(axis: Array) -> str:
    i = int(np.argmax(np.abs(axis)))
    return ("+" if axis[i] > 0 else "-") + _AXES[i]


def _declared(raw: RawC3d, markers: Markers | None) -> Array | None:
    """Return the axis that POINT:Y_SCREEN, the upward direction of the recording's screen, names."""
    text = next(iter(texts(raw.parameters, "POINT", "Y_SCREEN")), "").upper().replace(" ", "")
    if not re.fullmatch(r"[+-]?[XYZ]", text):
        return None
    i = _AXES.index(text[-1])
    below = markers is not None and bool(markers.seen.any()) and _middle(markers, i) < 0
    return np.eye(3)[i] * (-1.0 if below else 1.0)


def _floor(raw: RawC3d, markers: Markers | None) -> Array | None:
    """Return the normal of the plates on the side of the markers; None without plates in a coordinate plane."""
    corners = parameter_numbers(raw.parameters, "FORCE_PLATFORM", "CORNERS")
    plates = corners[: corners.size // 12 * 12].reshape(-1, 4, 3)
    plates = plates[[is_rectangle(one) for one in plates]]
    if not len(plates):
        return None
    normals = np.abs(np.cross(plates[:, 1] - plates[:, 0], plates[:, 3] - plates[:, 0])).sum(axis=0)
    axis = clear_axis(normals)
    if axis is None or markers is None or not markers.seen.any():
        return axis
    i = int(np.argmax(axis))
    above = _middle(markers, i) - float(plates[..., i].mean())
    return axis * (1.0 if above >= 0 else -1.0)


def _middle(markers: Markers, axis: int) -> float:
    """Return the median coordinate of the markers along an axis, by spread frames where these show any."""
    some = spread_frames(markers.xyz)[..., axis]
    return float(np.nanmedian(some if np.isfinite(some).any() else markers.xyz[..., axis]))

"""Which way is up in a C3D file? Plates, person and POINT:Y_SCREEN may say it."""

import re

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.c3d.layout import parameter_numbers, texts
from biodance.lab.c3d.raw import RawC3d
from biodance.lab.markers.upright import axis_to_head, clear_axis
from biodance.lab.plates.corners import is_rectangle
from biodance.records import Array, Markers, spread_frames

_CLOUD = 6
"""Markers that show how a body lies."""
_LONGER = 1.5
_AXES = "XYZ"


def turn_to_z_up(raw: RawC3d, markers: Markers | None) -> tuple[Array, tuple[str, ...], tuple[str, ...]]:
    """Return the rotation lab_R_file (3, 3) that makes z point up, history and warnings; the identity if it does
    already.

    ``markers`` are still in file axes. The floor of the plates decides the axis, the side on which the markers are its
    sign; without plates the upright person overrules Y_SCREEN, unless Y_SCREEN says +Z (the person may lie down). x
    stays where it is not the vertical itself.
    """
    declared = _declared(raw, markers)
    floor, body = _floor(raw, markers), (axis_to_head(markers) if markers else None)
    witnesses = {"the plates": floor, "the markers from feet to head": body, "POINT:Y_SCREEN": declared}
    if floor is not None:
        chosen, by = floor, "the plates"
    elif body is not None and (declared is None or declared[2] < 1):
        chosen, by = body, "the markers from feet to head"
    elif declared is not None:
        chosen, by = declared, "POINT:Y_SCREEN"
    else:
        chosen, by = np.array([0.0, 0.0, 1.0]), ""
    if not by:
        _refuse_lying(markers, raw)
    history = [
        f"Up is {_name(chosen)} in the file, as {by} {'say' if by != 'POINT:Y_SCREEN' else 'says'}."
        if by
        else "Nothing says which way is up; z assumed."
    ]
    warnings = [] if by else list(history)
    for who, direction in witnesses.items():
        if direction is not None and not np.array_equal(direction, chosen):
            line = (
                f"Up is {_name(chosen)} by {by}, but {_name(direction)} by {who}; the former was taken. Look at "
                f"the person in the report."
            )
            (history if who == "POINT:Y_SCREEN" else warnings).append(line)
    turn = _turn(chosen)
    if not np.array_equal(turn, np.eye(3)):
        history.append(f"Everything was turned so that z points up: {_name(chosen)} of the file became +Z.")
    return turn, tuple(history), tuple(warnings)


def _refuse_lying(markers: Markers | None, raw: RawC3d) -> None:
    """Refuse a file in which nothing says which way is up and the markers are far longer along x or y than along z."""
    if markers is None or len(markers.names) < _CLOUD:
        return
    frames = markers.xyz[markers.seen.sum(axis=1) >= _CLOUD]
    if not len(frames):
        return
    extent = np.median(np.nanmax(frames, axis=1) - np.nanmin(frames, axis=1), axis=0)
    longest = int(np.argmax(extent))
    if longest != 2 and extent[longest] > _LONGER * extent[2]:
        raise FileRefused(
            f"{raw.path}: nothing says which way is up (no plates, no POINT:Y_SCREEN, no labels of head and feet), and "
            f"along {_AXES[longest]} the markers are {extent[longest] / extent[2]:.1f} times as long as along Z. Write "
            f"the upward axis into POINT:Y_SCREEN (for example +{_AXES[longest]}), or name the markers' set with "
            f"--markers FILE."
        )


def _name(axis: Array) -> str:
    i = int(np.argmax(np.abs(axis)))
    return ("+" if axis[i] > 0 else "-") + _AXES[i]


def _turn(up: Array) -> Array:
    """Return the rotation whose third row is ``up``; its first row is x where possible."""
    first = np.array([1.0, 0.0, 0.0]) if up[0] == 0 else np.array([0.0, 1.0, 0.0])
    return np.stack([first, np.cross(up, first), up]) + 0.0


def _declared(raw: RawC3d, markers: Markers | None) -> Array | None:
    """Return the axis that POINT:Y_SCREEN, the upward direction of the recording's screen, names.

    Its sign is not believed (labs with z up write -Z): up is the side of the lab origin on which the markers are.
    """
    text = next(iter(texts(raw.parameters, "POINT", "Y_SCREEN")), "").upper().replace(" ", "")
    if not re.fullmatch(r"[+-]?[XYZ]", text):
        return None
    i = _AXES.index(text[-1])
    below = markers is not None and bool(markers.seen.any()) and _middle(markers, i) < 0
    return np.eye(3)[i] * (-1.0 if below else 1.0)


def _floor(raw: RawC3d, markers: Markers | None) -> Array | None:
    """Return the normal of the plates on the side of the markers; None without plates that lie in a coordinate
    plane. Corners that make no plate have no vote.
    """
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
    """Return the median coordinate of all markers along an axis, by frames spread over the recording, or by all where
    these show none.
    """
    some = spread_frames(markers.xyz)[..., axis]
    return float(np.nanmedian(some if np.isfinite(some).any() else markers.xyz[..., axis]))

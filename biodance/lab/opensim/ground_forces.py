"""Force plates in a table: OpenSim's columns of force, point of application and torque, to and from plates.

A plate is nine columns, ``..force..v{x,y,z}`` N, ``..force..p{x,y,z}`` m and ``..torque..{x,y,z}`` N·m (free moment
about the point). The wrench about the file's origin is ``[F, p x F + T]``. Where the plate itself lies is not in such a
file.
"""

import re
from collections.abc import Mapping
from itertools import product
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.opensim import Y_UP_TO_Z_UP
from biodance.lab.opensim.mot import TimeTable
from biodance.records import Array, Plate, Wrench
from biodance.settings import COP_FORCE
from biodance.spatial import wrench_about_origin, wrench_about_point

_VERSION = "40000"


def ground_table(feet: Mapping[str, Wrench], *, name: str) -> TimeTable:
    """Return the ground's force on each segment as a table, y up: nine columns a segment, its name in front.

    ``feet`` segment -> wrench of the ground on it about the lab origin. Force and torque stand at one point of the
    ground that does not move, the mean centre of pressure: a centre of pressure that jumps with every step has no
    derivative, and OpenSim draws splines through it.
    """
    columns, values = [], []
    for segment, wrench in feet.items():
        point = np.broadcast_to(_mean_place(wrench), (wrench.time.size, 3))
        torque = wrench_about_point(wrench.value, point)[:, 3:]
        columns += [f"{segment}_{part}{axis}" for part in ("force_v", "force_p", "torque_") for axis in _AXES]
        values += [part @ Y_UP_TO_Z_UP for part in (wrench.force, point, torque)]
    return TimeTable(name, tuple(columns), next(iter(feet.values())).time, np.hstack(values))


def _mean_place(wrench: Wrench) -> Array:
    """Return the mean centre of pressure (3,) m on the floor z = 0; the origin where the foot carries nothing."""
    cop = wrench.cop(height=0.0, threshold=COP_FORCE)
    known = np.isfinite(cop).all(axis=1)
    return np.asarray(cop[known].mean(axis=0)) if known.any() else np.zeros(3)


def external_loads(segments: tuple[str, ...], *, data_file: str) -> str:
    """Return ExternalLoads.xml: the columns of `ground_table` in ``data_file`` on their segments, in the ground."""
    root = Element("OpenSimDocument", Version=_VERSION)
    loads = SubElement(root, "ExternalLoads", name="ground")
    objects = SubElement(loads, "objects")
    for segment in segments:
        force = SubElement(objects, "ExternalForce", name=f"ground_on_{segment}")
        _say(force, applied_to_body=segment, force_expressed_in_body="ground", point_expressed_in_body="ground")
        _say(force, force_identifier=f"{segment}_force_v", point_identifier=f"{segment}_force_p")
        _say(force, torque_identifier=f"{segment}_torque_", data_source_name="Unassigned")
    _say(loads, datafile=data_file)
    return _text(root)


def inverse_dynamics_setup(
    name: str, *, model: str, coordinates: str, loads: str, between: tuple[float, float], out: str
) -> str:
    """Return the set-up of OpenSim's InverseDynamicsTool: files relative to its own, times s; no filter, since the
    coordinates are smooth already.
    """
    root = Element("OpenSimDocument", Version=_VERSION)
    tool = SubElement(root, "InverseDynamicsTool", name=name)
    _say(tool, results_directory=".", model_file=model, time_range=f"{between[0]:.10g} {between[1]:.10g}")
    _say(tool, forces_to_exclude="Muscles", external_loads_file=loads, coordinates_file=coordinates)
    _say(tool, lowpass_cutoff_frequency_for_coordinates="-1", output_gen_force_file=out)
    return _text(root)


def _say(parent: Element, **values: str) -> None:
    for tag, value in values.items():
        SubElement(parent, tag).text = value


def _text(root: Element) -> str:
    indent(root, space="  ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


_NOT_PLACED = (
    "The file does not say where the plate lies: its corners enclose the centres of pressure under load with 0.15 m to "
    "spare."
)
_FOOT_MARGIN = 0.15  # m, how far a foot reaches beyond its centres of pressure
_FARTHEST = 50.0  # m
_AXES = "xyz"


def has_plates(columns: tuple[str, ...]) -> bool:
    """Return True if the column labels hold the three forces and three points of at least one plate."""
    return bool(_groups(columns))


def plates_of(table: TimeTable, *, where: str) -> tuple[tuple[Plate, ...], tuple[str, ...]]:
    """Return the plates of a table, turned to z up and ground on subject, and what was decided about all of them.

    The axis of the mean total force is taken as up: y as OpenSim writes it, or z. A plate that is never loaded (20 N)
    is left out. Its corners enclose the centres of pressure while loaded plus 0.15 m, since the file does not tell
    where the plate lies.

    Raises
    ------
    FileRefused
        ``where`` (the file): no plate columns, a force that is NaN, a point that is NaN under load or farther than 50 m
        (not in metres).
    """
    groups = _groups(table.columns)
    if not groups:
        raise FileRefused(
            f"{where}: holds no force plate: the columns are {', '.join(table.columns[:6])} ... Columns such as "
            "ground_force_vx, ground_force_px and ground_torque_x are needed."
        )
    raw = {name: _wrench(table, columns, f"{where}, plate {name}") for name, columns in groups.items()}
    time = np.linspace(table.time[0], table.time[-1], table.time.size) if table.time.size else table.time
    history: list[str] = []
    if not table.has_equal_steps:
        time, raw = _equal_steps(table.time, raw)
        history.append(
            f"The time steps are not equal: the forces were interpolated linearly to {1 / (time[1] - time[0]):.6g} Hz."
        )
    turn, sign, decided = _upright(np.sum([value[:, :3].mean(axis=0) for value in raw.values()], axis=0))
    history += decided
    plates = []
    for number, (name, value) in enumerate(raw.items(), start=1):
        wrench = Wrench(time, sign * np.hstack([value[:, :3] @ turn.T, value[:, 3:] @ turn.T]))
        cop = wrench.cop(height=_height(table, groups[name], turn), threshold=COP_FORCE)
        if np.isnan(cop).all():
            history.append(
                f"Plate {number} ({name}) is never loaded above {COP_FORCE:g} N and was left out: the file does not "
                f"say where it lies."
            )
            continue
        said = (f"Columns of {name}.", *decided, _NOT_PLACED)
        plates.append(Plate(f"plate{number}", 0, _rectangle(cop), wrench, said, placed=False))
    return tuple(plates), tuple(history)


def _groups(columns: tuple[str, ...]) -> dict[str, dict[str, str]]:
    """Return per plate its columns by part, ``vx`` to ``pz`` and ``mx`` ... where there is a torque, in order."""
    found: dict[str, dict[str, str]] = {}
    for column in columns:
        match = re.fullmatch(r"(.*?)_?([vpmt]?)_?([xyz])", column.strip(), flags=re.IGNORECASE)
        if not match or not re.search(r"force|torque|moment|grf", match[1], flags=re.IGNORECASE):
            continue
        plate = re.sub(r"torque|moment", "force", match[1], flags=re.IGNORECASE)
        torque = plate != match[1] or match[2].lower() in ("m", "t")
        part = "m" if torque else match[2].lower()
        found.setdefault(plate, {})[part + match[3].lower()] = column
    needed = [part + axis for part in "vp" for axis in _AXES]
    return {plate: parts for plate, parts in found.items() if all(part in parts for part in needed)}


def _wrench(table: TimeTable, columns: dict[str, str], where: str) -> Array:
    """Return force and moment (T, 6) about the file's origin, in the file's axes."""
    nothing = np.zeros(table.time.size)
    rows = {key: table[columns[key]] if key in columns else nothing for key in map("".join, product("vpm", _AXES))}
    force, point, torque = np.array(list(rows.values())).reshape(3, 3, -1).transpose(0, 2, 1)
    torque = np.where(np.isnan(torque) & (force == 0).all(axis=1)[:, None], 0.0, torque)
    if (bad := np.isnan(force) | np.isnan(torque)).any():
        raise FileRefused(
            f"{where}: the force or torque is NaN at {table.time[bad.any(axis=1)][0]:g} s. Export the forces without "
            f"gaps."
        )
    loaded = np.linalg.norm(force, axis=1) > 0
    if (bad := np.isnan(point).any(axis=1) & loaded).any():
        raise FileRefused(
            f"{where}: the point of application is NaN at {table.time[bad][0]:g} s although there is a force. Export "
            f"it again."
        )
    point = np.where(loaded[:, None], point, 0.0)
    under_load = np.linalg.norm(force, axis=1) >= COP_FORCE
    if under_load.any() and (far := float(np.median(np.abs(point[under_load]).max(axis=1)))) > _FARTHEST:
        raise FileRefused(
            f"{where}: the point of application lies {far:.0f} m from the origin; it must be in metres. Export it in "
            f"metres."
        )
    return wrench_about_origin(np.hstack([force, torque]), point)


def _equal_steps(time: Array, raw: dict[str, Array]) -> tuple[Array, dict[str, Array]]:
    """Return the wrenches interpolated linearly at the median time step."""
    step = float(np.median(np.diff(time)))
    even = time[0] + step * np.arange(int((time[-1] - time[0]) / step + 1e-6) + 1)
    return even, {name: np.stack([np.interp(even, time, c) for c in value.T], axis=1) for name, value in raw.items()}


def _upright(mean_force: Array) -> tuple[Array, float, list[str]]:
    """Return the turn (3, 3) to z up, the sign that makes the ground push upwards, and the sentences that say so."""
    z_up = abs(mean_force[2]) > max(abs(mean_force[1]), COP_FORCE)
    turn = np.eye(3) if z_up else Y_UP_TO_Z_UP
    along_z, as_opensim = "The largest mean force is along z: taken as z up.", "y up as OpenSim writes it"
    said = [along_z if z_up else f"{as_opensim}: turned by 90 degrees about x to z up."]
    if (turn @ mean_force)[2] >= 0:
        return turn, 1.0, said
    return turn, -1.0, [*said, "The mean force points down: the file holds the load on the plate; the sign was turned."]


def _height(table: TimeTable, columns: dict[str, str], turn: Array) -> float:
    """Return the median height (m, z up) of the points of application under load; 0 if there is no load."""
    force, point = (np.stack([table[columns[part + axis]] for axis in _AXES], axis=1) for part in "vp")
    loaded = np.linalg.norm(force, axis=1) >= COP_FORCE
    return float(np.median((point[loaded] @ turn.T)[:, 2])) if loaded.any() else 0.0


def _rectangle(cop: Array) -> Array:
    """Return the corners (4, 3) m around the centres of pressure (T, 3), counter-clockwise seen from above."""
    (x0, y0, z), (x1, y1, _) = np.nanmin(cop, axis=0), np.nanmax(cop, axis=0)
    x0, y0, x1, y1 = x0 - _FOOT_MARGIN, y0 - _FOOT_MARGIN, x1 + _FOOT_MARGIN, y1 + _FOOT_MARGIN
    return np.array([[x1, y1, z], [x0, y1, z], [x0, y0, z], [x1, y0, z]])

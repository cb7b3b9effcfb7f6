"""OpenSim's table of forces, and that of Cortex: plates without markers."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.markers.time_axis import time_axis
from biodance.lab.plain_text import read_bytes, sha256
from biodance.lab.plates.decode import around_pressures, find_baseline
from biodance.lab.program_tables import Y_UP_TO_Z_UP, TimeTable, read_mot
from biodance.lab.readers import head_text
from biodance.records import Array, Plate, Role, Source, Trial, Wrench
from biodance.settings import COP_FORCE
from biodance.spatial import turned_wrench, wrench_about_origin

_AXES = "xyz"
_TURNED_BY = 0.1
"""m: moment along the force, as a share of the force, that no ground gives: friction of the whole force (coefficient
0.8, a shoe on rubber) half a foot from the middle. Over 126 plates of 12 laboratories it is 0.0001 (quiet standing) to
0.026 m (RMS; 0.09 at most where a plate is wrong), so 0.1 to 26 where torques are N·mm.
"""

NAME = "table of OpenSim"
EXTENSIONS = (".mot", ".sto", ".forces")
PREFERENCE = 20


def sniff(head: bytes) -> bool:
    """Return whether the head has the line "endheader", or begins with "[Force Data]"."""
    return bool(re.search(r"^\s*endheader\s*$|\A\[Force Data\]", head_text(head), flags=re.MULTILINE | re.IGNORECASE))


def read(path: Path, *, role: Role, subject: str | None = None) -> Trial:
    """Return the trial of a table with plate columns: plates, no markers."""
    table = read_mot(path)
    plates, said, doubts = plates_of(table, where=str(path))
    rate = plates[0].wrench.rate if plates else math.nan
    source = Source(path, sha256(read_bytes(path)), "MOT", analog_rate=rate)
    return Trial(path.stem, role, None, plates, source, history=said, warnings=(*table.warnings, *doubts))


@dataclass(frozen=True, eq=False)
class _Rows:
    """The rows of one plate as written, (T, 3) each: ``force`` N, ``point`` m, ``torque`` N·m about it; ``zero`` (3,) N
    that was taken off; what was ``said`` of it.
    """

    force: Array
    point: Array
    torque: Array
    zero: Array
    said: tuple[str, ...] = ()

    @property
    def wrench(self) -> Array:
        """Force and moment (T, 6) about the file's origin, in the file's axes."""
        return wrench_about_origin(np.hstack([self.force, self.torque]), self.point)


def has_plates(columns: tuple[str, ...]) -> bool:
    """Return True if the column labels hold the three forces and three points of at least one plate."""
    return bool(_groups(columns))


def plates_of(table: TimeTable, *, where: str) -> tuple[tuple[Plate, ...], tuple[str, ...], tuple[str, ...]]:
    """Return the plates of a table, turned to z up and ground on subject, what was decided about all of them, and what
    a person should look at.

    The axis of the mean total force is taken as up: y as OpenSim writes it, or z. Torques a thousand times too large
    are N·mm. What the rows without load read is taken off all rows. A plate that is never loaded (20 N) is left out.
    Its corners enclose the centres of pressure while loaded plus 0.15 m, since the file does not tell where the plate
    lies.

    Raises
    ------
    FileRefused
        ``where`` (the file): no plate columns, a force that is NaN, a point that is NaN under load or farther than 50 m
        (not in metres).
    """
    groups = _groups(table.columns)
    if not groups:
        raise FileRefused(f"{where}: {_no_plate(table)}")
    rows = {name: _rows(table, columns, f"{where}, plate {name}") for name, columns in groups.items()}
    rows, warnings = _in_newton_metres(rows)
    turn, sign, decided = _upright(np.sum([one.force.mean(axis=0) for one in rows.values()], axis=0))
    rows = {name: _zeroed(one, table.time, turn) for name, one in rows.items()}
    axis = time_axis(table.time, where=where)
    raw = {name: axis.at(one.wrench) for name, one in rows.items()}
    history = [*table.history, *([axis.said] if axis.said else []), *decided]
    plates = []
    for number, (name, value) in enumerate(raw.items(), start=1):
        wrench = Wrench(axis.time, sign * turned_wrench(value, turn))
        one = rows[name]
        loaded = np.linalg.norm(one.force, axis=1) >= COP_FORCE
        height = float(np.median((one.point[loaded] @ turn.T)[:, 2])) if loaded.any() else 0.0  # of the pressures
        cop = wrench.cop(height=height, threshold=COP_FORCE)
        if np.isnan(cop).all():
            history.append(
                f"Plate {number} ({name}) is never loaded above {COP_FORCE:g} N and was left out: the file does not "
                f"say where it lies."
            )
            continue
        around = (
            "The file does not say where the plate lies: its corners enclose the centres of pressure under load with "
            "0.15 m to spare."
        )
        said, zero = (f"Columns of {name}.", *one.said, *decided, around), sign * turn @ one.zero
        corners = around_pressures(cop, height)
        plates.append(Plate(f"plate{number}", 0, corners, wrench, said, zero, placed=False, columns=name))
    return tuple(plates), tuple(history), warnings


def _no_plate(table: TimeTable) -> str:
    """Say what a table without plates holds, and what to do."""
    if table.vectors:
        return (
            f"holds {len(table.vectors)} quantities of three numbers each (Vec3: {', '.join(table.vectors[:4])} ...) "
            "and no force plate. If they are markers, write them with OpenSim's TRCFileAdapter: they are read from "
            ".trc files."
        )
    return (
        f"holds no force plate: the columns are {', '.join(table.columns[:6])} ... Columns such as ground_force_vx, "
        "ground_force_px and ground_torque_x are needed."
    )


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


def _rows(table: TimeTable, columns: dict[str, str], where: str) -> _Rows:
    """Return the rows of one plate: no NaN, points zero where there is no force."""
    nothing = np.zeros(table.time.size)
    force, point, torque = (
        np.stack([table[columns[part + axis]] if part + axis in columns else nothing for axis in _AXES], axis=1)
        for part in "vpm"
    )
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
    if under_load.any() and (far := float(np.median(np.abs(point[under_load]).max(axis=1)))) > 50.0:
        raise FileRefused(
            f"{where}: the point of application lies {far:.0f} m from the origin; it must be in metres. Export it in "
            f"metres."
        )
    return _Rows(force, point, torque, np.zeros(3))


def _in_newton_metres(rows: Mapping[str, _Rows]) -> tuple[dict[str, _Rows], tuple[str, ...]]:
    """Return the plates with torques in N·m, and the warning where they were written in N·mm."""
    force, torque = (np.concatenate([getattr(one, what) for one in rows.values()]) for what in ("force", "torque"))
    size = np.linalg.norm(force, axis=1)
    loaded = size >= COP_FORCE
    along = (force * torque).sum(axis=1)[loaded] / size[loaded]
    # RMS moment along the force over the RMS force of loaded rows, m
    turned = float(np.sqrt((along**2).mean() / (size[loaded] ** 2).mean())) if loaded.any() else 0.0
    if not _TURNED_BY < turned <= 1000 * _TURNED_BY:
        return dict(rows), ()
    said = (
        f"The torque columns are 1000 times too large (N mm): the moment about the force is {turned:.2g} m times the "
        f"force (RMS), and a foot turns on the ground with at most {_TURNED_BY:g} m times the force. They were read as "
        f"N mm. Export them in N m."
    )
    return {name: replace(one, torque=one.torque / 1000, said=(said,)) for name, one in rows.items()}, (said,)


def _zeroed(rows: _Rows, time: Array, turn: Array) -> _Rows:
    """Return the rows less what the plate reads while nobody is on it, in every column of force and torque."""
    if time.size < 2:
        return rows
    window = find_baseline(rows.force @ turn[2], zero=None, rate=1 / float(np.median(np.diff(time))))
    empty = slice(window.start, window.stop)
    # Less than 0.3 N is zero: writers of tables cut off what is below a threshold.
    if window.stop <= window.start or np.abs(reads := rows.force[empty].mean(axis=0)).max() < 0.3:
        return rows
    torque = np.median(rows.torque[empty], axis=0)
    # A torque that noise alone would give is no zero.
    steady = np.abs(torque) > 3 * rows.torque[empty].std(axis=0)
    said = (
        f"Zero: nobody is on the plate in rows {empty.start + 1}-{empty.stop}; what they read on average "
        f"({', '.join(f'{one:.3g}' for one in reads)} N) was subtracted from every row."
    )
    kept = replace(rows, force=rows.force - reads, torque=rows.torque - np.where(steady, torque, 0.0), zero=reads)
    return replace(kept, said=(*rows.said, said))


def _upright(mean_force: Array) -> tuple[Array, float, list[str]]:
    """Return the turn (3, 3) to z up, the sign that makes the ground push upwards, and the sentences that say so."""
    z_up = abs(mean_force[2]) > max(abs(mean_force[1]), COP_FORCE)
    turn = np.eye(3) if z_up else Y_UP_TO_Z_UP
    along_z, as_opensim = "The largest mean force is along z: taken as z up.", "y up as OpenSim writes it"
    said = [along_z if z_up else f"{as_opensim}: turned by 90 degrees about x to z up."]
    if (turn @ mean_force)[2] >= 0:
        return turn, 1.0, said
    return turn, -1.0, [*said, "The mean force points down: the file holds the load on the plate; the sign was turned."]

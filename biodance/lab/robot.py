"""A robot's recording: a folder of encoder tables and force plate files, paired into trials."""

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from biodance.errors import BiodanceError, FileRefused, SessionRefused, refuse_unknown
from biodance.lab.cells import read_cells
from biodance.lab.plain_text import read_bytes
from biodance.lab.readers import read_head, read_trial, sniffed
from biodance.library import read_toml
from biodance.records import ROLES, Array, Markers, Role, Wrench
from biodance.records.motion import Encoders
from biodance.spatial import wrench_about_point

_UNITS = {"": 1.0, "rad": 1.0, "deg": np.pi / 180, "degree": np.pi / 180, "degrees": np.pi / 180}


def read_encoders(path: Path, *, unit: str = "") -> Encoders:
    """Return all joints of a table, whatever robot they belong to.

    A unit in the heading or below it, ``left_knee (deg)``, counts before ``unit`` ("rad", "deg" or "": rad).

    Raises
    ------
    FileRefused
        It is no table (`read_cells`), no column is time, a number is missing, time does not increase or has a gap.
    """
    cells = read_cells(read_bytes(path), path, least=2)
    values, names = cells.values, cells.labels
    clock = next((i for i, name in enumerate(names) if name.lower() in ("time", "t", "time_s", "timestamp")), None)
    if clock is None:
        raise FileRefused(
            f"{path}: no column is the time; the columns are {', '.join(names[:6])} ... Name one 'time', in s."
        )
    columns = [i for i in range(len(names)) if i != clock]
    bad = np.argwhere(~np.isfinite(values))
    if bad.size:
        row, column = bad[0]
        raise FileRefused(
            f"{path}: column {names[column]} holds no number in row {row + 2}; give all samples of every encoder."
        )
    time = values[:, clock]
    _check_clock(path, time)
    words = {names[i]: (cells.units[i] or unit).lower().rstrip(".") for i in columns}
    for name, word in words.items():
        if word not in _UNITS:
            raise FileRefused(f"{path}: the unit of column {name} is {word!r}; legal are rad and deg.")
    factors = np.array([_UNITS[words[names[i]]] for i in columns])
    joints = tuple(names[i] for i in columns)
    twice = sorted({name for name in joints if joints.count(name) > 1})
    if twice:
        raise FileRefused(f"{path}: the column {twice[0]} occurs twice. Keep the one that was recorded.")
    notes = [*cells.said[1:], *["Angles were converted from degrees."] * bool((factors != 1).any())]
    steps = np.diff(time)
    # A step of 1.6 usual ones: a sample is missing.
    late = np.flatnonzero(steps > 1.6 * np.median(steps))
    if late.size:
        others = f" and at {late.size - 1} other place{'s' * (late.size > 2)}" if late.size > 1 else ""
        first = f"Samples are missing after {time[late[0]]:.3f} s{others}"
        notes.append(f"{first}: up to {steps.max():.3g} s without one.")
    return Encoders(time, joints, values[:, columns] * factors, tuple(notes))


def _check_clock(path: Path, time: Array) -> None:
    if time.size < 10:
        raise FileRefused(f"{path}: holds {time.size} samples; a motion needs some seconds of them.")
    steps = np.diff(time)
    if not (steps > 0).all():
        row = int(np.argmax(steps <= 0))
        raise FileRefused(f"{path}: time does not increase in row {row + 3} ({time[row]:g} s, then {time[row + 1]:g}).")
    if steps.max() > 0.1:  # a joint moves visibly in it: angles are not interpolated
        row = int(steps.argmax())
        raise FileRefused(
            f"{path}: nothing was recorded for {steps.max():.3g} s after {time[row]:.3f} s. Give pieces without a gap "
            f"as trials of their own (is the time in s?)."
        )


def for_joints(
    found: Encoders, joints: tuple[str, ...], limits: tuple[Array, Array], *, where: str, fixed: dict[str, float]
) -> Encoders:
    """Return the encoders of a robot's ``joints`` in their order; ``fixed`` those without encoder, rad.

    ``limits`` lower and upper (n,) rad of the joints.

    Raises
    ------
    FileRefused
        An encoder is missing, or shows what the joint cannot do: degrees, another joint.
    """
    missing = [name for name in joints if name not in found.joints and name not in fixed]
    if missing:
        others = [name for name in found.joints if name not in joints]
        also = f" Columns that are no joint of the robot: {', '.join(others[:8])}." if others else ""
        raise FileRefused(
            f"{where}: no encoder for the joint{'s' if len(missing) > 1 else ''} {', '.join(missing)}.{also} Name the "
            f"columns as the joints, or give recording.toml [joints] fixed = {{{missing[0]} = 0.0}} (rad) for a joint "
            f'that did not move, rename = {{"column" = "joint"}} for another name.'
        )
    angle = np.empty((found.time.size, len(joints)))
    for column, name in enumerate(joints):
        read = name in found.joints
        angle[:, column] = found.angle[:, found.joints.index(name)] if read else fixed[name]
    low, high = limits
    # Positive: how far beyond the nearer limit.
    beyond = np.maximum(low - angle.min(axis=0), angle.max(axis=0) - high)
    worst = int(np.argmax(beyond))
    if np.abs(angle).max() > 2 * np.pi:
        most = int(np.argmax(np.abs(angle).max(axis=0)))
        raise FileRefused(
            f"{where}: {joints[most]} reaches {np.abs(angle[:, most]).max():.1f} rad, which no joint can. In degrees? "
            f"Then say so in the heading, '{joints[most]} (deg)', or in recording.toml: angle_unit = \"deg\"."
        )
    if beyond[worst] > 0.35:  # stops give, zeros are set by hand
        raise FileRefused(
            f"{where}: {joints[worst]} goes from {angle[:, worst].min():.2f} to {angle[:, worst].max():.2f} rad, the "
            f"URDF lets it go from {low[worst]:.2f} to {high[worst]:.2f}. Are columns swapped, signs turned, or in "
            f"other units?"
        )
    ignored, notes = [name for name in found.joints if name not in joints], list(found.notes)
    notes += [f"Columns that are no joint of the robot were left: {', '.join(ignored)}."] if ignored else []
    notes += [f"Taken as not moving: {', '.join(fixed)}."] if fixed else []
    return Encoders(found.time, joints, angle, tuple(notes))


_FILE = "recording.toml"

_KEPT = re.compile(r"valid|unseen|kept|squat", re.IGNORECASE)
_KEYS = {"angle_unit": str, "joints": dict, "trials": dict, "base": dict}


@dataclass(frozen=True, eq=False)
class RobotTrial:
    """One motion: ``encoders`` on the robot's clock, ``wrench`` of all plates on theirs, about the point
    of their surface over the lab origin, ``role`` "fit" or "validate", ``history`` what the readers decided,
    ``markers`` on the plates' clock over the same point.
    """

    name: str
    role: Role
    encoders: Encoders
    wrench: Wrench
    files: tuple[Path, Path]
    history: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    markers: Markers | None = None


@dataclass(frozen=True)
class BaseSensors:
    """What sees the base: ``markers`` m from the root link's origin (forwards, left, up) by name, in the files of the
    plate; or the ``imu``'s columns of roll and pitch among the encoders; neither by default.
    """

    markers: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    imu: tuple[str, str] | None = None


@dataclass(frozen=True, eq=False)
class RobotRecording:
    """The trials of a ``folder``; ``fixed`` joints without encoder and their angle, rad; ``base`` what sees it."""

    folder: Path
    trials: tuple[RobotTrial, ...]
    fixed: dict[str, float] = field(default_factory=dict)
    base: BaseSensors = BaseSensors()


def read_robot_recording(folder: str | Path, joints: tuple[str, ...]) -> RobotRecording:
    """Return what a folder holds of a robot with these ``joints`` (names of the URDF).

    Raises
    ------
    SessionRefused
        There is no such folder, no table of encoders or no force plate file in it, or they do not pair.
    FileRefused
        A file cannot be trusted.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise SessionRefused(f"{folder}: is no folder. Give the folder with the encoders and the force plate files.")
    path = folder / _FILE
    content = read_toml(path) if path.is_file() else {}
    for key, value in content.items():
        if key not in _KEYS or not isinstance(value, _KEYS[key]):
            raise SessionRefused(
                f"{path}: {key} = {value!r} is not legal; legal are angle_unit, [joints], [trials.X], [base]."
            )
    strange = sorted(set(content.get("joints", {})) - {"rename", "fixed"})
    if strange:
        raise SessionRefused(f"{path}: [joints] {strange[0]} is no key; legal are rename and fixed.")
    said = {"joints": {}, "trials": {}, **content}
    rename: dict[str, str] = said["joints"].get("rename", {})
    fixed = {name: float(angle) for name, angle in said["joints"].get("fixed", {}).items()}
    for name in (*fixed, *rename.values()):
        refuse_unknown("joint of the robot", name, joints)
    pairs = _told(folder, said["trials"]) or _paired(folder, set(joints) | set(rename))
    trials = tuple(
        _trial(name, role, *files, said.get("angle_unit", ""), rename) for name, (role, files) in pairs.items()
    )
    return RobotRecording(folder, trials, fixed, _base(folder / _FILE, said.get("base", {})))


def _base(path: Path, said: dict[str, Any]) -> BaseSensors:
    """Return what sees the base, as recording.toml says."""
    markers, imu = said.get("markers", {}), said.get("imu", {})
    numbers = isinstance(markers, dict) and all(
        isinstance(xyz, list) and len(xyz) == 3 and all(isinstance(x, int | float) for x in xyz)
        for xyz in markers.values()
    )
    named = isinstance(imu, dict) and set(imu) in (set(), {"roll", "pitch"})
    if not (numbers and named and set(said) <= {"markers", "imu"}) or (markers and imu):
        raise SessionRefused(
            f"{path}: [base] is not legal. Give markers = {{NAME = [forwards, left, up]}} in m from the root link's "
            f'origin, or imu = {{roll = "column", pitch = "column"}} of the encoders\' table.'
        )
    return BaseSensors(
        {name: tuple(xyz) for name, xyz in markers.items()}, (imu["roll"], imu["pitch"]) if imu else None
    )


def _told(folder: Path, trials: dict[str, Any]) -> dict[str, tuple[Role, tuple[Path, Path]]]:
    found: dict[str, tuple[Role, tuple[Path, Path]]] = {}
    for name, entry in trials.items():
        if not isinstance(entry, dict) or not {"encoders", "plate"} <= set(entry) <= {"encoders", "plate", "role"}:
            raise SessionRefused(
                f"{folder / _FILE}: [trials.{name}] must say encoders and plate (files), and may role."
            )
        role = entry.get("role", "validate" if _KEPT.search(name) else "fit")
        refuse_unknown("trial role", role, ROLES)
        if role != "skip":
            found[name] = (cast(Role, role), (folder / entry["encoders"], folder / entry["plate"]))
    return found


def _paired(folder: Path, joints: set[str]) -> dict[str, tuple[Role, tuple[Path, Path]]]:
    """Return the trials of a folder without a word about them."""
    files = sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    tables, plates = list[Path](), list[Path]()
    for path in files:
        with suppress(BiodanceError):
            is_table = path.suffix.lower() in (".csv", ".parquet")
            if is_table and joints & set(read_cells(read_bytes(path), path, least=2).labels):
                tables.append(path)
                continue
        with suppress(BiodanceError):
            known = sniffed(path, read_head(path)) is not None or path.suffix.lower() in (".c3d", ".bsf")
            plates += [path] * (known and path.name != _FILE)
    if not tables or not plates:
        lacks = "table with encoder columns named as the robot's joints" if not tables else "force plate file"
        raise SessionRefused(
            f"{folder}: holds no {lacks}; there are {', '.join(path.name for path in files[:8]) or 'no files'}. A "
            f"recording is a CSV or Parquet file of encoders and a C3D, AMTI or CSV file of the plate."
        )
    alone = len(tables) == len(plates) == 1
    pairs = [(table, plates[0] if alone else _plate_of(table, plates)) for table in tables]
    return {
        (name := _stem(table)): ("validate" if _KEPT.search(name) else "fit", (table, plate)) for table, plate in pairs
    }


def _plate_of(table: Path, plates: list[Path]) -> Path:
    """Return the only plate file of the same stem as a table of encoders."""
    same = [plate for plate in plates if _stem(plate) == _stem(table)]
    if len(same) != 1:
        raise SessionRefused(
            f"{table.parent}: which plate file belongs to {table.name}? Give both the same stem, as walk_joints.csv "
            f"and walk_plate.c3d, or say it in {_FILE}: [trials.{_stem(table)}] encoders, plate, role."
        )
    return same[0]


def _stem(path: Path) -> str:
    return re.sub(r"(?i)[_.-]?(joints?|encoders?|angles?|plates?|forces?|grf)$", "", path.stem) or path.stem


def _trial(name: str, role: Role, table: Path, plate: Path, unit: str, rename: dict[str, str]) -> RobotTrial:
    encoders = read_encoders(table, unit=unit)
    joints = tuple(rename.get(joint, joint) for joint in encoders.joints)
    recorded = read_trial(plate, role=role)
    if not recorded.plates:
        raise FileRefused(f"{plate}: holds no force plate that can be trusted. {' '.join(recorded.warnings)}")
    first = recorded.plates[0].wrench
    if any(one.wrench.time.size != first.time.size for one in recorded.plates):
        raise FileRefused(f"{plate}: its plates have different lengths. Export them at one rate.")
    # Mean height of the surfaces over the lab's origin.
    surface = np.array([0.0, 0.0, np.mean([one.height for one in recorded.plates])])
    # All about one point on the surface, so that they add.
    total = np.sum([wrench_about_point(one.wrench.value, surface) for one in recorded.plates], axis=0)
    said = (*(text for one in recorded.plates for text in one.decisions), *recorded.history)
    found = Encoders(encoders.time, joints, encoders.angle, encoders.notes)
    seen = recorded.markers
    markers = replace(seen, xyz=seen.xyz - surface) if seen is not None and seen.names else None
    return RobotTrial(name, role, found, Wrench(first.time, total), (table, plate), said, recorded.warnings, markers)

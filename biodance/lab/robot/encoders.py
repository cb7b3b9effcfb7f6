"""Joint encoders from a table with named columns (CSV or Parquet): time in s, angles in rad or as the heading says."""

import re
from pathlib import Path

import numpy as np

from biodance.errors import FileRefused
from biodance.library import refuse_special
from biodance.records import Array
from biodance.records.motion import Encoders

ENCODER_TABLES = (".csv", ".parquet")
_TIMES = ("time", "t", "time_s", "timestamp")
_UNITS = {"": 1.0, "rad": 1.0, "deg": np.pi / 180, "degree": np.pi / 180, "degrees": np.pi / 180}
_LATE = 1.6
"""Of the usual step: from there on a sample is missing."""
_LONGEST_GAP = 0.1
"""s without a sample over which angles are not interpolated: a joint moves visibly in it."""
_TURN = 2 * np.pi
"""rad: no joint of a humanoid turns further; larger numbers are degrees or counts."""
_BEYOND = 0.35
"""rad beyond a joint's range that an encoder may show: stops give, zeros are set by hand."""


def column_names(path: Path) -> tuple[str, ...]:
    """Return the headings of a table of columns; () for a file that is none."""
    if path.suffix.lower() == ".parquet":
        import pyarrow.parquet as parquet

        try:
            return tuple(parquet.read_schema(path).names)
        except (OSError, ValueError):
            return ()
    with open(path, encoding="utf-8-sig", errors="replace") as stream:
        return tuple(cell.strip().strip('"') for cell in stream.readline().strip().split(","))


def heading(column: str) -> str:
    """Return the heading of a column without its unit: ``left_knee (rad)`` is left_knee."""
    return re.sub(r"\s*[\[(][^\])]*[\])]\s*$", "", column).strip()


def read_encoders(path: Path, *, unit: str = "") -> Encoders:
    """Return all joints of a table, whatever robot they belong to.

    A unit in the heading, ``left_knee (deg)``, counts before ``unit`` ("rad", "deg" or "": rad).

    Raises
    ------
    FileRefused
        No column is time, a number is missing or not finite, time does not increase or has a gap.
    """
    values, names = _table(path)
    clock = next((i for i, name in enumerate(names) if heading(name).lower() in _TIMES), None)
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
    factors = np.array([_factor(path, names[i], unit) for i in columns])
    joints = tuple(heading(names[i]) for i in columns)
    twice = sorted({name for name in joints if joints.count(name) > 1})
    if twice:
        raise FileRefused(f"{path}: the column {twice[0]} occurs twice. Keep the one that was recorded.")
    notes = ("Angles were converted from degrees.",) if (factors != 1).any() else ()
    return Encoders(time, joints, values[:, columns] * factors, (*notes, *_lost(time)))


def _lost(time: Array) -> tuple[str, ...]:
    """Return in words where samples are missing; nothing where the clock runs on."""
    steps = np.diff(time)
    late = np.flatnonzero(steps > _LATE * np.median(steps))
    if not late.size:
        return ()
    others = late.size - 1
    first, places = float(time[late[0]]), f" and at {others} other place{'s' * (others > 1)}" if others else ""
    return (f"Samples are missing after {first:.3f} s{places}: up to {steps.max():.3g} s without one.",)


def _table(path: Path) -> tuple[Array, tuple[str, ...]]:
    import pandas as pd

    refuse_special(path)
    try:
        frame = pd.read_parquet(path) if path.suffix.lower() == ".parquet" else pd.read_csv(path, encoding="utf-8-sig")
        values = frame.apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    except (OSError, ValueError, pd.errors.ParserError) as error:
        why = " ".join(str(error).split())
        said = f"{path}: cannot be read as a table ({why}). Give columns with a heading each, separated by commas."
        raise FileRefused(said) from error
    return values, tuple(str(name).strip() for name in frame.columns)


def _factor(path: Path, column: str, unit: str) -> float:
    found = re.search(r"[\[(]\s*([^\])]+?)\s*[\])]\s*$", column)
    word = (found[1] if found else unit).lower().rstrip(".")
    if word not in _UNITS:
        raise FileRefused(f"{path}: the unit of column {column} is {word!r}; legal are rad and deg.")
    return _UNITS[word]


def _check_clock(path: Path, time: Array) -> None:
    if time.size < 10:
        raise FileRefused(f"{path}: holds {time.size} samples; a motion needs some seconds of them.")
    steps = np.diff(time)
    if not (steps > 0).all():
        row = int(np.argmax(steps <= 0))
        raise FileRefused(f"{path}: time does not increase in row {row + 3} ({time[row]:g} s, then {time[row + 1]:g}).")
    if steps.max() > _LONGEST_GAP:
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
    beyond = np.maximum(low - angle.min(axis=0), angle.max(axis=0) - high)
    worst = int(np.argmax(beyond))
    if np.abs(angle).max() > _TURN:
        most = int(np.argmax(np.abs(angle).max(axis=0)))
        raise FileRefused(
            f"{where}: {joints[most]} reaches {np.abs(angle[:, most]).max():.1f} rad, which no joint can. In degrees? "
            f"Then say so in the heading, '{joints[most]} (deg)', or in recording.toml: angle_unit = \"deg\"."
        )
    if beyond[worst] > _BEYOND:
        raise FileRefused(
            f"{where}: {joints[worst]} goes from {angle[:, worst].min():.2f} to {angle[:, worst].max():.2f} rad, the "
            f"URDF lets it go from {low[worst]:.2f} to {high[worst]:.2f}. Are columns swapped, signs turned, or in "
            f"other units?"
        )
    ignored = [name for name in found.joints if name not in joints]
    notes = (f"Columns that are no joint of the robot were left: {', '.join(ignored)}.",) if ignored else ()
    still = (f"Taken as not moving: {', '.join(fixed)}.",) if fixed else ()
    return Encoders(found.time, joints, angle, (*found.notes, *notes, *still))

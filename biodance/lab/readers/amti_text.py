"""AMTI text: one force plate as a table of numbers, explained by a header line or a TOML file beside it."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from biodance.errors import BiodanceError, FileRefused
from biodance.lab.plain_text import COMMAS_READ, parse_number, plain_table, read_bytes, read_text, sha256, with_points
from biodance.lab.plates import FORCE, MOMENT, plain_unit
from biodance.lab.plates.decode import DEEPEST, LONGEST_SIDE, SHORTEST_SIDE, find_baseline, loaded_samples
from biodance.lab.plates.sense import gravity_sign, sensor_below, wrench_in_lab
from biodance.lab.readers import head_text
from biodance.library import read_toml
from biodance.records import CHANNELS, Array, Plate, Role, Source, Trial, Wrench
from biodance.spatial import wrench_about_point

NAME = "AMTI text"
EXTENSIONS = (".asc", ".txt", ".csv")
PREFERENCE = 90
"""Asked last: any table of numbers looks like this format."""


def sniff(head: bytes) -> bool:
    """Return whether the rows after the first (which may be labels) hold at least six numbers (or nan) each; of several
    one may be damaged, which is for `read` to say.
    """
    rows = [line for line in head_text(head).splitlines()[:4] if line.strip()]
    cell = r"(?:[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?|nan)"
    row = re.compile(rf"\s*{cell}(?:[\s,;]+{cell}){{5,}}[\s,;]*", flags=re.IGNORECASE)
    fit = [bool(row.fullmatch(line)) for line in rows[1:] or rows]
    return any(fit) and sum(fit) >= len(fit) - (len(fit) > 2)


_KEYS = ("columns", "force_unit", "moment_unit", "rate_hz", "plate_size_m", "sensor_depth_m", "acts_on")
_EVEN = 0.02  # share by which a time step may differ from the others (times are often rounded to ms)


def _settings(header: list[str], values: Array, path: Path) -> tuple[dict[str, Any], Path | None]:
    """Return what header and the TOML beside the text say of each of `_KEYS`, checked, and that TOML; None = none."""
    beside = path.with_suffix(".toml")
    given = _given(beside) if beside.is_file() else {}
    columns, units = _header_columns(header)
    columns = given.get("columns", columns)
    if not isinstance(columns, list):
        raise FileRefused(
            f"{beside}: columns must name the columns, such as {list(CHANNELS)}; it is {columns!r}. Correct it."
        )
    usual = (None, units.get("Fz"), units.get("Mz"), _rate(values, columns), None, 0.0, "plate")
    found = {**dict(zip(_KEYS, usual, strict=True)), **given, "columns": columns or None}
    if lacking := [key for key, value in found.items() if value is None]:
        todo = f"Write the file {beside.name} beside it and correct what is not so:\n{_example(values, found)}"
        raise FileRefused(f"{path}: does not say {', '.join(lacking)}. {todo}")
    _refuse_nonsense(found, values, beside if given else path)
    own, rate = _rate(values, columns), float(found["rate_hz"])
    if "time_s" in columns and (own is None or abs(own - rate) > _EVEN * rate):
        has = "goes in unequal steps" if own is None else f"goes at {own:g} Hz"
        raise FileRefused(f"{path}: the time column {has}, {rate:g} Hz are declared. Export it again, or correct that.")
    return found, beside if given else None


def _table(text: str, path: Path) -> tuple[list[str], Array]:
    """Return the cells of the last line before the numbers (header, maybe empty) and the numbers (S, C)."""
    lines, header, first, begin = text.splitlines(), list[str](), list[str](), 0
    for line in lines:
        first = _cells(line)
        # All numbers of a row but one are a damaged row and no header.
        if first and sum(_numbers([cell]) is not None for cell in first) >= min(5, len(first)):
            break
        header, first, begin = first or header, [], begin + 1
    # Commas and semicolons part cells as tabs do.
    rest = "\n".join(filter(str.strip, lines[begin:])).replace(",", "\t").replace(";", "\t")
    values = plain_table(rest.split("\n"), len(first)) if first else np.empty((0, 0))
    if values is None or not np.isfinite(values).all():
        values = _row_by_row(lines, begin, path)
    if len(values) < 2 or len(first) < 6:
        raise FileRefused(
            f"{path}: holds {len(values)} rows of {len(first)} numbers; a plate needs at least 2 rows of 6. Check the "
            f"file."
        )
    return header, values


def _row_by_row(lines: list[str], begin: int, path: Path) -> Array:
    """Return the numbers (S, C) in the lines from ``begin`` on; the first line that is no row of them is refused."""
    rows: list[list[float]] = []
    for number, line in enumerate(lines[begin:], start=begin + 1):
        row = _numbers(found) if (found := _cells(line)) else []
        if row is None or (row and rows and len(row) != len(rows[0])):
            expected = f"{len(rows[0])} numbers" if rows else "numbers"
            raise FileRefused(
                f"{path}, line {number}: {line.strip()[:60]!r} is not a row of {expected}. Correct or export the file "
                f"again."
            )
        rows += [row] * bool(row)
    return np.array(rows)


def _cells(line: str) -> list[str]:
    """Return the cells of a line; a separator at its end parts nothing."""
    found = [c.strip() for c in re.split(r"[,;\t]" if re.search(r"[,;\t]", line) else r"\s+", line.strip())]
    return found if found[-1] else found[:-1]


def _numbers(cells: list[str]) -> list[float] | None:
    """Return the cells as numbers that can be recorded, None if one is none."""
    try:
        row = [parse_number(cell, "") for cell in cells]
    except FileRefused:
        return None
    return row if np.isfinite(row).all() else None


def _header_columns(header: list[str]) -> tuple[list[str], dict[str, str]]:
    """Return columns and units of a header ``Time (s), Fx (N), ...``; nothing unless it names all six channels."""
    columns, units = [], {}
    for cell in header:
        match = re.match(r"\s*\"?([A-Za-z]+)[^\[(]*(?:[\[(]\s*([^\])]+)[\])])?", cell)
        name, unit = (match[1], (match[2] or "").strip()) if match else ("", "")
        name = {"t": "time_s", "time": "time_s"}.get(name.lower(), name[:1].upper() + name[1:].lower())
        columns.append(name if name in CHANNELS or name == "time_s" else "skip")
        if unit:
            units[name] = unit
    return (columns, units) if set(CHANNELS) <= set(columns) else ([], {})


def _rate(values: Array, columns: list[str]) -> float | None:
    """Return the rate in Hz from the time column, None without one or where its steps differ."""
    if "time_s" not in columns or columns.index("time_s") >= values.shape[1]:
        return None
    time = values[:, columns.index("time_s")]
    step = (time[-1] - time[0]) / (time.size - 1)
    # Every time against its place on equal steps from the first to the last.
    even = step > 0 and np.abs(time - time[0] - step * np.arange(time.size)).max() <= max(_EVEN * step, 0.0005)
    return round(1 / step, 3) if even else None


def _given(beside: Path) -> dict[str, Any]:
    """Return the TOML beside the text; unknown keys are refused."""
    try:
        given = read_toml(beside)
    except BiodanceError as error:
        raise FileRefused(str(error)) from error
    if strange := sorted(set(given) - set(_KEYS)):
        raise FileRefused(f"{beside}: {', '.join(strange)} is no key of this file. Legal are {', '.join(_KEYS)}.")
    return given


def _refuse_nonsense(found: dict[str, Any], values: Array, where: Path) -> None:
    """Refuse settings of the wrong kind or range, naming key, value and what is legal."""
    columns, size = found["columns"], found["plate_size_m"]
    numbers = [found["rate_hz"], found["sensor_depth_m"], *(size if isinstance(size, list) else [None])]
    is_number = [isinstance(n, int | float) and not isinstance(n, bool) for n in numbers]
    faults = {
        f"columns must name {values.shape[1]} columns, with each of {', '.join(CHANNELS)} once "
        "(others: time_s, skip)": len(columns) != values.shape[1] or any(columns.count(c) != 1 for c in CHANNELS),
        f"force_unit must be one of {', '.join(FORCE)}": plain_unit(str(found["force_unit"])) not in FORCE,
        "moment_unit must be a force times a length, such as Nm, Nmm, inlbf": plain_unit(str(found["moment_unit"]))
        not in MOMENT,
        "rate_hz must be a positive number": not is_number[0] or not 0 < numbers[0] <= 100_000,
        f"sensor_depth_m must be from 0 to {DEEPEST:g}": not is_number[1] or not 0 <= numbers[1] <= DEEPEST,
        f"plate_size_m must be two sides (x, y) of {SHORTEST_SIDE:g} to {LONGEST_SIDE:g}": len(numbers) != 4
        or not all(is_number[2:])
        or not all(SHORTEST_SIDE <= side <= LONGEST_SIDE for side in numbers[2:]),
        'acts_on must be "plate" or "subject"': found["acts_on"] not in ("plate", "subject"),
    }
    for fault, is_so in faults.items():
        if is_so:
            raise FileRefused(f"{where}: {fault}; it is {found[fault.split()[0]]!r}. Correct it.")


def _example(values: Array, found: dict[str, Any]) -> str:
    """Return the TOML to write, filled with what the file says and AMTI's usual settings for the rest."""
    rest = values.shape[1] - 6
    columns = found["columns"] or ["time_s"] * min(rest, 1) + list(CHANNELS) + ["skip"] * max(rest - 1, 0)
    rate = found["rate_hz"] or _rate(values, columns) or 1000
    listed = ", ".join(f'"{c}"' for c in columns)
    return (
        f"columns = [{listed}]\n"
        f'force_unit = "{found["force_unit"] or "N"}"\n'
        f'moment_unit = "{found["moment_unit"] or "Nm"}"\n'
        f"rate_hz = {rate:g}\n"
        f"plate_size_m = {found['plate_size_m'] or [0.464, 0.508]}  # along the plate's x, y\n"
        "sensor_depth_m = 0.0  # depth of the point about which the moments are, below the surface\n"
        'acts_on = "plate"  # "plate": load on the plate, as AMTI records it; "subject": reaction\n'
    )


PLATE_UPRIGHT = np.diag([1.0, -1.0, -1.0])
"""lab_R_plate (3, 3): AMTI's plate axes have z down; x stays, y and z are turned, so that the lab's z points up."""


def amti_plate(
    number: int,
    channels: Array,
    size: tuple[float, float],
    centre: Array,
    vector: Array,
    *,
    rate: float,
    said: tuple[str, ...],
) -> tuple[Plate, tuple[str, ...]]:
    """Return the plate with the ground's wrench on the subject, and warnings."""
    channels, zeroed = _zeroed(channels, rate)
    below, placed = sensor_below(vector, PLATE_UPRIGHT)
    wrench = wrench_about_point(channels, below)
    sign = 1 if gravity_sign(wrench[loaded_samples(wrench, rate)], PLATE_UPRIGHT) > 0 else -1
    half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * np.array(size) / 2
    # Plate axes to the lab.
    corners = np.column_stack([half, np.zeros(4)]) @ PLATE_UPRIGHT.T + centre
    directions = (
        "Lab frame = plate frame turned about x: x stays, y and z (down) are reversed, so that z points up; origin at "
        "the first surface.",
        "Sign: the file holds the load on the plate; turned round to the ground's action on the subject."
        if sign < 0
        else "Sign: the weight shows that the file holds the reaction, not the load on the plate; it was kept.",
    )
    recorded = Wrench(np.arange(len(channels)) / rate, wrench_in_lab(wrench, PLATE_UPRIGHT, sign, centre))
    plate = Plate(f"plate{number}", 0, corners, recorded, (*said, zeroed, placed, *directions))
    return plate, (f"Plate {number}: {directions[1]}",) if sign > 0 else ()


def _zeroed(channels: Array, rate: float) -> tuple[Array, str]:
    """Return the channels without the empty plate's reading where it is more than the maker's zero leaves."""
    zero = find_baseline(channels[:, 2], zero=None, rate=rate)
    if zero.stop <= zero.start:
        return channels, "Zero: the maker's own was kept; the plate is never seen unloaded."
    empty = channels[zero.start : zero.stop].mean(axis=0)
    where = f"unloaded (samples {zero.start + 1}-{zero.stop}) the plate reads {empty[2]:.2g} N vertical"
    if abs(empty[2]) <= 5.0:  # what the maker's own zero leaves
        return channels, f"Zero: the maker's own was kept; {where}."
    return channels - empty, f"Zero: {where}; that mean was subtracted from every channel."


def read(path: str | Path, *, role: Role = "fit", subject: str | None = None) -> Trial:
    """Read a text export of one AMTI plate; what the text does not say stands in a small TOML file of the same name
    beside it.

    The wrench is as in `biodance.lab.readers.bsf`.

    Raises
    ------
    FileRefused
        The file is missing or no table of numbers, or order, units, rate or plate size are said nowhere; the message
        shows the TOML to write.
    """
    path = Path(path)
    text, commas = with_points(read_text(path))
    header, values = _table(text, path)
    found, beside = _settings(header, values, path)
    columns, rate, units = found["columns"], float(found["rate_hz"]), (found["force_unit"], found["moment_unit"])
    force, moment = FORCE[plain_unit(str(units[0]))], MOMENT[plain_unit(str(units[1]))]
    load = values[:, [columns.index(channel) for channel in CHANNELS]] * ([force] * 3 + [moment] * 3)
    where = f"Columns, units and size as in {beside.name}" if beside else "Columns and units as in the header line"
    said = (f"{where}: {', '.join(columns)}; {units[0]}, {units[1]}; {rate:g} Hz.", *[COMMAS_READ] * commas)
    load, (x, y) = load if found["acts_on"] == "plate" else -load, found["plate_size_m"]
    below = np.array([0.0, 0.0, -float(found["sensor_depth_m"])])
    plate, warnings = amti_plate(1, load, (float(x), float(y)), np.zeros(3), below, rate=rate, said=said)
    source = Source(path, sha256(read_bytes(path)), "AMTI text", analog_rate=rate)
    history = (f"AMTI text export, {rate:g} Hz.",)
    return Trial(path.stem, role, None, (plate,), source, history=history, warnings=warnings)

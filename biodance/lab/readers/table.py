"""Tables of markers and forces, CSV, TSV and Parquet as data sets publish them: labels, units where a row or the labels
say them, numbers with decimal points or commas.

Of plates a table says three forces and three moments, and neither about which point nor along which axes. They are
taken along the axes of the markers, in the unit of the labels or that in which they weigh a person, with the sign that
pushes up, where session.toml says. Else, where the pressures that follow lie under the feet, the moments are about the
lab's origin; where they lie elsewhere and a single plate carries everything, about its own, which is put where the feet
stand.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.markers.guess import guess_set
from biodance.lab.markers.sets import MarkerSet, landmark, read_marker_set, recognise
from biodance.lab.markers.signals import unseen_at_origin
from biodance.lab.markers.time_axis import TimeAxis, camera_instants, resampled, time_axis
from biodance.lab.markers.upright import (
    METRES,
    as_high_as_ever,
    axis_to_head,
    body_is_tall_along_z,
    extents,
    likely_unit,
    on_the_ground,
    turn_to,
)
from biodance.lab.plain_text import Cells, clean_label, header_of, is_parquet, read_bytes, read_cells, sha256
from biodance.lab.plates import C3D_ONLY, FORCE, MOMENT, NOTHING_TOLD, Told, channel_groups, plain_unit
from biodance.lab.plates.decode import around_pressures, find_baseline, plate_axes
from biodance.lab.plates.read import PlatesRead
from biodance.lab.readers import head_text
from biodance.records import SIDES, Array, Markers, Mask, Plate, Role, Source, Trial, Wrench
from biodance.settings import COP_FORCE, STANDARD_GRAVITY
from biodance.spatial import turned_wrench, wrench_about_origin

_TIME = re.compile(
    r"(?:time|t|time[\s_]?stamps?|stamps?|elapsed(?:[\s_]?time)?|seconds?|secs?)"
    r"(?:[\s_.]*(s|secs?|seconds?|ms|msecs?|milliseconds?|us|µs|ns))?",
    flags=re.IGNORECASE,
)
FEWEST_MARKERS = 3
"""Markers that a table must hold: fewer have no frame."""


@dataclass(frozen=True)
class TableColumns:
    """``time`` column, None = none, and the unit that its label says; ``markers`` label -> columns of x, y, z, and the
    ``length`` unit their labels say; ``plates`` columns of Fx Fy Fz Mx My Mz of each; ``others`` labels of columns that
    are none of these; ``broken`` markers of which an axis is missing.
    """

    time: int | None
    time_unit: str
    markers: dict[str, tuple[int, int, int]]
    length: str
    plates: tuple[tuple[int, ...], ...]
    others: tuple[str, ...]
    broken: tuple[str, ...]


def columns_in(labels: Sequence[str]) -> TableColumns:
    """Return what the columns with these ``labels`` hold."""
    times = ((k, match[1] or "") for k, label in enumerate(labels) if (match := _TIME.fullmatch(label)))
    time, unit = next(times, (None, ""))
    # Force_X_1 is FX_1, Tz is Mz
    turned = re.compile(r"(force|moment|torque)[\s_.]*([xyz])|(?<![A-Za-z])(t)([xyz])(?![a-z])", flags=re.IGNORECASE)
    forces = [
        turned.sub(lambda m: ("F" if (m[1] or "").lower() == "force" else "M") + (m[2] or m[4]), x) for x in labels
    ]
    plates = tuple(group for group in channel_groups(forces) if len(group) == 6)
    taken = {time, *chain(*plates)}
    free = [k for k in range(len(labels)) if k not in taken]
    behind = _triples(labels, free, r"(.+?)[\s_.:\-]*([xyz])", 2)
    before = _triples(labels, free, r"([xyz])[\s_.:\-]+(.+?)", 1)
    found, length = max((behind, before), key=lambda notation: len(_with_all_axes(notation[0])))
    markers = _with_all_axes(found)
    broken = tuple(name for name, axes in found.items() if len(axes) == 2)
    used = taken.union(*markers.values())
    others = tuple(label for k, label in enumerate(labels) if k not in used and label)
    return TableColumns(time, unit, markers, length, plates, others, broken)


def _with_all_axes(found: Mapping[str, Mapping[str, int]]) -> dict[str, tuple[int, int, int]]:
    """Return the columns of x, y, z of the markers of which none is missing."""
    return {name: (axes["x"], axes["y"], axes["z"]) for name, axes in found.items() if len(axes) == 3}


def _triples(
    labels: Sequence[str], free: Sequence[int], pattern: str, axis: int
) -> tuple[dict[str, dict[str, int]], str]:
    """Return the columns of each marker by axis, and the unit of length of the labels."""
    found: dict[str, dict[str, int]] = {}
    units = set()
    for k in free:
        if match := re.fullmatch(rf"{pattern}(?:[\s_.]+(mm|cm|m))?", labels[k], flags=re.IGNORECASE):
            found.setdefault(match[3 - axis].strip(), {}).setdefault(match[axis].lower(), k)
            units.add((match[3] or "").lower())
    return found, units.pop() if len(units) == 1 else ""


NAME = "table of markers and forces"
EXTENSIONS = (".csv", ".tsv", ".parquet", ".txt")
PREFERENCE = 40
FOLLOWS_TOLD = True


def sniff(head: bytes) -> bool:
    """Return whether the head is that of a Parquet file, or has labels of a time and of three markers."""
    if is_parquet(head):
        return True
    header = header_of(head_text(head))
    if header is None:
        return False
    columns = columns_in([clean_label(cell)[0] for cell in header[2]])
    return columns.time is not None and len(columns.markers) >= FEWEST_MARKERS


class Load(NamedTuple):
    """What a table holds of one plate: ``columns`` as it calls them, ``value`` (S, 6) N and N·m as written."""

    columns: str
    value: Array


_SECONDS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}


def read(path: Path, *, role: Role, subject: str | None = None, told: Told | None = None) -> Trial:
    """Return the trial of a table with a column of time, three columns a marker and, where there are any, six a plate.

    Lengths and times are in the units of the labels, else in those in which a person has a person's size and the steps
    are those of a camera. Samples at (0, 0, 0) and single-frame jumps are not seen, before anything is resampled.

    Raises
    ------
    FileRefused
        No table, no time, fewer than three markers, a time that does not increase, a marker cloud of no person's size.
    """
    content = read_bytes(path)
    cells = read_cells(content, path)
    columns = columns_in(cells.labels)
    if len(columns.markers) < FEWEST_MARKERS:
        raise FileRefused(
            f"{path}: holds {len(columns.markers)} markers; at least {FEWEST_MARKERS} are needed, each as three "
            f"columns (LASI_x, LASI_y, LASI_z). The columns are {', '.join(cells.labels[:6])} ..."
        )
    stamps, timed = _stamps(cells, columns, path)
    time_axis(stamps, where=str(path))  # refuses stamps that are none
    rows, lengths, turn = _markers(cells, columns, stamps, path)
    instants, arrived = camera_instants(stamps, rows.xyz)
    axis, rows = time_axis(instants, where=str(path)), replace(rows, time=instants)
    axis = replace(axis, stamps=axis.stamps - axis.time[0], time=axis.time - axis.time[0])
    loads, weighed = loads_of(columns.plates, cells.labels, cells.units, cells.values)
    known = recognise(rows.names)
    guess = "" if known else guess_set(rows).name
    worn = read_marker_set(guess) if guess else known
    markers, unseen = resampled(rows.names, rows.xyz, axis)
    plates = table_plates(
        [Load(one.columns, axis.at(one.value)) for one in loads], axis.time, turn, markers, worn, told or Told()
    )
    history = (
        *cells.said,
        *_columns_said(columns),
        *timed,
        *lengths,
        *unseen,
        *([weighed] if weighed else []),
        *([arrived] if arrived else []),
        *_time_said(axis, rows, loads),
        *plates.history,
    )
    rate = plates.plates[0].wrench.rate if plates.plates else math.nan
    source = Source(path, sha256(content), "table", rate=markers.rate, analog_rate=rate)
    warnings = [*([axis.said] if not axis.sampled and axis.said else []), *plates.warnings]
    if columns.broken:
        lacking = (
            f"Of {', '.join(columns.broken)} only two coordinates are there: they were left out. Export all three."
        )
        warnings.insert(0, lacking)
    name = known.name if known else ""
    return Trial(path.stem, role, markers, plates.plates, source, name, history=history, warnings=tuple(warnings))


def _stamps(cells: Cells, columns: TableColumns, path: Path) -> tuple[Array, list[str]]:
    """Return the time of every row in s from the first on, and the sentence about its unit."""
    if columns.time is None:
        raise FileRefused(
            f"{path}: has no column of time. Name it time (in s) or time_ms; the columns are "
            f"{', '.join(cells.labels[:6])} ..."
        )
    raw = cells.values[:, columns.time]
    said = columns.time_unit or cells.units[columns.time]
    unit = re.sub(r"^(sec|second)s?$", "s", said.lower())
    unit = {"msec": "ms", "msecs": "ms", "millisecond": "ms", "milliseconds": "ms", "us": "µs"}.get(unit, unit)
    by = "as its label says"
    if unit not in _SECONDS:
        step = float(np.median(np.diff(raw))) if raw.size > 1 else 0.0
        whole = step >= 1 and bool((raw == np.rint(raw)).all())
        # Up to 1.5 a step is in s, from 0.7 Hz on; up to 1500 in ms, so from 667 Hz down; and so on.
        factors = [1.5 * 1000**k for k in range(3)]
        unit = "ms" if whole and step < factors[0] else list(_SECONDS)[int(np.searchsorted(factors, step))]
        by = f"steps of {step:.4g}"
    label = cells.labels[columns.time]
    return (raw - raw[0]) * _SECONDS[unit], [f"Time: column {label} in {unit} ({by}), counted from its first row."]


def _markers(cells: Cells, columns: TableColumns, stamps: Array, path: Path) -> tuple[Markers, list[str], Array]:
    """Return the markers in m, z up, what was decided, and lab_R_file (3, 3)."""
    names = tuple(columns.markers)
    raw = cells.values[:, np.array([columns.markers[name] for name in names])]
    raw, zeros = unseen_at_origin(raw)
    sides = extents(raw, FEWEST_MARKERS)
    extent = float(np.median(sides.max(axis=1))) if len(sides) else 0.0
    if not extent > 0:
        raise FileRefused(f"{path}: no row shows {FEWEST_MARKERS} markers apart. Check what the columns hold.")
    written = {plain for k in columns.markers.values() for i in k if (plain := cells.units[i].lower())}
    label = columns.length or (written.pop() if len(written) == 1 else "")
    unit = label if label in METRES else likely_unit(extent)
    by = "as the labels say" if label in METRES else f"the markers span {extent:.4g}"
    if not 0.05 <= extent * METRES[unit] <= 50:
        raise FileRefused(
            f"{path}: the markers of one row span {extent * METRES[unit]:.2g} m in {unit}. Correct the unit."
        )
    markers = Markers(names, np.arange(len(stamps), dtype=float), raw * METRES[unit])
    up = axis_to_head(markers, recognise(names))
    if up is None:
        up = np.eye(3)[2 if body_is_tall_along_z(markers.xyz) else 1]
    turn = turn_to(up)
    axis = f"{'+' if up.sum() > 0 else '-'}{'XYZ'[int(np.argmax(np.abs(up)))]}"
    turned = "" if axis == "+Z" else "; everything was turned so that z points up"
    said = [f"Coordinates were read in {unit} ({by}) and turned into m.", f"Up is {axis} in the table{turned}.", *zeros]
    return Markers(names, stamps, markers.xyz @ turn.T), said, turn


def _columns_said(columns: TableColumns) -> list[str]:
    some = list(columns.markers)
    said = [f"{len(some)} markers ({some[0]} ... {some[-1]}), {len(columns.plates)} force plates by their labels."]
    if columns.others:
        more = f" and {len(columns.others) - 6} more" if len(columns.others) > 6 else ""
        said.append(f"Columns that are none of these were left aside: {', '.join(columns.others[:6])}{more}.")
    return said


def _time_said(axis: TimeAxis, markers: Markers, loads: list[Load]) -> list[str]:
    """Return what was decided of the time, and what resampling costs."""
    if not axis.sampled:
        return [axis.said] if axis.said else []
    missed = [f"markers {1000 * axis.missed_by(markers.xyz):.2g} mm"]
    for unit, part in (("forces {:.2g} N", slice(0, 3)), ("moments {:.2g} N·m", slice(3, 6))):
        missed += [unit.format(axis.missed_by(np.hstack([one.value[:, part] for one in loads])))] if loads else []
    cost = (
        f"What that costs at most, as a sample left out is missed by its neighbours (RMS): {', '.join(missed)}; the "
        f"noise of single samples is multiplied by {axis.noise:.2f}."
    )
    return [axis.said, cost]


_PERSON = (50.0, 4000.0)  # N that the mean load on plates can be: a child of 5 kg to 400 kg
_SPELLED = {"n": "N", "kn": "kN", "nm": "N·m", "nmm": "N·mm"}
_UNDER = 0.25  # m between pressure and feet up to which they belong together: a foot's length
_PRESSED = 0.58
"""Share of the way from heel to toe marker at which the pressure of somebody who stands lies: 12 people of 4
laboratories on plates of known place, 13 mm before the middle, sd 13 mm along the feet and 8 mm across.
"""


def loads_of(
    groups: Sequence[tuple[int, ...]], labels: Sequence[str], units: Sequence[str], values: Array
) -> tuple[list[Load], str]:
    """Return the load on every plate in N and N·m, and the sentence that says in which units it was written.

    A unit is that of the labels, else the one in which the load can be a person's and the pressure in a room.
    """
    if not groups:
        return [], ""
    force = plain_unit(next((units[k] for group in groups for k in group[:3] if units[k]), ""))
    moment = plain_unit(next((units[k] for group in groups for k in group[3:] if units[k]), ""))
    by_label = ", as the labels say" if force in FORCE and moment in MOMENT else ""
    total = np.sum([values[:, list(group[:3])] for group in groups], axis=0)
    # The mean force of all plates together is the weight, whichever axis points up.
    size = float(np.linalg.norm(np.nanmean(total, axis=0)))
    if force not in FORCE:
        force = next((unit for unit in ("n", "kn") if _PERSON[0] <= size * FORCE[unit] <= _PERSON[1]), "n")
    if moment not in MOMENT:
        # No pressure lies 20 m from the point of the moments.
        moment = "nmm" if _arm(groups, values) > 20.0 * FORCE[force] else "nm"
    factors = [FORCE[force]] * 3 + [MOMENT[moment]] * 3
    loads = [Load(f"{labels[group[0]]} ... {labels[group[-1]]}", values[:, list(group)] * factors) for group in groups]
    weight = size * FORCE[force]
    return loads, (
        f"Forces were read in {_SPELLED.get(force, force)}, moments in {_SPELLED.get(moment, moment)}{by_label}: the "
        f"mean force is {weight:.0f} N, the weight of {weight / STANDARD_GRAVITY:.1f} kg."
    )


def _arm(groups: Sequence[tuple[int, ...]], values: Array) -> float:
    """Return the median horizontal moment over the force, in the units of the table; 0 without load."""
    moment, force = (
        np.concatenate([np.linalg.norm(values[:, list(group[part])], axis=1) for group in groups])
        for part in (slice(3, 5), slice(0, 3))
    )
    # Where at least a tenth of the largest force acts.
    loaded = force > 0.1 * np.nanmax(force, initial=0.0)
    return float(np.nanmedian(moment[loaded] / force[loaded])) if loaded.any() else 0.0


def table_plates(
    loads: Sequence[Load], time: Array, turn: Array, markers: Markers, worn: MarkerSet | None, told: Told
) -> PlatesRead:
    """Return the plates of a table in the lab frame, ground on subject.

    ``loads`` on ``time`` (T,) s, with the wrench in the axes of the file; ``turn`` (3, 3) lab_R_file; ``markers`` (m,
    z up) of the same table, which may have another time; ``worn`` the marker set; ``told`` what session.toml says of
    the plates, by ``plate1`` ... in the order of the columns.
    """
    said = [told.plates.get(f"plate{number}", NOTHING_TOLD) for number in range(1, len(loads) + 1)]
    history = [f"plate{n} was left out, as session.toml says." for n, one in enumerate(said, 1) if not one.use]
    used = [(n, load, one) for n, (load, one) in enumerate(zip(loads, said, strict=True), 1) if one.use]
    placed = []
    for n, load, one in used:
        if one.corners is not None:
            # along the plate's own axes, about its centre
            turned, zero, zeroed = _zeroed(turned_wrench(load.value, plate_axes(one.corners)), time)
            signed, sign = _upright(turned)
            wrench = Wrench(time, wrench_about_origin(signed, one.corners.mean(axis=0)))
            about = f"Columns {load.columns}, along the plate's own axes and about the centre of its corners."
            decided = (about, zeroed, sign)
            placed.append(Plate(f"plate{n}", 0, one.corners, wrench, decided, zero, columns=load.columns))
    free = [(n, load) for n, load, one in used if one.corners is None]
    if free:
        feet = _feet(markers, worn)
        done = _by_feet(free, time, turn, feet)
        placed += done.plates
        history += done.history
        if done.warnings:
            return PlatesRead(tuple(placed), done.warnings, tuple(history))
    plates = []
    for plate in sorted(placed, key=lambda one: int(one.name.removeprefix("plate"))):
        one = told.plates.get(plate.name, NOTHING_TOLD)
        followed = [f"{one.sentence[0].upper()}{one.sentence[1:]}"] if one.sentence else []
        plates.append(replace(plate, foot=one.foot, decisions=(*plate.decisions, *followed)))
    idle = {name: ", ".join(key for key in one.keys if key in C3D_ONLY) for name, one in told.plates.items()}
    warnings = [
        f"{name}: {keys} of session.toml can be followed in C3D files only." for name, keys in idle.items() if keys
    ]
    return PlatesRead(tuple(plates), tuple(warnings), tuple(history))


def _upright(value: Array) -> tuple[Array, str]:
    """Return the wrench (T, 6) as the ground's action on the subject, and the sentence that says so."""
    if np.nanmean(value[:, 2]) >= 0:
        return value, "Sign: the mean force points up, so the table holds the action of the ground; it was kept."
    return -value, "Sign: the mean force points down, so the table holds the load on the plate; all of it was turned."


def _zeroed(value: Array, time: Array) -> tuple[Array, Array, str]:
    """Return the wrench less what the empty plate reads, that force (3,) N, and the sentence about it."""
    known = np.isfinite(value).all(axis=1)
    if time.size < 2 or not known.all():
        return value, np.zeros(3), "Zero: nothing was subtracted."
    window = find_baseline(value[:, 2], zero=None, rate=1 / float(np.median(np.diff(time))))
    said = re.sub(r"the file names no window \(ZERO is missing\)\. ?", "", window.said)
    if window.stop <= window.start:
        return value, np.zeros(3), said
    reads = value[window.start : window.stop].mean(axis=0)
    return value - reads, reads[:3], said


@dataclass(frozen=True, eq=False)
class _Feet:
    """Where the feet are: ``middle`` (F, 2) m where those on the ground are pressed at ``time`` (F,), NaN while none
    is; ``standing`` (F,) whether both are and the person stands as high as ever.
    """

    time: Array
    middle: Array
    standing: Mask


def _feet(markers: Markers, worn: MarkerSet | None) -> _Feet | None:
    """Return where the feet are by their heels and toes; None where the labels do not tell these."""
    if worn is None:
        return None
    ends = [[landmark(markers, worn, f"{side}_{end}") for end in ("heel", "toe")] for side in SIDES]
    if any(end is None for foot in ends for end in foot):
        return None
    places = np.array(ends, dtype=float)  # (side, end, T, 3)
    down = np.asarray(on_the_ground(places[..., 2]).all(axis=1))  # (side, T)
    both = np.asarray(down.all(axis=0))
    # Between heel and toe, at the share where people press.
    pressed = (1 - _PRESSED) * places[:, 0, :, :2] + _PRESSED * places[:, 1, :, :2]
    foot = np.where(down[..., None], pressed, np.nan)
    # Both down: between them; one down: under it.
    middle = np.where(both[:, None], foot.mean(axis=0), np.where(down[0][:, None], foot[0], foot[1]))
    # The mean of all markers while both feet are down.
    height = np.nanmean(markers.xyz[..., 2], axis=1) if both.any() else np.zeros(both.size)
    return _Feet(markers.time, middle, as_high_as_ever(height, both))


def _pressure(value: Array) -> Array:
    """Return the centre of pressure (T, 2) m about the point of the moments; NaN without load."""
    vertical = value[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        # x = -My / Fz, y = Mx / Fz.
        cop = np.stack([-value[:, 4] / vertical, value[:, 3] / vertical], axis=1)
    return np.where((np.abs(vertical) >= COP_FORCE)[:, None], cop, np.nan)


def _by_feet(free: Sequence[tuple[int, Load]], time: Array, turn: Array, feet: _Feet | None) -> PlatesRead:
    """Return plates of which nobody tells the place, by where the feet are; a warning where these do not tell it."""
    zeroed = [_zeroed(turned_wrench(load.value, turn), time) for _, load in free]
    signed = [_upright(value) for value, _, _ in zeroed]
    total = np.sum([value for value, _ in signed], axis=0)
    # The place is told by the total: which foot is on which plate does not matter.
    shift = None if feet is None else _shift(total, time, feet)
    if shift is None or (np.linalg.norm(shift) > _UNDER and len(free) > 1):
        return PlatesRead(warnings=(_lacking([n for n, _ in free], feet, shift),))
    own = float(np.linalg.norm(shift)) > _UNDER
    at = np.array([*shift, 0.0]) if own else np.zeros(3)
    usual = "Place: the moments are about the lab's origin: the pressures that follow lie under the feet."
    about = _put(shift) if own else usual
    plates, history = [], []
    for (number, load), (value, said), (_, zero, empty) in zip(free, signed, zeroed, strict=True):
        wrench = Wrench(time, wrench_about_origin(value, at))
        cop = wrench.cop()[:, :2]
        if not np.isfinite(cop).any():
            history.append(f"plate{number} ({load.columns}) is never loaded above {COP_FORCE:g} N and was left out.")
            continue
        decisions = (f"Columns {load.columns}, along the axes of the markers.", empty, said, about)
        points = np.concatenate([cop, feet.middle]) if own and feet is not None else cop
        corners = around_pressures(points, 0.0)
        name, put = f"plate{number}", shift if own else None
        plates.append(Plate(name, 0, corners, wrench, decisions, zero, placed=False, columns=load.columns, put=put))
    return PlatesRead(tuple(plates), history=tuple(history))


def _put(shift: Array) -> str:
    """Say where a plate was put by the feet, at ``shift`` (2,) m."""
    return (
        f"Place: the table does not say it. The moments are not about the lab's origin (the pressure would lie "
        f"{np.linalg.norm(shift):.2f} m beside the feet), so they are about the plate's own point, which was put at "
        f"({shift[0]:.3f}, {shift[1]:.3f}, 0) m, where the pressure lies under the feet as people stand: known "
        f"to 13 mm. Give corners_m in [plates.plate1] of session.toml to know it better."
    )


def _shift(total: Array, time: Array, feet: _Feet) -> Array | None:
    """Return the median (2,) m by which loaded feet on the ground lie beside the pressure; None without any."""
    known = np.isfinite(_pressure(total)).all(axis=1)
    if known.sum() < 1:
        return None
    pressure = np.stack([np.interp(feet.time, time[known], axis[known]) for axis in _pressure(total).T], axis=1)
    beside = feet.middle - pressure
    told = np.isfinite(beside).all(axis=1)
    best = told & feet.standing if (told & feet.standing).any() else told
    return np.asarray(np.median(beside[best], axis=0)) if best.any() else None


def _lacking(numbers: Sequence[int], feet: _Feet | None, shift: Array | None) -> str:
    """Say why plates of a table cannot be placed, and what to write."""
    names = ", ".join(f"plate{n}" for n in numbers)
    if feet is None:
        why = "no heels and toes are known among the markers that could show it"
    elif shift is None:
        why = "nobody stands on them with a foot on the ground"
    else:
        why = (
            f"with moments about the lab's origin the pressure lies {np.linalg.norm(shift):.2f} m beside the feet, and "
            f"of several plates these do not tell which is where"
        )
    tables = " ".join(
        f"[plates.plate{n}] corners_m = [[x, y, 0], [x, y, 0], [x, y, 0], [x, y, 0]]" for n in numbers[:2]
    )
    return (
        f"The table does not say where {names} lie{'s' * (len(numbers) == 1)}, and {why}: no force was read. Write the "
        f"corners in m in the lab frame, in the order +x+y, -x+y, -x-y, +x-y of the plate's axes, into session.toml: "
        f"{tables}."
    )

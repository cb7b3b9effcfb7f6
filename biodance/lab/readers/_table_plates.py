"""The plates of a table: forces and moments in N and N·m, and where they are.

The point of pressure, where the table has it, says about which point the moments are; else what session.toml says, else
the feet.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.markers.sets import MarkerSet, landmark
from biodance.lab.markers.time_axis import TimeAxis
from biodance.lab.markers.upright import METRES, as_high_as_ever, on_the_ground
from biodance.lab.plates import C3D_ONLY, FORCE, MOMENT, NOTHING_TOLD, Told, plain_unit
from biodance.lab.plates.decode import around_pressures, find_baseline, plate_axes
from biodance.lab.plates.read import PlatesRead
from biodance.records import SIDES, Array, Markers, Mask, Plate, Wrench
from biodance.settings import COP_FORCE, STANDARD_GRAVITY
from biodance.spatial import turned_wrench, wrench_about_origin


class Load(NamedTuple):
    """What a table holds of one plate: ``columns`` as it calls them, ``value`` (S, 6) N and N·m as written; where it
    says them, its points of ``pressure`` (S, 3) m. With ``corners`` (4, 3) m in the axes of the file both are along the
    plate's own axes, from the centre of these.
    """

    columns: str
    value: Array
    pressure: Array | None = None
    corners: Array | None = None

    def at(self, clock: TimeAxis) -> "Load":
        """Return the load at the equal steps of its clock."""
        pressure = None if self.pressure is None else clock.at(self.pressure)
        return self._replace(value=clock.at(self.value), pressure=pressure)


_PERSON = (50.0, 4000.0)  # N that the mean load on plates can be: a child of 5 kg to 400 kg
_SPELLED = {"n": "N", "kn": "kN", "nm": "N·m", "nmm": "N·mm"}
_UNDER = 0.25  # m between pressure and feet up to which they belong together: a foot's length
_PRESSED = 0.58
"""Share of the way from heel to toe marker at which the pressure of somebody who stands lies: 12 people of 4
laboratories on plates of known place, 13 mm before the middle, sd 13 mm along the feet and 8 mm across.
"""


def corners_of(above: Mapping[str, Sequence[str]], path: Path) -> Array | None:
    """Return the corners (4, 3) m of a plate of Qualisys QTM whose axes are its own; None for those of the lab."""
    frame = " ".join(above.get("DESCRIPTION", ())).lower()
    if above.get("DATA_INCLUDED") != ["Force"] or re.search("world|lab", frame):
        return None
    if "local" not in frame:
        raise FileRefused(f"{path}: the forces beside it do not say along which axes (DESCRIPTION). Export them again.")
    places = ("POSX_POSY", "NEGX_POSY", "NEGX_NEGY", "POSX_NEGY")
    rows = [[above[f"FORCE_PLATE_CORNER_{place}_{axis}"][0] for axis in "XYZ"] for place in places]
    return np.array(rows, dtype=float) * METRES["mm"]


def loads_of(
    groups: Sequence[tuple[int, ...]],
    labels: Sequence[str],
    units: Sequence[str],
    values: Array,
    corners: Array | None = None,
) -> tuple[list[Load], str]:
    """Return the load on every plate in N and N·m, and the sentence that says in which units it was written.

    A unit is that of the labels, else the one in which the load can be a person's and the pressure in a room.
    ``groups`` are the columns Fx Fy Fz Mx My Mz of each plate and, where they are there, of its point of pressure.
    """
    if not groups:
        return [], ""
    force = plain_unit(next((units[k] for group in groups for k in group[:3] if units[k]), ""))
    moment = plain_unit(next((units[k] for group in groups for k in group[3:6] if units[k]), ""))
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
    loads = [
        Load(
            f"{labels[group[0]]} ... {labels[group[5]]}",
            values[:, list(group[:6])] * factors,
            _metres(values[:, list(group[6:])], units[group[6]]) if group[6:] else None,
            corners,
        )
        for group in groups
    ]
    weight = size * FORCE[force]
    return loads, (
        f"Forces were read in {_SPELLED.get(force, force)}, moments in {_SPELLED.get(moment, moment)}{by_label}: the "
        f"mean force is {weight:.0f} N, the weight of {weight / STANDARD_GRAVITY:.1f} kg."
    )


def _metres(points: Array, unit: str) -> Array:
    """Return points of pressure in m: in the ``unit`` said, else mm where they would lie 20 m away."""
    far = float(np.nanmax(np.abs(points), initial=0.0)) > 20.0
    return points * METRES.get(unit.lower(), METRES["mm"] if far else 1.0)


def _arm(groups: Sequence[tuple[int, ...]], values: Array) -> float:
    """Return the median horizontal moment over the force, in the units of the table; 0 without load."""
    moment, force = (
        np.concatenate([np.linalg.norm(values[:, list(group[part])], axis=1) for group in groups])
        for part in (slice(3, 5), slice(0, 3))
    )
    # Where at least a tenth of the largest force acts.
    loaded = force > 0.1 * np.nanmax(force, initial=0.0)
    return float(np.nanmedian(moment[loaded] / force[loaded])) if loaded.any() else 0.0


@dataclass(frozen=True, eq=False)
class _Feet:
    """Where the feet are: ``middle`` (F, 2) m where those on the ground are pressed at ``time`` (F,), NaN while none
    is; ``standing`` (F,) whether both are and the person stands as high as ever; ``ends`` (F, 4, 2) m heels and toes.
    """

    time: Array
    middle: Array
    standing: Mask
    ends: Array


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
    feet = _feet(markers, worn)
    pressed = _all_pressed({n: load for n, load, _ in used if load.pressure is not None}, time, turn, feet)
    known = {n: _of_known_place(n, load, time, turn, one.corners, pressed.get(n)) for n, load, one in used}
    free = [(n, load) for n, load, _ in used if known[n] is None]
    done = _by_feet(free, time, turn, feet) if free else PlatesRead()
    parts = [*filter(None, known.values()), done]
    placed = tuple(chain(*(one.plates for one in parts)))
    doubts = tuple(chain(*(one.warnings for one in parts)))
    history += chain(*(one.history for one in parts))
    if done.warnings:
        return PlatesRead(placed, doubts, tuple(history))
    plates, idle = _followed(placed, told)
    return PlatesRead(plates, (*doubts, *idle), tuple(history))


def _followed(placed: Sequence[Plate], told: Told) -> tuple[tuple[Plate, ...], list[str]]:
    """Return the plates in order with the feet that session.toml says, and what of it cannot be followed."""
    plates = []
    for plate in sorted(placed, key=lambda one: int(one.name.removeprefix("plate"))):
        one = told.plates.get(plate.name, NOTHING_TOLD)
        followed = [f"{one.sentence[0].upper()}{one.sentence[1:]}"] if one.sentence else []
        plates.append(replace(plate, foot=one.foot, decisions=(*plate.decisions, *followed)))
    idle = {name: ", ".join(key for key in one.keys if key in C3D_ONLY) for name, one in told.plates.items()}
    return tuple(plates), [
        f"{name}: {keys} of session.toml can be followed in C3D files only." for name, keys in idle.items() if keys
    ]


def _of_known_place(
    n: int, load: Load, time: Array, turn: Array, told: Array | None, found: "_Pressed | str | None"
) -> PlatesRead | None:
    """Return plate ``n`` by its points of pressure, as ``found`` or why they cannot be used, else by corners that
    session.toml has ``told`` or its file says; None without either.
    """
    corners = told if told is not None or load.corners is None else load.corners @ turn.T
    name = f"plate{n} ({load.columns})"
    if isinstance(found, _Pressed) and found.loaded.any():
        around = around_pressures(found.points, float(np.median(found.points[:, 2])))
        plate = _plate(n, load, time, found.value, found.point, found.said, around if corners is None else corners)
        return PlatesRead((replace(plate, placed=corners is not None),))
    if corners is not None and (told is not None or not isinstance(found, str)):
        value, along = turned_wrench(load.value, plate_axes(corners)), "along the plate's own axes and about the centre"
        return PlatesRead((_plate(n, load, time, value, corners.mean(axis=0), f"{along} of its corners", corners),))
    if isinstance(found, _Pressed):
        return PlatesRead(history=(f"{name} is never loaded above {COP_FORCE:g} N and was left out.",))
    if not found:
        return None
    doubt = (
        f"{name} was left out: the points of pressure beside it {found}. Export all in the frame of the laboratory, "
    )
    return PlatesRead(warnings=(f"{doubt}or the C3D file.",))


def _plate(number: int, load: Load, time: Array, value: Array, point: Array, along: str, corners: Array) -> Plate:
    """Return a plate of known place of which ``value`` (T, 6) in the lab frame is about a ``point``."""
    value, zero, zeroed = _zeroed(value, time)
    signed, sign = _upright(value)
    wrench = Wrench(time, wrench_about_origin(signed, point))
    decided = (f"Columns {load.columns}, {along}.", zeroed, sign)
    return Plate(f"plate{number}", 0, corners, wrench, decided, zero, columns=load.columns)


_OFF = (0.001, 0.1)
"""m, and share of their travel, by which written points of pressure may lie beside those that follow (RMS): rounding,
and a sign or an axis that is wrong moves them by twice their travel.
"""


class _Pressed(NamedTuple):
    """A load (T, 6) in the lab frame, where it is ``loaded`` (T,), and the ``points`` (n, 3) m of pressure there; the
    ``point`` (3,) or (T, 3) m that its moments are about, which was found as is ``said``.
    """

    value: Array
    loaded: Mask
    points: Array
    point: Array
    said: str


def _pressed(load: Load, turn: Array) -> _Pressed | str:
    """Return which point moments are about by the points of pressure beside them; where these do not fit, that.

    About a point of pressure c a load has no horizontal moment: M + (p - c) x F is vertical, where p is the point of
    the moments M. That is linear in p, and the mean height of the pressures is its height where nothing tells it.
    """
    assert load.pressure is not None
    own = None if load.corners is None else load.corners @ turn.T
    axes, origin = (turn, np.zeros(3)) if own is None else (plate_axes(own), own.mean(axis=0))
    value, points = turned_wrench(load.value, axes), origin + load.pressure @ axes.T
    on = np.isfinite(value).all(axis=1) & np.isfinite(points).all(axis=1) & (np.abs(value[:, 2]) >= COP_FORCE)
    if not on.any():
        return _Pressed(value, on, points[on], origin, "")
    (fx, fy, fz, mx, my, _), c = value[on].T, points[on]
    middle, none = np.median(c, axis=0), np.zeros(fz.size)
    moment = np.concatenate([mx, my]) - np.cross(c, value[on, :3])[:, :2].T.ravel()
    rows = np.vstack([np.column_stack([none, fz, -fy]), np.column_stack([-fz, none, fx])])
    # as of one newton that shears each sample
    weak = np.sqrt(fz.size) * np.array([0.0, 0.0, 1.0])
    point = np.linalg.lstsq(np.vstack([rows, weak]), np.append(-moment, weak[2] * middle[2]), rcond=None)[0]
    size = float(np.sqrt((fz**2).mean()))
    off, free = (float(np.sqrt(2 * (one**2).mean())) / size for one in (moment + rows @ point, np.append(mx, my)))
    travel = float(np.sqrt(((c - middle)[:, :2] ** 2).sum(axis=1).mean()))
    if min(off, free) > max(_OFF[0], _OFF[1] * travel):
        return "do not follow from its force and moment along the axes of the markers"
    along = "the axes of the markers" if own is None else "the plate's own axes"
    where = "({:.3f}, {:.3f}, {:.3f}) m".format(*point) if off <= free else "of each pressure"
    said = (
        f"along {along} and about the point {where}, as the points of pressure beside them say (to "
        f"{1000 * min(off, free):.2g} mm RMS)"
    )
    return _Pressed(value, on, c, point if off <= free else np.where(on[:, None], points, middle), said)


def _all_pressed(
    loads: Mapping[int, Load], time: Array, turn: Array, feet: _Feet | None
) -> Mapping[int, _Pressed | str]:
    """Return what the points of pressure say of each plate; that they cannot be used where one lies beside the feet."""
    pressed = {n: _pressed(load, turn) for n, load in loads.items()}
    far = 0.0
    for one in pressed.values():
        if feet is not None and isinstance(one, _Pressed):
            frame = np.clip(np.searchsorted(feet.time, time[one.loaded]), 0, feet.time.size - 1)
            away = np.linalg.norm(feet.ends[frame] - one.points[:, None, :2], axis=2).min(axis=1)
            known = np.isfinite(away) & (np.abs(one.value[one.loaded, 2]) >= _PERSON[0])
            far = max(far, float(np.median(away[known])) if known.any() else 0.0)
    if far <= _UNDER:
        return pressed
    why = f"lie {far:.2f} m beside the feet, so in another frame than the markers"
    # The feet tell where a single plate is.
    return dict.fromkeys(pressed, why) if len(pressed) > 1 else {}


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
    ends_on_floor = places[..., :2].reshape(4, -1, 2).swapaxes(0, 1)
    return _Feet(markers.time, middle, as_high_as_ever(height, both), ends_on_floor)


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

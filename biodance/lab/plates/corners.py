"""The outline of a force plate: whether it is one, which way its axes point, what the analyst says of it
(``[plates.NAME]`` in session.toml, before what the file says), and one place for all trials.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from biodance.errors import TrialRefused
from biodance.records import Array, Plate, Trial, Wrench, grouped
from biodance.records.attention import Doubt
from biodance.spatial import wrench_about_origin, wrench_about_point

SHORTEST_SIDE, LONGEST_SIDE = 0.2, 2.0  # m
_NOT_CLOSED, _CROOKED = 0.02, 0.005  # m: refused from here on; worth a sentence from here on
_UNEVEN = 0.1  # share of the shortest side by which a rectangle may miss its closure
_STEEPEST = 0.7  # the plate's normal must have at least this vertical share (45 degrees)
_SWAPS = {(0, 1, 3, 2): "3 and 4 (or 1 and 2)", (0, 2, 1, 3): "2 and 3 (or 1 and 4)"}
_UNITS = {"m": 1.0, "mm": 0.001}
_FOOT = 0.15  # m that a foot reaches beyond its markers and centres of pressure


def corners_in_lab(corners: Array, *, metres: float, turn: Array) -> tuple[Array, tuple[str, ...]]:
    """Return the corners (4, 3) in m in the lab frame after checking that they are a lying rectangle of 0.2-2 m, and
    what was decided.

    ``corners`` in file units and axes, ``metres`` the file's length unit in m, ``turn`` (3, 3) from file axes to the
    lab. Corners that have an impossible size in the file's unit are taken as m or mm where that gives a legal one.

    Raises
    ------
    TrialRefused
        The corners are garbage, out of order (a bow-tie), no rectangle, of impossible size, or the surface is steeper
        than 45 degrees.
    """
    if not np.isfinite(corners).all() or np.abs(corners).max() > 1e6:
        raise TrialRefused(
            f"CORNERS hold values up to {np.abs(corners).max():.3g}, which is no place in a laboratory. Enter the "
            f"corners again."
        )
    if np.ptp(corners, axis=0).max() == 0:
        raise TrialRefused(f"all four CORNERS are {_point(corners[0])}. Enter the corners in the lab frame.")
    unit, decisions = _unit(corners, metres)
    lab = corners @ turn.T * unit
    _refuse_disorder(lab)
    _refuse_size(lab, corners)
    gap, skew = _gap(lab), _skew(lab)
    if gap > _NOT_CLOSED or skew > _NOT_CLOSED:
        raise TrialRefused(
            f"CORNERS are no rectangle: opposite sides differ by {1000 * gap:.0f} mm and the angles by "
            f"{1000 * skew:.0f} mm at a side's end (legal: {1000 * _NOT_CLOSED:.0f} mm). Measure the corners again."
        )
    if gap > _CROOKED or skew > _CROOKED:
        decisions.append(
            f"CORNERS deviate from a rectangle by {1000 * max(gap, skew):.0f} mm; the best-fitting axes were used."
        )
    axes = plate_axes(lab)
    if abs(axes[2, 2]) < _STEEPEST:
        raise TrialRefused(
            f"CORNERS make a surface {np.degrees(np.arccos(abs(axes[2, 2]))):.0f} degrees steep (legal: up to 45). "
            "Check corners and lab axes."
        )
    return lab, tuple(decisions)


def is_rectangle(corners: Array) -> bool:
    """Return whether corners (4, 3), in any unit and axes, make a closed rectangle with sides of similar length."""
    if not np.isfinite(corners).all():
        return False
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(sides, axis=1)
    if not lengths.min() * LONGEST_SIDE > SHORTEST_SIDE * lengths.max() > 0 or sides[0] @ sides[2] >= 0:
        return False
    return max(_gap(corners), _skew(corners)) < _UNEVEN * float(lengths.min())


def plate_axes(corners: Array) -> Array:
    """Return lab_R_plate (3, 3) from corners (4, 3) in the order +x+y, -x+y, -x-y, +x-y of the plate axes.

    x and y are the mean directions of opposite sides, made orthogonal without preferring one; z = x × y (it points down
    on most plates).
    """
    x, y = _along_sides(corners)
    # Polar factor U V' of the two directions: the nearest orthonormal pair, both turned alike.
    u, _, v = np.linalg.svd(np.column_stack([x / np.linalg.norm(x), y / np.linalg.norm(y)]), full_matrices=False)
    x, y = (u @ v).T
    return np.column_stack([x, y, np.cross(x, y)])


def _along_sides(corners: Array) -> Array:
    """Return (2, 3) m twice the mean opposite sides, along the plate's x and y."""
    a, b, c, d = corners
    return np.array([a + d - b - c, a + b - c - d])


def half_sides(corners: Array) -> Array:
    """Return half the side lengths (2,) m along the plate's x and y."""
    # Twice the mean side, and half of that: a quarter.
    return np.linalg.norm(_along_sides(corners), axis=1) / 4


def around_pressures(points: Array, height: float) -> Array:
    """Return the corners (4, 3) m around ``points`` (n, 2 or more) m with room for a foot, at a ``height`` m;
    counter-clockwise seen from above.
    """
    (x0, y0), (x1, y1) = np.nanmin(points, axis=0)[:2] - _FOOT, np.nanmax(points, axis=0)[:2] + _FOOT
    return np.array([[x1, y1, height], [x0, y1, height], [x0, y0, height], [x1, y0, height]])


def _unit(corners: Array, metres: float) -> tuple[float, list[str]]:
    """Return the metres per unit of the corners: the file's own, or m or mm where only that gives a legal size."""
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    fits = [
        name
        for name, unit in _UNITS.items()
        if unit * sides.min() >= SHORTEST_SIDE and unit * sides.max() <= LONGEST_SIDE
    ]
    if any(np.isclose(_UNITS[name], metres) for name in fits) or len(fits) != 1:
        return metres, []
    said = (
        f"CORNERS would be {sides.max() * metres:.4g} m long in the file's unit; they were taken as {fits[0]}, the "
        "only unit that fits a plate."
    )
    return _UNITS[fits[0]], [said]


def _refuse_disorder(lab: Array) -> None:
    """Refuse four corners whose sides cross."""
    sides = lab - np.roll(lab, -1, axis=0)
    if sides[0] @ sides[2] < 0 and sides[1] @ sides[3] < 0:
        return
    for order, which in _SWAPS.items():
        if _gap(lab[list(order)]) < _NOT_CLOSED:
            raise TrialRefused(
                f"CORNERS are out of order: the outline is a bow-tie; corners {which} are exchanged. The legal order "
                "is +x+y, -x+y, -x-y, +x-y of the plate axes. Correct FORCE_PLATFORM:CORNERS."
            )
    raise TrialRefused(
        f"CORNERS {', '.join(_point(p) for p in lab)} m are no rectangle: the outline crosses itself. Enter the "
        "corners in the order +x+y, -x+y, -x-y, +x-y of the plate axes."
    )


def _refuse_size(lab: Array, corners: Array) -> None:
    sides = np.linalg.norm(lab - np.roll(lab, -1, axis=0), axis=1)
    if sides.min() < SHORTEST_SIDE or sides.max() > LONGEST_SIDE:
        raise TrialRefused(
            f"CORNERS make a plate of {sides[:2].min():.3g} x {sides[:2].max():.3g} m (first corner as written: "
            f"{_point(corners[0])}); legal are sides of {SHORTEST_SIDE:g} to {LONGEST_SIDE:g} m. Check CORNERS and "
            "POINT:UNITS."
        )


def _gap(corners: Array) -> float:
    """Return by how much opposite sides differ."""
    return float(np.linalg.norm(corners[0] - corners[1] + corners[2] - corners[3]))


def _skew(lab: Array) -> float:
    """Return how far the end of a side is off at most, m, because the angle at its corner is not a right one."""
    sides = np.roll(lab, -1, axis=0) - lab
    lengths = np.linalg.norm(sides, axis=1)
    cosines = np.abs(np.sum(sides * np.roll(sides, -1, axis=0), axis=1)) / (lengths * np.roll(lengths, -1))
    return float((cosines * np.minimum(lengths, np.roll(lengths, -1))).max())


def _point(p: Array) -> str:
    return "(" + ", ".join(f"{c:.4g}" for c in p) + ")"


C3D_ONLY = ("type", "channels", "sensitivity", "origin_m")
"""What of a plate only a reader of its channels can follow."""


@dataclass(frozen=True, eq=False)
class ToldPlate:
    """What is said of one plate; None = nothing, the file decides.

    ``corners`` (4, 3) m in the lab frame (z up, as `inspect` shows them), in the order +x+y, -x+y, -x-y, +x-y of the
    plate axes; ``type`` of the C3D standard; ``channels`` labels, or numbers from 1; ``sensitivity`` (rows, channels)
    N and N·m per unit of a channel as the file gives it; ``origin`` (3,) m from the sensor to the centre of the
    surface, plate axes; ``foot`` that stands on it, "" = as the markers show; ``use`` False leaves the plate out.
    """

    corners: Array | None = None
    type: int | None = None
    channels: tuple[str | int, ...] | None = None
    sensitivity: Array | None = None
    origin: Array | None = None
    foot: str = ""
    use: bool = True

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of session.toml that say something of what the plate measures and where."""
        said = {
            "corners_m": self.corners,
            "type": self.type,
            "channels": self.channels,
            "sensitivity": self.sensitivity,
            "origin_m": self.origin,
            "foot": self.foot or None,
        }
        return tuple(key for key, value in said.items() if value is not None)

    @property
    def sentence(self) -> str:
        """What is taken from session.toml, for the history; "" for nothing."""
        return f"{', '.join(self.keys)} as session.toml says." if self.keys else ""


NOTHING_TOLD = ToldPlate()


@dataclass(frozen=True, eq=False)
class Told:
    """What the analyst says to readers of forces: ``plates`` by name, declared body ``mass`` kg or None."""

    plates: Mapping[str, ToldPlate] = field(default_factory=lambda: MappingProxyType({}))
    mass: float | None = None


def as_told(trial: Trial, told: Told) -> Trial:
    """Return a trial of a format whose plates come as wrenches (text, AMTI) with what the analyst says of them.

    A plate of unknown place gets its corners; one that was placed in a frame of its own is moved there with what it
    measured. What only the channels of a C3D file can follow is named in a warning.
    """
    plates, history, warnings = [], [], []
    for plate in trial.plates:
        said = told.plates.get(plate.name, NOTHING_TOLD)
        if not said.use:
            history.append(f"{plate.name} was left out, as session.toml says.")
            continue
        idle = [key for key in said.keys if key in C3D_ONLY]
        if idle:
            warnings.append(f"{plate.name}: {', '.join(idle)} of session.toml can be followed in C3D files only.")
        done = plate if said.corners is None else _placed(plate, said.corners)
        if used := ", ".join(key for key in said.keys if key not in idle):
            taken = f"{used} as session.toml says."
            done = replace(done, foot=said.foot, decisions=(*done.decisions, f"{taken[0].upper()}{taken[1:]}"))
            history.append(f"{plate.name}: {taken}")
        plates.append(done)
    history, warnings = [*trial.history, *history], [*trial.warnings, *warnings]
    return replace(trial, plates=tuple(plates), history=tuple(history), warnings=tuple(warnings))


def _placed(plate: Plate, corners: Array) -> Plate:
    """Return the plate at ``corners`` (4, 3) m."""
    if not plate.placed:
        return replace(plate, corners=corners, placed=True)
    turn = plate_axes(corners) @ plate_axes(plate.corners).T
    local = wrench_about_point(plate.wrench.value, plate.centre)
    # Both vectors turn about the plate's own centre.
    turned = np.hstack([local[:, :3] @ turn.T, local[:, 3:] @ turn.T])
    wrench = Wrench(plate.wrench.time, wrench_about_origin(turned, corners.mean(axis=0)))
    return replace(plate, corners=corners, wrench=wrench, zero=turn @ plate.zero)


_MOVED = 0.05
"""m between two trials from which on the plate was another one, or moved: nearly three times what the feet
leave open in two (0.013 m each)."""


def one_place(trials: Sequence[Trial]) -> tuple[list[Trial], list[str]]:
    """Return the trials with every plate that was put by the feet (``Plate.put``) at the median of what they say, and
    notes: a plate does not move between the trials of one visit, while people lean otherwise in each.
    """
    plates = (plate for trial in trials for plate in trial.plates)
    puts = grouped((plate.name, plate.put) for plate in plates if plate.put is not None)
    place, notes = {}, list[str]()
    for name, found in puts.items():
        apart = float(np.ptp(found, axis=0).max())
        if apart > _MOVED:
            notes.append(
                Doubt(
                    f"{name} would lie up to {1000 * apart:.0f} mm elsewhere in another trial by where the feet stand: "
                    "each trial keeps its own place",
                    f"Give corners_m in [plates.{name}] of session.toml.",
                )
            )
        elif len(found) > 1:
            place[name] = np.median(found, axis=0)
            x, y = place[name]
            notes.append(
                f"{name} was put at ({x:.3f}, {y:.3f}, 0) m in all trials, the median of what the feet of "
                f"{len(found)} say, which are up to {1000 * apart:.0f} mm apart."
            )
    return [replace(trial, plates=tuple(_moved(plate, place) for plate in trial.plates)) for trial in trials], notes


def _moved(plate: Plate, place: dict[str, Array]) -> Plate:
    """Return the plate, with its wrench, at its ``place``."""
    if plate.put is None or plate.name not in place:
        return plate
    shift = np.array([*(place[plate.name] - plate.put), 0.0])
    wrench = Wrench(plate.wrench.time, wrench_about_origin(plate.wrench.value, shift))
    return replace(plate, corners=plate.corners + shift, wrench=wrench, put=place[plate.name])

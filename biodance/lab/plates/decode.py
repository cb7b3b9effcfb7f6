"""One force plate from its raw channels to the wrench about its sensor, in the order in which it happens: corners,
origin, gaps, units, zero, wrench. In plate axes and with the recorded sign; `sense` decides the directions. At the end
its outline: whether it is a plate, and which way its axes point.

Sources: C3D user guide, FORCE_PLATFORM (TYPE 1-4, ORIGIN, CAL_MATRIX, ZERO); Visual3D documentation, force platform
types 5-7; Kistler 9287 manual (moments of an eight-channel plate).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from biodance.errors import TrialRefused
from biodance.lab.c3d.raw import RawC3d
from biodance.lab.plates import PLATE_TYPES, PlateParameters, PlateType
from biodance.records import Array, Mask, runs
from biodance.settings import TOUCH_FORCE

DEEPEST = 0.3  # m, no sensor lies farther below the surface
EDGE = 0.02  # m by which a sensor or a centre of pressure may lie beyond the edge
FARTHEST_PRESSURE = 1.5  # m: a centre of pressure farther away has no meaning
_NEAR = 20.0  # N, readings this close to the unloaded end of the trial belong to it
_SMALL = 30.0  # N, an offset that needs no further proof
_FLAT = 5.0  # N, spread of the block means up to which a plate counts as quiet
LARGEST_SHARE = 1 / 3  # an offset of the sign of a load must stay below this share of the trial's range
SHORTEST_SIDE, LONGEST_SIDE = 0.2, 2.0  # m
_NOT_CLOSED, _CROOKED = 0.02, 0.005  # m: refused from here on; worth a sentence from here on
FOOT_HEIGHT = 0.15  # m above the surface: markers of a standing foot, ankle included


@dataclass(frozen=True, eq=False)
class PlateReading:
    """A plate whose directions are not yet decided.

    ``plate`` what the file says; ``corners`` (4, 3) m in the lab frame; ``axes`` lab_R_plate (3, 3); ``half`` the sides
    (2,) m along the plate's x and y; ``sensor`` (S, 6) N, N·m about the sensor, plate axes, sign as recorded, zero
    taken off; ``vector`` (3,) m from the sensor to the centre of the surface, plate axes, as the file says; ``rate`` Hz
    of the samples; ``empty`` (3,) N that the empty plate read and that was subtracted, plate axes, sign as recorded;
    ``known`` (S,) False where a channel holds no number: ``sensor`` then keeps the nearest known sample, for decisions
    only; ``decisions`` what was decided, by the step (told, corners, origin, units, gaps, load, zero), in this order;
    ``warnings`` what a person should look at, beside odd corners, origins, gaps.
    """

    plate: PlateParameters
    corners: Array
    axes: Array
    half: Array
    sensor: Array
    vector: Array
    rate: float
    empty: Array
    known: Mask
    decisions: Mapping[str, tuple[str, ...]]
    warnings: tuple[str, ...] = ()

    @property
    def loaded(self) -> Mask:
        """The samples (S,) at which somebody is on the plate (`loaded_samples`)."""
        return loaded_samples(self.sensor, self.rate)

    def under(self, xyz: Array) -> Mask:
        """Return (...,) which markers ``xyz`` (..., 3) m are as low as those of a standing foot, and over the plate or
        no more than 0.05 m beside it: so far a sole reaches beyond its markers.
        """
        away = xyz - self.corners.mean(axis=0)
        # Rows are vectors: v @ axes is axes'v, in the plate's axes.
        over = (np.abs((away @ self.axes)[..., :2]) <= self.half + 0.05).all(axis=-1)
        return np.asarray(over & (np.abs(away[..., 2]) <= FOOT_HEIGHT))


def _origin(plate: PlateParameters, half: Array, metres: float) -> tuple[Array, tuple[str, ...]]:
    """Return ORIGIN (3,) in m, in the unit that makes sense, and what was decided."""
    four = PLATE_TYPES[plate.type].four_sensors
    fits = []
    for unit in dict.fromkeys((metres, 0.001, 1.0)):
        x, y, depth = np.abs(plate.origin * unit)
        # Four sensors lie inside the outline and 0.1 m apart; one may lie beside it, as treadmills have it, by 2 m.
        beside = np.array([x, y])
        inside = bool((beside >= 0.05).all() and (beside <= half + EDGE).all())
        if depth <= DEEPEST and max(x, y) <= 2.0 and (inside or not four):
            fits.append(unit)
    if fits and fits[0] == metres:
        return plate.origin * metres, ()
    written = ", ".join(f"{c:.4g}" for c in plate.origin)
    if len(fits) == 1:
        said = f"ORIGIN ({written}) makes no sense in the file's unit and was taken in units of {fits[0]:g} m."
        return plate.origin * fits[0], (said,)
    legal = "half distances of the sensors inside the plate, then the depth" if four else "sensor to surface centre"
    raise TrialRefused(
        f"ORIGIN is ({written}) in units of {metres:g} m, which no plate of {2 * half[0]:.2f} x {2 * half[1]:.2f} m "
        f"has (legal: {legal}, depth up to {DEEPEST:g} m). Enter the values of the maker's sheet."
    )


def decode_plate(raw: RawC3d, plate: PlateParameters, metres: float, turn: Array) -> PlateReading:
    """Return the reading of one plate; TrialRefused where corners or ORIGIN make no sense, or no sample is known."""
    kind = PLATE_TYPES[plate.type]
    corners, corners_said = corners_in_lab(plate.corners, metres=metres, turn=turn)
    half = np.linalg.norm(_along_sides(corners), axis=1) / 4  # of twice the mean sides
    origin, origin_said = _origin(plate, half, metres)

    def in_si(samples: Array) -> Array:
        # Calibration @ channels, sample by sample as rows.
        output = samples if plate.calibration is None else samples @ plate.calibration.T
        return output * plate.factors

    # A point on the surface, or four sensors around the axis: only x, y or only z leads to the centre.
    used = [False, False, True] if kind.four_sensors else [True, True, not kind.on_surface]
    vector = np.where(used, origin, 0.0)
    channels, known, gaps_said = _without_gaps(np.asarray(raw.analog[:, plate.channels], dtype=float), plate)
    vertical = in_si(channels)[:, kind.vertical].sum(axis=1)
    zero = find_baseline(vertical, zero=plate.zero, rate=raw.analog_rate)
    offsets = np.zeros(channels.shape[1])
    if zero.stop > zero.start:
        offsets = channels[zero.start : zero.stop].mean(axis=0)
        if kind.on_surface:  # where an empty plate is pressed has no zero
            offsets = np.where([what == "L" for what in kind.content], 0.0, offsets)
    sensor = sensor_wrench(kind, in_si(channels - offsets), origin)
    empty = sensor_wrench(kind, in_si(offsets[None]), origin)[0, :3]
    first = f"TYPE {plate.type}, analog channels {', '.join(str(c + 1) for c in plate.channels)}."
    told = tuple(f"{said[0].upper()}{said[1:]}" for said in (plate.told.sentence,) if said)
    said = {"told": (first, *told), "corners": corners_said, "origin": origin_said, "units": plate.units_said}
    said |= {"gaps": gaps_said, "load": (), "zero": (zero.said,)}
    axes = plate_axes(corners)
    return PlateReading(plate, corners, axes, half, sensor, vector, raw.analog_rate, empty, known, said)


def _without_gaps(channels: Array, plate: PlateParameters) -> tuple[Array, Mask, tuple[str, ...]]:
    """Return the channels with the nearest known sample in gaps, where all are known, and what was masked."""
    known = np.asarray(np.isfinite(channels).all(axis=1))
    if known.all():
        return channels, known, ()
    sample, column = np.argwhere(np.logical_not(np.isfinite(channels)))[0]
    where = f"analog channel {plate.channels[column] + 1} is not a number at sample {sample + 1}"
    if not known.any():
        raise TrialRefused(
            f"{where}, and no sample of the plate is whole. Check the channel in the recording software."
        )
    whole = np.flatnonzero(known)
    # Middles between known samples are the borders of their neighbourhoods.
    nearest = np.searchsorted((whole[1:] + whole[:-1]) / 2, np.arange(known.size))
    said = f"{int((~known).sum())} of {known.size} samples are unknown, the first: {where}; they are masked."
    return channels[whole[nearest]], known, (said,)


@dataclass(frozen=True)
class Baseline:
    """Samples ``start`` to ``stop`` (exclusive) to average, both 0 for none; ``said`` is the sentence about it."""

    start: int
    stop: int
    said: str


def find_baseline(vertical: Array, *, zero: tuple[int, int] | None, rate: float) -> Baseline:
    """Return the window in which the plate is unloaded: FORCE_PLATFORM:ZERO if it is one, else the longest found, else
    none.

    ``vertical`` (S,) N is the plate's vertical force as recorded, either sign; ``zero`` the first and last sample (from
    1) that the file names. Unloaded means: quiet, at the end of the trial's range away from the load, and either small
    or plainly no load.
    """
    written, why = _written(vertical, zero)
    # 10 samples: a shorter ZERO is only used where nothing better is found
    if written and written.stop - written.start >= 10:
        return written
    found = _longest_unloaded(vertical, rate)
    if found is not None:
        level = vertical[slice(*found)].mean()
        said = (
            f"Zero: {why} The plate is unloaded in samples {found[0] + 1}-{found[1]}; their mean was subtracted "
            f"({level:.3g} N vertical)."
        )
        return Baseline(*found, said)
    if written:
        return written
    low, high = _range(vertical)
    never = f"The plate is never seen unloaded (vertical {low:.0f} to {high:.0f} N): nothing was subtracted."
    return Baseline(0, 0, f"Zero: {why} {never}")


def _written(vertical: Array, zero: tuple[int, int] | None) -> tuple[Baseline | None, str]:
    """Return the window that the file names if it is legal and unloaded, and the reason why it is not used."""
    if zero is None:
        return None, "the file names no window (ZERO is missing)."
    first, last = zero
    if not 1 <= first <= last <= vertical.size:
        return None, f"ZERO is {first} {last}, which names no samples."
    # ZERO counts samples from 1 and names the last one, too.
    level = float(vertical[first - 1 : last].mean())
    if not is_unloaded(level, vertical):
        return None, f"ZERO names samples {first}-{last}, but the plate is loaded there ({level:.0f} N)."
    said = (
        f"Zero: mean of samples {first}-{last} as the file says (ZERO), {level:.3g} N vertical, subtracted from "
        f"every channel."
    )
    return Baseline(first - 1, last, said), f"ZERO names only {last - first + 1} samples."


def _longest_unloaded(vertical: Array, rate: float) -> tuple[int, int] | None:
    """Return the longest quiet stretch (samples) at one end of the range that is unloaded; None if there is none."""
    means, size = block_means(vertical, rate)
    found = []
    for end in (means.min(), means.max()):
        near = means[np.abs(means - end) <= _NEAR]
        middle = float(np.median(near))
        # 1.4826 times the median distance from the median: the standard deviation of a Gaussian, outliers or not.
        spread = 1.4826 * float(np.median(np.abs(near - middle)))
        for start, stop in runs(np.abs(means - middle) <= max(_FLAT, 4 * spread)):
            inner = slice(start + 1, stop - 1)
            if stop - start < 3:
                continue
            level, length = float(means[inner].mean()), (stop - start - 2) * size / rate
            small = abs(level) <= _SMALL
            # Standard deviation of a block mean of white noise, and half as much more.
            noise = 1.5 * float(vertical[(start + 1) * size : (stop - 1) * size].std()) / np.sqrt(size)
            # A larger offset is only believed where the signal is as still as its own noise, and for longer.
            most, least = (_FLAT, 0.12) if small else (max(1.5, noise), 0.5)
            if means[inner].std() <= most and length >= least and is_unloaded(level, means):
                found.append((small, length, (start + 1) * size, (stop - 1) * size))
    return max(found)[2:] if found else None


def is_unloaded(level: float, vertical: Array) -> bool:
    """Return True if ``level`` N can be the reading of the empty plate in a trial with these readings (S,) N.

    It must be the low or the high end of the trial's range (a load goes one way only). An offset up to 30 N is
    believed; a larger one only if it is no large part of the load, or has the opposite sign.
    """
    low, high = _range(vertical)
    if abs(level) <= _SMALL:
        return level <= low + _NEAR or level >= high - _NEAR
    if high - low < 5 * _NEAR:
        return False
    # The offset, positive the way in which the load goes.
    load = level if level <= low + _NEAR else -level
    at_an_end = level <= low + _NEAR or level >= high - _NEAR
    return at_an_end and -(high - low) <= load <= LARGEST_SHARE * (high - low)


def block_means(values: Array, rate: float, *, length: float = 0.04) -> tuple[Array, int]:
    """Return the means of ``values`` (S, ...) over whole blocks of ``length`` s (one at least; by default two periods
    of the mains), and samples a block.
    """
    size = min(max(1, round(length * rate)), len(values))
    count = len(values) // size
    return values[: count * size].reshape(count, size, *values.shape[1:]).mean(axis=1), size


def _range(values: Array) -> tuple[float, float]:
    low, high = np.percentile(values, [0.5, 99.5])
    return float(low), float(high)


def sensor_wrench(kind: PlateType, signals: Array, origin: Array) -> Array:
    """Return force and moment (S, 6) N, N·m about the sensor, plate axes, from the output (S, C) in SI of a plate.

    A force of a sensor at ``p`` adds ``p x F`` to the moment, that of two sensors at the middle between them, any other
    nothing: ``Mx = b (z1 + z2 - z3 - z4)``, ``My = a (-z1 + z2 + z3 - z4)``, ``Mz = b (x34 - x12) + a (y14 - y23)``.
    TYPE 1 holds the force ``F``, a point ``p`` on the surface and a free moment ``T``: ``M = p x F + T``, about the
    point of the surface above the sensor. A point farther than 1.5 m away, as an empty plate gives it, counts as 0.

    ``origin`` (3,) m is ORIGIN. The sign is that of the channels.
    """
    if kind.on_surface:
        fx, fy, fz, x, y, free = signals.T
        # The point of an empty plate is noise.
        x, y = np.where(np.maximum(np.abs(x), np.abs(y)) > FARTHEST_PRESSURE, 0.0, (x, y))
        # p x F for p = (x, y, 0).
        return np.column_stack([fx, fy, fz, y * fz, -(x * fz), free + (x * fy - y * fx)])
    # Where the four sensors lie, in a and b along the plate's x and y.
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    wrench = np.zeros((len(kind.outputs), 6))
    for column, name in enumerate(kind.outputs):
        axis = "xyz".index(name[1])
        wrench[column, axis + 3 * (name[0] == "m")] = 1.0
        if sensors := [int(number) - 1 for number in name[2:]]:
            place = np.append(corners[sensors].mean(axis=0) * np.abs(origin[:2]), 0.0)
            wrench[column, 3:] = np.cross(place, np.eye(3)[axis])
    return np.asarray(signals[:, : len(wrench)] @ wrench)


def loaded_samples(wrench: Array, rate: float) -> Mask:
    """Return (S,) True where the plate carries at least 30 N and 5 % of its peak along its own z, in the mean over 0.1
    s and at the sample.

    So a plate that only trembles under a neighbour's step does not count as loaded. ``wrench`` (S, 6) N, N·m in plate
    axes, either sign; ``rate`` Hz.
    """
    means, size = block_means(wrench[:, 2], rate, length=0.1)
    threshold = max(TOUCH_FORCE, 0.05 * float(np.abs(means).max()))
    lasting = np.repeat(np.abs(means) >= threshold, size)
    # The last block is not whole: as the one before.
    lasting = np.append(lasting, np.full(len(wrench) - lasting.size, lasting[-1]))
    return lasting & (np.abs(wrench[:, 2]) >= threshold)


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
    # Points are rows: R p becomes p R'.
    lab = corners @ turn.T * unit
    _refuse_disorder(lab)
    sides = np.linalg.norm(lab - np.roll(lab, -1, axis=0), axis=1)
    if sides.min() < SHORTEST_SIDE or sides.max() > LONGEST_SIDE:
        raise TrialRefused(
            f"CORNERS make a plate of {sides[:2].min():.3g} x {sides[:2].max():.3g} m (first corner as written: "
            f"{_point(corners[0])}); legal are sides of {SHORTEST_SIDE:g} to {LONGEST_SIDE:g} m. Check CORNERS and "
            "POINT:UNITS."
        )
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
    if abs(axes[2, 2]) < 0.7:  # the cosine of 45 degrees
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
    # In any unit: as far apart as the sides of plates can be, and opposite ones against each other.
    if not lengths.min() * LONGEST_SIDE > SHORTEST_SIDE * lengths.max() > 0 or sides[0] @ sides[2] >= 0:
        return False
    # Share of the shortest side by which a rectangle may miss its closure
    return max(_gap(corners), _skew(corners)) < 0.1 * float(lengths.min())


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


def around_pressures(points: Array, height: float) -> Array:
    """Return the corners (4, 3) m around ``points`` (n, 2 or more) m with 0.15 m, room for a foot, at a ``height`` m;
    counter-clockwise seen from above.
    """
    (x0, y0), (x1, y1) = np.nanmin(points, axis=0)[:2] - 0.15, np.nanmax(points, axis=0)[:2] + 0.15
    return np.array([[x1, y1, height], [x0, y1, height], [x0, y0, height], [x1, y0, height]])


def _unit(corners: Array, metres: float) -> tuple[float, list[str]]:
    """Return the metres per unit of the corners: the file's own, or m or mm where only that gives a legal size."""
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    units = {"m": 1.0, "mm": 0.001}
    fits = [
        one for one, unit in units.items() if SHORTEST_SIDE <= unit * sides.min() <= unit * sides.max() <= LONGEST_SIDE
    ]
    if any(np.isclose(units[name], metres) for name in fits) or len(fits) != 1:
        return metres, []
    said = (
        f"CORNERS would be {sides.max() * metres:.4g} m long in the file's unit; they were taken as {fits[0]}, the "
        "only unit that fits a plate."
    )
    return units[fits[0]], [said]


def _refuse_disorder(lab: Array) -> None:
    """Refuse four corners whose sides cross."""
    sides = lab - np.roll(lab, -1, axis=0)
    # Round a simple outline both pairs of opposite sides run against each other.
    if sides[0] @ sides[2] < 0 and sides[1] @ sides[3] < 0:
        return
    for order, which in (([0, 1, 3, 2], "3 and 4 (or 1 and 2)"), ([0, 2, 1, 3], "2 and 3 (or 1 and 4)")):
        if _gap(lab[order]) < _NOT_CLOSED:
            raise TrialRefused(
                f"CORNERS are out of order: the outline is a bow-tie; corners {which} are exchanged. The legal order "
                "is +x+y, -x+y, -x-y, +x-y of the plate axes. Correct FORCE_PLATFORM:CORNERS."
            )
    raise TrialRefused(
        f"CORNERS {', '.join(_point(p) for p in lab)} m are no rectangle: the outline crosses itself. Enter the "
        "corners in the order +x+y, -x+y, -x-y, +x-y of the plate axes."
    )


def _gap(corners: Array) -> float:
    """Return by how much opposite sides differ."""
    # a - b + c - d: zero in a parallelogram, whose diagonals halve each other.
    return float(np.linalg.norm(corners[0] - corners[1] + corners[2] - corners[3]))


def _skew(lab: Array) -> float:
    """Return how far the end of a side is off at most, m, because the angle at its corner is not a right one."""
    sides = np.roll(lab, -1, axis=0) - lab
    lengths = np.linalg.norm(sides, axis=1)
    cosines = np.abs(np.sum(sides * np.roll(sides, -1, axis=0), axis=1)) / (lengths * np.roll(lengths, -1))
    # The cosine of a corner's angle is the sine of what it lacks to a right one; times the shorter side.
    return float((cosines * np.minimum(lengths, np.roll(lengths, -1))).max())


def _point(p: Array) -> str:
    return "(" + ", ".join(f"{c:.4g}" for c in p) + ")"

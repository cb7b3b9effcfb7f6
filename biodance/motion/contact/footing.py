"""Soles on surfaces: the heights on which the feet stand, what lies over which plate, how far a pressure is from a
sole.
"""

from dataclasses import dataclass
from functools import reduce
from itertools import combinations

import numpy as np

from biodance.motion.contact.soles import Soles
from biodance.records import SIDES, Array, Mask, Plate, Trial, runs
from biodance.settings import COP_FORCE

RIM = 0.005
"""m of the outline's edge that carry nothing: a sole is rounded, and broadest above the ground."""
REACH = 0.09
"""m: a foot within this height of a plate is over that plate and not over one of another step."""
_HALF = 0.3
"""Share of the sole that must be over a raised plate."""
_UNDER = 0.03
"""m: a centre of pressure so near to a sole is under it."""
_BLOCK = 1024
"""Frames whose points all over the soles are looked at together: little memory, whatever the length."""
_RAISED = 0.05
"""m that a plate stands out of everything around it to count as raised."""


@dataclass(frozen=True, eq=False)
class Footing:
    """Feet (right, left) on plates: ``on_plate`` (T, 2, P) a part of a touching foot is over the plate; ``share`` (T,
    2) of the sole over plates of its height; ``covered`` (T, 2) nothing of the foot can touch anything but plates;
    ``unseen`` (T, 2) not seen.
    """

    on_plate: Mask
    share: Array
    covered: Mask
    unseen: Mask


def inside(plate: Plate, points: Array) -> Array:
    """Return how far points (..., 3) m are inside the plate seen from above: distance to the nearest edge, negative
    outside.
    """
    corners = plate.corners[:, :2]
    after = np.concatenate([corners[1:], corners[:1]])
    (x, y), (u, v) = corners.T, (after - corners).T
    inward = np.sign(x @ after[:, 1] - y @ after[:, 0]) * np.array([-v, u]) / np.hypot(u, v)
    within = points[..., :2] @ inward - (x * inward[0] + y * inward[1])
    return np.asarray(reduce(np.minimum, np.moveaxis(within, -1, 0)))


def overhang_notes(plates: tuple[Plate, ...], soles: Soles, beside: Mask) -> tuple[str, ...]:
    """Return a sentence for each foot that rests partly ``beside`` (T, 2) plates of known place: by how much."""
    notes = []
    for foot, side in enumerate(SIDES):
        outline = soles.outline[beside[:, foot], foot]
        if len(outline) and all(plate.placed for plate in plates):
            within = np.max([inside(plate, outline) for plate in plates], axis=0).min(axis=1)
            notes.append(
                f"Where it rests partly beside the plates, the {side} foot reaches {-1000 * np.median(within):.0f} mm "
                f"beyond their edge (median)."
            )
    return tuple(notes)


def footing(plates: tuple[Plate, ...], soles: Soles, surfaces: "Surfaces", touching: Mask) -> Footing:
    """Return which plates the touching feet (T, 2) are over, and whether they can touch anything else."""
    spread = _spread_over(plates, soles)
    low = (soles.outline[..., 2] - surfaces.offset).min(axis=2)
    unseen = np.isnan(low)
    anywhere = np.zeros(spread.shape[1:], dtype=bool)
    raised = np.ones(low.shape, dtype=bool)
    on_plate = np.zeros((*low.shape, len(plates)), dtype=bool)
    for index, plate in enumerate(plates):
        over = spread[index] & (np.abs(low - plate.height) < REACH)[..., None]
        on_plate[..., index] = over.any(axis=-1) & touching
        anywhere |= over
        if any(abs(height - plate.height) < _RAISED for height in surfaces.bare):
            raised &= ~over.any(axis=-1)
    share = anywhere.mean(axis=-1)
    covered = (share == 1) | (raised & (share >= _HALF))
    return Footing(on_plate, share, covered & ~unseen, unseen)


def _spread_over(plates: tuple[Plate, ...], soles: Soles) -> Mask:
    """Return (P, T, 2, S) which points all over the soles are over each plate, seen from above; of a plate of unknown
    place, or whose foot is told, all that are seen of a foot that presses it.
    """
    pressed = [None if plate.placed and not plate.foot else _pressed(plate, soles)[..., None] for plate in plates]
    parts = []
    for start in range(0, soles.time.size, _BLOCK):
        part = slice(start, start + _BLOCK)
        samples = _samples(soles.outline[part])
        seen, pairs = ~np.isnan(samples[..., 0]), zip(plates, pressed, strict=True)
        parts.append([inside(plate, samples) >= 0 if who is None else who[part] & seen for plate, who in pairs])
    return np.concatenate(parts, axis=1)


def _pressed(plate: Plate, soles: Soles) -> Mask:
    """Return (T, 2) which soles carry what a plate measures: the foot that is told; else its centre of pressure lies
    under this foot, else under both.
    """
    cop = plate.wrench.cop(height=plate.height, threshold=COP_FORCE)[:, :2]
    known = np.isfinite(cop).all(axis=1)
    alone = np.zeros((len(cop), 2), dtype=bool)
    if plate.foot:
        alone[:, SIDES.index(plate.foot)] = known
        return alone
    for feet in ([0], [1], [0, 1]):
        here = known & np.isfinite(soles.outline[:, feet]).all(axis=(1, 2, 3)) & ~alone.any(axis=1)
        points = np.concatenate([soles.outline[here, foot, :, :2] for foot in feet], axis=1)
        alone[np.ix_(np.flatnonzero(here), np.array(feet))] |= (distance_to_hull(cop[here], points) < _UNDER)[:, None]
    return alone


def _samples(outline: Array) -> Array:
    """Return points (T, 2, S, 3) m all over the soles without their rim: their ``outline`` (T, 2, P, 3) m and the
    middles of all its chords.
    """
    outwards = (outline - outline.mean(axis=2, keepdims=True)) * np.array([1.0, 1.0, 0.0])
    length = np.linalg.norm(outwards, axis=-1, keepdims=True)
    narrow = outline - np.minimum(RIM / np.maximum(length, 1e-9), 1.0) * outwards
    middles = [(narrow[:, :, i] + narrow[:, :, j]) / 2 for i, j in combinations(range(narrow.shape[2]), 2)]
    return np.concatenate([narrow, np.stack(middles, axis=2)], axis=2)


def cop_outside(plates: tuple[Plate, ...], soles: Soles, place: Footing, pressed: Mask) -> Array:
    """Return the distance (T, P) m of every plate's centre of pressure from the soles on it; 0 inside, NaN without foot
    or not ``pressed``.

    With both feet on a plate, the area between them counts as inside.
    """
    found = np.full(pressed.shape, np.nan)
    for index, plate in enumerate(plates):
        cop = plate.wrench.cop(height=plate.height)[:, :2]
        known = pressed[:, index] & np.isfinite(cop).all(axis=1)
        for feet in ([0], [1], [0, 1]):
            here = known & (place.on_plate[:, :, index] == np.isin([0, 1], feet)).all(axis=1)
            points = np.concatenate([soles.outline[here, foot, :, :2] for foot in feet], axis=1)
            found[here, index] = distance_to_hull(cop[here], points)
    return found


def distance_to_hull(point: Array, points: Array) -> Array:
    """Return the distance (n,) of each ``point`` (n, 2) from the convex hull of its ``points`` (n, P, 2); 0 inside.

    A point is outside if all others are seen from it within half a turn; then the nearest of all chords between them is
    the hull's edge.
    """
    towards = points - point[:, None]
    angle = np.sort(np.arctan2(towards[..., 1], towards[..., 0]), axis=1)
    widest = np.max(np.diff(angle, axis=1, append=angle[:, :1] + 2 * np.pi), axis=1)
    distance = np.zeros(len(point))
    for row in np.flatnonzero(widest > np.pi):
        i, j = np.triu_indices(points.shape[1], k=1)
        start, chord = towards[row, i], towards[row, j] - towards[row, i]
        along = np.clip(-np.sum(chord * start, axis=1) / np.maximum(np.sum(chord**2, axis=1), 1e-18), 0, 1)[:, None]
        distance[row] = np.linalg.norm(start + along * chord, axis=1).min()
    return distance


SAME_LEVEL = 0.05
"""m: heights closer than this are one surface."""
MARKER_HEIGHT = 0.20
"""m: a point of a sole that stands on a plate is at most this far above it (foot markers sit lower)."""
ASYMMETRY = 0.02
"""m: the two feet's points may be this differently high above the ground."""
CARRIED = 0.9
"""Share of the body weight on the plates above which a foot that rests elsewhere is held in the air."""


@dataclass(frozen=True, eq=False)
class Surfaces:
    """``offset`` (2, P) m: height of each point of each sole above the ground in standing; ``levels`` m: heights on
    which a foot can stand; ``bare`` m: those of them that are not plates, the floor first; ``notes`` what was found.
    """

    offset: Array
    levels: tuple[float, ...]
    bare: tuple[float, ...]
    notes: tuple[str, ...]


def speeds(soles: Soles, plates: tuple[Plate, ...] = (), moving: Array | None = None) -> Array:
    """Return the speed (T, 2, P) m/s of every point of the soles, over a plate relative to its ``moving`` (plates, 3)
    m/s; 0 for a single frame, NaN beside unseen ones.
    """
    if soles.time.size < 2:
        return 0.0 * soles.outline[..., 0]
    velocity = np.gradient(soles.outline, soles.time, axis=0)
    for plate, belt in zip(plates, moving if moving is not None else (), strict=False):
        if belt.any():
            velocity = velocity - belt * (inside(plate, soles.outline) >= 0)[..., None]
    return np.linalg.norm(velocity, axis=-1)


def resting(speed: Array, time: Array, *, still: float, lasting: float) -> Mask:
    """Return (T, 2) where a foot rests: all its points slower than ``still`` m/s for at least ``lasting`` s (or the
    whole trial).
    """
    slow = np.asarray((speed < still).all(axis=2))
    least = 1 if time.size < 2 else min(time.size, int(np.ceil(lasting / np.median(np.diff(time)))))
    found = np.zeros_like(slow)
    for foot in range(2):
        for start, stop in runs(slow[:, foot]):
            found[start:stop, foot] = stop - start >= least
    return found


def dilate(mask: Mask, frames: int) -> Mask:
    """Return ``mask`` (T, ...) widened by ``frames`` before and after every True."""
    from scipy.ndimage import maximum_filter1d

    return np.asarray(maximum_filter1d(mask, 2 * frames + 1, axis=0, mode="nearest")) if mask.size else mask


def find_surfaces(trial: Trial, soles: Soles, rests: Mask, load: Mask, *, weight: float) -> Surfaces:
    """Return the surfaces of a trial; ``rests`` (T, 2), ``load`` (T, plates) True where loaded, ``weight`` N (NaN =
    unknown).
    """
    plates = sorted({round(plate.height, 3) for plate in trial.plates})
    offset = _offsets(trial, soles, rests, load)
    low = (soles.outline[..., 2] - offset).min(axis=2)
    total = trial.wrench.force[:, 2]
    bare: list[float] = []
    notes: list[str] = []
    for foot, side in enumerate(SIDES):
        lifted = 0
        for start, stop in runs(rests[:, foot]):
            span = slice(start, stop)
            level, over = float(np.median(low[span, foot])), _over(trial, soles.centre[span, foot], load[span])
            known = [height for height in plates if abs(height - level) < SAME_LEVEL]
            if (over and known) or any(abs(height - level) < SAME_LEVEL for height in bare):
                continue
            if not known and np.mean(total[span]) >= CARRIED * weight:
                lifted += 1
                continue
            bare.append(known[0] if known else level)
            when = f"{soles.time[start]:.2f} to {soles.time[stop - 1]:.2f} s"
            notes.append(f"The {side} foot stands beside the plates on a surface at {level:z.2f} m, {when}.")
        if lifted:
            often = f"{lifted} time{'s' * (lifted != 1)}"
            notes.append(f"The {side} foot rests in the air ({often}): the plates carry the weight meanwhile.")
    lowest = float(np.nanmin(low, initial=plates[0]))
    if lowest < min([*bare, plates[0]]) - SAME_LEVEL:
        notes.append(
            f"A foot goes down to {lowest:z.2f} m: the floor is at least that far below the lowest plate "
            f"({plates[0]:z.2f} m)."
        )
        bare.append(lowest)
    bare = sorted({min([*bare, plates[0]]), *bare})
    return Surfaces(offset, tuple(sorted({*plates, *bare})), tuple(bare), tuple(notes))


def _over(trial: Trial, centre: Array, load: Mask) -> bool:
    """Return whether a resting sole's ``centre`` (n, 3) is over a plate that is loaded meanwhile."""
    middle = np.median(centre, axis=0)
    return any(
        bool(inside(plate, middle) > 0) and bool(load[:, index].any()) for index, plate in enumerate(trial.plates)
    )


def _offsets(trial: Trial, soles: Soles, rests: Mask, load: Mask) -> Array:
    """Return the standing height (2, P) m of each point: low percentile while the foot rests on a loaded plate.

    A foot that never does takes the other's; if neither does, its lowest resting (or lowest) height is taken for the
    lowest plate's.
    """
    found = np.full(soles.outline.shape[1:3], np.nan)
    for foot in range(2):
        heights = []
        for index, plate in enumerate(trial.plates):
            above = soles.outline[:, foot, :, 2] - plate.height
            here = rests[:, foot] & load[:, index] & (inside(plate, soles.centre[:, foot]) > 0)
            heights.append(above[here & (above.min(axis=1) > -SAME_LEVEL) & (above.max(axis=1) < MARKER_HEIGHT)])
        standing = np.concatenate(heights)
        if len(standing):
            found[foot] = np.percentile(standing, 10, axis=0)
    if np.isnan(found).all():
        z = soles.outline[..., 2]
        lowest = np.where(rests[..., None], z, np.inf).min(axis=(0, 1))
        lowest = np.where(np.isfinite(lowest), lowest, np.nanmin(z, axis=(0, 1), initial=np.inf))
        found[:] = lowest - min(plate.height for plate in trial.plates)
    found = np.where(np.isnan(found), found[::-1], found)
    return np.minimum(found, found[::-1] + ASYMMETRY)

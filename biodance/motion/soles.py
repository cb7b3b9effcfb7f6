"""Where the soles of the feet are, from heel and toe markers or the tracked body, and over which surface and plate;
who sits on something that stands on the plates is measured whole, though no foot is on them.
"""

from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import combinations

import numpy as np

from biodance.body.body import Body
from biodance.errors import TrialRefused
from biodance.lab.markers.sets import MarkerSet, landmark
from biodance.motion.kinematics import in_blocks, poses
from biodance.records import SIDES, Array, Markers, Mask, Motion, Plate, Trial, freeze, runs
from biodance.settings import COP_FORCE

OUTLINE = np.array([[0.0, 0.17], [0.0, -0.17], [0.6, -0.21], [1.0, -0.23], [1.25, 0.0], [1.0, 0.23], [0.6, 0.21]])
"""(P, 2) outline of a sole, in units of the horizontal distance from the heel to the toe marker: forwards from the heel
marker, and to the left. From foot length 0.152, breadth 0.055 and heel breadth 0.040 of stature (Winter 2009; ANSUR II
2012) and a distance of the markers of 0.121 of stature.
"""
_BEARS = (0.9, 1.2)
"""Shares of the weight between which the plates read, at the mean, while they carry all of it."""
_BESIDE = 0.10
"""m from both soles at which no foot carries the load: farther than a plate's place is wrong."""
_HANGS = 0.04
"""m over the plates: a sole of a scaled body that stands is nearer."""
_LASTS = 1.0
"""s of sitting, at least."""


@dataclass(frozen=True, eq=False)
class Soles:
    """Outlines of both soles: ``time`` (T,) s; ``outline`` (T, 2, P, 3) m, lab frame, right foot first, P points around
    the sole.

    The heights are those of the markers or of the body's sole; the contact finds out how far they are above the ground
    in standing. NaN = not seen.
    """

    time: Array
    outline: Array

    def __post_init__(self) -> None:
        freeze(self, "Soles", time=(None,), outline=(np.size(self.time), 2, None, 3))

    @cached_property
    def centre(self) -> Array:
        """(T, 2, 3) m, mean of the outline's points; right foot first; read-only."""
        centre = self.outline.mean(axis=2)
        centre.setflags(write=False)
        return centre


def soles_from_markers(markers: Markers, marker_set: MarkerSet) -> Soles:
    """Return the soles from the landmarks heel and toe (second metatarsal head) of each foot.

    Points between the two markers have the height that is interpolated between them; the toes bend, so that the tip has
    the height of the toe marker.

    Raises
    ------
    TrialRefused
        The recording lacks a heel or a toe marker.
    """
    feet = []
    for side in SIDES:
        heel, toe = (landmark(markers, marker_set, f"{side}_{name}") for name in ("heel", "toe"))
        if heel is None or toe is None:
            raise TrialRefused(
                f"The {side} foot has no heel or no toe marker, so its contact with the ground is unknown. Put both on."
            )
        ahead = (toe - heel) * np.array([1.0, 1.0, 0.0])
        # A quarter turn to the left in the plane.
        to_left = np.stack([-ahead[:, 1], ahead[:, 0], np.zeros(len(ahead))], axis=1)
        rise = (toe - heel) - ahead
        feet.append(np.stack([heel + x * ahead + y * to_left + min(x, 1.0) * rise for x, y in OUTLINE], axis=1))
    return Soles(markers.time, np.stack(feet, axis=1))


def soles_from_body(body: Body, motion: Motion) -> Soles:
    """Return the soles of the tracked body, from its ``feet``.

    Raises
    ------
    TrialRefused
        The body has no right or no left foot, or the two outlines have different numbers of points.
    """
    absent = [side for side in SIDES if side not in body.feet]
    if absent or len({body.feet[side].outline.shape for side in SIDES}) > 1:
        raise TrialRefused(
            f"The body {body.name} lacks two feet with outlines of equally many points, so its ground contact is "
            f"unknown."
        )
    feet = [body.feet[side] for side in SIDES]
    segments, points = [foot.segment for foot in feet for _ in foot.outline], np.concatenate([f.outline for f in feet])
    outline = np.empty((motion.time.size, 2, len(points) // 2, 3))
    for part, frames in in_blocks(motion):
        outline[part] = poses(body, frames.q).points(segments, points).reshape(-1, *outline.shape[1:])
    outline.setflags(write=False)  # the record keeps it without a copy
    return Soles(motion.time, outline)


def inside(plate: Plate, points: Array) -> Array:
    """Return how far points (..., 3) m are inside the plate from above: to the nearest edge, < 0 outside."""
    corners = plate.corners[:, :2]
    after = np.concatenate([corners[1:], corners[:1]])
    (x, y), (u, v) = corners.T, (after - corners).T
    # Sign of the signed area: inward whichever way the corners run round.
    inward = np.sign(x @ after[:, 1] - y @ after[:, 0]) * np.array([-v, u]) / np.hypot(u, v)
    within = points[..., :2] @ inward - (x * inward[0] + y * inward[1])
    # Inside a convex plate is inside all four edges: the least of the distances.
    return np.asarray(reduce(np.minimum, np.moveaxis(within, -1, 0)))


def standing_on(plates: tuple[Plate, ...], soles: Soles) -> Mask:
    """Return (T, 2, P) which soles are on each plate, as far as one frame tells: their middle lies over it; of a plate
    of unknown place, whose rectangle is only drawn round its pressures, or whose foot is told, they press it.
    """
    seen = [one.placed and not one.foot for one in plates]
    on = [inside(p, soles.centre) > 0 if s else _pressed_by(p, soles) for p, s in zip(plates, seen, strict=True)]
    return np.stack(on, axis=2)


def _pressed_by(plate: Plate, soles: Soles) -> Mask:
    """Return (T, 2) which soles carry what a plate measures: the foot told, the one under it, else both."""
    cop = plate.wrench.cop(height=plate.height, threshold=COP_FORCE)[:, :2]
    known = np.isfinite(cop).all(axis=1)
    alone = np.zeros((len(cop), 2), dtype=bool)
    if plate.foot:
        alone[:, SIDES.index(plate.foot)] = known
        return alone
    for feet in ([0], [1], [0, 1]):
        here = known & np.isfinite(soles.outline[:, feet]).all(axis=(1, 2, 3)) & ~alone.any(axis=1)
        points = np.concatenate([soles.outline[here, foot, :, :2] for foot in feet], axis=1)
        # 0.03 m: a centre of pressure so near to a sole is under it
        alone[np.ix_(np.flatnonzero(here), np.array(feet))] |= (distance_to_hull(cop[here], points) < 0.03)[:, None]
    return alone


def distance_to_hull(point: Array, points: Array) -> Array:
    """Return the distance (n,) of each ``point`` (n, 2) from the convex hull of its ``points`` (n, P, 2); 0 inside.

    A point is outside if all others are seen from it within half a turn; then the nearest of all chords between them is
    the hull's edge.
    """
    towards = points - point[:, None]
    angle = np.sort(np.arctan2(towards[..., 1], towards[..., 0]), axis=1)
    widest = np.max(np.diff(angle, axis=1, append=angle[:, :1] + 2 * np.pi), axis=1)
    distance = np.zeros(len(point))
    outside, (i, j) = np.flatnonzero(widest > np.pi), np.triu_indices(points.shape[1], k=1)
    for rows in np.split(outside, range(_BLOCK, len(outside), _BLOCK)):
        start = towards[rows][:, i]
        chord = towards[rows][:, j] - start
        # Foot of the perpendicular on a chord, kept between its ends.
        along = np.clip(-np.sum(chord * start, axis=2) / np.maximum(np.sum(chord**2, axis=2), 1e-18), 0, 1)
        distance[rows] = np.linalg.norm(start + along[..., None] * chord, axis=2).min(axis=1)
    return distance


_SAME_LEVEL = 0.05  # m: heights closer than this are one surface
_MARKER_HEIGHT = 0.20
"""m: a point of a sole that stands on a plate is at most this far above it (foot markers sit lower)."""
_CARRIED = 0.9
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


def find_surfaces(trial: Trial, soles: Soles, rests: Mask, load: Mask, *, weight: float) -> Surfaces:
    """Return the surfaces of a trial; ``rests`` (T, 2), loaded ``load`` (T, plates), ``weight`` N or NaN."""
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
            # Median over the rest: one frame of a bad marker makes no level.
            level, over = float(np.median(low[span, foot])), _over(trial, soles.centre[span, foot], load[span])
            known = [height for height in plates if abs(height - level) < _SAME_LEVEL]
            if (over and known) or any(abs(height - level) < _SAME_LEVEL for height in bare):
                continue
            if not known and np.mean(total[span]) >= _CARRIED * weight:
                lifted += 1
                continue
            bare.append(known[0] if known else level)
            when = f"{soles.time[start]:.2f} to {soles.time[stop - 1]:.2f} s"
            notes.append(f"The {side} foot stands beside the plates on a surface at {level:z.2f} m, {when}.")
        if lifted:
            often = f"{lifted} time{'s' * (lifted != 1)}"
            notes.append(f"The {side} foot rests in the air ({often}): the plates carry the weight meanwhile.")
    lowest = float(np.nanmin(low, initial=plates[0]))
    if lowest < min([*bare, plates[0]]) - _SAME_LEVEL:
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
    """Return the standing height (2, P) m of each point: low percentile while the foot rests on a loaded plate."""
    found = np.full(soles.outline.shape[1:3], np.nan)
    for foot in range(2):
        heights = []
        for index, plate in enumerate(trial.plates):
            above = soles.outline[:, foot, :, 2] - plate.height
            here = rests[:, foot] & load[:, index] & (inside(plate, soles.centre[:, foot]) > 0)
            heights.append(above[here & (above.min(axis=1) > -_SAME_LEVEL) & (above.max(axis=1) < _MARKER_HEIGHT)])
        standing = np.concatenate(heights)
        if len(standing):
            found[foot] = np.percentile(standing, 10, axis=0)
    if np.isnan(found).all():
        z = soles.outline[..., 2]
        # Without a loaded plate the lowest that a resting foot reaches stands for the ground.
        lowest = np.where(rests[..., None], z, np.inf).min(axis=(0, 1))
        lowest = np.where(np.isfinite(lowest), lowest, np.nanmin(z, axis=(0, 1), initial=np.inf))
        found[:] = lowest - min(plate.height for plate in trial.plates)
    # A foot that never stood on a plate: as high as the other one.
    found = np.where(np.isnan(found), found[::-1], found)
    # The same point of both feet may be 2 cm differently high above the ground.
    return np.minimum(found, found[::-1] + 0.02)


_RIM = 0.005
"""m of the outline's edge that carry nothing: a sole is rounded, and broadest above the ground."""
_REACH = 0.09
"""m: a foot within this height of a plate is over that plate and not over one of another step."""
_BLOCK = 1024
"""Frames whose points all over the soles are looked at together: little memory, whatever the length."""


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


def footing(plates: tuple[Plate, ...], soles: Soles, surfaces: Surfaces, touching: Mask, load: Mask) -> Footing:
    """Return which plates the touching feet (T, 2) are over, and what else they can touch; ``load`` (T, P)."""
    spread = _spread_over(plates, soles, touching, load)
    low = (soles.outline[..., 2] - surfaces.offset).min(axis=2)
    unseen = np.isnan(low)
    anywhere = np.zeros(spread.shape[1:], dtype=bool)
    raised = np.ones(low.shape, dtype=bool)
    on_plate = np.zeros((*low.shape, len(plates)), dtype=bool)
    for index, plate in enumerate(plates):
        over = spread[index] & (np.abs(low - plate.height) < _REACH)[..., None]
        on_plate[..., index] = over.any(axis=-1) & touching
        anywhere |= over
        # 0.05 m that a plate stands out of everything around it to count as raised
        if any(abs(height - plate.height) < 0.05 for height in surfaces.bare):
            raised &= ~over.any(axis=-1)
    share = anywhere.mean(axis=-1)
    # Share of the sole that must be over a raised plate
    covered = (share == 1) | (raised & (share >= 0.3))
    return Footing(on_plate, share, covered & ~unseen, unseen)


def _spread_over(plates: tuple[Plate, ...], soles: Soles, touching: Mask, load: Mask) -> Mask:
    """Return (P, T, 2, S) which points of the soles are over each plate; all of a foot on an unplaced plate."""
    unplaced = [index for index, plate in enumerate(plates) if not plate.placed or plate.foot]
    pressed = np.array([_pressed_by(plates[i], soles) for i in unplaced])
    standing = _standing(pressed, load[:, unplaced], touching) if unplaced else None
    parts = []
    for start in range(0, soles.time.size, _BLOCK):
        part = slice(start, start + _BLOCK)
        outline = soles.outline[part]
        outwards = (outline - outline.mean(axis=2, keepdims=True)) * np.array([1.0, 1.0, 0.0])
        length = np.linalg.norm(outwards, axis=-1, keepdims=True)
        narrow = outline - np.minimum(_RIM / np.maximum(length, 1e-9), 1.0) * outwards
        # Corners and the middles of all pairs: points all over a convex sole.
        middles = [(narrow[:, :, i] + narrow[:, :, j]) / 2 for i, j in combinations(range(narrow.shape[2]), 2)]
        samples = np.concatenate([narrow, np.stack(middles, axis=2)], axis=2)
        over = np.stack([inside(plate, samples) >= 0 for plate in plates])
        if standing is not None:
            over[unplaced] = standing[:, part, :, None] & ~np.isnan(samples[..., 0])
        parts.append(over)
    return np.concatenate(parts, axis=1)


def _standing(pressed: Mask, load: Mask, touching: Mask) -> Mask:
    """Return (P, T, 2) the plates of unknown place on which a foot stands: while it may be ``touching`` (T, 2) without
    a break it stays on what it alone presses under ``load`` (T, P), before the first newtons and after the last ones,
    too: what is low and slow has not gone to another plate. Between two plates the nearer in time counts.
    """
    found = pressed.copy()
    sure = pressed & np.logical_not(pressed[:, :, ::-1]) & load.T[:, :, None]
    for foot in range(touching.shape[1]):
        known = np.flatnonzero(sure[:, :, foot].any(axis=0))
        for start, stop in runs(touching[:, foot]):
            here = known[(known >= start) & (known < stop)]
            if here.size:
                frames = np.arange(start, stop)
                nearest = here[np.abs(frames[:, None] - here).argmin(axis=1)]
                found[:, frames, foot] |= sure[:, nearest, foot]
    return found


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


def sitting(trial: Trial, soles: Soles, *, weight: float) -> Mask:
    """Return (T,) where the person sits on the plates: for a second and longer they carry the ``weight`` N (NaN =
    unknown, then nowhere), both feet hang over them, and the load lies beside both.
    """
    found, total = np.zeros(soles.time.size, dtype=bool), trial.wrench
    if not weight > 0 or soles.time.size < 2:
        return found
    height = max(plate.height for plate in trial.plates)
    load = total.cop(height=height, threshold=max(COP_FORCE, weight / 2))[:, :2]
    known = np.isfinite(load).all(axis=1) & np.isfinite(soles.outline).all(axis=(1, 2, 3))
    outline = soles.outline[known][..., :2].reshape(int(known.sum()), 2 * soles.outline.shape[2], 2)
    # Both soles together: who sits has the load beside the hull of both feet.
    beside = np.zeros(found.size, dtype=bool)
    beside[known] = distance_to_hull(load[known], outline) > _BESIDE
    least = _LASTS / float(np.median(np.diff(soles.time)))
    for start, stop in runs(beside):
        hangs = np.median(soles.outline[start:stop, ..., 2].min(axis=2), axis=0) - height > _HANGS
        share = float(np.mean(total.force[start:stop, 2])) / weight
        found[start:stop] = stop - start >= least and hangs.all() and _BEARS[0] <= share <= _BEARS[1]
    return found

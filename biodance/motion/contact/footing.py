"""Feet on plates: which parts of the soles lie over which plate, and how far a pressure is from a sole."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from biodance.motion.contact.over import distance_to_hull, inside, pressed_by
from biodance.motion.contact.soles import Soles
from biodance.motion.contact.surfaces import Surfaces
from biodance.records import SIDES, Array, Mask, Plate, runs

RIM = 0.005
"""m of the outline's edge that carry nothing: a sole is rounded, and broadest above the ground."""
REACH = 0.09
"""m: a foot within this height of a plate is over that plate and not over one of another step."""
_HALF = 0.3
"""Share of the sole that must be over a raised plate."""
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
    """Return which plates the touching feet (T, 2) are over, and whether they can touch anything else; ``load`` (T, P)
    True where a plate is loaded.
    """
    spread = _spread_over(plates, soles, touching, load)
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


def _spread_over(plates: tuple[Plate, ...], soles: Soles, touching: Mask, load: Mask) -> Mask:
    """Return (P, T, 2, S) which points all over the soles are over each plate, seen from above; of a plate of unknown
    place, or whose foot is told, all that are seen of a foot that stands on it.
    """
    unplaced = [index for index, plate in enumerate(plates) if not plate.placed or plate.foot]
    pressed = np.array([pressed_by(plates[i], soles) for i in unplaced])
    standing = _standing(pressed, load[:, unplaced], touching) if unplaced else None
    parts = []
    for start in range(0, soles.time.size, _BLOCK):
        part = slice(start, start + _BLOCK)
        samples = _samples(soles.outline[part])
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

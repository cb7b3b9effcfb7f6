"""How fast the soles move on what they stand on: belts, speeds, feet at rest."""

import numpy as np

from biodance.motion.contact.over import inside, standing_on
from biodance.motion.contact.soles import Soles
from biodance.records import Array, Mask, Plate, Trial, runs

_SLOWEST = 0.2
"""m/s: a slower belt is none; feet creep that much in standing and at the edges of stance."""
_RIGID = 0.25
"""m/s: a sole whose points move more evenly than this lies flat on something."""
_LOW = 0.03
"""m over its lowest height in which a sole stands."""
_EVEN = 0.15
"""m/s around the median in which most flat soles move on a belt of constant speed."""
_MOST = 0.6
_FEWEST = 10
"""Frames of flat soles that tell a belt."""


def belts(trial: Trial, soles: Soles, load: Mask) -> tuple[Array, tuple[str, ...]]:
    """Return the velocity (P, 3) m/s of what the feet stand on, per plate, and a sentence for each belt; zero where it
    does not move.

    ``load`` (T, P) True where a plate is loaded. A belt is what nearly all flat, low soles on a loaded plate move with;
    its speed is taken as constant.
    """
    found, notes = np.zeros((len(trial.plates), 3)), []
    if soles.time.size < _FEWEST:
        return found, ()
    velocity, on = np.gradient(soles.outline, soles.time, axis=0), standing_on(trial.plates, soles)
    spread = np.linalg.norm(velocity - velocity.mean(axis=2, keepdims=True), axis=-1).max(axis=2)
    height = soles.outline[..., 2].mean(axis=2)
    flat = (spread < _RIGID) & (height < np.nanmin(height, axis=0, initial=np.inf) + _LOW)
    for index, plate in enumerate(trial.plates):
        here = flat & on[:, :, index] & load[:, index, None]
        moving = velocity.mean(axis=2)[here]
        if len(moving) < _FEWEST:
            continue
        middle = np.median(moving, axis=0)
        same = np.linalg.norm(moving - middle, axis=1) < _EVEN
        if np.linalg.norm(middle) > _SLOWEST and same.mean() >= _MOST:
            found[index] = moving[same].mean(axis=0)
            notes.append(
                f"The soles on {plate.name} move with it at {np.linalg.norm(found[index]):.2f} m/s: a belt; contact is "
                f"judged by the speed relative to it."
            )
    return found, tuple(notes)


def speeds(soles: Soles, plates: tuple[Plate, ...] = (), moving: Array | None = None) -> Array:
    """Return the speed (T, 2, P) m/s of every point of the soles on what is under the sole; 0 for a single frame, NaN
    beside unseen ones.

    ``moving`` (plates, 3) m/s of the plates' belts. A sole that is over a part of a plate moves with its belt. Where
    rectangles of several plates are under it (drawn round pressures they overlap), it can stand on one of them only:
    each point's speed is the smallest that one of their belts leaves it.
    """
    if soles.time.size < 2:
        return 0.0 * soles.outline[..., 0]
    velocity = np.gradient(soles.outline, soles.time, axis=0)
    speed = np.linalg.norm(velocity, axis=-1)
    if moving is None or not moving.any():
        return speed
    least = np.full(speed.shape, np.inf)
    for plate, belt in zip(plates, moving, strict=True):
        over = (inside(plate, soles.outline) >= 0).any(axis=2, keepdims=True)
        least = np.where(over, np.minimum(least, np.linalg.norm(velocity - belt, axis=-1)), least)
    return np.where(np.isfinite(least), least, speed)


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

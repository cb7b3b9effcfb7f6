"""Belts: what the soles on a plate move with."""

import numpy as np

from biodance.motion.contact.footing import inside
from biodance.motion.contact.soles import Soles
from biodance.records import Array, Mask, Trial

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
    velocity = np.gradient(soles.outline, soles.time, axis=0)
    spread = np.linalg.norm(velocity - velocity.mean(axis=2, keepdims=True), axis=-1).max(axis=2)
    height = soles.outline[..., 2].mean(axis=2)
    flat = (spread < _RIGID) & (height < np.nanmin(height, axis=0, initial=np.inf) + _LOW)
    for index, plate in enumerate(trial.plates):
        over = inside(plate, soles.centre) > 0
        here = flat & over & load[:, index, None]
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

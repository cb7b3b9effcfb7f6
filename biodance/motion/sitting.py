"""Who sits on something that stands on the plates: they measure all that the ground does, though no foot is on them."""

import numpy as np

from biodance.motion.soles import Soles, distance_to_hull
from biodance.records import Mask, Trial, runs
from biodance.settings import COP_FORCE

_BEARS = (0.9, 1.2)
"""Shares of the weight between which the plates read, at the mean, while they carry all of it."""
_BESIDE = 0.10
"""m from both soles at which no foot carries the load: farther than a plate's place is wrong."""
_HANGS = 0.04
"""m over the plates: a sole of a scaled body that stands is nearer."""
_LASTS = 1.0
"""s of sitting, at least."""


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

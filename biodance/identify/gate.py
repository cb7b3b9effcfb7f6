"""Frames that no wrong body explains: a posture that jumps, a plate that somebody else steps on. They are masked before identification.

The usual limit is 0.3 of the body weight: the table misses at most 0.18 of it in virtual squats and dances; a load of a quarter of
the mass passes.
"""

from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_dilation

from biodance.body.body import Body
from biodance.identify.statistics import Fit
from biodance.motion.regressor import predict_wrench
from biodance.records import Array

LEVER = 0.5
"""m: the same limit for moments about the standing point."""
AROUND = 0.5
"""s before and after such a frame that are masked too."""


def believable(body: Body, fit: Fit, about: Array) -> tuple[Fit, str]:
    """Return the trial without frames in which table and plates differ by more than ``fit.outlier``, and a sentence or ""."""
    limit = -fit.outlier * body.gravity[2] * body.sip.mass.sum()
    difference = fit.wrench.value - predict_wrench(body, fit.motion).value
    moment = difference[:, 3:] - np.cross(about, difference[:, :3])
    size = np.maximum(np.linalg.norm(difference[:, :3], axis=1), np.linalg.norm(moment, axis=1) / LEVER)
    wrong = fit.use & (size > limit)
    if not wrong.any():
        return fit, ""
    wide = binary_dilation(wrong, iterations=max(1, round(AROUND * fit.motion.rate)))
    left = fit.use & ~wide
    where = fit.motion.time[int(np.argmax(np.where(fit.use, size, -1.0)))]
    return replace(fit, use=left), (
        f"{fit.name}: {int((fit.use & ~left).sum())} of {int(fit.use.sum())} frames left out, the motion needs up to "
        f"{size[fit.use].max():.0f} N more than the plates show (at {where:.2f} s, limit {limit:.0f} N): look for a posture that jumps or "
        "a contact beside the plates."
    )

"""How far every uncertain quantity of the body was pulled from what was known before, and what it still means for the
joints: pull and impact, as particle physics ranks its nuisance parameters.

Pull = (value - prior value) / prior standard deviation. Impact = what one standard deviation of the quantity after the
data does to a joint moment, all other quantities following it as far as they hang together with it (their regression on
it): for parameters phi with covariance C and a quantity g' phi of standard deviation s, phi moves by C g / s and the
moment by Y C g / s, Y its regressor. Squared and summed over quantities that do not hang together it is the variance of
the moment. After ATLAS and CMS, Procedure for the LHC Higgs boson search combination, ATL-PHYS-PUB-2011-11 (2011).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.identification.identification import Identification
from biodance.identification.knowledge import QUANTITIES, segment_quantities
from biodance.identification.torques import torque_regressor
from biodance.records import Array, Motion

_JOINTS = ("knee_flexion", "hip_flexion")
_FRAMES = 400
"""Frames, about, from which a root mean square is taken."""


@dataclass(frozen=True)
class Impact:
    """One quantity of a ``segment``: its ``pull`` and its standard deviation after the data ``left``, both in prior
    standard deviations; ``knee``, ``hip`` N·m, RMS over the used frames of the flexion moment that one standard
    deviation of it after the data adds, on the side where that is more.
    """

    segment: str
    quantity: str
    pull: float
    left: float
    knee: float
    hip: float


def impacts(found: Identification, motion: Motion, use: NDArray[np.bool_]) -> tuple[Impact, ...]:
    """Return every quantity of every segment in the frames ``use`` (T,) of ``motion``, the largest impact first; ()
    where no knee or hip bends or no frame is used.
    """
    names = [joint.name for joint in found.body.joints]
    of = {kind: [i for i, name in enumerate(names) if name.endswith(kind)] for kind in _JOINTS}
    if not use.any() or not all(of.values()):
        return ()
    at = np.flatnonzero(use)
    at = at[:: max(1, at.size // _FRAMES)]
    frames = motion.at(at)
    joints = [i for kind in _JOINTS for i in of[kind]]
    Y = torque_regressor(found.body, frames)[:, joints]
    moved, sd = _moved(found)
    added = np.sqrt(np.mean((Y.reshape(-1, Y.shape[2]) @ moved).reshape(len(Y), len(joints), -1) ** 2, axis=0))
    knee, hip = added[: len(of["knee_flexion"])].max(axis=0), added[len(of["knee_flexion"]) :].max(axis=0)
    rows = [
        Impact(
            known.segment,
            known.quantity,
            (known.value - known.table) / known.table_sd,
            known.sd / known.table_sd,
            float(knee[k]),
            float(hip[k]),
        )
        for k, known in enumerate(found.known)
        if known.table_sd > 0 and sd[k] > 0
    ]
    return tuple(sorted(rows, key=lambda row: -max(row.knee, row.hip)))


def _moved(found: Identification) -> tuple[Array, Array]:
    """Return by how much the parameters move (10N, 10N) with one standard deviation of each quantity, and these (10N,).

    Columns in the order of ``found.known``: segment by segment, in each the quantities of `QUANTITIES`.
    """
    C, size = found.belief.covariance, len(QUANTITIES)
    slopes = np.zeros_like(C)
    for i in range(len(found.sip.segments)):
        cut = slice(size * i, size * i + size)
        slopes[cut, cut] = segment_quantities(found.sip.phi[cut])[1].T
    together = C @ slopes
    sd = np.sqrt(np.maximum(np.einsum("pk,pk->k", slopes, together), 0.0))
    return np.divide(together, sd, out=np.zeros_like(together), where=sd > 0), sd

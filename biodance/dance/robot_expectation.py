"""What will be known of a robot after its dance: encoders and geometry are exact, what errs is the wrench.

The maker's data as prior, one independent error of the wrench in every quarter of a second; no soft tissue, no joint centres to find.
"""

import numpy as np

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.expectation import Expectation
from biodance.identify.information import Information, fold
from biodance.identify.knowledge import segment_quantities
from biodance.identify.posterior import Posterior, posterior
from biodance.motion.regressor import regressor
from biodance.records import Array, Motion

ERROR = np.array([1.1, 0.5, 0.9, 0.2, 0.7, 0.4])
"""N, N·m: error of one sample of the wrench; what Bonnet 2016 left unexplained of an unseen movement of HOAP-3 (table II)."""
RATE = 4.0
"""Hz: independent samples of the wrench."""


def robot_rows(body: Body, motion: Motion, wrench: Array) -> Array:
    """Return the whitened rows (6 T, 10N + 1) of [W y] for a ``motion`` and a ``wrench`` (T, 6) N, N·m at ``RATE`` or slower."""
    rows = np.concatenate([regressor(body, motion), wrench[:, :, None]], axis=2) / ERROR[:, None]
    return np.asarray(rows.reshape(-1, rows.shape[2]))


def expect_robot(dance: Dance, *, steps: int = 10) -> Expectation:
    """Return what is expected after ``steps`` durations of ``dance``, evenly spread over its postures, if it is danced exactly."""
    body, motion = dance.body, dance.motion(RATE)
    rows = robot_rows(body, motion, regressor(body, motion) @ body.sip.phi)
    ends = [phase.end for phase in dance.phases if phase.kind == "hold"]
    chosen = [ends[k] for k in sorted({int(k) for k in np.linspace(0, len(ends) - 1, steps + 1).round()[1:]})]
    triangle, start = np.zeros((rows.shape[1], rows.shape[1])), 0
    beliefs = [posterior(Information(triangle, 1), body.sip)]
    for end in chosen:
        stop = int(np.searchsorted(motion.time, end)) * 6
        triangle, start = fold(rows[start:stop], triangle), stop
        beliefs.append(posterior(Information(triangle, stop), body.sip))
    sd = np.array([[_deviations(belief, 10 * i) for i in range(len(body.segments))] for belief in beliefs])
    share = np.array([belief.information.reshape(-1, 10).mean(axis=1) for belief in beliefs])
    mass, com, inertia = np.moveaxis(sd, 2, 0)
    return Expectation(body.segments, np.array([0.0, *chosen]), mass, com, inertia, share)


def _deviations(belief: Posterior, first: int) -> Array:
    """Return the standard deviations (3,) of mass kg, CoM m (per axis) and moments of inertia kg·m² of one segment."""
    cut = slice(first, first + 10)
    _, slope = segment_quantities(belief.prior.phi[cut])
    variance = np.diag(slope @ belief.covariance[cut, cut] @ slope.T)
    return np.sqrt([variance[0], np.mean(variance[1:4]), np.mean(variance[[4, 6, 9]])])

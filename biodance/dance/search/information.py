"""What standing in a posture and going there tells of the body: rows of the regressor, per standard deviation of the
error and of the table.

With ``centres`` postures also tell of the centres of the ball joints, which identification finds from the movement. A
centre lies at c in the frame of the one segment and at d in that of the other: c = R d + their distance, with R the
rotation between them. Every posture is one such equation, and only postures that differ tell both apart.
"""

import numpy as np
from scipy.linalg import block_diag

from biodance.dance.problem.chain import Chain
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.splines import rest_to_rest
from biodance.identification.posterior import prior_factor
from biodance.motion.dynamics import regressor
from biodance.motion.kinematics import poses
from biodance.records import Array

SAMPLE_ERROR = np.array([8.0, 8.0, 8.0, 4.0, 4.0, 4.0])
"""N, N·m: error of one independent sample of the wrench of a person (residual of the paper: 7.8 N, 4.3 N·m)."""
SAMPLE_RATE = 4.0
"""Hz: independent samples per second of moving."""
_BALLS = (
    *(("pelvis", "right_thigh"), ("pelvis", "left_thigh"), ("pelvis", "trunk_head")),
    *(("trunk_head", "right_upper_arm"), ("trunk_head", "left_upper_arm")),
)
_UNKNOWN, _SKIN = 0.015, 0.020
"""m: what is not known of a centre before the movement, and how far skin slides in one posture."""
CENTRES = 6 * len(_BALLS)
"""Unknown coordinates of all centres."""


class PostureInformation:
    """What postures of ``chain`` and moves of the plan's duration tell; ``factor`` (10 N, k): the table's covariance is
    ``factor factor'``; ``scale`` (10 N, k) the same per standard deviation of the table, weighted by the plan.

    Rows (m, k) are per standard deviation; a posterior (k, k) is the covariance of what they multiply, 1 beforehand.
    """

    def __init__(self, chain: Chain, plan: Plan, *, centres: bool = False) -> None:
        self.chain, self.centres, self.factor = chain, centres, prior_factor(chain.body.sip)
        before = np.sum(self.factor**2, axis=1)
        self.weight = np.repeat(plan.emphasis(chain.body.segments), 10) * (before > 0)
        self.scale = self.factor * np.sqrt(self.weight / np.where(before > 0, before, 1.0))[:, None]
        if centres:
            self.factor = np.pad(self.factor, ((0, 0), (0, CENTRES)))
            self.scale = block_diag(self.scale, np.eye(CENTRES))
        way = rest_to_rest(plan.move, via=0, rate=SAMPLE_RATE)
        self._way = [part[1:-1] for part in (way.position, way.velocity, way.acceleration)]

    @property
    def beforehand(self) -> Array:
        """(k, k) the posterior before any posture."""
        return np.eye(self.factor.shape[1])

    def white(self, W: Array) -> Array:
        """Return regressors (G, 6 T, 10 N) per standard deviation of error and of the table, (G, 6 T, k)."""
        error = np.tile(SAMPLE_ERROR, W.shape[1] // 6)
        flat = (W / error[:, None]).reshape(-1, W.shape[2]) @ self.factor  # one product: many small ones are slow
        return np.asarray(flat.reshape(*W.shape[:2], -1))

    def standing(self, x: Array) -> Array:
        """Return the regressor (S, 6, 10 N) of standing still in each posture (S, n)."""
        motion = self.chain.motion(np.arange(len(x), dtype=float), x, *np.zeros((2, *x.shape)))
        return np.asarray(regressor(self.chain.body, motion)).reshape(len(x), 6, -1)

    def of_ways(self, ends: Array) -> Array:
        """Return the rows (G, m, k) of going straight from one posture to another, ``ends`` (G, 2, n)."""
        x, v, a = ((part @ ends).reshape(-1, ends.shape[2]) for part in self._way)
        W = regressor(self.chain.body, self.chain.motion(np.arange(len(x)) / SAMPLE_RATE, x, v, a))
        return self.white(np.asarray(W).reshape(len(ends), -1, W.shape[-1]))

    def of_posture(self, x: Array, standing: Array) -> Array:
        """Return the rows (m, k) of a posture ``x`` (n,) whose regressor ``standing`` (6, 10 N) is known."""
        still = self.white(standing[None])[0]
        return np.concatenate([still, rows_of_centres(self.chain, x, still.shape[1])]) if self.centres else still

    def gains(self, posterior: Array, rows: Array) -> Array:
        """Return by how much each of ``rows`` (..., m, k) lowers the weighted variance that a posterior leaves,
        (...).
        """
        return np.asarray(np.sum((learned(posterior, rows) @ self.scale.T) ** 2, axis=(-2, -1)))


def learned(posterior: Array, rows: Array) -> Array:
    """Return Z (..., m, k) with new covariance = ``posterior`` - Z'Z (k, k) after whitened ``rows`` (..., m, k)."""
    spread = rows @ posterior
    factor = np.linalg.cholesky(np.eye(rows.shape[-2]) + spread @ np.swapaxes(rows, -1, -2))
    return np.asarray(np.linalg.solve(factor, spread))


def update_posterior(posterior: Array, rows: Array) -> Array:
    """Return the posterior (k, k) after whitened ``rows`` (m, k)."""
    Z = learned(posterior, rows)
    return np.asarray(posterior - Z.T @ Z)


def rows_of_centres(chain: Chain, x: Array, columns: int) -> Array:
    """Return the whitened rows (3 J, columns) of a posture ``x`` (n,): per standard deviation of what slides and, in
    the last `CENTRES` columns, of what is not known of the J centres.
    """
    body, out = chain.body, np.zeros((3 * len(_BALLS), columns))
    turned = np.asarray(poses(body, chain.positions(x[None])).rotation)[0]
    for k, (near, far) in enumerate(_BALLS):
        first, second = (turned[body.segments.index(name)] for name in (near, far))
        here = columns - CENTRES + 6 * k
        out[3 * k : 3 * k + 3, here : here + 6] = np.hstack([np.eye(3), -first.T @ second])
    return out * _UNKNOWN / _SKIN

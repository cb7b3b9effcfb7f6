"""How restless the skin of a session is: what its markers do on the body that no joint angle explains.

Errors of soft tissue that go with the movement are looked for one by one (`soft_tissue`), all markers of a segment
alike. What goes its own way (waves of flesh, clothes, a strap that works loose) follows no column, and neither does
flesh that lags behind the acceleration where every marker of a segment lags otherwise: both can only be noise, and the
markers show how much of it there is, where, and how fast it is.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.parts import GRAVITY
from biodance.motion.kinematics import poses
from biodance.records import Array, Motion, Trial
from biodance.uncertainty.bands import BANDS

_RATE = 50.0
"""Hz at which markers are looked at: second differences of what is slower than 6 Hz are good to 10 %."""
_FEWEST = 10.0
"""Coefficients per band and axis, beside those that the movement explains, below which nothing is measured."""
_LOUDEST = 9.0
"""Times the power of the middle marker (three times its size) beyond which a marker is wrong rather than restless."""
_EXPLAINED = 1e-6
"""Share of a specific force beside the joint angles below which these explain it."""


@dataclass(frozen=True, eq=False)
class SkinUnrest:
    """What the markers do on the body per axis and coefficient, in every band: (B, 3, M) m², m²/s², m²/s⁴, the power
    times the powers 0, 2 and 4 of its angular frequency; zero in bands where too little is left to tell and for markers
    that tell nothing (weight zero, seen in less than half of the time).

    ``waves`` what neither joint angles nor the specific force at the marker explain; ``swing`` what the specific force
    explains beside the angles: flesh that lags behind the acceleration.
    """

    waves: Array
    swing: Array

    def sizes(self) -> tuple[Array, Array]:
        """Return (B,) m of the waves and of the swing: the middle marker, as one that is wrong tells nothing."""
        return np.sqrt(_middle(self.waves)[:, 0]), np.sqrt(_middle(self.swing)[:, 0])

    def excess(self, waves: tuple[float, ...], swing: tuple[float, ...]) -> Array:
        """Return (B, 3, M): power that is more than usual, where (B,) m of ``waves`` and ``swing`` are; of the waves
        none in the fastest band, where markers show the cameras.
        """
        own = _excess(self.waves, waves)
        own[-1] = 0.0
        return own + _excess(self.swing, swing)


@dataclass(frozen=True, eq=False)
class _Runs:
    """Coefficients of all runs: of ``angles`` (m, 1 + A) with a constant, of the markers' places on the body ``local``
    (m, K, 3) m, NaN = not seen, and of the ``specific`` force there (m, K, 3) m/s²; ``frequency`` (m,) Hz.
    """

    angles: Array
    local: Array
    specific: Array
    frequency: Array


def skin_unrest(body: Body, moved: Iterable[tuple[Trial, Motion, NDArray[np.bool_]]]) -> SkinUnrest:
    """Return what the markers of ``body`` do on it in ``moved`` trials, with its motion and the frames (T,) to look at.

    Least squares take off what the joint angles explain, then what the specific force at the marker does, with the same
    coefficients in all trials.
    """
    found = [one for trial, motion, use in moved for one in _runs(body, trial, motion, use)]
    out = np.zeros((2, len(BANDS), 3, len(body.markers.names)))
    if found:
        every = _Runs(*(np.concatenate([getattr(one, part) for one in found]) for part in _Runs.__dataclass_fields__))
        for k in np.flatnonzero(np.asarray(body.markers.weight) > 0):
            out[..., k] = _left(every, int(k))
    return SkinUnrest(*out)


def _middle(power: Array) -> Array:
    """Return (B, 3): the median of ``power`` (B, 3, M) over the markers that tell anything."""
    told = power[:, :, power.any(axis=(0, 1))]
    return np.median(told, axis=2) if told.size else np.zeros(power.shape[:2])


def _excess(power: Array, usual: tuple[float, ...]) -> Array:
    """Return (B, 3, M): the share of the ``power`` of every marker by which the middle one exceeds what is ``usual``
    (B,) m.
    """
    middle = _middle(power)
    # Share of the power beyond the usual: 1 - usual² / measured², as independent parts add in power.
    share = np.maximum(1 - np.square(usual) / np.maximum(middle[:, 0], 1e-12), 0.0)
    return np.asarray(share[:, None, None] * np.minimum(power, _LOUDEST * middle[:, :, None]))


def _runs(body: Body, trial: Trial, motion: Motion, use: NDArray[np.bool_]) -> Iterator[_Runs]:
    """Yield the coefficients of every run of the frames ``use`` (T,) of a trial."""
    markers, step = trial.markers, max(1, round(motion.rate / _RATE)) if np.isfinite(motion.rate) else 0
    if markers is None or not step:
        return
    q, rate = motion.q[::step], motion.rate / step
    worn = [k for k, name in enumerate(body.markers.names) if name in markers]
    pose, segment = poses(body, q), [body.markers.segment[k] for k in worn]
    place = pose.points(segment, body.markers.position[worn])
    shape = (len(q), len(body.markers.names), 3)
    local, specific = np.full(shape, np.nan), np.zeros(shape)
    turn = pose.rotation[:, segment]
    apart = markers.select(body.markers.names[k] for k in worn).xyz[::step] - place
    # R' (measured - model): sum over i of R[t, k, i, j] d[t, k, i].
    local[:, worn] = np.einsum("tkij,tki->tkj", turn, apart)
    if len(q) > 2:
        acceleration = np.gradient(np.gradient(place, 1 / rate, axis=0), 1 / rate, axis=0)
        # Specific force g - a in the segment's axes: what flesh is pulled by.
        specific[:, worn] = np.einsum("tkij,tki->tkj", turn, GRAVITY - acceleration)
    angles = np.column_stack([np.ones(len(q)), q[:, 7 if body.n_root else 0 :]])
    bands = BANDS.at(rate)
    for pick in bands.runs(use[::step], rate):
        # As in `Bands.of`: k half periods in the run.
        frequency = np.arange(pick.size) * bands.rate / (2 * pick.size)
        kept = bands.of(pick.size) >= 0
        cut = [bands.coefficients(one[pick])[kept] for one in (angles, local, specific)]
        yield _Runs(cut[0], cut[1], cut[2], frequency[kept])


def _left(every: _Runs, marker: int) -> Array:
    """Return (2, B, 3): waves and swing of one marker, per axis and coefficient; zero for one that was not seen in half
    of the time. How far it lags is measured below the fastest band, where markers show the cameras.
    """
    out, seen = np.zeros((2, len(BANDS), 3)), np.isfinite(every.local[:, marker]).all(axis=1)
    if seen.mean() < 0.5:
        return out
    angles, specific, place = every.angles[seen], every.specific[seen, marker], every.local[seen, marker]
    speed = 2 * np.pi * every.frequency[seen]
    band = np.searchsorted(BANDS.edges, every.frequency[seen], side="right") - 1
    # Columns that never move are left out: QR of a zero column would still give it a direction.
    basis = np.linalg.qr(angles[:, angles.any(axis=0)])[0]
    # Q Q' projects on the angles; what is left of place and specific force is orthogonal to them (Frisch-Waugh).
    rest, beside = (one - basis @ (basis.T @ one) for one in (place, specific))
    told = np.linalg.norm(beside, axis=0) > _EXPLAINED * np.linalg.norm(specific, axis=0)
    slow, beside = band < len(BANDS) - 1, beside[:, told]
    # Fitted in slow bands alone, applied in all: in the fastest, cameras would look like lag.
    swing = beside @ np.linalg.lstsq(beside[slow], rest[slow], rcond=None)[0]
    # 1 - leverage: how many coefficients of a band the angles leave (its sum is n - p over all).
    free = 1 - np.sum(basis**2, axis=1)
    for b in range(len(BANDS)):
        here = band == b
        if free[here].sum() >= _FEWEST:
            for which, (one, count) in enumerate(((rest - swing, free[here].sum()), (swing, here.sum()))):
                square = np.mean(one[here] ** 2, axis=1)
                # Powers of the angular frequency: displacement, and what it becomes in velocity and acceleration.
                out[which, b] = [np.sum(square * speed[here] ** power) / count for power in (0, 2, 4)]
    return out

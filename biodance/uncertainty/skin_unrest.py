"""How restless the skin of a session is: what its markers do on the body that no joint angle, weight or acceleration
explains.

Errors of soft tissue that go with the movement are looked for one by one (`soft_tissue`). What goes its own way (waves
of flesh, clothes, a strap that works loose) follows no column: it can only be noise, and the markers show how much of
it there is, and how fast it is.
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


@dataclass(frozen=True, eq=False)
class _Runs:
    """Coefficients of all runs: of ``angles`` (m, 1 + A) with a constant, of the markers' places on the body ``local``
    (m, K, 3) m, NaN = not seen, and of the ``specific`` force there (m, K, 3) m/s²; ``frequency`` (m,) Hz.
    """

    angles: Array
    local: Array
    specific: Array
    frequency: Array


def skin_unrest(body: Body, moved: Iterable[tuple[Trial, Motion, NDArray[np.bool_]]]) -> Array:
    """Return (B, 3) m², m²/s², m²/s⁴: what is left of a marker's place on the body per axis and coefficient, times the
    powers 0, 2 and 4 of its angular frequency, in every band; the median over the markers that count, as a marker that
    is wrong tells nothing of the skin.

    ``moved`` trials with the motion of ``body`` in them and the frames (T,) to look at. Least squares take off what the
    joint angles and the specific force at the marker explain, with the same coefficients in all trials; zero in bands
    where too little is left to tell.
    """
    found = [one for trial, motion, use in moved for one in _runs(body, trial, motion, use)]
    if not found:
        return np.zeros((len(BANDS), 3))
    every = _Runs(*(np.concatenate([getattr(one, part) for one in found]) for part in _Runs.__dataclass_fields__))
    left = [_left(every, k) for k, weight in enumerate(body.markers.weight) if weight > 0]
    seen = [one for one in left if one is not None]
    return np.median(seen, axis=0) if seen else np.zeros((len(BANDS), 3))


def excess_unrest(power: Array, usual: tuple[float, ...]) -> Array:
    """Return what of the unrest ``power`` (B, 3) (`skin_unrest`) is more than ``usual`` (B) m; none in the fastest
    band, where markers show the cameras.
    """
    share = 1 - np.square(usual) / np.maximum(power[:, 0], 1e-12)
    share[-1] = 0.0
    return power * np.maximum(share, 0.0)[:, None]


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
    local[:, worn] = np.einsum("tkij,tki->tkj", turn, apart)
    if len(q) > 2:
        acceleration = np.gradient(np.gradient(place, 1 / rate, axis=0), 1 / rate, axis=0)
        specific[:, worn] = np.einsum("tkij,tki->tkj", turn, GRAVITY - acceleration)
    angles = np.column_stack([np.ones(len(q)), q[:, 7 if body.n_root else 0 :]])
    bands = BANDS.at(rate)
    for pick in bands.runs(use[::step], rate):
        frequency = np.arange(pick.size) * bands.rate / (2 * pick.size)
        kept = bands.of(pick.size) >= 0
        cut = [bands.coefficients(one[pick])[kept] for one in (angles, local, specific)]
        yield _Runs(cut[0], cut[1], cut[2], frequency[kept])


def _left(every: _Runs, marker: int) -> Array | None:
    """Return (B, 3): what is left of one marker, per axis and coefficient that nothing explains; None for one that was
    not seen in half of the time.
    """
    seen = np.isfinite(every.local[:, marker]).all(axis=1)
    if seen.mean() < 0.5:
        return None
    explaining = np.column_stack([every.angles, every.specific[:, marker]])[seen]
    basis, place = np.linalg.qr(explaining[:, explaining.any(axis=0)])[0], every.local[seen, marker]
    rest, free = place - basis @ (basis.T @ place), 1 - np.sum(basis**2, axis=1)
    speed = 2 * np.pi * every.frequency[seen]
    band = np.searchsorted(BANDS.edges, every.frequency[seen], side="right") - 1
    out = np.zeros((len(BANDS), 3))
    for b in range(len(BANDS)):
        here = band == b
        if free[here].sum() >= _FEWEST:
            square = np.mean(rest[here] ** 2, axis=1)
            out[b] = [np.sum(square * speed[here] ** power) / free[here].sum() for power in (0, 2, 4)]
    return out

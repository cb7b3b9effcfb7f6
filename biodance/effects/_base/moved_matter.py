"""What the wrench becomes when the matter of a body lies a little elsewhere than tracked.

With places c, velocities c', spins w, inertias I and masses m of the segments, and their displacements d and turns r
(lab frame), the ground wrench changes by

    force = P'',   moment = Q'' + S' - P x g,
    P = sum m d,   Q = sum m c x d + I r,   S = sum 2 m d x c' + r x (I w) - (w x I - I w x) r,

so that nine numbers per frame carry everything, and only they are filtered and differentiated (docs/derivations.md,
"Moved matter").
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from biodance.body.inertia import TENSOR
from biodance.lab.filters import LowPass, low_pass
from biodance.motion.kinematics import SegmentMotion
from biodance.records import Array
from biodance.spatial import skew

_DEGREE = 5


@dataclass(frozen=True, eq=False)
class MovedMatter:
    """F frames of N segments: ``by_place``, ``by_turn`` (F, 9, N, 3): P, Q, S per metre and radian of each segment."""

    by_place: Array
    by_turn: Array


def moved_matter(move: SegmentMotion, phi: Array, speed: Array) -> MovedMatter:
    """Return the map of segments that move as ``move`` with the parameters ``phi`` (10N,); ``speed`` (F, N, 3) m/s
    of their CoM.
    """
    table = phi.reshape(-1, 10)
    mass = table[:, 0]
    arm = (move.rotation @ centres_of(phi)[..., None])[..., 0]
    tensor = np.empty((len(table), 3, 3))
    for column, (i, j) in enumerate(TENSOR, start=4):
        tensor[:, i, j] = tensor[:, j, i] = table[:, column]
    spin_of = move.rotation @ tensor @ np.swapaxes(move.rotation, -1, -2)
    heavy = mass[:, None, None]
    central = spin_of - heavy * (
        np.sum(arm**2, axis=-1)[..., None, None] * np.eye(3) - arm[..., :, None] * arm[..., None, :]
    )
    spin = (central @ move.angular_velocity[..., None])[..., 0]
    wheel = skew(move.angular_velocity)
    unit = np.broadcast_to(heavy * np.eye(3), central.shape)
    place = np.stack([unit, heavy * skew(move.position + arm), -2 * heavy * skew(speed)], axis=1)
    turn = np.stack([np.zeros_like(central), central, -skew(spin) - (wheel @ central - central @ wheel)], axis=1)
    return MovedMatter(*(np.moveaxis(part, 2, 3).reshape(len(part), 9, len(table), 3) for part in (place, turn)))


def centres_of(phi: Array) -> Array:
    """Return the centres of mass (N, 3) m in the segment frames; the origin for a segment without mass."""
    table = phi.reshape(-1, 10)
    return np.asarray(table[:, 1:4] / np.where(table[:, :1] != 0, table[:, :1], np.inf))


def wrench_of(nine: Array, time: Array, wanted: Array, *, smoothed: LowPass, gravity: Array) -> Array:
    """Return the change (T, 6, P) of the ground wrench about the lab origin at the even times ``wanted`` (T,) s from P,
    Q, S ``nine`` (F, 9, P) at some ``time`` (F,) s, low-passed and differentiated as the motion was (``smoothed``, see
    `biodance.motion.smoothing`).
    """
    rough = make_interp_spline(time, nine.reshape(len(nine), -1), k=_DEGREE)(wanted)
    smooth = low_pass(rough, (len(wanted) - 1) / (wanted[-1] - wanted[0]), smoothed)
    ends = [(order, np.zeros(smooth.shape[1])) for order in (3, 4)]
    spline = make_interp_spline(wanted, smooth, k=_DEGREE, bc_type=(ends, ends))
    first, second = (spline(wanted, nu=order).reshape(len(wanted), 9, -1) for order in (1, 2))
    moment = second[:, 3:6] + first[:, 6:] + skew(gravity) @ smooth.reshape(first.shape)[:, :3]
    return np.concatenate([second[:, :3], moment], axis=1)

"""Loads on segments: the ten parameters of a compact load, their second moment where mass and place are unknown, a body
that may carry one, and on which segment the place of one lies: a load is looked for in and near every segment's box,
and near a joint the box of the neighbour is as near.
"""

from collections.abc import Sequence

import numpy as np

from biodance.body.body import Body
from biodance.motion.kinematics import poses
from biodance.records import Array, Motion, Sip
from biodance.spatial import point_mass

_SCALE = 2.0
"""kg: typical size of a load; the answer changes little between half and twice of it."""
_RADIUS = 0.04
"""m: radius of gyration of a compact load."""
_NEAR = 0.5
"""A load may lie this share of the box beyond the box (straps, wrist weights)."""
UNDECLARED = 0.25
"""Share of a load's second moment that noise is learned with: 1 kg on every segment, undeclared."""


def compact_load(place: Array) -> Array:
    """Return the ten parameters (..., 10) per kg of compact loads with CoM at ``place`` (..., 3) m."""
    return point_mass(1.0, place, radius=_RADIUS)


def load_moments(body: Body, segment: int) -> Array:
    """Return U (10, k): U U' is the second moment of the parameters of a load of typical mass in or near the
    segment's box.
    """
    loads = _unit_loads(body, segment) * _SCALE
    # Second moment about zero, not the covariance: that there is a load at all is unknown.
    return _factor(loads.T @ loads / len(loads))


def unit_load(body: Body, segment: int) -> tuple[Array, Array]:
    """Return mean (10,) and factor G (10, k) of the covariance G G' of the parameters of a load of 1 kg in or near the
    segment's box.
    """
    loads = _unit_loads(body, segment)
    mean = loads.mean(axis=0)
    return mean, _factor((loads - mean).T @ (loads - mean) / len(loads))


def _unit_loads(body: Body, segment: int) -> Array:
    """Return the parameters (2000, 10) of loads of 1 kg, placed alike in and near the segment's box."""
    low, high = body.boxes[segment]
    margin = _NEAR * (high - low)
    place = np.random.default_rng(segment).uniform(low - margin, high + margin, (2000, 3))
    return compact_load(place)


def _factor(moment: Array) -> Array:
    """Return U (10, k) with U U' = ``moment`` (10, 10), without directions of no size."""
    value, vector = np.linalg.eigh(moment)
    keep = value > 1e-12 * value.max()
    # V E^1/2: directions of no size would be zero columns.
    return np.asarray(vector[:, keep] * np.sqrt(value[keep]))


def unknown_loads(body: Body, *, share: Array | None = None) -> Array:
    """Return the covariance (10N, 10N) that an undeclared load on every segment adds; ``share`` (N,) of a load's second
    moment for every segment, by default `UNDECLARED`.
    """
    room = np.full(len(body.segments), UNDECLARED) if share is None else share
    covariance = np.zeros((10 * len(room), 10 * len(room)))
    for i in range(len(body.segments)):
        U = load_moments(body, i)
        covariance[10 * i : 10 * i + 10, 10 * i : 10 * i + 10] = room[i] * U @ U.T
    return covariance


def with_room(prior: Sip, loads: Array) -> Sip:
    """Return ``prior`` with a covariance that leaves room for `unknown_loads`. Noise is learned under it: with the
    total mass pinned to the declared one, a load would pass for slow noise.
    """
    return Sip(prior.segments, prior.phi, prior.covariance + loads)


_FRAMES = 50
"""Frames of a movement in which the boxes are compared: only joints that turn far change the answer."""


def nearest_segment(body: Body, motions: Sequence[Motion], segment: str, place: Array) -> str:
    """Return the segment to whose box a point is nearest in the mean over ``motions``.

    Parameters
    ----------
    body : Body
        Whose boxes are compared.
    motions : sequence of Motion
        In which the point is carried along.
    segment : str
        That carries the point; it is the answer where no other is nearer.
    place : Array
        (3,) m in the joint frame of ``segment``; NaN: not known.

    Returns
    -------
    str
        Its name; "" where the place is not known.
    """
    if not np.isfinite(place).all():
        return ""
    q = np.concatenate([one.q[:: max(1, len(one.q) // _FRAMES)] for one in motions])
    pose, own = poses(body, q), body.segment_index(segment)
    point, n = pose.points([own], place[None]), len(body.segments)
    # R'(point - origin) in every segment's axes: sum over j of R[t, s, j, i] d[t, s, j].
    local = np.einsum("tsji,tsj->tsi", pose.rotation[:, :n], point - pose.position[:, :n])
    low, high = np.moveaxis(body.boxes, 1, 0)
    # Distance outside a box: per axis what lies beyond either side, zero inside.
    far = np.linalg.norm(np.maximum(0.0, np.maximum(low - local, local - high)), axis=2).mean(axis=0)
    return segment if far[own] <= far.min() else body.segments[int(np.argmin(far))]

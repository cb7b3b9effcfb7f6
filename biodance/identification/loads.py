"""Loads on segments: the ten parameters of a compact load, their second moment where mass and place are unknown, and a
body that may carry one.
"""

import numpy as np

from biodance.body.body import Body
from biodance.records import Array, Sip
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
    return np.asarray(vector[:, keep] * np.sqrt(value[keep]))


def with_unknown_load(body: Body, prior: Sip, *, share: Array | None = None) -> Sip:
    """Return ``prior`` with a covariance that leaves room for an undeclared load on every segment.

    ``share`` (N,) of a load's second moment for every segment, by default `UNDECLARED`. Noise is learned under it: with
    the total mass pinned to the declared one, a load would pass for slow noise.
    """
    room = np.full(len(prior.segments), UNDECLARED) if share is None else share
    covariance = np.array(prior.covariance)
    for i in range(len(prior.segments)):
        U = load_moments(body, i)
        covariance[10 * i : 10 * i + 10, 10 * i : 10 * i + 10] += room[i] * U @ U.T
    return Sip(prior.segments, prior.phi, covariance)

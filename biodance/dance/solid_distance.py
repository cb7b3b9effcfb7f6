"""Distances between the solids of a body, exactly, by coal: for checking, not for optimising.

Pairs that are certainly further apart than ``ENOUGH`` (by points on their axes or their middles) are not measured more closely.
"""

from typing import Any

import numpy as np

from biodance.body.body import Body
from biodance.dance.shapes import Solids
from biodance.motion.kinematics import Poses
from biodance.records import Array

ENOUGH = 0.05
"""m: a distance above it is given as what is certain."""
POINTS = 5
"""Points on the axis of a capsule for the first look."""


def distances(body: Body, pose: Poses) -> tuple[Array, list[str]]:
    """Return the distances (T, pairs) m between surfaces, negative where they overlap, and the names of the pairs.

    A distance above ``ENOUGH`` is a lower bound of the true one.
    """
    solids = Solids.of(body)
    limbs = list(zip(solids.first, solids.second, strict=True))
    boxes = list(zip(solids.limb, solids.box, strict=True))
    out = np.stack(
        [*(_limbs_at_least(solids, pose, *pair) for pair in limbs), *(_box_at_least(body, solids, pose, *pair) for pair in boxes)], axis=1
    )
    shapes = _Shapes(body, solids)
    for t, k in zip(*np.nonzero(out < ENOUGH), strict=True):
        i, j = (limbs + boxes)[k]
        out[t, k] = shapes.distance(pose, t, i, j, box=k >= len(limbs))
    return out, [f"{body.segments[i]} - {body.segments[j]}" for i, j in limbs + boxes]


def _axis(solids: Solids, pose: Poses, segment: int) -> tuple[Array, float]:
    """Return points (T, K, 3) m on the axis of a capsule and half the way between them, m."""
    a, b = solids.axis[segment]
    points = a + np.linspace(0, 1, POINTS)[:, None] * (b - a)
    return pose.points([segment] * POINTS, points), float(np.linalg.norm(b - a)) / (POINTS - 1) / 2


def _limbs_at_least(solids: Solids, pose: Poses, i: int, j: int) -> Array:
    (a, near), (b, far) = _axis(solids, pose, i), _axis(solids, pose, j)
    apart = np.linalg.norm(a[:, :, None] - b[:, None], axis=3).min(axis=(1, 2))
    return np.asarray(apart - near - far - solids.radius[i] - solids.radius[j])


def _box_at_least(body: Body, solids: Solids, pose: Poses, limb: int, box: int) -> Array:
    points, near = _axis(solids, pose, limb)
    local = np.einsum("tji,tkj->tki", pose.rotation[:, box], points - pose.position[:, box, None])
    low, high = body.boxes[box]
    beyond = np.maximum(np.maximum(low - local, local - high), 0.0)
    return np.asarray(np.linalg.norm(beyond, axis=2).min(axis=1) - near - solids.radius[limb])


class _Shapes:
    """coal's solids of a body, made once."""

    def __init__(self, body: Body, solids: Solids) -> None:
        import coal

        self.coal: Any = coal
        self.capsules, self.turns, self.boxes = [], [], []
        for (a, b), radius in zip(solids.axis, solids.radius, strict=True):
            along = (b - a) / max(float(np.linalg.norm(b - a)), 1e-12)
            side = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
            side /= np.linalg.norm(side)
            self.capsules.append(coal.Capsule(float(radius), float(np.linalg.norm(b - a))))
            self.turns.append((np.stack([side, np.cross(along, side), along], axis=1), (a + b) / 2))
        for low, high in body.boxes:
            self.boxes.append((coal.Box(*(high - low)), (low + high) / 2))

    def distance(self, pose: Poses, t: int, limb: int, other: int, *, box: bool) -> float:
        """Return the distance m of a limb's capsule from another one or from the box of another segment in frame ``t``."""
        solid, middle = self.boxes[other] if box else (self.capsules[other], self.turns[other][1])
        own = np.eye(3) if box else self.turns[other][0]
        first, second = ((pose.rotation[t, s], pose.position[t, s]) for s in (limb, other))
        places = (
            self.coal.Transform3s(first[0] @ self.turns[limb][0], first[1] + first[0] @ self.turns[limb][1]),
            self.coal.Transform3s(second[0] @ own, second[1] + second[0] @ middle),
        )
        found = self.coal.DistanceResult()
        return float(self.coal.distance(self.capsules[limb], places[0], solid, places[1], self.coal.DistanceRequest(), found))

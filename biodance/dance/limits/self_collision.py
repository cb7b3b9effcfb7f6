"""Limbs, trunk and pelvis do not touch each other (paper eq. 14, d > 0). An arm that hangs, asked for nothing, may lie
against trunk and legs, as arms do.

Exact distances: of two line segments for two capsules, of a line segment from a box for a capsule and a box.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from biodance.body.body import Body
from biodance.dance.limits import FAR, CheckedMotion, ForImprecise, ImpreciseCopy, Limit, Margins, Remaining, bounded
from biodance.dance.problem.shapes import Solids, may_touch, points_apart, points_off_box, points_on_axis
from biodance.dance.problem.state import State
from biodance.motion.kinematics import Poses
from biodance.records import Array

SAMPLES = np.linspace(0.0, 1.0, 33)
"""Places on the axis of a capsule that are held against a box in each round of the search."""
_ROUNDS = 6  # Of the search, which leaves a sixteenth of the line each time
_ENOUGH = 0.05  # m: a distance above it is given as what is certain
_POINTS = 5  # Points on the axis of a capsule for the first look
_FREE = 1.0  # m said of two segments that may touch


@dataclass(frozen=True)
class SelfCollision(Limit):
    """``gap`` m that is left between the surfaces of any two segments at least, ``room`` m by imprecise people."""

    gap: float = bounded(0.0, 0.0, 0.04, "m")
    room: float = bounded(0.02, 0.0, 0.05, "m", imprecise=True)
    name, unit, scale, suspicion = "self_collision", "m", 0.05, 50

    def margins(self, state: State) -> Margins:
        """Return the distances (T, pairs) m between surfaces, less the gap."""
        near, far = (part(state, self.gap + FAR * self.scale) for part in (_capsules, _boxes))
        value = np.concatenate([near.value, far.value], axis=1) - self.gap
        slopes = np.concatenate([near.slopes, far.slopes], axis=2)
        free = may_touch(state.chain.body, state.stance.hanging)
        value[:, free], slopes[:, :, free] = _FREE, 0.0
        return Margins(value, slopes)

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return the distances (T, pairs) m between surfaces by coal, less the gap; a large one is a lower bound."""
        apart, pairs = solid_distances(motion.body, motion.pose)
        return Remaining(np.where(may_touch(motion.body, motion.stance.hanging), _FREE, apart - self.gap), tuple(pairs))

    def for_imprecise(self) -> ForImprecise:
        """Segments stay ``room`` apart."""
        return ForImprecise(_left, max(self.gap, self.room), "gap_m", "room between arms, legs and trunk")


LIMIT = SelfCollision


def _left(copy: ImpreciseCopy) -> Remaining:
    """Return the distances (T, pairs) m between surfaces, in closed form; large ones of moving people: lower bounds."""
    apart, pairs = surface_distances(copy.body, copy.pose, near=np.inf if copy.still else _CLOSE)
    # Who holds a frame or hangs an arm does so throughout a dance.
    return Remaining(np.where(may_touch(copy.body, copy.stances[0].hanging), _FREE, apart), pairs)


def _capsules(state: State, near: float) -> Margins:
    solids = Solids.of(state.chain.body)
    first, second = solids.first, solids.second
    a, b = (state.placed(np.repeat(side, 2), solids.axis[side].reshape(-1, 3)) for side in (first, second))
    a, b = (place.reshape(len(place), -1, 2, 3) for place in (a, b))
    s, t = nearest(a, b)
    here, there = _on(a, s), _on(b, t)
    apart = here - there
    distance = np.maximum(np.linalg.norm(apart, axis=2), 1e-9)
    value = distance - solids.radius[first] - solids.radius[second]
    slopes, close = np.zeros((1, *value.shape, state.chain.size)), (value < near).any(axis=0)
    normal = (apart / distance[..., None])[:, close]
    # d|p - q| = n (dp - dq): the places on the lines do not count, since they are the nearest (envelope theorem).
    slopes[0][:, close] = state.along(first[close], here[:, close], normal) - state.along(
        second[close], there[:, close], normal
    )
    return Margins(value, slopes)


def nearest(a: Array, b: Array) -> tuple[Array, Array]:
    """Return where on two line segments (..., 2, 3) their nearest points lie, 0..1 from the first to the second end."""
    # |r + s d1 - t d2|² is least where A s - B t = -C and B s - E t = F.
    d1, d2, r = a[..., 1, :] - a[..., 0, :], b[..., 1, :] - b[..., 0, :], a[..., 0, :] - b[..., 0, :]
    A, E, B = (np.sum(p * q, axis=-1) for p, q in ((d1, d1), (d2, d2), (d1, d2)))
    C, F = np.sum(d1 * r, axis=-1), np.sum(d2 * r, axis=-1)
    # Cramer's rule; of parallel lines, A E = B², the numerator is zero, too: s = 0 is as good as any.
    s = np.clip((B * F - C * E) / np.maximum(A * E - B * B, 1e-12), 0.0, 1.0)
    # Best t for this s, then the best s for that t: clipped at the ends of the segments.
    t = np.clip((B * s + F) / E, 0.0, 1.0)
    s = np.clip((B * t - C) / A, 0.0, 1.0)
    return s, np.clip((B * s + F) / E, 0.0, 1.0)


def _boxes(state: State, near: float) -> Margins:
    solids = Solids.of(state.chain.body)
    limb, box = solids.limb, solids.box
    ends = state.placed(np.repeat(limb, 2), solids.axis[limb].reshape(-1, 3)).reshape(len(state.x), -1, 2, 3)
    low, high = np.swapaxes(state.chain.body.boxes[box], 0, 1)
    turn, half = state.rotation[:, box], (high - low) / 2
    # (p - o)'R: into the box's frame, from its middle.
    local = (ends - state.position[:, box, None]) @ turn - (low + half)[:, None]
    share = deepest(local, half)
    depth, away = outside(_on(local, share), half)
    value = depth - solids.radius[limb]
    slopes, close = np.zeros((1, *value.shape, state.chain.size)), (value < near).any(axis=0)
    normal, place = np.einsum("tkij,tkj->tki", turn, away)[:, close], _on(ends, share)[:, close]
    # The same place as a point of the limb and of the box: only their relative motion counts.
    slopes[0][:, close] = state.along(limb[close], place, normal) - state.along(box[close], place, normal)
    return Margins(value, slopes)


def _on(ends: Array, share: Array) -> Array:
    """Return the points (..., 3) at ``share`` (...) of the way between two ends (..., 2, 3)."""
    return np.asarray(ends[..., 0, :] + share[..., None] * _along(ends))


def _along(ends: Array) -> Array:
    return np.asarray(ends[..., 1, :] - ends[..., 0, :])


def outside(point: Array, half: Array) -> tuple[Array, Array]:
    """Return the signed distance (...) of points (..., 3) from a box about the origin with half sides ``half`` (...,
    3), and its slope.
    """
    over = np.abs(point) - half
    depth = _depth(over)
    # Inside, the nearest side is the one that is left soonest.
    nearest_side = np.eye(3)[np.argmax(over, axis=-1)]
    free = depth[..., None] > 0
    # Outside, the direction to the nearest point of the box; sign(point) unfolds the octant.
    return depth, np.where(free, np.maximum(over, 0.0) / np.where(free, depth[..., None], 1.0), nearest_side) * np.sign(
        point
    )


def _depth(over: Array) -> Array:
    """Return the signed distance (...) from a box of points that lie ``over`` (..., 3) its three pairs of sides."""
    return _depth_of(*np.moveaxis(over, -1, 0))


def _depth_of(x: Array, y: Array, z: Array) -> Array:
    """Return the same of what lies over each pair of sides (...)."""
    # Inside: minus the way to the nearest side.
    inner = np.maximum(np.maximum(x, y), z)
    x, y, z = (np.maximum(part, 0.0) for part in (x, y, z))
    # Outside: length of what lies over the sides.
    beyond = np.sqrt(x * x + y * y + z * z)
    return np.where(beyond > 0, beyond, inner)


def deepest(ends: Array, half: Array) -> Array:
    """Return where (T, K), 0..1, the lines between ``ends`` (T, K, 2, 3) come nearest to their boxes with half sides
    (K, 3).

    The signed distance from a convex body is convex along a line, so that the smallest sample and its neighbours
    enclose the minimum.
    """
    start, width = np.zeros(ends.shape[:2]), np.ones(ends.shape[:2])
    first, along = (np.ascontiguousarray(np.moveaxis(part, -1, 0)) for part in (ends[..., 0, :], _along(ends)))
    for _ in range(_ROUNDS):
        share = start + width * SAMPLES[:, None, None]
        over = [np.abs(first[k] + share * along[k]) - half[..., k] for k in range(3)]  # far faster than (..., 3)
        best = np.argmin(_depth_of(*over), axis=0)
        # One sample to either side of the best one encloses the minimum.
        start = np.clip(start + width * (best - 1) / (len(SAMPLES) - 1), 0.0, 1.0)
        width = np.minimum(width * 2 / (len(SAMPLES) - 1), 1.0 - start)
    return start + width / 2


_CLOSE = 0.25
"""m between the axes of two segments whose distance is worked out; others' is a lower bound."""
_LOOKS = 4  # Places on a limb at which it is held against a box before its distance is worked out


def surface_distances(body: Body, pose: Poses, *, near: float = _CLOSE) -> tuple[Array, tuple[str, ...]]:
    """Return the distances (T, pairs) m between the surfaces of the segments that must not touch, and the pairs.

    In closed form, many frames at once; of axes farther apart than ``near`` m a lower bound.
    """
    solids = Solids.of(body)
    ends = np.stack([pose.points(list(range(len(body.segments))), solids.axis[:, k]) for k in (0, 1)], axis=2)
    low, high = np.swapaxes(body.boxes[solids.box], 0, 1)
    turn, middle = pose.rotation[:, solids.box], (low + high) / 2
    # Into the frame of the box, from its middle.
    local = (ends[:, solids.limb] - pose.position[:, solids.box, None]) @ turn - middle[:, None]
    apart = [
        _limbs_apart(ends[:, solids.first], ends[:, solids.second], near) - solids.radius[solids.second],
        _boxes_apart(local, (high - low) / 2, near),
    ]
    pairs = list(zip([*solids.first, *solids.limb], [*solids.second, *solids.box], strict=True))
    names = tuple(f"{body.segments[i]} - {body.segments[j]}" for i, j in pairs)
    return np.concatenate(apart, axis=1) - solids.radius[[i for i, _ in pairs]], names


def _limbs_apart(a: Array, b: Array, enough: float) -> Array:
    """Return the distances (T, K) of lines ``a`` from lines ``b`` (T, K, 2, 3)."""
    # Triangle inequality: no two points are nearer than the middles less both half lengths.
    out = _length(_middle(a) - _middle(b)) - _length(_along(a)) / 2 - _length(_along(b)) / 2
    near = out < enough
    a, b = a[near], b[near]
    s, t = nearest(a, b)
    out[near] = _length(_on(a, s) - _on(b, t))
    return out


def _boxes_apart(line: Array, half: Array, enough: float) -> Array:
    """Return the signed distances (T, K) of lines (T, K, 2, 3) from boxes about the origin with half sides (K, 3)."""
    first, along = line[..., 0, :], _along(line)
    # Middles of equal pieces: no point is farther from one of them than half a piece, and distance falls no faster.
    looked = [_depth(np.abs(first + (k + 0.5) / _LOOKS * along) - half) for k in range(_LOOKS)]
    out = np.min(looked, axis=0) - _length(along) / (2 * _LOOKS)
    near = out < enough
    line, half = line[near], np.broadcast_to(half, (*out.shape, 3))[near]
    out[near] = _depth(np.abs(_on(line, deepest(line[None], half)[0])) - half)
    return out


def _length(way: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", way, way)))


def _middle(ends: Array) -> Array:
    return np.asarray(ends[..., 0, :] + ends[..., 1, :]) / 2


def solid_distances(body: Body, pose: Poses) -> tuple[Array, list[str]]:
    """Return the distances (T, pairs) m between surfaces, negative where they overlap, and the names of the pairs.

    A distance above ``ENOUGH`` is a lower bound of the true one.
    """
    solids = Solids.of(body)
    limbs = list(zip(solids.first, solids.second, strict=True))
    boxes = list(zip(solids.limb, solids.box, strict=True))
    # Points on the axes, and half of what is between neighbours: no point of an axis is farther from one of them.
    points = [points_on_axis(pose, i, ends, _POINTS) for i, ends in enumerate(solids.axis)]
    between = [float(np.linalg.norm(b - a)) / (_POINTS - 1) / 2 for a, b in solids.axis]
    apart = [points_apart(points[i], points[j]) - between[i] - between[j] for i, j in limbs]
    apart = [one - solids.radius[i] - solids.radius[j] for one, (i, j) in zip(apart, limbs, strict=True)]
    apart += [points_off_box(body, pose, points[i], j) - between[i] - solids.radius[i] for i, j in boxes]
    out = np.stack(apart, axis=1)
    shapes = _Shapes(body, solids)
    for t, k in zip(*np.nonzero(out < _ENOUGH), strict=True):
        i, j = (limbs + boxes)[k]
        out[t, k] = shapes.distance(pose, t, i, j, box=k >= len(limbs))
    return out, [f"{body.segments[i]} - {body.segments[j]}" for i, j in limbs + boxes]


class _Shapes:
    """coal's solids of a body, made once."""

    def __init__(self, body: Body, solids: Solids) -> None:
        import coal

        self.coal: Any = coal
        self.capsules, self.turns, self.boxes = [], [], []
        for (a, b), radius in zip(solids.axis, solids.radius, strict=True):
            # coal's capsules lie along z: a right-handed frame whose third axis is the line.
            along = (b - a) / max(float(np.linalg.norm(b - a)), 1e-12)
            # Across the axis that is least along the line, so that the product is not small.
            side = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
            side /= np.linalg.norm(side)
            self.capsules.append(coal.Capsule(float(radius), float(np.linalg.norm(b - a))))
            self.turns.append((np.stack([side, np.cross(along, side), along], axis=1), (a + b) / 2))
        for low, high in body.boxes:
            self.boxes.append((coal.Box(*(high - low)), (low + high) / 2))

    def distance(self, pose: Poses, t: int, limb: int, other: int, *, box: bool) -> float:
        """Return the distance m of a limb's capsule from another one, or from the box of a segment, in frame ``t``."""
        solid, middle = self.boxes[other] if box else (self.capsules[other], self.turns[other][1])
        own = np.eye(3) if box else self.turns[other][0]
        first, second = ((pose.rotation[t, s], pose.position[t, s]) for s in (limb, other))
        places = (
            # R_segment R_own, and its middle in the lab.
            self.coal.Transform3s(first[0] @ self.turns[limb][0], first[1] + first[0] @ self.turns[limb][1]),
            self.coal.Transform3s(second[0] @ own, second[1] + second[0] @ middle),
        )
        found = self.coal.DistanceResult()
        return float(
            self.coal.distance(self.capsules[limb], places[0], solid, places[1], self.coal.DistanceRequest(), found)
        )

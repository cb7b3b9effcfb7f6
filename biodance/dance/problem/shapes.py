"""The room that segments take: limbs are the widest capsules in their boxes, trunk and pelvis the boxes themselves."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.motion.kinematics import Poses, poses
from biodance.records import SIDES, Array

BOXES = ("pelvis", "trunk_head")
_KINDS = (
    *("foot shank", "foot thigh", "forearm_hand thigh", "forearm_hand forearm_hand"),  # the paper's
    *("forearm_hand shank", "forearm_hand upper_arm", "shank shank", "foot foot", "thigh upper_arm"),
    *("shank thigh", "foot forearm_hand"),
)
"""Limbs that must not touch, each pair in the order of the alphabet."""
_NEIGHBOURS = ("foot shank", "foot thigh", "shank thigh", "forearm_hand upper_arm")
"""Those of them that do on one side: there only opposite sides must not."""


def capsule_pairs(body: Body) -> list[tuple[int, int]]:
    """Return the pairs of limbs (segments) that must not touch, `_KINDS`."""
    sides = [s.split("_")[0] for s in body.segments]
    kinds = [s.removeprefix("right_").removeprefix("left_") for s in body.segments]
    pairs = []
    for i, j in combinations(range(len(kinds)), 2):
        pair = " ".join(sorted([kinds[i], kinds[j]]))
        if pair in _KINDS and not (pair in _NEIGHBOURS and sides[i] == sides[j]):
            pairs.append((i, j))
    return pairs


class Pairs(NamedTuple):
    """Pairs of segments (indices) to keep apart: ``limbs`` two limbs, ``boxes`` a limb and a box. ``unchecked`` names
    those that cannot be kept apart because they overlap at zero angles.
    """

    limbs: list[tuple[int, int]]
    boxes: list[tuple[int, int]]
    unchecked: tuple[str, ...] = ()


def pairs_of(body: Body) -> Pairs:
    """Return the pairs of segments that must not touch: by name in a person's body (forearms against trunk and pelvis,
    limbs as `capsule_pairs`), else by the tree.
    """
    named = {kind for pair in _KINDS for kind in pair.split()} | set(BOXES)
    if not all(segment.removeprefix("right_").removeprefix("left_") in named for segment in body.segments):
        return tree_pairs(body)
    arms = [i for i, s in enumerate(body.segments) if s.endswith("forearm_hand")]
    return Pairs(capsule_pairs(body), [(arm, body.segment_index(box)) for arm in arms for box in BOXES])


@dataclass(frozen=True, eq=False)
class Solids:
    """What must not touch: capsules ``first`` and ``second`` (C,) of segments, limbs ``limb`` (B,) and boxes ``box``
    (B,) of segments; ``axis`` (N, 2, 3) m and ``radius`` (N,) m of the capsule in every segment's box.
    """

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    limb: NDArray[np.intp]
    box: NDArray[np.intp]
    axis: Array
    radius: Array

    @classmethod
    @lru_cache(maxsize=8)
    def of(cls, body: Body) -> "Solids":
        """Return the pairs of a body, worked out once."""
        capsules, boxes = (np.array(pairs, dtype=np.intp).reshape(-1, 2) for pairs in pairs_of(body)[:2])
        shape = [capsule(body, i) for i in range(len(body.segments))]
        axis, radius = np.array([ends for ends, _ in shape]), np.array([radius for _, radius in shape])
        return cls(capsules[:, 0], capsules[:, 1], boxes[:, 0], boxes[:, 1], axis, radius)


_ARM = ("upper_arm", "forearm_hand")


def may_touch(body: Body, hanging: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return which of the pairs of limbs, then of limbs and boxes, (C + B,) are an arm that hangs (``hanging``: 0
    right, 1 left) and anything but an arm.
    """
    solids = Solids.of(body)
    arms, hang = ({f"{SIDES[k]}_{part}" for k in which for part in _ARM} for which in ((0, 1), hanging))
    pairs = zip([*solids.first, *solids.limb], [*solids.second, *solids.box], strict=True)
    names = [{body.segments[i], body.segments[j]} for i, j in pairs]
    return np.array([bool(both & hang) and not both <= arms for both in names], dtype=bool)


def palm(body: Body, side: str) -> tuple[int, Array]:
    """Return the segment of a hand and the middle of its palm (3,) m there: 0.85 of the way to the fingertips."""
    segment = body.segment_index(f"{side}_forearm_hand")
    low, high = body.boxes[segment]
    return segment, np.array([(low[0] + high[0]) / 2, 0.85 * low[1], (low[2] + high[2]) / 2])


_NEAR = 2
"""Segments away along the tree: closer limbs are neighbours, or neighbours of the same segment."""
_LEAST = 0.01  # Half length of a capsule in a cube, in its radius: a line of no length has no direction


def capsule(body: Body, segment: int) -> tuple[Array, float]:
    """Return the ends (2, 3) m of the axis, in the segment frame, and the radius m of the widest capsule in its box."""
    low, high = body.boxes[segment]
    half, centre = (high - low) / 2, (high + low) / 2
    axis = int(np.argmax(half))
    # Radius of the smaller half width: the capsule lies inside the box.
    radius = float(np.sort(half)[0])
    reach = max(half[axis] - radius, _LEAST * radius) * np.eye(3)[axis]
    return np.array([centre - reach, centre + reach]), radius


def tree_pairs(body: Body) -> Pairs:
    """Return the pairs of a robot's segments that must not touch: limbs more than `_NEAR` segments apart along the
    tree, and limbs that belong to no leg against boxes other than the one that carries them.
    """
    solid, walls = _distant_pairs(body)
    pose = poses(body, body.neutral[None])
    shape = {i: capsule(body, i) for i in range(len(body.segments))}
    axes = {i: points_on_axis(pose, i, ends, 41) for i, (ends, _) in shape.items()}
    free = [(i, j) for i, j in solid if points_apart(axes[i], axes[j])[0] - shape[i][1] - shape[j][1] > 0]
    clear = [(i, j) for i, j in walls if points_off_box(body, pose, axes[i], j)[0] - shape[i][1] > 0]
    left = [pair for pair in solid + walls if pair not in free and pair not in clear]
    return Pairs(free, clear, tuple(f"{body.segments[i]} - {body.segments[j]}" for i, j in left))


def _distant_pairs(body: Body) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Return the pairs of two limbs, and of a limb and a box (root, or carrier of several), that are no neighbours."""
    carried = body.segment_joint[: len(body.segments)]
    above = [body.place_on_segment(joint)[0] if joint >= 0 else -1 for joint in carried]
    boxes = [i for i in range(len(above)) if i == 0 or above.count(i) > 1]
    limbs = [i for i in range(len(above)) if i not in boxes]
    legs = {k for foot in body.feet.values() for k in _up(above, foot.segment)}
    # segments apart along the tree: what both ways to the root share drops out
    ways = {i: set(_up(above, i)) for i in limbs}
    solid = [(i, j) for i, j in combinations(limbs, 2) if len(ways[i] ^ ways[j]) > _NEAR]
    return solid, [(i, j) for i in limbs if i not in legs for j in boxes if above[i] != j]


def _up(above: list[int], segment: int) -> list[int]:
    path = [segment]
    while above[path[-1]] >= 0:
        path.append(above[path[-1]])
    return path


def points_on_axis(pose: Poses, segment: int, ends: Array, count: int) -> Array:
    """Return ``count`` points (T, K, 3) m, lab frame, evenly spaced from one of the ``ends`` (2, 3) m, fixed in a
    segment, to the other.
    """
    a, b = ends
    return pose.points([segment] * count, a + np.linspace(0.0, 1.0, count)[:, None] * (b - a))


def points_apart(a: Array, b: Array) -> Array:
    """Return the least distance (T,) m of points ``a`` (T, K, 3) from points ``b`` (T, L, 3)."""
    return np.asarray(np.linalg.norm(a[:, :, None] - b[:, None], axis=3).min(axis=(1, 2)))


def points_off_box(body: Body, pose: Poses, points: Array, segment: int) -> Array:
    """Return the least distance (T,) m of ``points`` (T, K, 3), lab frame, from the box of a segment; 0 inside it."""
    # R'(p - o): into the segment's frame.
    local = np.einsum("tji,tkj->tki", pose.rotation[:, segment], points - pose.position[:, segment, None])
    low, high = body.boxes[segment]
    # Per axis how far outside; all zero within.
    beyond = np.maximum(np.maximum(low - local, local - high), 0.0)
    return np.asarray(np.linalg.norm(beyond, axis=2).min(axis=1))

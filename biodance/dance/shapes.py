"""The room that segments take: limbs are the widest capsules in their boxes, trunk and pelvis the boxes themselves."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.dance.tree_pairs import capsule, tree_pairs
from biodance.records import Array

BOXES = ("pelvis", "trunk_head")
_KINDS = {
    *(("foot", "shank"), ("foot", "thigh"), ("forearm_hand", "thigh"), ("forearm_hand", "forearm_hand")),  # the paper's
    *(("forearm_hand", "shank"), ("forearm_hand", "upper_arm"), ("shank", "shank"), ("foot", "foot"), ("upper_arm", "thigh")),
    *(("shank", "thigh"), ("forearm_hand", "foot")),
}


def capsule_pairs(body: Body) -> list[tuple[int, int]]:
    """Return the pairs of limbs (segment indices) that must not touch: the paper's and others that a dance could bring together."""
    kinds = [s.removeprefix("right_").removeprefix("left_") for s in body.segments]
    side = [s.split("_")[0] for s in body.segments]
    near = {("shank", "thigh"), ("foot", "shank"), ("foot", "thigh"), ("forearm_hand", "upper_arm")}  # only the opposite side
    pairs = []
    for i, j in combinations(range(len(kinds)), 2):
        for pair in ((kinds[i], kinds[j]), (kinds[j], kinds[i])):
            if pair in _KINDS and not (pair in near and side[i] == side[j]):
                pairs.append((i, j))
                break
    return pairs


def box_pairs(body: Body) -> list[tuple[int, int]]:
    """Return the pairs (limb, trunk or pelvis) that must not touch: the forearms against both."""
    arms = [i for i, s in enumerate(body.segments) if s.endswith("forearm_hand")]
    return [(arm, body.segment_index(box)) for arm in arms for box in BOXES]


def pairs_of(body: Body) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Return the pairs of limbs, and of a limb and a box, that must not touch: by name in a person's body, else by the tree."""
    return (capsule_pairs(body), box_pairs(body)) if _is_named(body) else tree_pairs(body)[:2]


def unchecked_pairs(body: Body) -> tuple[str, ...]:
    """Return the pairs of a robot's segments that should be kept apart and cannot, in words (`tree_pairs`)."""
    return () if _is_named(body) else tree_pairs(body)[2]


def _is_named(body: Body) -> bool:
    named = {kind for pair in _KINDS for kind in pair} | set(BOXES)
    return all(segment.removeprefix("right_").removeprefix("left_") in named for segment in body.segments)


@dataclass(frozen=True, eq=False)
class Solids:
    """What must not touch: capsules ``first`` and ``second`` (C,) of segments, limbs ``limb`` (B,) and boxes ``box`` (B,) of segments;
    ``axis`` (N, 2, 3) m and ``radius`` (N,) m of the capsule in every segment's box.
    """

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    limb: NDArray[np.intp]
    box: NDArray[np.intp]
    axis: Array
    radius: Array

    @classmethod
    def of(cls, body: Body) -> "Solids":
        """Return the pairs of a body."""
        capsules, boxes = (np.array(pairs, dtype=np.intp).reshape(-1, 2) for pairs in pairs_of(body))
        shape = [capsule(body, i) for i in range(len(body.segments))]
        axis, radius = np.array([ends for ends, _ in shape]), np.array([radius for _, radius in shape])
        return cls(capsules[:, 0], capsules[:, 1], boxes[:, 0], boxes[:, 1], axis, radius)


def palm(body: Body, side: str) -> tuple[int, Array]:
    """Return the segment of a hand and the middle of its palm (3,) m in that segment: 0.85 of the way to the fingertips."""
    segment = body.segment_index(f"{side}_forearm_hand")
    low, high = body.boxes[segment]
    return segment, np.array([(low[0] + high[0]) / 2, 0.85 * low[1], (low[2] + high[2]) / 2])

"""Which markers are judged together: those of legs and pelvis, trunk, arms and head, whose skin slides differently."""

import numpy as np

from biodance.body.body import Body
from biodance.body.human.optional_joints import neck_and_vertex
from biodance.body.human.skeleton import kind_of

_ARMS = ("upper_arm", "forearm_hand", "hand")
_TRUNK = ("trunk_head", "clavicle")


def marker_groups(body: Body) -> tuple[str, ...]:
    """Return the group of every marker of the body (K): "legs" (with the pelvis), "trunk", "arms" or "head".

    The head's are those on a head of its own, or on the trunk above the neck.
    """
    places = neck_and_vertex(body)
    neck = np.inf if places is None else float(places[0][1])
    worn = zip(body.markers.segment, body.markers.position[:, 1], strict=True)
    return tuple(_group(kind_of(body.links[s]), y > neck) for s, y in worn)


def _group(kind: str, above_neck: bool) -> str:
    if kind == "head" or (kind == "trunk_head" and above_neck):
        return "head"
    return "arms" if kind in _ARMS else "trunk" if kind in _TRUNK else "legs"

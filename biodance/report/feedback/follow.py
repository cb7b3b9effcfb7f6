"""What the page must know to follow a person and to grade a posture by what it tells of every segment."""

from base64 import b64encode
from typing import Any

import numpy as np

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.telling import telling_of
from biodance.records import SIDES

_POINTS = {"upper_arm": "shoulder", "forearm_hand": "elbow", "thigh": "hip", "shank": "knee", "foot": "ankle"}
"""Segment -> the point at its origin."""
_WRISTS = ("{}WRA", "{}WRB")
_NUMBERS = {"shoulder": 5, "elbow": 7, "wrist": 9, "hip": 11, "knee": 13, "ankle": 15}
"""Of the left point among the 17 of MoveNet (order of COCO); the right one comes next."""
_ASKED = {"elbow": 1.0, "wrist": 1.0, "knee": 1.0, "shoulder": 0.8}
"""Points that a person is asked to correct, and how readily; the others follow them."""
_LIMBS, _TRUNK = 0.6, 0.25
"""rad, standard deviation of a joint angle about the plan: what the camera does not tell stays near it."""


def follow_scene(dance: Dance) -> dict[str, Any] | None:
    """Return what the page needs to follow a person through ``dance`` as plain values; None for a body whose joints the
    camera does not know, such as a robot's.
    """
    body, points = dance.body, _points(dance.body)
    if not points or not body.n_root:
        return None
    told = telling_of(dance)
    return {
        "rate": told.rate,
        "plan": _packed(dance.motion(told.rate).q),
        "root": _packed(told.root),
        "weights": told.weights.tolist(),
        "edges": list(told.edges),
        "still": told.still.tolist(),
        "about": told.about.tolist(),
        "gravity": body.gravity.tolist(),
        "segments": [_called(name) for name in body.segments],
        "carriers": list(body.segment_joint),
        "joints": [
            {
                "parent": joint.parent,
                "rotation": joint.rotation.ravel().tolist(),
                "translation": joint.translation.tolist(),
                "axis": joint.axis.tolist(),
                "free": _TRUNK if joint.name.startswith("trunk") else _LIMBS,
            }
            for joint in body.joints
        ],
        "points": points,
        "phases": [
            {
                "kind": phase.kind,
                "posture": phase.posture,
                "start": phase.start,
                "end": phase.end,
                "planted": [body.feet[SIDES[side]].segment for side in phase.stance.planted],
            }
            for phase in dance.phases
        ],
    }


def _called(segment: str) -> str:
    return segment.replace("_head", " and head").replace("_hand", " and hand").replace("_", " ")


def _packed(values: "np.ndarray[Any, Any]") -> str:
    return b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")


def _points(body: Body) -> list[dict[str, Any]]:
    """Return the points of the body that the camera finds: ``name``, ``number`` among those of MoveNet, ``segment`` and
    ``place`` m in its frame, ``asks`` how readily it is corrected; none when the body lacks one.
    """
    out = []
    for second, side in enumerate(("left", "right")):
        for part, name in _POINTS.items():
            if f"{side}_{part}" not in body.segments:
                return []
            out.append((f"{side} {name}", body.segment_index(f"{side}_{part}"), np.zeros(3), name, second))
        wrist = [
            body.markers.names.index(n) for one in _WRISTS if (n := one.format(side[0].upper())) in body.markers.names
        ]
        if not wrist:
            return []
        place = body.markers.position[wrist].mean(axis=0)
        out.append((f"{side} wrist", body.markers.segment[wrist[0]], place, "wrist", second))
    return [
        {
            "name": called,
            "number": _NUMBERS[name] + second,
            "segment": int(segment),
            "place": place.tolist(),
            "asks": _ASKED.get(name, 0.0),
        }
        for called, segment, place, name, second in out
    ]

"""What a person is asked to do so that a segment becomes better known: in words, and as a posture."""

from functools import cache
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.library import locate, read_toml
from biodance.pipeline.still import silhouettes
from biodance.records import SIDES, Array


@cache
def _asked() -> dict[str, Any]:
    return read_toml(locate("protocols/vocabulary", "asked"))


def asked_words(segment: str) -> str:
    """Return the sentence by which a person is asked to move a segment, for example ``left_thigh``."""
    side, kind = _split(segment)
    found = _asked().get(kind)
    return found["say"].format(side) if found else "Squat, bow, and lift both arms to the side, each once more."


def asked_posture(body: Body, segment: str) -> Array:
    """Return the posture (nq,) of the picture beside these words; the pelvis leans so far that the soles are flat, and
    the lower foot stands on the floor, z = 0.
    """
    side, kind = _split(segment)
    asked = {name.format(side): angle for name, angle in _asked().get(kind, {}).get("angles", {}).items()}
    q, root = np.array(body.neutral, dtype=float), body.nq - len(body.joints)
    for j, joint in enumerate(body.joints):
        bare = joint.name.partition("_")[2]
        q[root + j] = np.radians(asked.get(joint.name, asked.get(bare, 0.0)))
    lean = asked.get("hip_flexion", 0.0) - asked.get("knee_flexion", 0.0) + asked.get("ankle_dorsiflexion", 0.0)
    q[3:7] = (Rotation.from_euler("y", lean, degrees=True) * Rotation.from_quat(q[3:7])).as_quat()
    q[2] -= min(outline[:, 1].min() for _, outline, _ in silhouettes(body, q, (1.0, 0.0)))
    return q


def _split(segment: str) -> tuple[str, str]:
    """Return side ("" for the middle) and kind of a segment."""
    side, _, kind = segment.partition("_")
    return (side, kind) if side in SIDES else ("", segment)

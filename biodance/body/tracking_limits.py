"""The joint ranges within which one person is tracked: anatomical ranges, counted from this person's standing posture, and some more.

Stops that the person passes are worse than none: the joint is held, all others take the error coherently, and identification believes it.
Of virtual persons who copied postures of the anatomical ranges seven degrees off, 67 to 79 % of all frames lay at a stop, and masses came
out up to two times as wrong as without (docs/benchmarks/dance.md).
"""

from dataclasses import replace

import numpy as np

from biodance.body.body import Body, JointLimits
from biodance.records import Array

HAND_TURN = np.radians(120.0)
"""rad either way: the model has no pronation, so with a straight elbow a turning hand is seen as a turning shoulder; a narrower limit makes
the arm jump to the other set of angles that reaches the same hand (seen in a real walk)."""
LOADED_ANKLE = np.radians(40.0)
"""rad: dorsiflexion under body weight with a bent knee, as on stairs and in squats (weight-bearing lunge, Bennell et al. 1998); the tables
give the unloaded joint's 20 to 25 deg."""
BEYOND = np.radians(25.0)
"""rad: how far a joint of the model may pass the anatomical range of the joint whose name it has: trunk and girdle bend in many places
where the model has one joint, marker sets turn the axes, and skin slides."""
HELD = ("_knee_flexion", "_elbow_flexion", "_shoulder_rotation")
"""Ends of the names of joints that do not go further: hinges, and the shoulder's turn, which is as wide as the hand's."""
SPARE = np.radians(5.0)
"""rad: how far a joint range is widened beyond the angle of the static trial."""


def widen(body: Body, q: Array) -> tuple[JointLimits, tuple[str, ...]]:
    """Return the limits for tracking: counted from this person's upright pelvis, the static posture ``SPARE`` inside them, the shoulder
    turning as far as the hand does, the ankle bending as far as under load, and all but knees, elbows and that turn by ``BEYOND`` more. The
    notes name what this posture changed.

    Clinical ranges of hip and trunk count from upright standing, ISB angles from the plane of the pelvis markers, which stands tilted.
    """
    angle, limits = q[body.nq - len(body.joints) :], body.limits
    tilt = standing_tilt(q)
    shift = np.array([tilt * (joint.name.endswith("_hip_flexion") - float(joint.name == "trunk_flexion")) for joint in body.joints])
    limits = replace(limits, lower=limits.lower + np.minimum(shift, 0.0), upper=limits.upper + np.maximum(shift, 0.0))
    turning, ankle = (
        np.array([joint.name.endswith(end) for joint in body.joints]) for end in ("_shoulder_rotation", "_ankle_dorsiflexion")
    )
    loaded = np.where(ankle, np.maximum(limits.upper, LOADED_ANKLE), limits.upper)
    limits = replace(limits, lower=np.where(turning, -HAND_TURN, limits.lower), upper=np.where(turning, HAND_TURN, loaded))
    free = BEYOND * np.array([not joint.name.endswith(HELD) for joint in body.joints])
    limits = replace(limits, lower=limits.lower - free, upper=limits.upper + free)
    lower, upper = np.minimum(limits.lower, angle - SPARE), np.maximum(limits.upper, angle + SPARE)
    notes = tuple(
        f"Range of {joint.name} widened to {np.degrees(lower[i]):.0f} .. {np.degrees(upper[i]):.0f} deg: "
        f"{np.degrees(angle[i]):.0f} deg when standing."
        for i, joint in enumerate(body.joints)
        if lower[i] < limits.lower[i] or upper[i] > limits.upper[i]
    )
    tilted = f"Pelvis markers stand tilted {np.degrees(tilt):.0f} deg forwards: ranges of hip and trunk flexion are widened by as much."
    return replace(limits, lower=lower, upper=upper), (tilted, *notes)


def tracked(body: Body) -> Body:
    """Return a body of which no static trial is known, with the limits for tracking counted from the neutral posture."""
    return replace(body, limits=widen(body, body.neutral)[0])


def standing_tilt(q: Array) -> float:
    """Return the forward tilt, rad, of the pelvis in a posture q: how far its x axis points below the horizontal."""
    from scipy.spatial.transform import Rotation

    return -float(np.arcsin(Rotation.from_quat(q[3:7]).as_matrix()[2, 0]))

"""A person whose joints lie elsewhere than the static trial shows, and markers of whole-body movement."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from biodance.body.human.human import human
from biodance.body.human.scaling import Scaling, measure_static
from biodance.body.human.skeleton import joint_limits
from biodance.motion.ik.joint_unknowns import (
    SIZE,
    JointUnknowns,
    own_centre,
    own_turn,
)
from biodance.motion.kinematics import poses
from biodance.records import Array, Markers, Source, Subject, Trial

SUBJECT = Subject(65.0, 1.75, "F", 33.0)
ARMS = {"shoulder_adduction": -25, "elbow_flexion": 25, "knee_flexion": 5}


@cache
def scaling() -> Scaling:
    """Return the scaling on a static trial of the generic person with slightly bent arms."""
    body = human(SUBJECT)
    q = body.neutral
    q[2] = 0.95
    for side in ("right", "left"):
        for joint, degrees in ARMS.items():
            q[7 + body.joint_index(f"{side}_{joint}")] = np.radians(degrees)
    xyz = poses(body, np.tile(q, (60, 1))).points(body.markers.segment, body.markers.position)
    markers = Markers(body.markers.names, np.arange(60) / 100, xyz)
    return measure_static(
        SUBJECT, Trial("static", "static", markers, (), Source(Path("static.c3d"), "", "test", 100.0), "plug_in_gait")
    )


def displaced(theta: Array) -> Scaling:
    """Return the same person with joints elsewhere; the static trial looks exactly the same."""
    return replace(scaling(), centres=JointUnknowns(scaling().centres).moved(theta))


def moving(true: Scaling, *, share: float = 0.8, seconds: float = 120.0, seed: int = 3) -> Markers:
    """Return what a person does who goes ``share`` of the way to a random posture every 0.4 s, with 1 mm of noise."""
    rng = np.random.default_rng(seed)
    body, stand = true.body()
    time = np.arange(0, seconds, 0.4)
    limits = joint_limits(SUBJECT)
    q = np.tile(stand, (time.size, 1))
    q[:, 7:] += share * (rng.uniform(limits.lower, limits.upper, size=(time.size, len(body.joints))) - stand[7:])
    xyz = poses(body, q).points(body.markers.segment, body.markers.position)
    return Markers(body.markers.names, time, xyz + 0.001 * rng.normal(size=xyz.shape))


def hidden() -> Array:
    """Return joints that a static trial does not show: elbows turned by 40 degrees, the trunk's joint 6 cm lower, a
    hip 15 mm off.
    """
    theta = np.zeros(SIZE)
    unknowns = JointUnknowns(scaling().centres)
    for elbow, angle in (("right_elbow", 0.7), ("left_elbow", -0.6)):
        theta[own_turn(elbow)] = angle
        residual, _ = unknowns.prior(theta)
        theta[own_centre(elbow)] = -0.008 * residual[own_centre(elbow)]
    theta[own_centre("trunk")] = [-0.01, 0.005, -0.06]
    theta[own_centre("right_hip")] = [0.01, -0.008, 0.009]
    return theta

"""A tracked trial of the human whose markers carry soft-tissue errors: for effects in the body's geometry."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.effects import Case
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import poses
from biodance.motion.track import track
from biodance.records import Array, Markers, Plate, Source, Subject, Trial, Wrench

CORNERS = np.array([[0.6, 0.5, 0], [0.2, 0.5, 0], [0.2, -0.1, 0], [0.6, -0.1, 0]])


def moving(body: Body, frames: int, rng: np.random.Generator) -> Array:
    """Return q (frames, nq): all joints moving by about 10 degrees, knees and elbows bent, the root turning about."""
    time = np.arange(frames) / 100
    knots = np.arange(-1.4, time[-1] + 1.5, 0.7)
    middle = np.array([0.7 if joint.name.endswith(("knee_flexion", "elbow_flexion")) else 0.0 for joint in body.joints])
    angles = CubicSpline(knots, middle + 0.2 * rng.uniform(-1, 1, (len(knots), len(middle))))(time)
    turn = Rotation.from_rotvec(CubicSpline(knots, rng.normal(0, 0.2, (len(knots), 3)))(time)) * Rotation.from_quat(
        body.neutral[3:7]
    )
    place = CubicSpline(knots, rng.normal([0.3, -0.2, 0.9], 0.05, (len(knots), 3)))(time)
    return np.hstack([place, turn.as_quat(), angles])


def case_of(body: Body, markers: Markers, rng: np.random.Generator) -> Case:
    """Return the case of some markers on one plate that measures what the tracked motion needs, and 1 N of noise."""
    nothing = Wrench(markers.time, np.zeros((markers.time.size, 6)))
    trial = Trial("t", "fit", markers, (Plate("plate1", 2, CORNERS, nothing),), Source(Path(__file__), "", "test"))
    motion = track(body, trial)
    value = predict_wrench(body, motion).value + rng.normal(0, 1.0, (markers.time.size, 6))
    plate = replace(trial.plates[0], wrench=Wrench(markers.time, value))
    return Case(body, replace(trial, plates=(plate,)), motion, body.sip.phi, np.linspace(0, 1, markers.time.size))


@cache
def human_case(frames: int = 300) -> Case:
    """Return the tracked human: every marker is off by 4 mm and slides by 4 mm."""
    rng = np.random.default_rng(1)
    body = human(Subject(70, 1.75, "M", 30))
    q = moving(body, frames, rng)
    time = np.arange(frames) / 100
    xyz = poses(body, q).points(body.markers.segment, body.markers.position)
    skin = rng.normal(0, 0.004, (2, xyz.shape[1], 3))
    xyz = xyz + skin[0] + skin[1] * np.sin(2 * np.pi * 0.4 * time)[:, None, None]
    return case_of(body, Markers(body.markers.names, time, xyz), rng)


def with_tilted(body: Body, joint: str, degrees: float) -> Body:
    """Return the body with one joint, ``right_knee``, that stood so far off its axes in the static trial."""
    at = next(i for i, one in enumerate(body.joints) if one.name.startswith(f"{joint}_"))
    off = Rotation.from_euler("x", degrees, degrees=True).as_matrix()
    return replace(body, joints=(*body.joints[:at], replace(body.joints[at], rotation=off), *body.joints[at + 1 :]))

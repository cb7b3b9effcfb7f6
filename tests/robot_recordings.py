"""A robot on its left foot, moving every joint: angles made up, wrench by pinocchio's inverse dynamics of a robot whose
masses are not those of the drawing.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
from robot_lab import RobotLab, write_robot_trial

from biodance.body.body import Body
from biodance.body.export import write_model
from biodance.body.similarity import hoap3
from biodance.body.urdf import read_urdf
from biodance.lab.robot import read_robot_recording
from biodance.pipeline.robot_trials import MatchedTrial, bring_together
from biodance.records import Array, Sip

FEET = ("right_foot", "left_foot")
RATE = 200.0
SOLE_OVER_ANKLE = -0.040
LIFTED = {"right_hip_pitch": -0.6, "right_knee_pitch": 1.2, "right_ankle_pitch": -0.6}
COVER = 0.4
"""kg taken off the trunk."""


def drawing(folder: Path) -> Path:
    """Write the drawing of HOAP-3 as URDF."""
    folder.mkdir(parents=True, exist_ok=True)
    write_model(hoap3(), folder / "hoap3.urdf", format="urdf")
    return folder / "hoap3.urdf"


def real_robot() -> Body:
    """Return the robot without a cover: 0.4 kg less at the trunk's centre, its inertia in proportion."""
    body = hoap3()
    phi, i = np.array(body.sip.phi), body.segment_index("trunk_head")
    phi[10 * i : 10 * i + 10] *= 1 - COVER / phi[10 * i]
    return replace(body, sip=Sip(body.segments, phi, body.sip.covariance))


def matched(folder: Path, urdf: Path) -> MatchedTrial:
    """Return the one trial of a recording of the robot of ``urdf``, its files on one clock."""
    body = read_urdf(urdf, feet=FEET)
    trials, lost = bring_together(body, read_robot_recording(folder, tuple(joint.name for joint in body.joints)))
    assert not lost
    return trials[0]


def danced(body: Body, seed: int, seconds: float, *, nod: Array | float = 0.0) -> tuple[Array, Array, Array]:
    """Return times (T,) s, angles (T, n) rad and the ground's wrench (T, 6) about the middle of nothing but the origin
    under the left ankle, on which the foot nods by ``nod`` (T + 2,) rad, toes down.
    """
    rng, time = np.random.default_rng(seed), np.arange(0, seconds, 1 / RATE)
    names = [joint.name for joint in body.joints]
    low, high = body.limits.lower, body.limits.upper
    centre = np.clip([LIFTED.get(name, 0.0) for name in names], low + 0.25, high - 0.25)
    size = np.minimum(0.22, np.minimum(centre - low, high - centre))
    phase, rhythm = rng.uniform(0, 2 * np.pi, (2, 21)), rng.uniform(0.25, 0.7, (2, 21))
    waves = 0.6 * np.sin(2 * np.pi * rhythm[0] * time[:, None] + phase[0])
    angle = centre + size * (waves + 0.4 * np.sin(2 * np.pi * rhythm[1] * time[:, None] + phase[1]))
    model, ankle = body.model, body.segment_joint[body.feet["left"].segment] + 2
    data = model.createData()
    planted = pin.SE3(np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]]), np.array([0.0, 0.0, -SOLE_OVER_ANKLE]))
    q, nods = np.empty((len(time), model.nq)), np.broadcast_to(nod, time.shape)
    for t, one in enumerate(angle):
        rest = np.concatenate([[0.0, 0, 0, 0, 0, 0, 1], one])
        pin.forwardKinematics(model, data, rest)
        tilted = pin.SE3(pin.exp3(np.array([0.0, nods[t], 0.0])), np.zeros(3))
        root = tilted * planted * data.oMi[ankle].inverse()
        q[t] = np.concatenate([pin.SE3ToXYZQUAT(root), one])
    return time[1:-1], angle[1:-1], ground_wrench(model, q)


def ground_wrench(model: pin.Model, q: Array) -> Array:
    """Return the wrench (T - 2, 6) about the origin that the configurations ``q`` (T, nq) at `RATE` need, without the
    first and the last.
    """
    data = model.createData()
    v = np.array([pin.difference(model, a, b) for a, b in zip(q[:-2], q[2:], strict=True)]) * RATE / 2
    a = np.gradient(v, 1 / RATE, axis=0)
    out = []
    for now, rate, change in zip(q[1:-1], v, a, strict=True):
        force = pin.Force(pin.rnea(model, data, now, rate, change)[:6])
        out.append(pin.XYZQUATToSE3(now[:7]).act(force).vector)
    return np.array(out)


TILTED = {"hip_pitch": -0.4, "knee_pitch": 0.8, "ankle_pitch": -0.4, "ankle_roll": -0.5}
"""rad of a leg that is lifted by less than its sole is tilted: the other sole, too, lies above that one's plane."""


def stepped(body: Body, seed: int) -> tuple[Array, Array, Array]:
    """Return times (T,) s, angles (T, n) rad and the ground's wrench (T, 6) of 16 s on the left, then 16 s on the right
    foot, the other one lifted a little and tilted, waist and arms moving; both flat between, at rest. The wrench is
    about the place of the left ankle on the ground.
    """
    rng, time = np.random.default_rng(seed), np.arange(0, 32.0, 1 / RATE)
    names, model = [joint.name for joint in body.joints], body.model
    angle = np.zeros((len(time), len(names)))
    for k, lifted in enumerate(("right", "left")):
        begin = np.clip((time - 16.0 * k - 1.0) / 2, 0, 1) * np.clip((16.0 * (k + 1) - 1.0 - time) / 2, 0, 1)
        up = begin**3 * (10 - 15 * begin + 6 * begin**2)
        sign = 1.0 if lifted == "right" else -1.0
        for name, size in TILTED.items():
            angle[:, names.index(f"{lifted}_{name}")] += size * up * (sign if name.endswith("roll") else 1.0)
        for j, name in enumerate(names):
            if any(part in name for part in ("waist", "shoulder", "elbow")):
                rhythm, phase = rng.uniform(0.2, 0.5), rng.uniform(0, 2 * np.pi)
                angle[:, j] += 0.3 * up * np.sin(2 * np.pi * rhythm * time + phase)
    ankles = {side: body.segment_joint[body.feet[side].segment] + 2 for side in ("left", "right")}
    data, q = model.createData(), np.empty((len(time), model.nq))
    planted = {"left": pin.SE3(np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]]), np.array([0.0, 0.0, -SOLE_OVER_ANKLE]))}
    for t, one in enumerate(angle):
        pin.forwardKinematics(model, data, np.concatenate([[0.0, 0, 0, 0, 0, 0, 1], one]))
        planted.setdefault("right", planted["left"] * data.oMi[ankles["left"]].inverse() * data.oMi[ankles["right"]])
        side = "left" if time[t] < 16.0 else "right"
        root = planted[side] * data.oMi[ankles[side]].inverse()
        q[t] = np.concatenate([pin.SE3ToXYZQUAT(root), one])
    return time[1:-1], angle[1:-1], ground_wrench(model, q)


def recorded(
    folder: Path, *, seed: int = 0, seconds: float = 11.0, lab: RobotLab | None = None, name: str = "run"
) -> Path:
    """Write a recording and return its folder."""
    body = real_robot()
    time, angle, wrench = danced(body, seed, seconds)
    names = tuple(joint.name for joint in body.joints)
    write_robot_trial(folder / name, names, time, angle, wrench, lab=lab or RobotLab(), seed=seed)
    return folder

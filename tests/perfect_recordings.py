"""Somebody who raises both arms, recorded by a laboratory without any error: made by hand, no files; and the virtual
laboratory with perfect instruments.
"""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import poses
from biodance.records import Markers, Motion, Plate, Source, Subject, Trial, Wrench
from biodance.virtual_lab.person.skeleton import REALISTIC, LabTolerances

SUBJECT = Subject(62.0, 1.70, "F", 30.0, "S01")
PLATE = np.array([[0.5, 0.5, 0.0], [-0.5, 0.5, 0.0], [-0.5, -0.5, 0.0], [0.5, -0.5, 0.0]])
RATE = 100.0
_DRAWN = [field.name for field in fields(LabTolerances)]
PERFECT_INSTRUMENTS = replace(REALISTIC, **dict.fromkeys(_DRAWN[_DRAWN.index("marker_placement") :], 0.0))
"""Perfect plates, cameras and bone-fixed markers, but an unchanged person and motion."""


def arm_swing(body, *, frames: int, angle: float) -> Motion:
    """Return somebody who stands and raises both arms by ``angle`` rad and lowers them, with exact derivatives."""
    time = np.arange(frames) / RATE
    rate = 2 * np.pi / time[-1]
    course = angle * (1 - np.cos(rate * time)) / 2
    q, v, a = np.tile(body.neutral, (frames, 1)), np.zeros((frames, body.nv)), np.zeros((frames, body.nv))
    q[:, 2] = -poses(body, body.neutral).points([body.feet["left"].segment], body.feet["left"].outline[:1])[0, 0, 2]
    for side in ("left", "right"):
        i = body.joint_index(f"{side}_shoulder_flexion")
        q[:, 7 + i] = course
        v[:, 6 + i], a[:, 6 + i] = angle * rate * np.sin(rate * time) / 2, angle * rate**2 * np.cos(rate * time) / 2
    return Motion(time, q, v, a)


def recorded(body, name: str, motion: Motion) -> Trial:
    """Return what a perfect laboratory records of ``motion``: the markers of the body and the wrench it needs, on
    one large plate.
    """
    xyz = poses(body, motion.q).points(list(body.markers.segment), body.markers.position)
    wrench = predict_wrench(body, motion)
    fine = np.arange(10 * (motion.time.size - 1) + 1) / (10 * RATE)
    value = np.stack([np.interp(fine, motion.time, column) for column in wrench.value.T], axis=1)
    source = Source(Path(f"/lab/S01/{name}.c3d"), "00" * 32, "C3D", RATE, 10 * RATE)
    role = "check" if name == "standing" else "fit"
    plates = (Plate("plate1", 2, PLATE, Wrench(fine, value)),)
    return Trial(name, role, Markers(body.markers.names, motion.time, xyz), plates, source, "plug_in_gait")

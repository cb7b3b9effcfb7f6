"""Somebody who squats on one large plate that measures exactly what that needs: made by hand, no files, no tracking."""

from pathlib import Path

import numpy as np

from biodance.body.human.human import human
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import poses
from biodance.pipeline.trial import TrialResult
from biodance.records import Motion, Plate, Source, Subject, Trial, Wrench

BODY = human(Subject(62.0, 1.70, "F", 30.0, "S01"))
TIME = np.arange(0, 2, 0.01)


def squat() -> TrialResult:
    """Somebody who squats with both feet on one large plate, which measures exactly what that needs."""
    depth, rate, bend = (np.pi * TIME, np.pi, {"hip_flexion": 65, "knee_flexion": 95, "ankle_dorsiflexion": 30})
    q, v, a = np.tile(BODY.neutral, (TIME.size, 1)), *np.zeros((2, TIME.size, BODY.nv))
    for side in ("right", "left"):
        for name, angle in bend.items():
            j = BODY.joint_index(f"{side}_{name}")
            half = np.radians(angle) / 2
            q[:, 7 + j], v[:, 6 + j] = half * (1 - np.cos(depth)), half * rate * np.sin(depth)
            a[:, 6 + j] = half * rate**2 * np.cos(depth)
    q[:, :3] = np.array([0.0, 0.0, 0.075]) - poses(BODY, q).position[:, BODY.segment_index("right_foot")]
    turn = poses(BODY, q).root_rotation[0]
    v[:, :3] = np.gradient(q[:, :3], TIME, axis=0, edge_order=2) @ turn
    a[:, :3] = np.gradient(v[:, :3], TIME, axis=0, edge_order=2)
    motion = Motion(TIME, q, v, a)
    corners = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]]) * 1.0
    plate = Plate("plate1", 2, corners, Wrench(TIME, predict_wrench(BODY, motion).value))
    trial = Trial("squat", "fit", None, (plate,), Source(Path("squat.c3d"), "", "C3D", 100.0, 100.0))
    return TrialResult(trial, (), motion=motion)

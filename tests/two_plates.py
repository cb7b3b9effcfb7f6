"""Somebody who stands and squats with one foot on each of two plates that measure exactly what that needs: made by
hand, no files.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from squatting import BODY, TIME, squat

from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import poses
from biodance.records import Markers, Motion, Plate, Session, Source, Subject, Trial, Wrench

SUBJECT = Subject(62.0, 1.70, "F", 30.0, "S01")
CENTRES = {"plate1": np.array([0.05, 0.335, 0.0]), "plate2": np.array([0.05, -0.175, 0.0])}
HALF = np.array([[0.3, 0.25, 0], [-0.3, 0.25, 0], [-0.3, -0.25, 0], [0.3, -0.25, 0]])
FINE = 1000.0
"""Hz of the plates."""
NOISE = np.array([0.3, 0.3, 0.5, 0.05, 0.05, 0.05])
"""N, N·m of one sample."""


def session() -> Session:
    """Return a static trial and two squats without any fault."""
    moving = squat().motion
    assert moving is not None
    still = Motion(TIME, np.tile(moving.q[:1], (TIME.size, 1)), *np.zeros((2, TIME.size, BODY.nv)))
    trials = (
        _recorded("static", "static", still),
        _recorded("squat_1", "fit", moving),
        _recorded("squat_2", "fit", moving),
    )
    return Session(SUBJECT, trials, Path("two_plates"))


def _recorded(name: str, role: str, motion: Motion) -> Trial:
    """Return markers, and the wrench that the motion needs, shared by two plates so that each presses under a foot."""
    xyz = poses(BODY, motion.q).points(list(BODY.markers.segment), BODY.markers.position)
    xyz = xyz + np.random.default_rng(3).normal(0, 2e-4, xyz.shape)
    fine = np.arange(round(FINE * TIME[-1]) + 1) / FINE
    whole = np.stack([np.interp(fine, TIME, column) for column in predict_wrench(BODY, motion).value.T], axis=1)
    feet = [float(np.mean([xyz[0, BODY.markers.names.index(f"{s}{m}"), 1] for m in ("HEE", "TOE")])) for s in "LR"]
    share = (whole[:, 3] / whole[:, 2] - feet[1]) / (feet[0] - feet[1])
    plates = []
    for (label, centre), y, part in zip(CENTRES.items(), feet, (share, 1 - share), strict=True):
        value = whole * part[:, None]
        value[:, 3] = y * value[:, 2]
        value += NOISE * np.random.default_rng(len(plates)).normal(size=value.shape)
        plates.append(Plate(label, 2, HALF + centre, Wrench(fine, value)))
    source = Source(Path(f"/lab/S01/{name}.c3d"), "00" * 32, "C3D", 100.0, FINE)
    markers = Markers(BODY.markers.names, TIME, xyz)
    return Trial(name, role, markers, tuple(plates), source, marker_set="plug_in_gait")


def changed(one: Session, change, *names: str) -> Session:
    """Return a session whose trials of these ``names`` (none: all) have the plates that ``change`` makes of theirs."""
    return replace(
        one,
        trials=tuple(
            replace(trial, plates=change(trial.plates)) if not names or trial.name in names else trial
            for trial in one.trials
        ),
    )


def late(seconds: float):
    """Return a change: all samples come so much later; before the first one somebody stands as in it."""

    def change(plates: tuple[Plate, ...]) -> tuple[Plate, ...]:
        rng = np.random.default_rng(9)
        return tuple(replace(p, wrench=Wrench(p.wrench.time, delayed(p.wrench, rng))) for p in plates)

    def delayed(wrench: Wrench, rng: np.random.Generator) -> np.ndarray:
        count = round(seconds * wrench.rate)
        before = wrench.value[:20].mean(axis=0) + NOISE * rng.normal(size=(count, 6))
        return np.concatenate([before, wrench.value[:-count]])

    return change


def weak(plates: tuple[Plate, ...], number: int = 2, share: float = 0.7) -> tuple[Plate, ...]:
    """Let plate 2 (or that of another ``number``) read 0.7 (or another ``share``) of everything."""
    wrong = plates[number - 1]
    wrong = replace(wrong, wrench=Wrench(wrong.wrench.time, share * wrong.wrench.value))
    return (*plates[: number - 1], wrong, *plates[number:])


def exchanged(plates: tuple[Plate, ...]) -> tuple[Plate, ...]:
    """Exchange what the two plates, which have the same axes, measure about their centres."""
    moved = CENTRES["plate1"] - CENTRES["plate2"]
    values = [
        np.concatenate([w.force, w.moment + np.cross(way * moved, w.force)], axis=1)
        for w, way in ((plates[1].wrench, 1), (plates[0].wrench, -1))
    ]
    return tuple(replace(p, wrench=Wrench(p.wrench.time, v)) for p, v in zip(plates, values, strict=True))


def foreign(plates: tuple[Plate, ...]) -> tuple[Plate, ...]:
    """Give the plates the forces of another trial: somebody who shifts the weight up and down at another pace."""
    time = plates[0].wrench.time
    course = 1 + 0.5 * np.sin(2 * np.pi * 2.3 * time + 1.0)
    return tuple(replace(p, wrench=Wrench(time, p.wrench.value[:1] * course[:, None])) for p in plates)

"""Small session folders as text, for tests of the session room: somebody of known mass and stature who stands or
walks.
"""

import numpy as np

from biodance.lab.program_tables import Y_UP_TO_Z_UP, TimeTable, write_mot
from biodance.lab.readers.trc import write_trc
from biodance.records import Markers, Plate, Wrench
from biodance.spatial import wrench_about_point

STATURE, MASS, GRAVITY = 1.70, 62.0, 9.80665
PLUG_IN_GAIT = {
    "LFHD": (0.08, 0.07, 0.945), "RFHD": (0.08, -0.07, 0.945), "LBHD": (-0.10, 0.07, 0.939), "RBHD": (-0.10, -0.07,
    0.939),
    "C7": (-0.06, 0.0, 0.840), "T10": (-0.09, 0.0, 0.72), "CLAV": (0.06, 0.0, 0.79), "STRN": (0.09, 0.0, 0.71),
    "LSHO": (0.0, 0.17, 0.82), "RSHO": (0.0, -0.17, 0.82), "LELB": (0.0, 0.28, 0.63), "RELB": (0.0, -0.28, 0.63),
    "LWRA": (0.03, 0.30, 0.49), "RWRA": (0.03, -0.30, 0.49), "LWRB": (-0.03, 0.30, 0.49), "RWRB": (-0.03, -0.30, 0.49),
    "LFIN": (0.0, 0.31, 0.44), "RFIN": (0.0, -0.31, 0.44), "LASI": (0.10, 0.12, 0.56), "RASI": (0.10, -0.12, 0.56),
    "LPSI": (-0.09, 0.05, 0.57), "RPSI": (-0.09, -0.05, 0.57), "LTHI": (0.0, 0.17, 0.40), "RTHI": (0.0, -0.17, 0.40),
    "LKNE": (0.0, 0.15, 0.27), "RKNE": (0.0, -0.15, 0.27), "LTIB": (0.0, 0.13, 0.17), "RTIB": (0.0, -0.13, 0.17),
    "LANK": (0.0, 0.12, 0.05), "RANK": (0.0, -0.12, 0.05), "LHEE": (-0.06, 0.10, 0.03), "RHEE": (-0.06, -0.10, 0.03),
    "LTOE": (0.15, 0.10, 0.03), "RTOE": (0.15, -0.10, 0.03),
}  # fmt: skip


def person(*, frames=100, rate=100.0, speed=0.0, seed=1):
    """Markers of somebody who walks along x at ``speed`` m/s (0: stands), with 0.5 mm of noise."""
    time = np.arange(frames) / rate
    xyz = np.array(list(PLUG_IN_GAIT.values())) * [1, 1, STATURE] + np.random.default_rng(seed).normal(
        0, 5e-4, (frames, len(PLUG_IN_GAIT), 3)
    )
    xyz[..., 0] += (speed * time)[:, None]
    return Markers(tuple(PLUG_IN_GAIT), time, xyz)


def plate(*, frames=1000, rate=1000.0, mass=MASS, seed=2):
    """One plate that carries ``mass``, with 1 N of noise."""
    force = np.array([0, 0, mass * GRAVITY]) + np.random.default_rng(seed).normal(0, 1.0, (frames, 3))
    moment = np.cross([0.02, 0.01, 0.0], force)
    corners = np.array([[0.3, 0.2, 0], [-0.3, 0.2, 0], [-0.3, -0.2, 0], [0.3, -0.2, 0]])
    return Plate("plate1", 2, corners, Wrench(np.arange(frames) / rate, np.hstack([force, moment])))


def write_trial(folder, name, *, mass=MASS, **kind):
    """Write one trial as .trc, with its forces as .mot beside it unless ``mass`` is None; return the path of the
    markers.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = write_trc(folder / f"{name}.trc", person(**kind))
    if mass is not None:
        write_mot(folder / f"{name}.mot", table_of((plate(mass=mass),)))
    return path


def two_trials(place):
    """Write a session folder with a static and a squat, by name; return it."""
    session = place / "S01" / "visit"
    write_trial(session, "static01")
    write_trial(session, "squat_1", speed=1.0)
    return session


def roles(session):
    """Roles of the trials by name."""
    return {trial.name: trial.role for trial in session.trials}


def said(session):
    """All notes of a session as one text."""
    return " ".join(session.notes)


def table_of(plates: tuple[Plate, ...]) -> TimeTable:
    """Return the plates as OpenSim's columns, y up; force and torque stand at the fixed centre of each plate, so that
    nothing is NaN.

    Columns are ``ground_force_1_vx`` ... in N, ``ground_force_1_px`` ... in m, ``ground_torque_1_x`` ... in N·m.
    """
    columns = []
    values = []
    for i, plate in enumerate(plates, start=1):
        point = np.broadcast_to(plate.centre, (plate.wrench.time.size, 3))
        torque = wrench_about_point(plate.wrench.value, point)[:, 3:]
        columns += [
            f"ground_{kind}_{i}_{part}{axis}"
            for kind, part in (("force", "v"), ("force", "p"), ("torque", ""))
            for axis in "xyz"
        ]
        values += [part @ Y_UP_TO_Z_UP for part in (plate.wrench.force, point, torque)]
    time = plates[0].wrench.time if plates else np.empty(0)
    return TimeTable("ground_reactions", tuple(columns), time, np.hstack(values) if values else np.empty((0, 0)))

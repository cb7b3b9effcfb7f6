"""A designed dance as others see it: its postures one by one, what cameras will see of it, a robot's joint angles."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from biodance.dance.dance import Dance
from biodance.lab.c3d.write import FileValue
from biodance.motion.kinematics import poses
from biodance.records import SIDES, Array, Markers, Motion

PREVIEW_RATE = 100.0
"""Hz of the preview's markers and of the table of joint angles."""


def held_postures(dance: Dance, chosen: Sequence[int] | None = None) -> Motion:
    """Return the postures of a dance (all, or those ``chosen`` by index) as a motion of one frame each, at rest."""
    numbers = range(len(dance.stances)) if chosen is None else chosen
    both = ((dance.postures[p], dance.stances[p]) for p in numbers)
    x = np.array([dance.chain.plant(row[None], stance.planted, stance.ankle)[0] for row, stance in both])
    return dance.chain.motion(np.arange(len(x), dtype=float), x, np.zeros_like(x), np.zeros_like(x))


def preview_markers(dance: Dance) -> Markers:
    """Return the dance as virtual markers at `PREVIEW_RATE`: what cameras see of a person who dances it exactly."""
    motion, markers = dance.motion(PREVIEW_RATE), dance.body.markers
    xyz = poses(dance.body, motion.q).points(list(markers.segment), markers.position)
    return Markers(markers.names, motion.time, xyz)


def preview_parameters(dance: Dance) -> dict[str, dict[str, FileValue]]:
    """Return what a C3D file says beside the markers: the mass (kg), events and support phases."""
    weight = float(dance.body.sip.mass.sum())
    return {
        "PROCESSING": {"Bodymass": weight},
        "SUBJECTS": {"NAMES": ["designed dance"]},
        "EVENT": _events(dance),
        "DANCE": _phases(dance),
    }


def _events(dance: Dance) -> dict[str, FileValue]:
    """Return the events of a dance as C3D files hold them (times in minutes and seconds): postures by their number, and
    feet that leave the ground or come back.
    """
    found = [(phase.start, "General", f"Posture {phase.posture + 1}") for phase in dance.phases if phase.kind == "hold"]
    for before, after in pairwise(dance.phases):
        for side, name in enumerate(SIDES):
            down = [side in phase.stance.planted for phase in (before, after)]
            if down[0] != down[1]:
                found.append((after.start, name.capitalize(), "Foot Strike" if down[1] else "Foot Off"))
    time = np.array([one[0] for one in sorted(found)])
    contexts, labels = ([one[k] for one in sorted(found)] for k in (1, 2))
    minutes = np.stack([time // 60, time % 60])
    return {"USED": np.int16(len(found)), "CONTEXTS": contexts, "LABELS": labels, "TIMES": minutes}


def _phases(dance: Dance) -> dict[str, FileValue]:
    """Return the support phases: from when to when (s), on which feet."""
    feet = [" and ".join(SIDES[side] for side in phase.stance.planted) or "stool" for phase in dance.phases]
    times = np.array([[phase.start, phase.end] for phase in dance.phases]).T
    return {"SUPPORT": feet, "SUPPORT_TIMES": times}


def setpoints(dance: Dance) -> tuple[list[str], Array]:
    """Return headings and rows of a robot's dance at `PREVIEW_RATE`: time (s), place of the root (m), its quaternion
    x y z w, and all joint angles (rad), lab frame, z up.
    """
    motion = dance.motion(PREVIEW_RATE)
    names = ["time_s", *(f"root_{axis}_m" for axis in "xyz"), *(f"root_q{axis}" for axis in "xyzw")]
    return [*names, *(f"{joint.name}_rad" for joint in dance.body.joints)], np.column_stack([motion.time, motion.q])

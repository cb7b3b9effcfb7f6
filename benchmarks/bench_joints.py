"""How far joint centres and hinge axes are from the truth of virtual persons: by landmarks alone, and placed by the
dance.

    python benchmarks/bench_joints.py [--subjects 12] [--protocol dance]

Root mean squares over the subjects, in the static posture; 6 s a subject.
"""

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np
from virtual_visits import TUNED, subjects

from biodance.body.human.scaling import Scaling, measure_static
from biodance.lab.prepare import prepare
from biodance.lab.session.read import read_session
from biodance.motion.ik.functional_joints import functional_joints
from biodance.motion.ik.joint_unknowns import HINGES
from biodance.motion.kinematics import poses
from biodance.virtual_lab.simulate import simulate_session

JOINTS = {
    "thigh": "hip",
    "shank": "knee",
    "foot": "ankle",
    "trunk_head": "trunk",
    "upper_arm": "shoulder",
    "forearm_hand": "elbow",
}


def errors(scaling: Scaling, truth: dict) -> dict[str, float]:
    """Return joint kind -> RMS error of the centres, mm, and of knee and elbow axes, degrees."""
    true = {one["name"]: one for one in truth["static_pose"]["segments_12"]}
    body, stand = scaling.body()
    pose, found = poses(body, stand[None]), {}
    for segment, position in zip(body.segments, pose.position[0], strict=True):
        kind = next((joint for ending, joint in JOINTS.items() if segment.endswith(ending)), None)
        if kind:
            found.setdefault(f"{kind}, mm", []).append(1e3 * np.linalg.norm(position - true[segment]["position_m"]))
    for hinge in HINGES:
        index = body.joint_index(f"{hinge}_flexion")
        axis = pose.joint_rotation[0, index] @ body.joints[index].axis
        cosine = abs(axis @ np.array(true[body.segments[body.joints[index].segment]]["rotation"])[:, 2])
        found.setdefault(f"{hinge.split('_')[1]} axis, deg", []).append(np.degrees(np.arccos(min(1.0, cosine))))
    return {name: float(np.sqrt(np.mean(np.square(values)))) for name, values in found.items()}


def main() -> None:
    """Simulate, place, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--subjects", type=int, default=12)
    parser.add_argument("--protocol", default="dance")
    chosen = parser.parse_args()
    before, after, seconds = [], [], []
    for i, subject in enumerate(subjects(chosen.subjects, TUNED)):
        with tempfile.TemporaryDirectory() as folder:
            place = simulate_session(subject, chosen.protocol, Path(folder) / "session", seed=TUNED[1] + i)
            session, truth = read_session(place), json.loads((place / "truth" / "truth.json").read_text())
        (static,) = session.of_role("static")
        scaling = measure_static(session.subject, prepare(static))
        markers = [prepare(trial).markers for trial in session.of_role("fit")]
        start = time.process_time()
        found = functional_joints(scaling, markers)
        seconds.append(time.process_time() - start)
        before.append(errors(scaling, truth))
        after.append(errors(found.scaling, truth))
    print(
        f"{chosen.subjects} subjects, protocol {chosen.protocol}, {np.median(seconds):.1f} s of processor time (median)"
    )
    for name in before[0]:
        old, new = (np.sqrt(np.mean([row[name] ** 2 for row in rows])) for rows in (before, after))
        print(f"{name:16s} landmarks {old:5.1f}   movement {new:5.1f}")


if __name__ == "__main__":
    main()

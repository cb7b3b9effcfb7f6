"""People and faults of the third laboratory (benchmarks/third_lab, a clean room), held against their truth.

    python benchmarks/bench_third_lab.py people 1 6 --out FOLDER      # masses, CoM, coverage, squats
    python benchmarks/bench_third_lab.py diagnose 1 8 --out FOLDER [--faults plate_place load_thigh | all]

A seed is a person in a room. Each session is made, read through the front door, examined and diagnosed once; what was
found is kept in FOLDER as JSON (the recordings are removed again), so that a run that was stopped goes on. With
`--faults` seed A gets the first of them, A + 1 the second, and so on, round and round.

The truth lies in the world of that laboratory; the true mean places of the markers in the static trial, laid over those
that were read, carry it into the laboratory frame of the package (as bench_people.py counts the rest).
"""

import argparse
import json
import shutil
import time
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from bench_people import deviations
from bench_people import table as people_table
from scipy.spatial.transform import Rotation
from third_lab import FAULTS, make_session
from third_lab_answers import answer, diagnosis_table

import biodance
from biodance.body.body import Body
from biodance.motion.kinematics import poses
from biodance.pipeline.results import SessionResult
from biodance.records import Array, Motion

Row = dict[str, Any]


def measured(seed: int, fault: str, out: Path) -> Row:
    """Return what was found in one session, made, examined and diagnosed now if it is not kept in ``out``."""
    kept = out / f"{seed:04d}-{fault}.json"
    if kept.is_file():
        return json.loads(kept.read_text())
    folder = out / "sessions" / f"P{seed}-{fault}"
    make_session(folder, seed, fault)
    true = json.loads(folder.with_name(folder.name + ".truth.json").read_text())
    start = time.process_time()
    visit = biodance.examine(biodance.read_session(folder))
    spent = time.process_time() - start
    turn, shift = world_to_read(visit, true["static"]["markers_m"])
    row: Row = {"seed": seed, "fault": true["fault"], "room": true["room"], "examine_s": spent}
    if fault == "none":
        row["person"] = person(seed, visit, true, turn, shift)
    start = time.process_time()
    row["answer"] = answer(biodance.diagnose(visit), true, turn)
    row["diagnose_s"] = time.process_time() - start
    kept.write_text(json.dumps(row, indent=1, default=lambda value: np.asarray(value).tolist()))
    shutil.rmtree(folder)
    return row


def world_to_read(visit: SessionResult, markers: dict[str, list[float]]) -> tuple[Array, Array]:
    """Return rotation (3, 3) and shift (3,) m that carry the world of the truth over what was read."""
    static = next(one.trial for one in visit.trials if one.trial.role == "static")
    names = [name for name in static.markers.names if name in markers]
    read = np.nanmean([static.markers[name] for name in names], axis=1)
    true = np.array([markers[name] for name in names])
    turn = Rotation.align_vectors(read - read.mean(axis=0), true - true.mean(axis=0))[0].as_matrix()
    return turn, read.mean(axis=0) - turn @ true.mean(axis=0)


def person(seed: int, visit: SessionResult, true: Row, turn: Array, shift: Array) -> Row | None:
    """Return what table and identification say of one person, and the truth; None where nothing was identified."""
    body, found = visit.body, visit.identification
    if body is None or found is None or found.gain is None:
        return None
    static = next(one.motion for one in visit.trials if one.trial.role == "static")
    mass, com, own_com = truth(body, static, true, turn, shift)
    sip, gain = found.identification.sip, found.gain
    knee = {joint.name: float(np.linalg.norm(joint.translation)) for joint in body.joints}
    own = {side: abs(true["segments"][f"{side}_shank"]["joint_in_parent_m"][2]) for side in ("right", "left")}
    return {
        "seed": seed, "segments": body.segments, "mass": mass, "com": com, "own_com": own_com, "sd": deviations(sip),
        "apart": found.identification.apart, "table_mass": body.sip.mass, "table_com": body.sip.com,
        "found_mass": sip.mass, "found_com": sip.com,
        "thigh": knee["right_knee_flexion"] - knee["left_knee_flexion"], "true_thigh": own["right"] - own["left"],
        "gain": (gain.force, gain.moment), "sure": min(gain.force_interval[0], gain.moment_interval[0]) > 1,
        "alarm": found.search.status == "found", "notes": len(found.notes),
        "pelvis_share": true["lumps"]["pelvis"]["mass_kg"] / true["mass_kg"],
    }  # fmt: skip


def truth(body: Body, static: Motion, true: Row, turn: Array, shift: Array) -> tuple[Array, Array, Array]:
    """Return true masses (n,) kg, CoM (n, 3) m in the model's frames of the static trial, and CoM (n, 3) m from the
    true joint centres (of the pelvis from the model's), in the axes of the model.
    """
    pose, standing = poses(body, static.q[::10]), true["static"]
    mass, com, own = np.zeros(len(body.segments)), *np.zeros((2, len(body.segments), 3))
    for i, name in enumerate(body.segments):
        mass[i] = true["lumps_as_recorded"][name]["mass_kg"]
        lab = turn @ standing["com_m"][name] + shift
        joint = pose.position[:, i] if i == 0 else turn @ standing["joint_m"][name] + shift
        com[i], own[i] = (
            np.einsum("tji,tj->ti", pose.rotation[:, i], lab - origin + np.zeros_like(pose.position[:, i])).mean(axis=0)
            for origin in (pose.position[:, i], joint)
        )
    return mass, com, own


def main() -> None:
    """Run people or faults and print their table."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("what", choices=("people", "diagnose"))
    ask.add_argument("first", type=int, help="first seed")
    ask.add_argument("last", type=int, help="last seed")
    ask.add_argument("--out", type=Path, required=True)
    ask.add_argument("--faults", nargs="*", default=[], choices=("all", *FAULTS))
    asked = ask.parse_args()
    (asked.out / "sessions").mkdir(parents=True, exist_ok=True)
    faults = FAULTS if "all" in asked.faults else asked.faults or ["none"]
    rows = []
    for seed, fault in zip(range(asked.first, asked.last + 1), cycle(faults), strict=False):
        rows.append(measured(seed, fault, asked.out))
        print(f"{seed} {fault}: {rows[-1]['answer']['verdict']} {rows[-1]['answer']['named']}", flush=True)
    lines = diagnosis_table(rows)
    if asked.what == "people":
        lines = people_table([row["person"] for row in rows if row.get("person")])
    print("\n".join(lines))


if __name__ == "__main__":
    main()

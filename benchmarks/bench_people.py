"""Masses, CoM, lengths and squats of people of a laboratory that is not ours, against their truth and the table.

    python benchmarks/bench_people.py run 401 424 --sessions FOLDER --into people.jsonl   # needs BIODANCE_FOREIGN_LAB
    python benchmarks/bench_people.py table 401 412 --into people.jsonl

A person is a seed; a session that is not in the folder is generated, a person who is in the file is left out, so that
an interrupted run goes on. The truth has 14 segments: lower trunk, upper trunk and head are our trunk_head, forearm
and hand are one there already. Its joints (hip, lumbar joint ...) are its own; a mass is what turns with that
segment there. The true CoM of every segment (of a compound, the mean weighted by mass) is known in the lab in the
static trial and taken into the model's segment frame there: no misplaced joint centre counts as an error of a CoM.
Intervals are about the true joint centres, and so is the truth that they have to hold.
"""

import argparse
import json
import os
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from biodance.body.body import Body
from biodance.identification.knowledge import SIGMAS, segment_quantities
from biodance.lab.session.read import read_session
from biodance.motion.kinematics import poses
from biodance.pipeline.session import examine
from biodance.records import Array, Motion, Sip

_LIMBS = {"thigh": "thigh", "shank": "shank", "foot": "foot", "upper_arm": "uarm", "forearm_hand": "farm"}
PARTS = {"pelvis": ("pelvis",), "trunk_head": ("trunk", "thorax", "head")} | {
    f"{side}_{ours}": (f"{side[0]}_{theirs}",) for side in ("right", "left") for ours, theirs in _LIMBS.items()
}
"""Segments of the other laboratory that make ours."""
HIP = ("pelvis", "right_thigh", "left_thigh")
Row = dict[str, Any]


def session_of(seed: int, folder: Path) -> Path:
    """Return the session of a person in a real room, generated if it is not there."""
    place = folder / f"P{seed}"
    if not place.with_name(f"P{seed}.truth.json").is_file():
        rng, sex = random.Random(seed), "FM"[seed % 2]
        height = round(rng.uniform(*((1.52, 1.75) if sex == "F" else (1.64, 1.95))), 2)
        mass = round(rng.uniform(19.5, 28.5) * height**2, 1)
        words: Row = {"seed": seed, "sex": sex, "height": height, "mass": mass}
        words |= {"noise": 0.6, "camera": 0.3, "out": place}
        asked = [str(text) for name, value in words.items() for text in (f"--{name}", value)]
        program = Path(os.environ["BIODANCE_FOREIGN_LAB"]) / "foreign_lab.py"
        subprocess.run([sys.executable, str(program), *asked], check=True, stdout=subprocess.DEVNULL)
    return place


def truth(body: Body, static: Motion, segments: Row) -> tuple[Array, Array, Array]:
    """Return true masses (12,) kg, CoM (12, 3) m in the model's frames of the static trial, and CoM (12, 3) m from the
    true joint centres (of the pelvis from the model's), in the axes of the model.
    """
    pose = poses(body, static.q[::10])
    mass, com, own = np.zeros(len(body.segments)), *np.zeros((2, len(body.segments), 3))
    for i, name in enumerate(body.segments):
        parts = [segments[part] for part in PARTS[name]]
        weight = np.array([part["mass_kg"] for part in parts])
        lab = weight @ np.array([part["com_static_lab_m"] for part in parts]) / weight.sum()
        centre = pose.position[:, i] if i == 0 else np.array(parts[0]["origin_static_lab_m"])
        mass[i] = weight.sum()
        com[i], own[i] = (
            np.einsum("tji,tj->ti", pose.rotation[:, i], lab - origin).mean(axis=0)
            for origin in (pose.position[:, i], centre + np.zeros_like(pose.position[:, i]))
        )
    return mass, com, own


def deviations(sip: Sip) -> Array:
    """Return the standard deviations (N, 4) of mass, kg, and CoM, m."""
    out = []
    for i in range(len(sip.segments)):
        cut = slice(10 * i, 10 * i + 10)
        slope = segment_quantities(sip.phi[cut])[1][:4]
        out.append(np.sqrt(np.diag(slope @ sip.covariance[cut, cut] @ slope.T)))
    return np.array(out)


def person(seed: int, folder: Path) -> Row:
    """Return what table and identification say of one person, and the truth."""
    place = session_of(seed, folder)
    result = examine(read_session(place))
    body, found = result.body, result.identification
    assert body is not None
    assert found is not None
    assert found.gain is not None
    static = next(one.motion for one in result.trials if one.trial.role == "static")
    true = json.loads(place.with_name(f"P{seed}.truth.json").read_text())["segments"]
    mass, com, own_com = truth(body, static, true)
    sip, gain = found.identification.sip, found.gain
    knee = {joint.name: float(np.linalg.norm(joint.translation)) for joint in body.joints}
    own = {side: float(np.linalg.norm(true[f"{side[0]}_shank"]["joint_in_parent_m"])) for side in ("right", "left")}
    row: Row = {"seed": seed, "segments": body.segments, "mass": mass, "com": com, "own_com": own_com}
    row |= {"sd": deviations(sip), "apart": found.identification.apart}
    row |= {"table_mass": body.sip.mass, "table_com": body.sip.com, "found_mass": sip.mass, "found_com": sip.com}
    row |= {"thigh": knee["right_knee_flexion"] - knee["left_knee_flexion"], "true_thigh": own["right"] - own["left"]}
    row |= {"gain": (gain.force, gain.moment), "sure": min(gain.force_interval[0], gain.moment_interval[0]) > 1}
    row |= {"alarm": found.search.status == "found", "notes": len(found.notes)}
    return {key: np.asarray(value).tolist() for key, value in row.items()}


def table(rows: list[Row]) -> list[str]:
    """Return the table of a group of people as lines of Markdown."""
    names = rows[0]["segments"]
    of = {key: np.array([row[key] for row in rows]) for key in rows[0] if key != "segments"}
    mass, com = ({w: of[f"{w}_{what}"] - of[what] for w in ("table", "found")} for what in ("mass", "com"))
    e_mass = {w: np.abs(x) for w, x in mass.items()}
    e_com = {w: 1e3 * np.linalg.norm(x, axis=2) for w, x in com.items()}
    z = mass["found"] / of["sd"][:, :, 0]
    z_com = (of["found_com"] - of["own_com"]) / of["sd"][:, :, 1:]
    lines = [
        "| segment | mass kg: table, identified | bias | rms z | covered % | CoM mm: table, identified | covered % |",
        "|---|---|---|---|---|---|---|",
    ]
    for i, name in enumerate(names):
        lines.append(
            f"| {name} | {e_mass['table'][:, i].mean():.2f} {e_mass['found'][:, i].mean():.2f} | "
            f"{mass['found'][:, i].mean():+.2f} | {np.sqrt(np.mean(z[:, i] ** 2)):.2f} | {_within(z[:, i]):.0f} | "
            f"{e_com['table'][:, i].mean():.1f} {e_com['found'][:, i].mean():.1f} | {_within(z_com[:, i]):.0f} |"
        )
    ratio = [e["found"].mean() / e["table"].mean() for e in (e_mass, e_com)]
    hip = [names.index(name) for name in HIP]
    lines += [
        "",
        f"{len(rows)} people: mass {e_mass['table'].mean():.3f} -> {e_mass['found'].mean():.3f} kg ({ratio[0]:.2f} x), "
        f"CoM {e_com['table'].mean():.1f} -> {e_com['found'].mean():.1f} mm ({ratio[1]:.2f} x). 95 % intervals hold "
        f"{_within(z):.1f} % of the masses, {_within(z_com):.1f} % of the CoM, {_within(z[:, hip]):.1f} % of pelvis "
        f"and thighs. Thigh right less left, largest: {1e3 * np.abs(of['thigh']).max():.0f} mm, off by "
        f"{1e3 * np.abs(of['thigh'] - of['true_thigh']).max():.0f} mm. Squats, table over identified, median: force "
        f"{np.median(of['gain'][:, 0]):.2f}, moment {np.median(of['gain'][:, 1]):.2f}; the interval excludes 1 in "
        f"{100 * of['sure'].mean():.0f} %. Loads announced: {of['alarm'].sum():.0f}. "
        f"Sides apart in {of['apart'].sum():.0f}.",
    ]
    return lines


def _within(z: Array) -> float:
    return float(100 * np.mean(np.abs(z) < SIGMAS))


def main() -> None:
    """Run people, or print the table of those who were run."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("what", choices=("run", "table"))
    ask.add_argument("first", type=int, help="seed of the first person")
    ask.add_argument("last", type=int, help="seed of the last person")
    ask.add_argument("--sessions", type=Path, default=Path("people"), help="folder of the sessions")
    ask.add_argument("--into", type=Path, required=True)
    asked = ask.parse_args()
    rows = [json.loads(line) for line in asked.into.read_text().splitlines()] if asked.into.is_file() else []
    seeds = range(asked.first, asked.last + 1)
    if asked.what == "table":
        print("\n".join(table([row for row in rows if row["seed"] in seeds])))
        return
    with asked.into.open("a") as out:
        for seed in sorted(set(seeds) - {row["seed"] for row in rows}):
            print(json.dumps(person(seed, asked.sessions)), file=out, flush=True)


if __name__ == "__main__":
    main()

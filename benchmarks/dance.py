"""Dances designed for bodies of both sexes and all sizes: whether all limits hold, how much is called at once, what
imprecise people leave, what will be known, how long a design takes.

    OMP_NUM_THREADS=1 python -m benchmarks dance FOLDER [--protocols short easy] [--bodies reference careful]
        [--seconds 800] [--play]

A row a body and protocol, all with seed 0. Everything is kept in FOLDER: what is found there is not designed again, and
after ``--seconds`` no other one is begun. The margins are those that the design itself reports, of 200 imprecise
performers. ``--play`` plays each dance
in MuJoCo, which takes half as long as the dance.
"""

import argparse
import json
import resource
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.people import Row
from biodance.body.human.human import human
from biodance.body.human.limits import joint_limits
from biodance.dance.cues import dance_instructions
from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.expectation import expect
from biodance.dance.performers import OF_PERFORMERS, for_imprecise
from biodance.dance.problem.person import HEALTHY, PersonLimits, fit_to_person
from biodance.dance.problem.plan import read_plan
from biodance.dance.rehearsal import rehearse
from biodance.errors import BiodanceError
from biodance.records import Subject

STIFF = PersonLimits(
    range_shares=(("left_shoulder", 0.5), ("left_elbow", 0.6), ("left_hip", 0.7), ("left_knee", 0.7)),
    reason="left side stiff",
)
CAREFUL = PersonLimits(stand_alone_on=(), reason="no standing on one leg")
BODIES: dict[str, tuple[Subject, PersonLimits]] = {
    "reference": (Subject(65.0, 1.75, "F", 33.0), HEALTHY),
    "small_woman": (Subject(45.0, 1.50, "F", 25.0), HEALTHY),
    "woman": (Subject(60.0, 1.65, "F", 45.0), HEALTHY),
    "heavy_woman": (Subject(95.0, 1.62, "F", 50.0), HEALTHY),
    "tall_woman": (Subject(80.0, 1.85, "F", 28.0), HEALTHY),
    "small_man": (Subject(58.0, 1.60, "M", 30.0), HEALTHY),
    "man": (Subject(75.0, 1.77, "M", 33.0), HEALTHY),
    "heavy_man": (Subject(110.0, 1.80, "M", 40.0), HEALTHY),
    "tall_man": (Subject(90.0, 1.95, "M", 24.0), HEALTHY),
    "old_man": (Subject(72.0, 1.70, "M", 70.0), HEALTHY),
    "stiff_left": (Subject(68.0, 1.72, "M", 55.0), STIFF),
    "careful": (Subject(62.0, 1.60, "F", 65.0), CAREFUL),
}


def _spent() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return float(sum(one.ru_utime + one.ru_stime for one in used))


HEADING = (
    "| body | protocol | postures | s | instructions a cue: mean, most | limits kept | inside, mm | apart, mm "
    "| mass sd, kg | CoM sd, mm | design: CPU s, wall s |\n|" + "---|" * 11
)


def found(name: str, protocol: str, folder: Path) -> Row:
    """Return the numbers of the dance of one body and protocol, designed if it is not in the folder."""
    path = folder / f"{name}_{protocol}.json"
    if path.exists():
        return dict(json.loads(path.read_text(encoding="utf-8")))
    subject, person = BODIES[name]
    plan = read_plan(protocol)
    body = replace(human(subject), limits=joint_limits(subject, within=plan.ranges))
    body, plan, _ = fit_to_person(body, plan, person)
    before, start = _spent(), time.time()
    try:
        dance, margins = design(body, plan, seed=0)
    except BiodanceError as error:
        out: Row = {"refused": str(error)}
    else:
        cpu, wall, known = _spent() - before, time.time() - start, expect(dance, steps=1)
        needs = {f"{limit.name}_{OF_PERFORMERS}": one.least for limit, one in for_imprecise(plan.limits).items()}
        counts = [len(said) for said in dance_instructions(dance)]
        out = {
            "notes": list(dance.notes),
            "postures": len(dance.postures),
            "duration_s": dance.duration,
            "instructions": [float(np.mean(counts)), max(counts)],
            "kept": [sum(one.worst >= 0 for one in margins), len(margins)],
            "left": {one.limit: one.worst + needs[one.limit] for one in margins if one.limit in needs},
            **{key: _rms(getattr(known, key)).tolist() for key in ("mass", "com")},
            "cpu_s": cpu,
            "wall_s": wall,
        }
        dance.save(path.with_suffix(".npz"))
    path.write_text(json.dumps(out), encoding="utf-8")
    return out


def _rms(sd: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(sd**2, axis=1)))


def row(name: str, protocol: str, folder: Path) -> str:
    """Return the row of one body and protocol."""
    one = found(name, protocol, folder)
    if "refused" in one:
        return f"| {name} | {protocol} | refused: {one['refused']} |" + " |" * 8
    mean, most = one["instructions"]
    left = " | ".join(f"{1000 * worst:.0f}" for worst in one["left"].values()) or "– | –"
    mass, com = ([f"{factor * sd:.{digits}f}" for sd in one[key]] for key, factor, digits in _SIZES)
    return (
        f"| {name} | {protocol} | {one['postures']} | {one['duration_s']:.0f} | {mean:.1f}, {most} | "
        f"{one['kept'][0]} of {one['kept'][1]} | {left} | {' -> '.join(mass)} | {' -> '.join(com)} | "
        f"{one['cpu_s']:.0f}, {one['wall_s']:.0f} |"
    )


_SIZES = (("mass", 1.0, 2), ("com", 1000.0, 1))
_PROTOCOLS = ("easy", "patient", "chair", "short", "full")


def main() -> None:
    """Print the table."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path)
    ask.add_argument("--protocols", nargs="+", default=_PROTOCOLS)
    ask.add_argument("--bodies", nargs="+", choices=tuple(BODIES), default=tuple(BODIES))
    ask.add_argument("--seconds", type=float, default=np.inf)
    ask.add_argument("--play", action="store_true")
    asked = ask.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    begun = time.time()
    print(HEADING, flush=True)
    for protocol in asked.protocols:
        for name in asked.bodies:
            path = asked.folder / f"{name}_{protocol}.npz"
            if path.with_suffix(".json").exists() or time.time() - begun < asked.seconds:
                print(row(name, protocol, asked.folder), flush=True)
                if asked.play and path.exists():
                    print(f"\nPlayed in MuJoCo: {name}\n\n{rehearse(Dance.load(path)).table()}\n", flush=True)

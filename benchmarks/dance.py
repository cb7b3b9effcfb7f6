"""Dances designed for bodies of both sexes and all sizes: whether all limits hold, how much is called at once, what
imprecise people leave, what will be known, how long a design takes.

    OMP_NUM_THREADS=1 python -m benchmarks dance FOLDER [--protocols short easy] [--bodies reference careful]
        [--play] [--patients 40] [--visits 20]

A row a body and protocol, all with seed 0. Everything is kept in FOLDER: what is found there is not designed again. The
margins are those that the design itself reports, of 200 imprecise performers. ``--play`` plays each dance in MuJoCo,
which takes half as long as the dance. ``--patients`` designs for so many generated patients instead; ``--visits`` goes
all the way from a template of limits to the subject's page with so many people who copy their dance restlessly.
"""

import argparse
import json
import resource
import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.people import Row, truth_of
from biodance import examine, read_session, simulate
from biodance.body.human.human import human
from biodance.body.human.skeleton import joint_limits
from biodance.dance.cues import dance_instructions
from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.expectation import expect
from biodance.dance.performers import OF_PERFORMERS, for_imprecise
from biodance.dance.playback import rehearse
from biodance.dance.problem.person import HEALTHY, PersonLimits, fit_to_person, read_person
from biodance.dance.problem.plan import read_plan
from biodance.errors import BiodanceError
from biodance.library import folder as shipped
from biodance.pipeline.diagnosis import as_diagnosed, diagnosed_and_corrected
from biodance.pipeline.movement import account_for
from biodance.records import Subject
from biodance.report.pages.feedback import write_feedback

STIFF = PersonLimits(
    range_shares=(("left_shoulder", 0.5), ("left_elbow", 0.6), ("left_hip", 0.7), ("left_knee", 0.7)),
    reason="left side stiff",
)
CAREFUL = PersonLimits(stand_alone_on=(), reason="no standing on one leg")
_PATIENTS = ("stroke", "hip_tep", "parkinson", "child", "old", "amputee")
_AGES = {"child": (9, 15), "old": (75, 92), "hip_tep": (55, 85)}


def patients(count: int) -> dict[str, tuple[Subject, PersonLimits, str]]:
    """Return ``count`` generated patients by name: whose limits are those of the templates in turn, harder or milder;
    how often they stand free, hold a frame or sit, and the protocol that they are asked.
    """
    out = {}
    for k in range(count):
        rng, kind = np.random.default_rng([40, k]), _PATIENTS[k % len(_PATIENTS)]
        sex, age = "FM"[k // len(_PATIENTS) % 2], float(rng.uniform(*_AGES.get(kind, (35, 75))))
        stature = float(rng.normal(1.45, 0.08) if kind == "child" else rng.normal(1.63 if sex == "F" else 1.76, 0.07))
        mass = float(np.clip(rng.normal(19 if kind == "child" else 26, 4), 15, 40)) * stature**2
        person, way = read_person(shipped("protocols") / "limits" / f"{kind}.toml"), int(rng.integers(3))
        ease = float(rng.uniform(0.8, 1.2))
        person = replace(
            person,
            ranges=tuple((key, ease * low, ease * high) for key, low, high in person.ranges),
            strengths=tuple((key, min(1.0, ease * share)) for key, share in person.strengths),
            max_speed=ease * person.max_speed,
            holds=((), ("right",), ())[way],
        )
        protocol = "chair" if way == 2 else "easy" if kind == "child" else "patient"
        subject = Subject(round(max(mass, 30.0), 1), round(max(stature, 1.2), 2), sex, round(age))
        out[f"{kind} {k + 1}"] = (subject, person, protocol)
    return out


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
    "| body | protocol | postures | s | instructions a cue: mean, most | limits kept | inside, mm | over the floor, mm "
    "| apart, mm | mass sd, kg | CoM sd, mm | design: CPU s, wall s |\n|" + "---|" * 12
)


def found(name: str, protocol: str, folder: Path, who: tuple[Subject, PersonLimits] | None = None) -> Row:
    """Return the numbers of the dance of one body (``who``, else of this name), designed if not in the folder."""
    path = folder / f"{name}_{protocol}.json"
    if path.exists():
        return dict(json.loads(path.read_text(encoding="utf-8")))
    subject, person = who or BODIES[name]
    plan = read_plan(protocol)
    body = replace(human(subject), limits=joint_limits(subject, within=plan.ranges))
    body, plan, corrected = fit_to_person(body, plan, person)
    before, start = _spent(), time.time()
    try:
        dance, margins = design(body, plan, seed=0)
    except BiodanceError as error:
        out: Row = {"refused": str(error), "cpu_s": _spent() - before}
    else:
        cpu, wall, known = _spent() - before, time.time() - start, expect(dance, steps=1)
        needs = {f"{limit.name}_{OF_PERFORMERS}": one.least for limit, one in for_imprecise(plan.limits).items()}
        counts = [len(said) for said in dance_instructions(dance)]
        out = {
            "notes": [*corrected, *dance.notes],
            "unsafe": [one.limit for one in dance.unsafe],
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
        return f"| {name} | {protocol} | refused: {one['refused']} |" + " |" * 9
    mean, most = one["instructions"]
    left = " | ".join(f"{1000 * worst:.0f}" for worst in one["left"].values()) or "– | – | –"
    mass, com = ([f"{factor * sd:.{digits}f}" for sd in one[key]] for key, factor, digits in _SIZES)
    return (
        f"| {name} | {protocol} | {one['postures']} | {one['duration_s']:.0f} | {mean:.1f}, {most} | "
        f"{one['kept'][0]} of {one['kept'][1]} | {left} | {' -> '.join(mass)} | {' -> '.join(com)} | "
        f"{one['cpu_s']:.0f}, {one['wall_s']:.0f} |"
    )


def patient_rows(count: int, folder: Path) -> Iterator[str]:
    """Yield the table of generated patients, and at last how many have a safe dance in a minute of processor time."""
    yield "| patient | protocol | postures | s | safe | inside, mm | apart, mm | mass sd, kg | left out | CPU, s |"
    yield "|" + "---|" * 10
    good = 0
    for name, (subject, person, protocol) in patients(count).items():
        one = found(name.replace(" ", "_"), protocol, folder, (subject, person))
        who = f"{name}: {subject.sex}, {subject.age:g} y, {subject.stature:.2f} m, {subject.mass:.0f} kg"
        who += f", holds {person.holds[0]}" if person.holds and protocol != "chair" else ""
        if "refused" in one:
            yield f"| {who} | {protocol} | refused: {one['refused']} |" + " |" * 7
            continue
        good += not one["unsafe"] and one["cpu_s"] <= 60
        left = " | ".join(f"{1000 * worst:.0f}" for key, worst in one["left"].items() if not key.startswith("floor"))
        mass = " -> ".join(f"{sd:.2f}" for sd in one["mass"])
        notes = sum("eft out" in note for note in one["notes"])
        yield (
            f"| {who} | {protocol} | {one['postures']} | {one['duration_s']:.0f} | {'no' if one['unsafe'] else 'yes'} "
            f"| {left} | {mass} | {notes} | {one['cpu_s']:.0f} |"
        )
    yield f"\n{good} of {count} have a safe dance in 60 s of processor time."


_VISITORS = {
    "stroke": Subject(70.0, 1.62, "F", 60.0),
    "old": Subject(72.0, 1.70, "M", 80.0),
    "amputee": Subject(80.0, 1.78, "M", 50.0),
    "parkinson": Subject(64.0, 1.62, "F", 66.0),
}
_FIRST_VISITOR = 100
"""Seed of the first one."""


def visited(k: int, folder: Path) -> Row:
    """Return what the subject's page says after visit ``k``: of every mass and of the weight low, high and true kg."""
    kind, protocol = [*_VISITORS][k % len(_VISITORS)], "chair" if k % 3 == 2 else "patient"
    path = folder / f"visit_{k}.json"
    if path.exists():
        return dict(json.loads(path.read_text(encoding="utf-8")))
    who, limits = _VISITORS[kind], read_person(shipped("protocols") / "limits" / f"{kind}.toml")
    found(kind, protocol, folder, (who, limits))
    dance, place = Dance.load(folder / f"{kind}_{protocol}.npz"), folder / f"visit_{k}"
    write_feedback(dance, folder / f"{kind}_{protocol}.html", force=True)
    shutil.rmtree(place, ignore_errors=True)  # of a run that was stopped
    simulate(who, None, place, seed=_FIRST_VISITOR + k, dance=dance, performer="restless")
    result, told = diagnosed_and_corrected(examine(read_session(place)))
    account = account_for(as_diagnosed(result, told.diagnosis), told)
    true = {one["name"]: one["mass_kg"] for one in truth_of("own", place)["segments_12"]}
    parts = [one for one in (*account.parts, account.together) if one is not None and one.measured]
    out: Row = {
        "who": f"{kind} {_FIRST_VISITOR + k}",
        "protocol": protocol,
        "verdict": str(told.diagnosis.verdict),
        "withheld": account.withheld,
        "masses": [[one.low, one.high, sum(true[name] for name in one.segments)] for one in parts],
        "weight": [*account.weight, sum(true.values())] if np.isfinite(account.weight[0]) else None,
    }
    path.write_text(json.dumps(out), encoding="utf-8")
    return out


def visit_rows(numbers: Sequence[int], folder: Path) -> Iterator[str]:
    """Yield the table of visits, and at last how many numbers of the subjects' pages lie in their intervals."""
    yield "| visit | protocol | verdict | masses shown | within | weight | no numbers because of |\n" + "|---" * 7 + "|"
    good, shown = 0, 0
    for k in numbers:
        one = visited(k, folder)
        within = [low <= true <= high for low, high, true in one["masses"]]
        weight = one["weight"] and one["weight"][0] <= one["weight"][2] <= one["weight"][1]
        numbered = [*within, *([weight] if one["weight"] else [])]
        good, shown = good + sum(numbered), shown + len(numbered)
        said = {None: "–", True: "within", False: "outside"}[weight]
        yield (
            f"| {one['who']} | {one['protocol']} | {one['verdict']} | {len(within)} | {sum(within)} | {said} | "
            f"{', '.join(one['withheld']) or '–'} |"
        )
    yield f"\n{good} of {shown} numbers lie within their 95 % intervals."


_SIZES = (("mass", 1.0, 2), ("com", 1000.0, 1))
_PROTOCOLS = ("easy", "patient", "chair", "short", "full")


def main() -> None:
    """Print the table."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path)
    ask.add_argument("--protocols", nargs="+", default=_PROTOCOLS)
    ask.add_argument("--bodies", nargs="+", choices=tuple(BODIES), default=tuple(BODIES))
    ask.add_argument("--play", action="store_true")
    ask.add_argument("--patients", type=int, default=0)
    ask.add_argument("--visits", type=int, default=0)
    asked = ask.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    if asked.patients or asked.visits:
        people, visits = patient_rows(asked.patients, asked.folder), visit_rows(range(asked.visits), asked.folder)
        for line in people if asked.patients else visits:
            print(line, flush=True)
        return
    print(HEADING, flush=True)
    for protocol in asked.protocols:
        for name in asked.bodies:
            path = asked.folder / f"{name}_{protocol}.npz"
            print(row(name, protocol, asked.folder), flush=True)
            if asked.play and path.exists():
                print(f"\nPlayed in MuJoCo: {name}\n\n{rehearse(Dance.load(path)).table()}\n", flush=True)

"""What bench_truth.py runs: every session or archive of every demand as a `Job`, which says of each demand whether it
was met.
"""

import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import bench_honesty
import bench_loads
import bench_plates
import bench_registration
import bench_removed
import bench_walks
import numpy as np
from bench_registration import BARS, REAL, simulated
from diagnosis_scores import judge as judged
from hidden_causes import sample
from hidden_sessions import Scenario
from honesty_sessions import foreign_folder
from honesty_sessions import jobs as honest_sessions
from plate_archives import draw

from biodance.diagnosis.archive.judge import judge
from biodance.pipeline.plates import judge_plates

Hits = dict[str, list[bool]]
FIRST_PERSON = 545
"""Seed of the first foreign session with a fault (bench_removed.py): people for development since 2026-11-23."""
LOAD = ("left_forearm_hand", 2.4)


@dataclass(frozen=True)
class Job:
    """One session or archive of a ``column`` of the table; ``run`` returns what was said of it, and hits by demand."""

    part: str
    column: str
    key: str
    run: Callable[[], tuple[str, Hits]]


def clean() -> Iterator[Job]:
    """Yield sessions without fault: real, foreign in three rooms, own, and of drawn laboratories."""
    for key, column, session, true, hidden in honest_sessions(24, 12, 24):
        if not hidden:
            kind, _, room = column.partition(", ")
            yield Job("clean", kind, key, partial(_clean, key, room, session, true))


def _clean(key: str, room: str, session, true: set[str]) -> tuple[str, Hits]:  # type: ignore[no-untyped-def]
    one = bench_honesty.answered(key, room, session(), true)
    demand = f"without fault{room and f', {room}'}"
    hits = {f"{demand}: a false name or an alarm": [one.alarm], f"{demand}: cannot tell": [one.cannot_tell]}
    return f"{one.headline} {one.false}", hits | {
        '"complete" or "nothing wrong" beside a failed check': [one.contradicts]
    }


def removed(person: int = FIRST_PERSON) -> Iterator[Job]:
    """Yield one clear fault a session, diagnosed with the whole family and without the culprit's effect."""
    for column, effect, said, session in bench_removed.jobs(person):
        yield Job("removed", column, said, partial(_removed, column, effect, said, session))


def _removed(column: str, effect: str, said: str, session) -> tuple[str, Hits]:  # type: ignore[no-untyped-def]
    result = bench_removed.kept_session(f"{column}-{said}", session)
    without, whole = (bench_removed.answered(column, effect, said, result, without=w) for w in (True, False))
    blamed = bool(without.innocents)
    hits = {
        "one file removed: an innocent named": [blamed],
        "one file removed: ... and called complete": [blamed and without.verdict == "named, complete"],
        "one file removed: nothing wrong": [without.verdict == "nothing wrong"],
    }
    if effect == bench_removed.UNKNOWN:
        hits["no file describes it: unexplained"] = [whole.verdict == "unexplained"]
    else:
        hits["a clear fault: not nothing wrong"] = [whole.verdict not in ("nothing wrong", "cannot tell")]
        hits["a clear fault: named"] = [whole.found]
        hits["a clear fault: an innocent named"] = [bool(whole.innocents)]
        size = bench_removed.there(whole)
        if whole.size and np.isfinite(size):
            hits["a clear fault: interval covers"] = [abs(whole.size[0] - size) <= 1.96 * whole.size[1]]
    return f"{without.verdict} {without.named}; whole family: {whole.verdict} {whole.named}", hits


def walks() -> Iterator[Job]:
    """Yield real walking sessions, each with every fault written into its bytes, heard by the witnesses."""
    for name in bench_walks.ISSUE:
        yield Job("walks", "real", name, partial(_walks, name))


def _walks(name: str) -> tuple[str, Hits]:
    with tempfile.TemporaryDirectory() as place:
        found = [one for one, _ in bench_walks.scored(Path(os.environ["BIODANCE_DATA"]), name, Path(place), norms={})]
    faults = [one for one in found if one.fault.text]
    hits = {
        "walks with a fault: named or in the set": [one.listed for one in faults],
        "walks with a fault: interval covers": [one.covered for one in faults if one.covered is not None],
        "walks with a fault: refused": [one.told.startswith("refused") for one in faults],
        "walks without fault: a name": [bool(one.told) for one in found if not one.fault.text],
    }
    return "; ".join(one.fault.kind for one in faults if not one.listed), hits


def own_faults() -> Iterator[Job]:
    """Yield the sample of the own laboratory's sessions with one cause."""
    for one in sample():
        if one.hidden:
            yield Job("own", "own", one.key, partial(_own, one))


def _own(scenario: Scenario) -> tuple[str, Hits]:
    one, hits = judged(scenario), {}
    if one.ratio >= 2:
        hits["twice its limit or more: detected"] = [not one.silent]
        hits["twice its limit or more: named"] = [one.exact[0]]
        hits["twice its limit or more: interval covers"] = [] if one.covered is None else [one.covered]
    return f"{one.hidden[0]} at {one.ratio:.1f} limits: {one.verdict} {one.names}", hits


def loads() -> Iterator[Job]:
    """Yield foreign people with and without a load on the forearm."""
    for person in range(10):
        yield Job("loads", "foreign", f"unloaded {person}", partial(_unloaded, person))
        yield Job("loads", "foreign", f"2.4 kg, {person}", partial(_loaded, person))


def _unloaded(person: int) -> tuple[str, Hits]:
    alone = [row for row in bench_loads.unloaded("foreign", person) if row["against"] == "alone"]
    return "", {"unloaded, no reference: a load found": [row["status"] == "found" for row in alone]}


def _loaded(person: int) -> tuple[str, Hits]:
    segment, kg = LOAD
    rows = [row for row in bench_loads.loaded("foreign", person, (segment,), (kg,)) if row["against"] == "reference"]
    near = [row["status"] == "found" and abs(row["mass"] - kg) <= 0.25 for row in rows]
    covers = [row["interval"][0] <= kg <= row["interval"][1] for row in rows]
    said = ", ".join(f"{row['mass']:.2f} kg on {row['best']}" for row in rows)
    return said, {"2.4 kg with reference: within 0.25 kg": near, "2.4 kg with reference: interval covers": covers}


def plates() -> Iterator[Job]:
    """Yield archives: simulated ones with a step and without, the recorded balance trials and walks."""
    for seed in range(1000, 1020):
        for step in bench_plates.STEPS:
            if abs(step.size) == 0.005 or step.size == 5.0:
                within = 5 if step.quantity.startswith("place") else 2
                key = f"{step.plate} {step.quantity} {step.size} {seed}"
                yield Job("plates", "own", key, partial(_step, step, seed, within))
        yield Job("plates", "own", f"no step {seed}", partial(_no_step, seed + 4000))
    yield Job("plates", "real", "foam", _foam)
    yield Job("plates", "real", "walks", _walked)


def _step(step: bench_plates.Step, seed: int, within: int) -> tuple[str, Hits]:
    found = judge(draw(seed, visits=step.at + within, step=step))
    what = f"{1000 * step.size:g} mm" if within == 5 else f"{step.size:g} N"
    return "", {f"plates: {what} within {within} visits, date right": [bench_plates.named(found, step)]}


def _no_step(seed: int) -> tuple[str, Hits]:
    return "", {"plates without a step: an alarm": [bool(judge(draw(seed)).findings)]}


def _foam() -> tuple[str, Hits]:
    found = judge_plates(Path(os.environ["BIODANCE_DATA"]) / "bds").judgement
    people = {visit.person for visit in found.visits}
    named = {who for one in found.conditions if "foam" in (one.level.lower(), one.base.lower()) for who in one.persons}
    return ", ".join(sorted(named)), {"plates: the pad named, of persons": [who in named for who in sorted(people)]}


def _walked() -> tuple[str, Hits]:
    found = judge_plates(Path(os.environ["BIODANCE_DATA"]) / "biomechzoo").judgement
    return "; ".join(one.text for one in found.findings), {"plates without a step: an alarm": [bool(found.findings)]}


def registration() -> Iterator[Job]:
    """Yield people whose recordings are cut in two files: own, real, and a dance and a squat of foreign ones."""
    data = Path(os.environ.get("BIODANCE_DATA", ""))
    for seed in range(1, 13):
        yield Job("registration", "own", f"own {seed}", partial(_registered, "own", partial(simulated, seed)))
    for name in REAL:
        yield Job("registration", "real", name, partial(_registered, "real", partial(_one, data / f"{name}.c3d")))
    for seed in range(401, 413):
        yield Job("registration", "foreign", f"P{seed}", partial(_registered, "foreign", partial(_foreign, seed)))


def _one(path: Path, _: Path) -> list[Path]:
    return [path]


def _foreign(seed: int, _: Path) -> list[Path]:
    return [foreign_folder(seed, "real rooms") / f"{name}.c3d" for name in ("dance01", "squat01")]


def _registered(lab: str, recordings: Callable[[Path], list[Path]]) -> tuple[str, Hits]:
    rows = []
    with tempfile.TemporaryDirectory() as made:
        for k, path in enumerate(recordings(Path(made))):
            chance = np.random.default_rng(list(f"{path.parent.name} {path.name}".encode()))
            one = bench_registration.cut(path, Path(made) / f"cut{k}", lab, chance)
            rows.append(bench_registration.measured(one, one.forces))
    done = [row["status"] == "registered" for row in rows]
    met = [not ready or row["within"] for ready, row in zip(done, rows, strict=True)]
    said = "; ".join(f"{row['name']} {row['status']} {[row.get(bar) for bar in BARS]}" for row in rows)
    return said, {"registration: within all bars, or refused": met, "registration: registered": done}

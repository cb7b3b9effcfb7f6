"""How often a diagnosis is right: sessions without fault and with one clear fault, in laboratories real, foreign,
third, own, drawn at random from our own family, and home: without fault, as a user simulates them.

    python -m benchmarks diagnosis FOLDER --lab real foreign third own drawn home [--kind clean fault] [--sessions 24]
        [--first SEED] [--tell]

Every session goes through the front door: written, read, examined, diagnosed. Each is run once and kept in FOLDER, so
that a stopped run goes on; ``--tell`` prints only the table of what is there. Without ``--first`` people are drawn by
the date of the run. Real sessions stand in real_sessions.toml; faults written into the bytes of real walks are in
`walks`.
"""

import argparse
import os
import shutil
import tempfile
import time
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from test_hidden_causes import CAUSES, UNTOLD

import biodance
from benchmarks.people import Row, first_seed, kept, run_foreign, subject_of, truth_of, world_to_read
from benchmarks.third_lab import FAULTS, make_session
from benchmarks.third_lab.markers import name_markers
from benchmarks.third_lab.write import lump_of
from biodance.diagnosis.diagnosis import Diagnosis, Finding
from biodance.pipeline.results import SessionResult
from biodance.records import Array
from biodance.virtual_lab.causes import parse_cause
from biodance.virtual_lab.movement import read_protocol
from biodance.virtual_lab.simulate import simulate_session
from biodance.virtual_lab.visit import FIRST_VISIT, LabVisit, draw_laboratory, draw_visitor

COLUMNS = ("real", "foreign", "third", "own", "drawn", "home")
HOME = ("squat", "short", "easy", "diagnosis")
"""Sessions that a user simulates, in turn: two protocols, and two dances designed for the person."""
REAL = tomllib.loads(Path(__file__).with_name("real_sessions.toml").read_text(encoding="utf-8"))
"""Real sessions with their names that are not false."""
UNKNOWN = "unknown"  # effect of a cause of the foreign laboratory that no file here describes
FOREIGN = (
    ("plate_position", "plate_position", "0.03", "x"), ("plate_rotation", "plate_rotation", "5", "z"),
    ("time_delay", "time_delay", "0.02", ""), ("plate_gain", "plate_gain", "0.05", "Fz"),
    ("added_mass", "added_mass", "2.4", "l_farm"), ("plate_offset", "plate_offset", "25", "Fz"),
    ("plate_crosstalk", "plate_crosstalk", "0.025", "Fx"), ("body_mass", "body_mass", "0.08", ""),
    ("lab_tilt", "lab_tilt", "3", "x"), ("plate_drift", "plate_drift", "15", "Mx"),
    ("external_contact", "external_contact", "30", "R"), ("body_weight_support", "body_weight_support", "", ""),
    ("clock_drift", "clock_drift", "0.03", ""), ("sloshing_load", "sloshing_load", "", ""),
    ("head_joint", "head_joint", "15", ""), ("marker_misplaced", "marker_misplaced", "0.12", "RKNE:x"),
    (UNKNOWN, "plate_hysteresis", "", ""), ("wobbling_mass", "wobbling_mass", "", ""),
    ("filter_mismatch", "force_filter", "3", ""), ("trunk_joint", "trunk_joint", "10", ""),
    ("joint_centre", "joint_centre", "0.06", "hipR:x"), ("segment_length", "segment_length", "0.1", "kneeL"),
    ("marker_misplaced", "marker_moved", "0.06", "RKNE:x"), ("labels_swapped", "marker_swap", "", ""),
    ("clipping", "clipping", "", ""), (UNKNOWN, "creep", "", ""),
)  # fmt: skip
"""Effect here, cause of the foreign laboratory, its size ("" its own) and target."""
SAME = {
    "joint_centre": {"segment_length"}, "segment_length": {"joint_centre"}, "plate_drift": {"plate_offset"},
    "clock_drift": {"time_delay"}, "marker_misplaced": {"joint_centre"},
}  # fmt: skip
"""Other names of the same thing: a bone of another length is a joint elsewhere, and so is a marker that is wrong in the
static trial, too; a drift from zero on is a drift about its middle and an offset; the foreign clock drifts about the
middle of a session of which only the dances are judged."""
OWN = tuple(text for text in CAUSES if text not in UNTOLD)
"""Clear faults of our own laboratory, in turn."""
NO_LABEL = "no label"
JOINTED = frozenset({"trunk_joint", "head_joint", "shoulder_girdle"})
"""What the bodies of the third laboratory have: a spine of three joints, and clavicles."""
CLAIMS = (0.0, 0.05, 0.5, 0.85, 0.95, 1.0)
"""Edges between which claims are counted by their probability."""


@dataclass(frozen=True)
class Told:
    """What may be named in a session: ``right`` names ("effect target" or "effect") with the size each should have,
    None where that is not compared; names ``beside`` that are no false ones; ``alike`` whether another target of
    a right effect is right; ``unknown`` whether no file describes the cause.
    """

    right: dict[str, float | None] = field(default_factory=dict)
    beside: frozenset[str] = frozenset()
    alike: bool = False
    unknown: bool = False

    def holds(self, name: str) -> bool:
        """Return whether a name is right."""
        return name in self.right or (self.alike and any(name.split()[0] == one.split()[0] for one in self.right))


class Job(NamedTuple):
    """One session of a ``column``; ``visit`` makes it in a folder and says what may be named in it."""

    column: str
    key: str
    visit: Callable[[Path], tuple[SessionResult, Told]]


def real(name: str, folder: Path) -> tuple[SessionResult, Told]:
    """Return a real session, of one file in a folder of its own, and what is known to be wrong in it."""
    place = Path(os.environ["BIODANCE_DATA"]) / name
    if not place.is_dir():
        shutil.copy(place.with_suffix(".c3d"), folder)
        place = folder
    return biodance.examine(biodance.read_session(place)), Told(beside=frozenset(REAL[name]))


def foreign(seed: int, number: int | None, folder: Path) -> tuple[SessionResult, Told]:
    """Return a session of the foreign laboratory, clean or with fault ``number``."""
    place, words, told = folder / "s", ["--trials", "4"], Told()
    if number is not None:
        effect, cause, size, target = FOREIGN[number]
        words += [
            text for pair in (("--cause", cause), ("--size", size), ("--target", target)) if pair[1] for text in pair
        ]
        told = Told(dict.fromkeys((effect, *SAME.get(effect, ()))), alike=True, unknown=effect == UNKNOWN)
    run_foreign(seed, place, *words)
    return biodance.examine(biodance.read_session(place)), told


def own(seed: int, text: str, drawn: bool, folder: Path) -> tuple[SessionResult, Told]:
    """Return a session of our own laboratory or of one ``drawn`` from its family, clean or with a cause in words."""
    plan, visit, who = read_protocol("diagnosis"), FIRST_VISIT, subject_of(seed)
    if drawn:
        visit = LabVisit(laboratory=draw_laboratory(seed))
        who = draw_visitor(visit.laboratory, seed)
        if visit.laboratory.plates > 1 and text.startswith(
            ("plate_offset", "plate_drift", "plate_gain", "plate_cross")
        ):
            text = text.replace("target=", "target=plate1:")
    plan = replace(plan, trials=tuple(one for one in plan.trials if one.role != "validate"))
    hidden = (parse_cause(text),) if text else ()
    simulate_session(who, plan, folder / "s", seed=seed, hidden=hidden, visit=visit)
    told = Told()
    if text:
        cause = parse_cause(text)
        size = float(np.linalg.norm(next(iter(cause.values.values()))))
        effect, target = text.partition(":")[0], text.partition("target=")[2].partition(",")[0]
        told = Told({f"{effect} {target}".strip(): size}, frozenset(SAME.get(effect, ())))
    return biodance.examine(biodance.read_session(folder / "s")), told


def home(seed: int, plan: str, folder: Path) -> tuple[SessionResult, Told]:
    """Return a session without fault of a protocol or a dance, from the function behind ``biodance simulate``."""
    who = subject_of(seed)
    danced = plan in ("short", "easy")
    shown = biodance.design_dance(who, protocol=plan, seed=seed).dance if danced else None
    biodance.simulate(who, None if danced else plan, folder / "s", seed=seed, dance=shown)
    return biodance.examine(biodance.read_session(folder / "s")), Told()


def third(seed: int, fault: str, folder: Path) -> tuple[SessionResult, Told]:
    """Return a session of the third laboratory, clean or with a ``fault``."""
    make_session(folder / "s", seed, fault)
    true = truth_of("third", folder / "s")
    result = biodance.examine(biodance.read_session(folder / "s"))
    right, beside = expected(true, world_to_read(result, true["static"]["markers_m"])[0])
    return result, Told(right, JOINTED | beside)


def expected(true: Row, turn: Array) -> tuple[dict[str, float | None], set[str]]:
    """Return the names that tell the fault, each with the size it should have, and names that are no false ones beside.

    A size is signed as the package's files in `effects` say, and counts the tolerance that the plate has anyway; None
    where a name has none. ``turn`` (3, 3) carries the laboratory's world into the package's.
    """
    fault = true["fault"]
    kind, target, size = fault["kind"], fault["target"], fault["size"]
    plates = true["plates"]
    labels = name_markers(true["room"]["marker_set"])

    if kind.startswith("plate_"):
        plate = {key: np.array(value) for key, value in plates[int(target[-1]) - 1].items() if key != "make"}
        places = {"plate_place": -plate["shift"], "plate_offset": plate["turn"] @ plate["offset"][:3]}
        if kind in places:
            lab, way = turn @ places[kind], turn @ plate["turn"][:, "xyz".index(fault["axis"])]
            i = int(np.abs(way).argmax())
            name = f"plate_position {target}:" if kind == "plate_place" else f"plate_offset {target}:F"
            return {name + "xyz"[i]: float(lab[i])}, set()
        if kind == "plate_yaw":
            return {f"plate_rotation {target}:z": -float(plate["yaw"])}, set()
        return {f"plate_gain {target}:Fz": float(plate["response"][2, 2] - 1)}, set()
    if kind.startswith("load_"):
        return {f"added_mass {lump_of(target)}": size}, set()
    wrist = "/".join(sorted(labels.get(f"{target}_{end}", NO_LABEL) for end in ("radial", "ulnar")))
    knee, side = labels.get(target, NO_LABEL), target.split("_")[0]
    return {
        "none": ({}, set()),
        "force_delay": ({"time_delay": plates[0]["delay"]}, set()),
        "knee_moved": ({f"marker_misplaced {knee}": abs(size)}, set()),
        "knee_misplaced": ({f"joint_centre {side}_knee": None}, {f"segment_length {side}_thigh"}),
        "labels_exchanged": ({f"labels_swapped {wrist}": None}, set()),
        "wrong_mass": ({"body_mass": -size}, set()),
        "force_filter": ({"filter_mismatch": size}, set()),
        "rail": ({f"external_contact {target.replace('hand', 'forearm_hand')}": size}, set()),
        "lab_tilt": ({"lab_tilt x": abs(size), "lab_tilt y": abs(size)}, set()),
    }[kind]  # fmt: skip


def size_of(one: Finding) -> tuple[float, float]:
    """Return the size of a finding, all parameters of the unit of the first as a vector, and its standard deviation."""
    same = [p for p in one.parameters if p.unit == one.parameters[0].unit]
    value, sd = np.array([p.value for p in same]), np.array([p.sd for p in same])
    length = float(np.linalg.norm(value))
    return length, float(np.linalg.norm(value * sd) / max(length, 1e-12))


def answer(one: Diagnosis, told: Told) -> Row:
    """Return what was named and what of it is false, whether the session cannot tell, sizes beside the truth."""
    names = [f"{finding.effect} {finding.target}".strip() for finding in one.findings]
    allowed = told.beside | {effect for name in told.beside for effect in SAME.get(name, ())}
    sets = {f"{alias.effect} {alias.target}".strip() for finding in one.findings for alias in finding.set}
    head = next((said.text for said in one.attention if said.about == "diagnosis"), one.told)
    sized = [
        (name, *size_of(finding), abs(told.right[name] or 0.0))
        for name, finding in zip(names, one.findings, strict=True)
        if told.right.get(name) is not None and finding.parameters
    ]
    claims = [] if told.beside else [("nothing wrong", one.p_clean, not told.right)]  # what is beside may not matter
    for finding in (*one.findings, *one.resembles):
        alike = [f"{alias.effect} {alias.target}".strip() for alias in (finding, *finding.set)]
        true = any(told.holds(name) or {name, name.split()[0]} & allowed for name in alike)
        claims.append(("a cause", finding.probability, true))
    return {
        "verdict": one.verdict,
        "claims": claims,
        "cannot_tell": head.lower().startswith(("cannot tell", "nobody can tell")),
        "named": names,
        "in_set": any(map(told.holds, {*names, *sets})),
        "exact": any(map(told.holds, names)),
        "false": [name for name in names if not told.holds(name) and not {name, name.split()[0]} & allowed],
        "sizes": [(name, value, sd, true, abs(value - true) < 1.96 * sd) for name, value, sd, true in sized],
    }


def judged(job: Job) -> Row:
    """Return the row of one session."""
    with tempfile.TemporaryDirectory() as scratch:
        try:
            result, told = job.visit(Path(scratch))
            start = time.process_time()
            said = answer(biodance.diagnose(result).diagnosis, told)
        except biodance.BiodanceError as error:
            told, start = Told(), time.process_time()
            said = {"verdict": f"refused: {error}", "cannot_tell": True, "named": [], "in_set": False, "exact": False}
            said |= {"false": [], "sizes": [], "claims": []}
    said |= {"column": job.column, "key": job.key, "fault": bool(told.right), "unknown": told.unknown}
    return said | {"s": time.process_time() - start}


def jobs(columns: list[str], kinds: list[str], sessions: int, first: int) -> list[Job]:
    """Return the sessions of some columns: ``sessions`` people a column and kind, from seed ``first`` on."""
    out = []
    if "real" in columns and "clean" in kinds:
        out += [Job("real", name, partial(real, name)) for name in REAL]
    if "clean" in kinds:
        plans = [(first + k, HOME[k % len(HOME)]) for k in range(sessions)]
        out += [Job("home", f"{seed} {plan}", partial(home, seed, plan)) for seed, plan in plans]
    for kind in kinds:
        for k in range(sessions):
            seed, fault = first + k + 50 * (kind == "fault"), kind == "fault"
            number, text = (k % len(FOREIGN), OWN[k % len(OWN)]) if fault else (None, "")
            theirs = FAULTS[k % len(FAULTS)] if fault else "none"
            name = "" if number is None else " ".join(filter(None, FOREIGN[number][1:]))
            out += [
                Job("foreign", f"{seed} {name}".strip(), partial(foreign, seed, number)),
                Job("third", f"{seed} {theirs}", partial(third, seed, theirs)),
                Job("own", f"{seed} {text}".strip(), partial(own, seed, text, False)),
                Job("drawn", f"{seed} {text}".strip(), partial(own, seed, text, True)),
            ]
    return [one for one in out if one.column in columns]


def table(rows: list[Row]) -> list[str]:
    """Return the demands as a table: how often, of how many, in each column; and how many claims of a probability are
    true: of every cause with its set, and that nothing is there that matters.
    """
    alarm = ("unexplained", "named, incomplete", "named, complete")
    demands: dict[str, Callable[[Row], list[bool]]] = {
        "without fault: a false name": lambda one: [bool(one["false"])] * (not one["fault"]),
        "without fault: a false name or an alarm": (
            lambda one: [bool(one["false"]) or (one["verdict"] in alarm and not _unsure(one))] * (not one["fault"])
        ),
        "without fault: says that it cannot tell": lambda one: [_unsure(one)] * (not one["fault"]),
        "a clear fault: not nothing wrong": lambda one: [one["verdict"] != "nothing wrong"] * one["fault"],
        "a clear fault: named": lambda one: [one["exact"]] * (one["fault"] and not one["unknown"]),
        "a clear fault: named or in the set": lambda one: [one["in_set"]] * (one["fault"] and not one["unknown"]),
        "a clear fault: an innocent named": lambda one: [bool(one["false"])] * one["fault"],
        "no file describes it: unexplained": lambda one: [one["verdict"] == "unexplained"] * one["unknown"],
        "95 % interval of the size holds the truth": lambda one: [size[4] for size in one["sizes"]],
    }
    for what, (low, high) in product(("a cause", "nothing wrong"), pairwise(CLAIMS)):
        demands[f"{what}, P {low:g} to {high:g}: true"] = partial(_true, what, low, high)
    lines = [f"| | {' | '.join(COLUMNS)} |", "|" + "---|" * (len(COLUMNS) + 1)]
    for demand, test in demands.items():
        hits = [[hit for one in rows if one["column"] == c for hit in test(one)] for c in COLUMNS]
        lines.append(f"| {demand} | {' | '.join(map(_share, hits))} |")
    return lines


def _true(what: str, low: float, high: float, one: Row) -> list[bool]:
    return [true for kind, p, true in one["claims"] if kind == what and low <= p < high + (high == 1)]


def _unsure(one: Row) -> bool:
    return bool(one["cannot_tell"] and not one["named"])


def _share(hits: list[bool]) -> str:
    return f"{sum(hits)} of {len(hits)}" if hits else "-"


def main() -> None:
    """Run what is not there yet and print the table."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path)
    ask.add_argument("--lab", nargs="+", choices=COLUMNS, default=["own"])
    ask.add_argument("--kind", nargs="+", choices=("clean", "fault"), default=["clean", "fault"])
    ask.add_argument("--sessions", type=int, default=24, help="of each laboratory and kind")
    ask.add_argument("--first", type=int, default=first_seed())
    ask.add_argument("--tell", action="store_true")
    asked = ask.parse_args()
    rows = []
    for job in jobs(asked.lab, asked.kind, asked.sessions, asked.first):
        path = asked.folder / f"{job.column}_{''.join(c if c.isalnum() or c in '.-' else '_' for c in job.key)}.json"
        if path.is_file() or not asked.tell:
            rows.append(kept(path, partial(judged, job)))
            print(f"{job.column} {job.key}: {rows[-1]['verdict']} {rows[-1]['named']}", flush=True)
    print("\n".join(table(rows)))

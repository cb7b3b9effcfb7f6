"""Faults written into copies of real walking sessions at the level of bytes, and what is named.

    BIODANCE_DATA=folder python -m benchmarks walks [--without-static] [--only SESSION ...]

The folder holds the public sessions named below: C3D files, and TRC with OpenSim's force files. One fault at a time is
in every file of a copy, as in a laboratory; ``--without-static`` with static trials taken away.
"""

import argparse
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from inject import inject

from biodance.diagnosis.diagnosis import Finding
from biodance.errors import BiodanceError
from biodance.lab.c3d.raw import read_raw
from biodance.lab.plates import count_plates
from biodance.lab.session.read import read_session
from biodance.observations import SeenTrial, observe, recording
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.session import examine
from biodance.records import Array, Session
from biodance.virtual_lab.causes import fault_of, parse_cause

CHILDREN = tuple(f"biomechzoo/HC0{n}A" for n in (30, 31, 32, 38, 44, 50, 55))
SESSIONS = (*CHILDREN, "adl_gait", "gaitalytics/test_small", "gaitalytics/treadmill_no_events", "pycgm",
            "c3d_parser_Sydney", "c3d_parser_QCMAS", "opensim_models/raj_walk", "opensim_models/raj_run",
            "opensim_models/gait10", "subject4")  # fmt: skip
NOT_WALKED = ("DJ", "STS", "squats")  # beginnings of the names of files that hold no walk


@dataclass(frozen=True)
class Fault:
    """What is written: ``text`` for the virtual lab, ``truths`` the causes that name it, its ``size`` (0: none)."""

    kind: str
    text: str
    truths: tuple[tuple[str, str], ...]
    size: float = 0.0


@dataclass(frozen=True)
class Score:
    """One session with one fault: whether it was named first, named or in a set, covered (None: no interval), all that
    was named; ``others`` of which it is no look-alike; ``claims`` how probable each; ``limit`` of what is shown.
    """

    session: str
    fault: Fault
    first: bool
    listed: bool
    covered: bool | None
    told: str
    others: tuple[tuple[str, str], ...] = ()
    verdict: str = ""
    claims: tuple[tuple[tuple[str, str], float], ...] = ()
    limit: float = np.nan


def faults_for(session: Session) -> Iterator[Fault]:
    """Return the faults to write into a session: on the plate with most steps, across the way."""
    mass = session.subject.mass
    seen = [recording(trial, mass=mass) for trial in session.trials if trial.plates]
    steps = [(one, step) for one in seen for step in one.steps]
    if not steps:
        return
    names = [step.plate for _, step in steps]
    plate = max(sorted(set(names)), key=names.count)
    ahead = np.mean([np.abs(one.foot(s.side).axes(s.middle)[0]) for one, s in steps if s.plate == plate], axis=0)
    across, along = ("x", "y") if ahead[1] > ahead[0] else ("y", "x")
    prefix = "" if all(len(one.trial.plates) == 1 for one in seen) else f"{plate}:"
    at = f"target={plate}"
    for way, axis in (("across", across), ("along", along)):
        place = (("plate_position", f"{plate}:{axis}"),)
        yield Fault(f"20 mm {way}", f"plate_position:{at}:{axis},shift=0.02", place, 0.02)
    yield Fault("30 ms late", "time_delay:delay=0.03", (("time_delay", ""),), 0.03)
    gain = (("plate_gain", f"{prefix}Fz"), ("body_mass", ""))
    yield Fault("Fz 5 %", f"plate_gain:{at}:Fz,gain=0.05", gain, 0.05)
    rest = _empty(seen, plate, "Fx")
    yield Fault("Fx 15 N", f"plate_offset:{at}:Fx,offset=15", (("plate_offset", f"{prefix}Fx"),), 15.0 + rest)
    yield Fault("yaw 3 degrees", f"plate_rotation:{at}:z,angle=0.0524", (("plate_rotation", f"{plate}:z"),), 0.0524)
    labels = sorted(n for n in seen[0].trial.markers.names if re.fullmatch(r"[LR][._]?ASIS?", n.rpartition(":")[2]))
    if len(labels) == 2:
        pair = "/".join(labels)
        yield Fault("ASIS exchanged", f"labels_swapped:target={pair}", (("labels_swapped", pair),))


def _empty(seen: list[SeenTrial], plate: str, channel: str) -> float:
    """Return what a plate reads empty in the recordings as they are, N, mean of the trials: 0 where none shows it."""
    what, every = f"{plate} {channel}, taken off", (observe(one, ("empty_plate",)) for one in seen)
    kept = [o.value for some in every for o in some if o.what == what]
    return float(np.mean(kept)) if kept else 0.0


def copied(files: list[Path], folder: Path, text: str) -> Path:
    """Write a copy of a session with the fault that ``text`` says in every file with plates; "" for none."""
    folder.mkdir(parents=True)
    for number, path in enumerate(files):
        clock = {path.stem: (number / len(files), (number + 1) / len(files))}
        if text and path.suffix == ".mot":
            write_mot(path, folder / path.name, text)
        elif text and path.suffix == ".trc":
            (folder / path.name).write_text(_exchanged(path.read_text(), text, moving="static" not in path.stem))
        elif text and count_plates(read_raw(path))[0]:
            inject(path, folder / path.name, fault_of(parse_cause(text), clock))
        else:
            shutil.copy(path, folder / path.name)
    return folder


def _exchanged(table: str, text: str, *, moving: bool) -> str:
    """Return a TRC file's text with two labels exchanged, if that is the fault and somebody moves."""
    cause = parse_cause(text)
    if cause.name != "labels_swapped" or not moving:
        return table
    one, other = cause.target.split("/")
    lines = table.split("\n")
    lines[3] = "\t".join({one: other, other: one}.get(name, name) for name in lines[3].split("\t"))
    return "\n".join(lines)


def write_mot(path: Path, copy: Path, text: str) -> None:
    """Write a force file of OpenSim (y up, x ahead) with a fault of one plate, or of the clock of all."""
    lines = path.read_text().split("\n")
    first = 2 + next(k for k, line in enumerate(lines) if line.strip() == "endheader")
    names = lines[first - 1].split("\t")
    rows = np.array([line.split() for line in lines[first:] if line.strip()], dtype=float)
    plates = [name[:-2] for name in names if name.endswith("vx")]
    number = re.match(r"plate(\d+)", parse_cause(text).target)
    plate = plates[int(number[1]) - 1 if number else 0]
    force, place = ([names.index(f"{plate}{letter}{axis}") for axis in "xyz"] for letter in "vp")
    rows = _with_fault(rows, force, place, text)
    table = ["\t".join(f"{value:.9g}" for value in row) for row in rows]
    copy.write_text("\n".join([*lines[:first], *table, ""]))


def _with_fault(rows: Array, force: list[int], place: list[int], text: str) -> Array:
    """Return a force file's rows with a fault in a plate's columns ``force`` and ``place`` (x, y, z of OpenSim; the
    laboratory's y is its -z).
    """
    cause = parse_cause(text)
    size, loaded = next(iter(cause.values.values()), (0.0,))[0], rows[:, force[1]] > 20
    unit = 1000.0 if np.abs(rows[loaded][:, place]).max() > 20 else 1.0
    middle = rows[loaded][:, place].mean(axis=0)
    column, sign = {"x": (0, 1.0), "y": (2, -1.0)}.get(cause.target[-1:], (1, 1.0))
    if cause.name == "plate_position":
        rows[:, place[column]] += sign * size * unit
    elif cause.name == "plate_offset":
        rows[:, force[column]] += sign * size
    elif cause.name == "plate_gain":
        rows[:, force[column]] *= 1 + size
        rows[:, place] = middle + (rows[:, place] - middle) / (1 + size)
    elif cause.name == "plate_rotation":
        turn = np.array([[np.cos(size), 0, np.sin(size)], [0, 1, 0], [-np.sin(size), 0, np.cos(size)]])
        rows[:, force] = rows[:, force] @ turn.T
        rows[:, place] = middle + (rows[:, place] - middle) @ turn.T
    elif cause.name == "time_delay":
        late = round(size / float(np.diff(rows[:, 0]).mean()))
        return np.column_stack([rows[late:, 0], rows[:-late, 1:]])
    return rows


def judged(name: str, fault: Fault, found: tuple[Finding, ...]) -> Score:
    """Return the score of one session; a named truth covers if its 95 % interval holds the size that was written."""
    own = [one for one in found if (one.effect, one.target) in fault.truths[:1] and one.parameters]
    low_high = own[0].parameters[0].interval if own and fault.size else None
    sizes = [", ".join(f"{p.value:.3g} ± {p.sd:.2g} {p.unit}" for p in one.parameters) for one in found]
    sets = [{(one.effect, one.target), *((a.effect, a.target) for a in one.set)} for one in found]
    return Score(
        name,
        fault,
        bool(found) and (found[0].effect, found[0].target) in fault.truths,
        any(truth in some for truth in fault.truths for some in sets),
        None if low_high is None else low_high[0] <= fault.size <= low_high[1],
        "; ".join(f"{one.effect} {one.target} {size}" for one, size in zip(found, sizes, strict=True)),
        tuple((one.effect, one.target) for one, some in zip(found, sets, strict=True) if some.isdisjoint(fault.truths)),
        claims=tuple(((one.effect, one.target), one.probability) for one in found if one.probability > 0),
    )


def files_of(data: Path, name: str) -> list[Path]:
    """Return the files of a session: of a folder those that hold a walk or a posture, or the one file of that name."""
    place = data / name
    if not place.is_dir():
        return [place.with_suffix(".c3d")]
    files = sorted(path for path in place.iterdir() if path.suffix in (".c3d", ".trc", ".mot"))
    return [path for path in files if not path.name.startswith(NOT_WALKED)]


def scored(data: Path, name: str, place: Path, *, static: bool = True) -> Iterator[Score]:
    """Return the scores of one session, clean first, then each fault; with its ``static`` trials or without."""
    files = files_of(data, name)
    clean = read_session(copied(files, place / name / "clean", ""))
    if not static:
        still = {trial.source.path.name for trial in clean.trials if trial.role == "static"}
        files = [one for one in files if one.name not in still]
        clean = read_session(copied(files, place / name / "moving", ""))
    limits: dict[tuple[str, str], float] = {}
    for number, fault in enumerate([Fault("nothing", "", ()), *faults_for(clean)]):
        try:
            session = read_session(copied(files, place / name / str(number), fault.text)) if fault.text else clean
            found = diagnose_session(examine(session)).diagnosis
            limits = limits or {(row.effect, row.target): row.limit for row in found.limits}
            limit = min((limits.get(truth, np.nan) for truth in fault.truths[:1]), default=np.nan)
            yield replace(judged(name, fault, found.findings), verdict=f"{found.verdict}: ", limit=limit)
        except BiodanceError as error:
            yield Score(name, fault, False, False, None, f"refused: {error}")


def table(scores: list[Score]) -> list[str]:
    """Return the summary as a table: one line a fault."""
    head = "| written | sessions | named first | first or in the set | interval covers | innocents |"
    lines = [head, "|---" * 6 + "|"]
    every, clean = [one for one in scores if one.fault.text], [one for one in scores if not one.fault.text]
    known = {(one.session, name) for one in clean for name in one.others}
    for kind in (*dict.fromkeys(one.fault.kind for one in every), "all"):
        some = [one for one in every if kind in (one.fault.kind, "all")]
        sized = [one.covered for one in some if one.covered is not None]
        covers = f"{sum(sized)} of {len(sized)}" if sized else "-"
        first, listed = sum(one.first for one in some), sum(one.listed for one in some)
        blamed = sum(any((one.session, name) not in known for name in one.others) for one in some)
        lines.append(f"| {kind} | {len(some)} | {first} | {listed} | {covers} | {blamed} |")
    missed = [one for one in every if not one.listed]
    small = sum(abs(one.fault.size) < one.limit for one in missed)
    lines.append(f"| missed: smaller than that session says that it shows | {len(missed)} | {small} | | | |")
    lines.append(f"| nothing | {len(clean)} | names in {sum(bool(one.told) for one in clean)} | | | |")
    new = [(p, name not in one.others) for one in every for name, p in one.claims if (one.session, name) not in known]
    for low, high in pairwise((0.5, 0.85, 0.95, 1.0)):
        some = [true for p, true in new if low <= p < high + (high == 1)]
        lines.append(f"| P {low} to {high}: new names, true | {len(some)} | {sum(some)} | | | |")
    return lines


def main() -> None:
    """Print what was named in each session, and the counts."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--without-static", action="store_true")
    ask.add_argument("--only", nargs="*", default=SESSIONS)
    asked, scores = ask.parse_args(), []
    with tempfile.TemporaryDirectory() as place:
        for name in asked.only:
            for one in scored(Path(os.environ["BIODANCE_DATA"]), name, Path(place), static=not asked.without_static):
                scores.append(one)
                mark = "first" if one.first else "in the set" if one.listed else "MISSED" if one.fault.text else ""
                print(f"{name} | {one.fault.kind} | {mark} | {one.covered} | {one.verdict}{one.told}", flush=True)
    print("\n".join(["", *table(scores)]))

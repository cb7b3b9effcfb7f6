"""Real people: what identification is worth on recordings of other laboratories, through the functions of the command.

    BIODANCE_DATA=folder python -m benchmarks real_people FOLDER [--only paper masses halves trials]

``paper`` is the man of the laboratory of the paper, fitted on one movement, another kept; ``masses`` runners whose mass
nobody declares; ``halves`` treadmills, one half of a trial fitted, the other kept; ``trials`` visits of several, the
first half of those of a kind fitted, the others kept. Nothing is chosen by hand but the roles of the trials, and where
the man's long table is cut. Rows are kept in FOLDER, so that a stopped run goes on.
"""

import argparse
import os
import re
import shutil
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from benchmarks.people import Row, kept
from biodance.errors import SessionRefused
from biodance.identification.validation import TrialValidation
from biodance.lab.session.read import read_session
from biodance.motion.dynamics import compare
from biodance.pipeline.diagnosis import diagnosed_and_corrected
from biodance.pipeline.session import examine, identification_of
from biodance.records import CHANNELS, Array, Markers, Role, Session, Trial, Wrench
from biodance.settings import STANDARD_GRAVITY

QUESTIONS = ("paper", "masses", "halves", "trials")
RUNNERS = tuple(f"rbds/S0{n}" for n in ("01", "03", "05", "09", "12", "16", "17", "18", "20", "24"))
MAN = {"squats": (8.0, 27.5), "march": (27.5, 61.0)}
"""What one long table of the man of the paper's laboratory holds, s."""
BELTS = {
    "opensim_models/raj_run": "run",
    "gaitalytics/treadmill_no_events.c3d": "treadmill_no_events",
    **{f"{runner} {speed}": f"runT{speed}" for runner in RUNNERS for speed in (25, 35)},
}
"""Sessions, or single files, on treadmills; their trials."""
CHILDREN = tuple(f"HC0{n}" for n in ("02D", "30A", "31A", "32A", "36A", "38A", "44A", "50A", "55A"))
VISITS = {
    "c3d_parser_Sydney": ("S4-AMGait",),
    "c3d_parser_FMC": ("MH0222_BP",),
    "subject4": ("walking", "squats", "STS", "DJ"),
    **{
        f"biomechzoo/HC{n}": (f"HC{n}",)
        for n in ("002D", "030A", "031A", "032A", "036A", "038A", "044A", "050A", "055A")
    },
}
"""Visits with several trials of a kind, and how the names of each kind begin."""


def read(name: str, folder: Path) -> Session:
    """Return a session of the data as the command reads it; a single file lies alone in a folder below ``folder``."""
    place = Path(os.environ["BIODANCE_DATA"]) / name.partition(" ")[0]
    if place.is_file():
        (alone := folder / "sessions" / place.stem).mkdir(parents=True, exist_ok=True)
        place = Path(shutil.copy(place, alone)).parent
    return read_session(place)


def split(session: Session, name: str, parts: dict[str, tuple[float, float]]) -> Session:
    """Return a session with ``parts``, first and last second by name, in the place of the trial ``name``."""
    trial, markers, new = session[name], session[name].markers, []
    for part, (start, end) in parts.items():
        seen, felt = ((time >= start) & (time < end) for time in (markers.time, trial.wrench.time))
        plates = [replace(one, wrench=Wrench(one.wrench.time[felt], one.wrench.value[felt])) for one in trial.plates]
        worn = Markers(markers.names, markers.time[seen], markers.xyz[seen])
        new.append(replace(trial, name=part, markers=worn, plates=tuple(plates)))
    return replace(session, trials=(*(one for one in session.trials if one.name != name), *new))


def halves(session: Session, trial: str) -> Session:
    """Return a session whose ``trial`` is two, of half its length."""
    middle = float(session[trial].wrench.time[[0, -1]].mean())
    return split(session, trial, {"first": (-np.inf, middle), "second": (middle, np.inf)})


def first_half(session: Session, kind: str) -> Session:
    """Return a session of which the first half of the trials whose names begin with ``kind`` is fitted, others kept."""
    names = [one.name for one in session.trials if one.role != "static" and one.name.startswith(kind)]
    return with_roles(session, {name: "fit" if 2 * k < len(names) - 1 else "validate" for k, name in enumerate(names)})


def with_roles(session: Session, roles: dict[str, Role]) -> Session:
    """Return a session whose moving trials have these roles, and no others any."""
    moved = (one if one.role == "static" else replace(one, role=roles.get(one.name, "skip")) for one in session.trials)
    return replace(session, trials=tuple(moved))


def sessions(question: str, folder: Path) -> dict[str, Callable[[], Session]]:
    """Return by name how to make the sessions of a ``question``, their trials fitted and kept."""
    made: dict[str, Callable[[], Session]] = {}

    def add(name: str, whole: Callable[[], Session], fitted: str, hold: str) -> None:
        made[name] = lambda: with_roles(whole(), {fitted: "fit", hold: "validate"})

    if question == "paper":
        for fitted, hold in (("march", "squats"), ("squats", "march")):
            add(f"c3d, {fitted} to {hold}", lambda: read("laas_human/c3d", folder), fitted, hold)
            add(f"raw, {fitted} to {hold}", lambda: split(read("laas_human/raw", folder), "Trial03", MAN), fitted, hold)
    for fitted, hold in (("first", "second"), ("second", "first")) * (question == "halves"):
        for name, trial in BELTS.items():
            add(f"{name}, {hold}", lambda n=name, t=trial: halves(read(n, folder), t), fitted, hold)
    for name, kinds in VISITS.items():
        for kind in kinds if question == "trials" else ():
            made[f"{name} {kind}"] = lambda n=name, k=kind: first_half(read(n, folder), k)
    return made


def judged(session: Session) -> Row:
    """Return what table and identified body leave of kept trials, or why nothing was found."""
    try:
        found = identification_of(diagnosed_and_corrected(examine(session))[0])
    except SessionRefused as why:
        return {"refused": str(why)}
    return {"kept": list(map(residuals, found.validations)), "gain": asdict(found.gain) if found.gain else None}


def residuals(one: TrialValidation) -> Row:
    """Return RMS differences (6,) N, N·m in a kept trial, ``extended`` with skin, flesh and joints if told; seconds."""
    weighed = compare(one.measured, Wrench(one.table.time, one.weighed * one.table.value), one.use)
    extended = one.extended_agreement or one.identified_agreement
    found = {"table": one.table_agreement, "identified": one.identified_agreement, "extended": extended}
    rms = {name: agreement.rms for name, agreement in (found | {"weighed": weighed}).items()}
    return {**rms, "seconds": one.use.sum() / one.measured.rate}


def ratios(row: Row, which: str) -> Array:
    """Return residuals (6,) in kept trials: of one of the bodies, over those of the table with the weighed mass."""
    own, table = (sum(one["seconds"] * np.square(one[name]) for one in row["kept"]) for name in (which, "weighed"))
    return np.asarray(np.sqrt(own / table))


def told(name: str, row: Row) -> str:
    """Return a row of the table of kept trials."""
    if not row.get("kept"):
        return f"| {name} | {row.get('refused', 'no kept trial')} |"
    rms = [np.mean([one[which] for one in row["kept"]], axis=0) for which in ("table", "identified")]
    means = [" -> ".join(f"{one[part].mean():.1f}" for one in rms) for part in (slice(0, 3), slice(3, 6))]
    gain, wide = row["gain"] or {}, "{:.2f} ({:.2f} to {:.2f})"
    sure = [wide.format(gain[key], *gain[f"{key}_interval"]) for key in ("force", "moment") if gain]
    by = (" ".join(f"{value:.2f}" for value in ratios(row, which)) for which in ("identified", "extended"))
    return f"| {name} | {' | '.join((*means, ', '.join(sure), *by))} |"


def median(rows: list[Row], which: str) -> str:
    """Return the medians of the ratios of some rows by channel, and in how many a channel is worse by over 2 %."""
    found = np.array([ratios(row, which) for row in rows if row.get("kept")]).reshape(-1, 6)
    by = [f"{name} {value:.2f}" for name, value in zip(CHANNELS, np.median(found, axis=0), strict=True)]
    worse = [f"{name} {count}" for name, count in zip(CHANNELS, (found > 1.02).sum(axis=0), strict=True)]
    return f"{len(found)} of {len(rows)}. {which} over table, median: {', '.join(by)}. Worse: {', '.join(worse)}."


def weighed(runner: str, folder: Path) -> Row:
    """Return what a runner weighs whose mass nobody declared, kg, and the mean force over whole strides as read."""
    session = read(runner, folder)
    unknown = replace(session, subject=replace(session.subject, mass=float("nan")))
    strides = [whole_strides(one) for one in session.trials if one.role == "fit"]
    return {"told": examine(unknown).subject.mass, "strides": strides}


def whole_strides(trial: Trial) -> float:
    """Return the mean vertical force of a runner's trial over an even number of steps, kg."""
    force = trial.wrench.force[:, 2]
    loaded = force > force.mean() / 2
    starts = np.flatnonzero(loaded[1:] & ~loaded[:-1])
    starts = starts[np.diff(starts, prepend=-np.inf) > 0.1 * trial.wrench.rate]  # noise is no step
    return float(force[starts[0] : starts[-1 - (len(starts) + 1) % 2]].mean()) / STANDARD_GRAVITY


def main() -> None:
    """Answer one question after the other, and print a table of each."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path)
    ask.add_argument("--only", nargs="+", choices=QUESTIONS, default=QUESTIONS)
    for question in (asked := ask.parse_args()).only:
        print(f"\n## {question}\n", flush=True)
        if question == "masses":
            for runner in RUNNERS:
                path = asked.folder / f"masses/{runner[-4:]}.json"
                one = kept(path, lambda: weighed(runner, asked.folder))  # noqa: B023
                print(f"| {runner} | {100 * (one['told'] / np.mean(one['strides']) - 1):+.2f} % |", flush=True)
            continue
        rows = []
        for name, make in sessions(question, asked.folder).items():
            path = asked.folder / question / (re.sub(r"[^\w.]+", "_", name) + ".json")
            rows.append(kept(path, lambda: judged(make())))  # noqa: B023
            print(told(name, rows[-1]), flush=True)
        for which in ("identified", "extended"):
            print(f"\n{median(rows, which)}")

"""Loads on five segments, declared with the load and without it, found with a reference session and without one, on
people of our virtual laboratory and of one that is not ours.

    python benchmarks/bench_loads.py own 3 --into loads.jsonl [--segments trunk_head]   # a line for every search
    python benchmarks/bench_loads.py foreign 3 --into loads.jsonl      # needs BIODANCE_FOREIGN_LAB
    python benchmarks/bench_loads.py unloaded 8 --into loads.jsonl     # unloaded foreign people, two sessions each
    python benchmarks/bench_loads.py unloaded-own 8 --into loads.jsonl # the same of our laboratory
    python benchmarks/bench_loads.py table --into loads.jsonl          # the tables of docs/benchmarks/identification.md
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from virtual_visits import subjects, visit

from biodance.body.body import Body
from biodance.identification.added_mass import LoadSearch, added_mass
from biodance.identification.identification import identify_body
from biodance.identification.statistics import Fit
from biodance.identification.unloaded_body import scaled_to_mass
from biodance.lab.session.read import read_session
from biodance.pipeline.session import examine
from biodance.pipeline.trial_result import trial_fit

SEGMENTS = {
    "left_forearm_hand": "l_farm",
    "left_upper_arm": "l_uarm",
    "left_shank": "l_shank",
    "trunk_head": "thorax",
    "left_thigh": "l_thigh",
}
"""Segments and their names in the other laboratory."""
KILOGRAMS = (2.4, 1.0, 0.5)
FIRST_FOREIGN = 501
"""Seed of the first foreign person: none of those on whom the rule was looked at while it was made (301 to 308)."""
Seen = tuple[Body, tuple[Fit, ...]]
Row = dict[str, Any]


def own(person: int, session: int, load: tuple[str, float] | None) -> Seen:
    """Return body, with the mass of the scale (unloaded), and trials of a person of our laboratory."""
    one = visit(subjects(40)[person], "short", seed=900 + person, session=session, load=load)
    return one.body, one.fits


def foreign(person: int, session: int, load: tuple[str, float] | None) -> Seen:
    """Return the same of a person of the other laboratory in a real room."""
    rng, sex = np.random.default_rng(FIRST_FOREIGN + person), "FM"[person % 2]
    height = round(float(rng.normal(1.66 if sex == "F" else 1.79, 0.06)), 2)
    words = {"seed": FIRST_FOREIGN + person, "sex": sex, "height": height}
    words |= {"mass": round(float(rng.uniform(19, 29)) * height**2, 1), "noise": 0.6, "camera": 0.3, "session": session}
    if load:
        words |= {"cause": "added_mass", "target": SEGMENTS[load[0]], "size": load[1]}
    with tempfile.TemporaryDirectory() as scratch:
        words["out"] = f"{scratch}/visit"
        asked = [text for name, value in words.items() for text in (f"--{name}", str(value))]
        program = Path(os.environ["BIODANCE_FOREIGN_LAB"]) / "foreign_lab.py"
        subprocess.run([sys.executable, str(program), *asked], check=True, stdout=subprocess.DEVNULL)
        result = examine(read_session(Path(words["out"])))
    fits = [trial_fit(one) for one in result.trials if one.trial.role == "fit"]
    assert result.body is not None
    return result.body, tuple(fit for fit in fits if fit is not None)


_LABS = {"own": own, "foreign": foreign}


def loaded(lab: str, person: int, segments: tuple[str, ...], kilograms: tuple[float, ...] = KILOGRAMS) -> Iterator[Row]:
    """Yield every search of one person with loads of ``kilograms`` on ``segments``, declared either way."""
    make = _LABS[lab]
    reference = identify_body(*make(person, 1, None))
    mass = float(reference.body.sip.mass.sum())
    for kg, segment in product(kilograms, segments):
        body, fits = make(person, 2, (segment, kg))
        for way, declared in (("with", mass + kg), ("without", mass)):
            one = identify_body(replace(body, sip=scaled_to_mass(body.sip, declared)), fits)
            yield _row(lab, person, segment, kg, way, "reference", added_mass(one, reference=reference))
            yield _row(lab, person, segment, kg, way, "alone", added_mass(one))


def unloaded(lab: str, person: int) -> Iterator[Row]:
    """Yield the searches of one person's two sessions without load."""
    first, second = (identify_body(*_LABS[lab](person, session, None)) for session in (1, 2))
    yield _row(lab, person, "", 0.0, "with", "alone", added_mass(first))
    yield _row(lab, person, "", 0.0, "with", "alone", added_mass(second))
    yield _row(lab, person, "", 0.0, "with", "reference", added_mass(second, reference=first))


def _row(lab: str, person: int, segment: str, kg: float, way: str, against: str, found: LoadSearch) -> Row:
    best = found.best
    hers = next((one for one in found.suspects if one.segment == segment), best)
    row = {"lab": lab, "person": person, "segment": segment, "kg": kg, "declared": way, "against": against}
    row |= {"status": found.status, "p_none": found.p_no_load, "best": best.segment, "set": found.set}
    return row | {"mass": hers.mass, "interval": hers.interval, "smallest": hers.smallest}


def table(rows: list[Row]) -> None:
    """Print how often an unloaded session raises an alarm, and the table of loads."""
    for lab in ("own", "foreign"):
        for against in ("alone", "reference"):
            none = [r for r in rows if (r["lab"], r["kg"], r["against"]) == (lab, 0.0, against)]
            if none:
                false, least = sum(r["status"] == "found" for r in none), min(r["p_none"] for r in none)
                print(f"- Unloaded, {lab}, {against}: {false} false in {len(none)}; smallest p of no load {least:.3f}.")
    print("\n| load on | kg | declared | own, reference | own, alone | foreign, reference | foreign, alone |")
    print("|---|---|---|---|---|---|---|")
    kinds = [(lab, against) for lab in ("own", "foreign") for against in ("reference", "alone")]
    for segment in SEGMENTS:
        for kg in sorted(KILOGRAMS):
            for way in ("with", "without"):
                cells = [_cell([r for r in rows if _kind(r) == (*kind, segment, kg, way)]) for kind in kinds]
                print(f"| {segment} | {kg:g} | {way} | {' | '.join(cells)} |")


def _kind(row: Row) -> tuple[str, str, str, float, str]:
    return row["lab"], row["against"], row["segment"], row["kg"], row["declared"]


def _cell(some: list[Row]) -> str:
    """Return how many were found, of them in the right segment (and in the set that is told beside it), the median
    error and how many intervals cover.
    """
    found = [r for r in some if r["status"] == "found"]
    if not found:
        return f"0/{len(some)}" if some else ""
    answers = [[r["best"]] for r in found], [r["set"] for r in found]
    right, told = (sum(r["segment"] in one for r, one in zip(found, named, strict=True)) for named in answers)
    error = float(np.median([abs(r["mass"] - r["kg"]) for r in found]))
    covers = sum(r["interval"][0] <= r["kg"] <= r["interval"][1] for r in found)
    return f"{len(found)}/{len(some)}, {right} ({told}), {error:.2f} kg, {covers}"


def main() -> None:
    """Run what was asked for; every search is one line of JSON, so that an interrupted run is worth its lines."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("what", choices=("own", "foreign", "unloaded", "unloaded-own", "table"))
    ask.add_argument("people", type=int, nargs="?", default=1)
    ask.add_argument("--first", type=int, default=0, help="number of the first person")
    ask.add_argument("--segments", default=",".join(SEGMENTS), help="that carry a load, separated by commas")
    ask.add_argument("--into", type=Path, required=True)
    asked = ask.parse_args()
    if asked.what == "table":
        table([json.loads(line) for line in asked.into.read_text().splitlines()])
        return
    with asked.into.open("a") as out:
        for person in range(asked.first, asked.first + asked.people):
            if asked.what.startswith("unloaded"):
                rows = unloaded("own" if asked.what == "unloaded-own" else "foreign", person)
            else:
                rows = loaded(asked.what, person, tuple(asked.segments.split(",")))
            for row in rows:
                print(json.dumps(row), file=out, flush=True)


if __name__ == "__main__":
    main()

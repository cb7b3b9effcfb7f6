"""Loads on five segments, declared with the load and without it, found with a reference session and without one.

    python -m benchmarks loads FOLDER --lab own foreign [--people 3] [--first SEED] [--segments trunk_head ...]

Every person is also searched unloaded, two sessions. What one person gave is kept in FOLDER, so that a stopped run goes
on.
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.people import Row, first_seed, kept, run_foreign, subject_of
from biodance.body.body import Body
from biodance.identification.added_mass import LoadSearch, added_mass, scaled_to_mass
from biodance.identification.identification import identify_body
from biodance.identification.statistics import Fit
from biodance.lab.session.read import read_session
from biodance.pipeline.session import examine
from biodance.pipeline.trial import trial_fit
from biodance.virtual_lab.causes import parse_cause
from biodance.virtual_lab.movement import read_protocol
from biodance.virtual_lab.simulate import simulate_session
from biodance.virtual_lab.visit import LabVisit

SEGMENTS = {
    "left_forearm_hand": "l_farm",
    "left_upper_arm": "l_uarm",
    "left_shank": "l_shank",
    "trunk_head": "thorax",
    "left_thigh": "l_thigh",
}
"""Segments and their names in the other laboratory."""
KILOGRAMS = (2.4, 1.0, 0.5)
Seen = tuple[Body, tuple[Fit, ...]]


def seen(lab: str, seed: int, visit: int, load: tuple[str, float] | None) -> Seen:
    """Return body, with the mass of the scale (unloaded), and trials of a person's visit with a load (segment, kg)."""
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch) / "visit"
        if lab == "own":
            who, plan = subject_of(seed), read_protocol("short")
            causes = (parse_cause(f"added_mass:target={load[0]},mass={load[1]}"),) if load else ()
            simulate_session(who, plan, place, seed=seed, hidden=causes, visit=LabVisit(visit))
        else:
            carried = ("--cause", "added_mass", "--target", SEGMENTS[load[0]], "--size", load[1]) if load else ()
            run_foreign(seed, place, "--session", visit, *carried)
        result = examine(read_session(place))
    fits = [trial_fit(one) for one in result.trials if one.trial.role == "fit"]
    assert result.body is not None
    return result.body, tuple(fit for fit in fits if fit is not None)


def loaded(lab: str, person: int, segments: tuple[str, ...]) -> Iterator[Row]:
    """Yield every search of one person with loads on ``segments``, declared either way."""
    reference = identify_body(*seen(lab, person, 1, None))
    mass = float(reference.body.sip.mass.sum())
    for kg, segment in product(KILOGRAMS, segments):
        body, fits = seen(lab, person, 2, (segment, kg))
        for way, declared in (("with", mass + kg), ("without", mass)):
            one = identify_body(replace(body, sip=scaled_to_mass(body.sip, declared)), fits)
            yield _row(lab, person, segment, kg, way, "reference", added_mass(one, reference=reference))
            yield _row(lab, person, segment, kg, way, "alone", added_mass(one))


def unloaded(lab: str, person: int) -> Iterator[Row]:
    """Yield the searches of one person's two sessions without load."""
    first, second = (identify_body(*seen(lab, person, session, None)) for session in (1, 2))
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
    """Run people and print the tables."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path)
    ask.add_argument("--lab", nargs="+", choices=("own", "foreign"), default=["own", "foreign"])
    ask.add_argument("--people", type=int, default=3)
    ask.add_argument("--first", type=int, default=first_seed())
    ask.add_argument("--segments", nargs="+", choices=tuple(SEGMENTS), default=tuple(SEGMENTS))
    asked = ask.parse_args()
    rows = []
    for lab, seed in product(asked.lab, range(asked.first, asked.first + asked.people)):

        def searches(lab: str = lab, seed: int = seed) -> Row:
            return {"rows": [*unloaded(lab, seed), *loaded(lab, seed, tuple(asked.segments))]}

        rows += kept(asked.folder / f"{lab}_{seed}_{len(asked.segments)}.json", searches)["rows"]
        print(f"{lab} {seed}", flush=True)
    table(rows)

"""What keeps a danced session from the truth: the same people dance with one source of error switched off after
another.

    OMP_NUM_THREADS=1 python benchmarks/chain_sources.py FOLDER --people 0,1,2 [--only skin]

FOLDER holds the dances of bench_chain.py (`dances/0_short.npz` ...); rows are kept in FOLDER/sources.jsonl, so that an
interrupted run goes on. A line of the table: root mean squares over the people, the table's beside.
"""

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bench_chain import FIRST_SEED, errors, identified, rms
from virtual_visits import subjects

from biodance.dance.dance import Dance
from biodance.pipeline.simulate_dance import simulate_dance
from biodance.records import Subject
from biodance.virtual_lab.movement.dancing import PERFORMERS, Performer
from biodance.virtual_lab.recording.laboratory import LabVisit
from biodance.virtual_lab.tolerances import REALISTIC, instruments_perfect

_EXACT = Performer(tracking=0.0, pace=1.0, timing=0.0, sway=0.0)
_SKIN = ("soft_tissue", "soft_tissue_day")
_PARTS = ("head_motion", "thorax_motion", "thorax_share", "wrist_motion", "clavicle_rhythm", "girdle_motion")
_PLATES = tuple(name for name in vars(REALISTIC) if name.startswith("plate_"))


def _without(*names: str) -> LabVisit:
    return LabVisit(tolerances=replace(REALISTIC, **dict.fromkeys(names, 0.0)))


_STIFF = instruments_perfect(replace(REALISTIC, **dict.fromkeys((*_PARTS, "tremor", "breathing"), 0.0)))
_NORMAL = PERFORMERS["normal"]
WAYS: dict[str, tuple[Performer, LabVisit]] = {
    "all errors": (_NORMAL, LabVisit()),
    "exact performer": (_EXACT, LabVisit()),
    "still skin": (_NORMAL, _without(*_SKIN)),
    "segments that do not bend": (_NORMAL, _without(*_PARTS)),
    "perfect plates": (_NORMAL, _without(*_PLATES)),
    "perfect plates, cameras, skin, marker placement": (_NORMAL, LabVisit(tolerances=instruments_perfect())),
    "the same, and segments that do not bend": (_NORMAL, LabVisit(tolerances=_STIFF)),
}
"""Performer and visit of every way."""


def row(folder: Path, number: int, subject: Subject, name: str) -> dict[str, Any]:
    """Return RMS errors of mass (kg) and CoM (m), table's and identified, of one person's session."""
    performer, visit = WAYS[name]
    dance = Dance.load(folder / "dances" / f"{number}_short.npz")
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch) / "session"
        simulate_dance(subject, dance, place, seed=FIRST_SEED + number, performer=performer, visit=visit)
        found = json.loads(json.dumps(identified(place), default=np.ndarray.tolist))
    pairs = {which: [rms([one]) for one in errors(found, which)] for which in ("table", "identified")}
    return {"person": number, "way": name, **pairs}


def table(rows: list[dict[str, Any]]) -> str:
    """Return a line for every way as Markdown, over the people who have all ways that anybody has."""
    names = [name for name in WAYS if any(r["way"] == name for r in rows)]
    whole = {r["person"] for r in rows if {s["way"] for s in rows if s["person"] == r["person"]} >= set(names)}
    lines = ["| switched off | mass RMS, kg: table, danced | CoM RMS, mm: table, danced |", "|---|---|---|"]
    for name in names:
        some = [r for r in rows if r["way"] == name and r["person"] in whole]
        mass, com = ([rms([r[which][k] for r in some]) for which in ("table", "identified")] for k in (0, 1))
        lines.append(f"| {name} | {mass[0]:.3f}, {mass[1]:.3f} | {1e3 * com[0]:.1f}, {1e3 * com[1]:.1f} |")
    return "\n".join([f"{len(whole)} people", *lines])


def main() -> None:
    """Run what is missing, person by person, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--people", default="0,1,2")
    parser.add_argument("--only", help="a way whose name contains this")
    asked = parser.parse_args()
    kept = asked.folder / "sources.jsonl"
    rows = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    everybody = subjects(10)
    for number in map(int, asked.people.split(",")):
        for name in WAYS:
            if (number, name) in {(r["person"], r["way"]) for r in rows} or (asked.only and asked.only not in name):
                continue
            rows.append(row(asked.folder, number, replace(everybody[number], age=33.0), name))
            with kept.open("a") as out:
                print(json.dumps(rows[-1]), file=out, flush=True)
    print(table(rows))


if __name__ == "__main__":
    main()

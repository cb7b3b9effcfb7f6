"""What a followable dance loses to the free optimum of the same length, and where.

    OMP_NUM_THREADS=1 python benchmarks/chain_limits.py FOLDER --people 0,1,2 --visits 3 [--only free,followable]

FOLDER holds the dances of bench_chain.py (`dances/0_short.npz`) and free ones of the same length (`free/0_short.npz`).
Every person's dance is danced by that person and, in further visits, by other people of the same size. Ways:
`followable`; `free`; `words`: as many postures of the same words, of which each may be anything and telling most is all
that counts (`price.freer_dance`), the best that these words can do. The error of the centres of mass is taken apart:
what the table leaves because the data do not say more, and what the data add. Rows are kept in FOLDER/limits.
"""

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bench_chain import FIRST_SEED, covered, errors, identified, rms
from virtual_visits import subjects

from biodance.dance.dance import Dance
from biodance.dance.followable.walk import freer_dance
from biodance.dance.problem.plan import read_plan
from biodance.pipeline.dance import dancer
from biodance.pipeline.simulate_dance import simulate_dance
from biodance.records import Subject
from biodance.virtual_lab.movement.dancing import PERFORMERS

WAYS = {"followable": "dances", "words": "words", "free": "free"}
"""Folder of the dances of every way."""
_HEADING = (
    "| dance | mass, kg: table, danced | removed | CoM, mm: table, danced | removed | left by the table | "
    "added by the data | 95 % intervals hold mass, CoM |\n|" + "---|" * 8
)
_OTHERS, _APART = 600, 20
"""Seed of the first other person, and how far those of two visits are apart."""


def danced(folder: Path, number: int, subject: Subject, way: str) -> Dance:
    """Return the dance of a person, chosen freely from the words if it is not there."""
    path = folder / WAYS[way] / f"{number}_short.npz"
    if way == "words" and not path.exists():
        plan = read_plan("short")
        path.parent.mkdir(exist_ok=True)
        freer_dance(dancer(subject, plan), plan, seed=0).save(path)
    return Dance.load(path)


def row(folder: Path, number: int, way: str, visit: int) -> dict[str, Any]:
    """Return what a session gave, as bench_chain.py keeps it."""
    kept = folder / "limits" / f"{number}_{way}_{visit}.json"
    if not kept.exists():
        subject = replace(subjects(10)[number], age=33.0)
        seed = FIRST_SEED + number if visit == 0 else _OTHERS + _APART * (visit - 1) + number
        with tempfile.TemporaryDirectory() as scratch:
            place, dance = Path(scratch) / "session", danced(folder, number, subject, way)
            simulate_dance(subject, dance, place, seed=seed, performer=PERFORMERS["normal"])
            found = identified(place)
        kept.parent.mkdir(exist_ok=True)
        kept.write_text(json.dumps(found, default=np.ndarray.tolist), encoding="utf-8")
    return dict(json.loads(kept.read_text(encoding="utf-8")))


def line(way: str, rows: list[dict[str, Any]]) -> str:
    """Return the row of a way: root mean squares over all segments and sessions."""
    pairs = [[errors(one, which) for one in rows] for which in ("table", "identified")]
    mass, com = ([rms(pair[k] for pair in which) for which in pairs] for k in (0, 1))
    left = [np.linalg.norm(one["pull"]["com"], axis=1) for one in rows]
    off = [np.subtract(one["identified"]["com"], one["true"]["com"]) for one in rows]
    added = [np.linalg.norm(a - one["pull"]["com"], axis=1) for a, one in zip(off, rows, strict=True)]
    held = (100 * np.mean([covered(one, name) for one in rows]) for name in ("mass", "com"))
    return (
        f"| {way} | {mass[0]:.3f}, {mass[1]:.3f} | {mass[0] - mass[1]:.3f} | "
        f"{1000 * com[0]:.1f}, {1000 * com[1]:.1f} | {1000 * (com[0] - com[1]):.1f} | "
        f"{1000 * rms(left):.1f} | {1000 * rms(added):.1f} | {', '.join(f'{share:.0f} %' for share in held)} |"
    )


def main() -> None:
    """Print a line a way over the sessions that all ways have."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--people", default="0,1,2")
    parser.add_argument("--visits", type=int, default=3)
    parser.add_argument("--only", default=",".join(WAYS))
    chosen = parser.parse_args()
    who = [(int(number), visit) for visit in range(chosen.visits) for number in chosen.people.split(",")]
    found: dict[str, list[dict[str, Any]]] = {way: [] for way in chosen.only.split(",")}
    for number, visit in who:
        for way, rows in found.items():
            rows.append(row(chosen.folder, number, way, visit))
    print(f"{len(who)} sessions a way")
    print(_HEADING)
    for way, rows in found.items():
        print(line(way, rows))


if __name__ == "__main__":
    main()

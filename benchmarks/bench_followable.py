"""Dances that people follow: how much is called at once, what imprecise people leave, what will be known.

    OMP_NUM_THREADS=1 python benchmarks/bench_followable.py FOLDER [--protocols short,easy] [--bodies reference,careful]
        [--seconds 800] [--price] [--page docs/benchmarks/dance.md]

A row a body and protocol, all with seed 0. Everything is kept in FOLDER: what is found there is not designed again, and
after ``--seconds`` no other one is begun. The margins are those that the design itself reports, of 200 imprecise
performers. ``--price`` also says what the postures would tell if they were chosen freely.
``--page`` writes the rows that are there into that page, between the marks of the table.
"""

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bench_dance import BODIES, _spent

from biodance.body.human.human import human
from biodance.body.human.limits import joint_limits
from biodance.dance.cues import dance_instructions
from biodance.dance.design import design
from biodance.dance.expectation import expect
from biodance.dance.followable.walk import freer_dance
from biodance.dance.performers import OF_PERFORMERS, for_imprecise, rehearse_imprecisely
from biodance.dance.problem.person import fit_to_person
from biodance.dance.problem.plan import read_plan
from biodance.errors import BiodanceError

HEADING = (
    "| body | protocol | postures | s | instructions a cue: mean, most | limits kept | inside, mm | apart, mm "
    "| mass sd, kg | CoM sd, mm | freely chosen: kg, mm | design: CPU s, wall s |\n|" + "---|" * 12
)


def found(name: str, protocol: str, folder: Path, price: bool) -> dict[str, Any]:
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
        out: dict[str, Any] = {"refused": str(error)}
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
        if not out["left"]:
            few = rehearse_imprecisely(dance, plan.limits, who=range(_FEW))
            out["few"] = {room.limit: room.worst for room in few.least_margins}
        if price and np.isfinite(plan.instructions):
            free = expect(freer_dance(body, plan, seed=0), steps=1)
            out["free"] = [float(_rms(free.mass)[-1]), float(_rms(free.com)[-1])]
    path.write_text(json.dumps(out), encoding="utf-8")
    return out


def _rms(sd: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(sd**2, axis=1)))


def row(name: str, protocol: str, folder: Path, price: bool) -> str:
    """Return the row of one body and protocol."""
    one = found(name, protocol, folder, price)
    if "refused" in one:
        return f"| {name} | {protocol} | refused: {one['refused']} |" + " |" * 9
    mean, most = one["instructions"]
    few = "" if one["left"] else f" ({_FEW})"
    left = " | ".join(f"{1000 * worst:.0f}{few}" for worst in (one["left"] or one["few"]).values())
    mass, com = ([f"{factor * sd:.{digits}f}" for sd in one[key]] for key, factor, digits in _SIZES)
    free = f"{one['free'][0]:.2f}, {1000 * one['free'][1]:.1f}" if "free" in one else "–"
    return (
        f"| {name} | {protocol} | {one['postures']} | {one['duration_s']:.0f} | {mean:.1f}, {most} | "
        f"{one['kept'][0]} of {one['kept'][1]} | {left} | {' -> '.join(mass)} | {' -> '.join(com)} | {free} | "
        f"{one['cpu_s']:.0f}, {one['wall_s']:.0f} |"
    )


_FEW = 20
"""Performers of a free dance, which is not made for them."""
_SIZES = (("mass", 1.0, 2), ("com", 1000.0, 1))
_PROTOCOLS = ("easy", "patient", "chair", "short", "full")
_MARKS = ("<!-- followable -->", "<!-- end of followable -->")


def write_page(page: Path, rows: list[str]) -> None:
    """Write the table between its marks into a page."""
    before, rest = page.read_text(encoding="utf-8").split(_MARKS[0])
    after = rest.split(_MARKS[1])[1]
    text = "\n".join([_MARKS[0], "", HEADING, *rows, "", _MARKS[1]])
    page.write_text(before + text + after, encoding="utf-8")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--protocols", default=",".join(_PROTOCOLS))
    parser.add_argument("--bodies", default=",".join(BODIES))
    parser.add_argument("--seconds", type=float, default=np.inf)
    parser.add_argument("--price", action="store_true")
    parser.add_argument("--page", type=Path)
    chosen = parser.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)
    begun, rows = time.time(), list[str]()
    print(HEADING, flush=True)
    for protocol in chosen.protocols.split(","):
        for name in chosen.bodies.split(","):
            there = (chosen.folder / f"{name}_{protocol}.json").exists()
            if there or (not chosen.page and time.time() - begun < chosen.seconds):
                rows.append(row(name, protocol, chosen.folder, chosen.price))
                print(rows[-1], flush=True)
    if chosen.page:
        write_page(chosen.page, rows)


if __name__ == "__main__":
    main()

"""Dances that people follow: how much is called at once, what imprecise people leave, what will be known.

    OMP_NUM_THREADS=1 python benchmarks/bench_followable.py FOLDER [--protocols short,easy] [--bodies reference,careful]

A row a body and protocol. Everything is kept in FOLDER. Free: the same stances and counts without vocabulary, known
instructions or performers (`instructions` = inf), which costs as much again; with ``--free``.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from bench_dance import BODIES, _spent

from biodance.body.human.human import human
from biodance.body.human.limits import joint_limits
from biodance.dance.cues import dance_instructions
from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.expectation import expect
from biodance.dance.performers import perform_with
from biodance.dance.problem.person import fit_to_person
from biodance.dance.problem.plan import read_plan
from biodance.dance.verify import broken, verify
from biodance.errors import BiodanceError


def row(name: str, protocol: str, folder: Path, *, free: bool) -> str:
    """Return the row of one body and protocol, designed if it is not in the folder."""
    subject, person = BODIES[name]
    plan = read_plan(protocol)
    if free:
        plan = replace(plan, instructions=np.inf, simplicity=0.0, wide=1.0)
    body = replace(human(subject), limits=joint_limits(subject, within=plan.ranges))
    body, plan, _ = fit_to_person(body, plan, person)
    path = folder / f"{name}_{protocol}{'_free' if free else ''}.npz"
    if not path.exists():
        before = _spent()
        try:
            dance, _ = design(body, plan, seed=1)
        except BiodanceError as error:
            return f"| {name} | {protocol} | refused: {error} |"
        dance.save(path)
        path.with_suffix(".json").write_text(json.dumps(_spent() - before), encoding="utf-8")
    dance, seconds = Dance.load(path), json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    counts = [len(said) for said in dance_instructions(dance)]
    margins = verify(body, dance, plan.limits)
    with ProcessPoolExecutor(2) as pool:
        found = perform_with(pool, dance)
    known = expect(dance, steps=1)
    mass, com = (np.sqrt(np.mean(sd**2, axis=1)) for sd in (known.mass, known.com))
    return (
        f"| {name} | {protocol}{' (free)' if free else ''} | {len(dance.postures)} | {dance.duration:.0f} | "
        f"{np.mean(counts):.1f}, {max(counts)} | {len(margins) - len(broken(margins))} of {len(margins)} | "
        f"{1000 * found.balance.worst:.0f} | {1000 * found.gap.worst:.0f} | {mass[0]:.2f} -> {mass[-1]:.2f} | "
        f"{1000 * com[0]:.1f} -> {1000 * com[-1]:.1f} | {seconds:.0f} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--protocols", default="short,easy,patient")
    parser.add_argument("--bodies", default=",".join(BODIES))
    parser.add_argument("--free", action="store_true")
    chosen = parser.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)
    print(
        "| body | protocol | postures | s | instructions a cue: mean, most | limits that hold | 200 performers: inside"
    )
    print("the support, mm | segments apart, mm | mass sd, kg | CoM sd, mm | design, CPU s |\n|" + "---|" * 11)
    for name in chosen.bodies.split(","):
        for protocol in chosen.protocols.split(","):
            print(row(name, protocol, chosen.folder, free=chosen.free), flush=True)


if __name__ == "__main__":
    main()

"""A laboratory learns from all its sessions but one and judges that one; prints the table of docs/benchmarks/plates.md.

BIODANCE_DATA=folder python benchmarks/bench_learn.py [ARCHIVE]
"""

import argparse
import os
from pathlib import Path

import numpy as np

from biodance.errors import BiodanceError
from biodance.lab.session.archive import archive_folders
from biodance.lab.session.read import read_session
from biodance.pipeline.diagnosis import SessionDiagnosis, diagnose_session
from biodance.pipeline.learn import LearnedSession, learned_session, learned_together
from biodance.pipeline.session import examine
from biodance.uncertainty.tolerances import Tolerances


def told(found: SessionDiagnosis) -> str:
    """Return verdict, names, and the largest z of what is left."""
    names = ", ".join(f"{one.effect} {one.target}" for one in found.findings)
    z = max((row.z for row in found.diagnosis.adequacy), default=float("nan"))
    return f"{found.verdict}{': ' + names if names else ''} | {z:.1f}"


def limits(found: SessionDiagnosis) -> dict[tuple[str, str], float]:
    """Return from which size on the session sees each cause."""
    return {(row.effect, row.target): row.limit for row in found.diagnosis.limits if np.isfinite(row.limit)}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "archive", nargs="?", type=Path, default=Path(os.environ.get("BIODANCE_DATA", ".")) / "biomechzoo"
    )
    archive = parser.parse_args().archive
    results = {path.name: examine(read_session(path)) for path in archive_folders(archive)[0]}
    taught: dict[str, LearnedSession] = {}
    for name, result in results.items():
        try:
            taught[name] = learned_session(result)
        except BiodanceError as why:
            print(f"<!-- {name} teaches nothing: {' '.join(str(why).split())[:140]} -->")
    print(
        "| session | learned from | shipped: verdict | largest z | own: verdict | largest z | limits, own / shipped |"
    )
    print("|---|---|---|---|---|---|---|")
    for name, result in results.items():
        rest = [one for other, one in taught.items() if other != name]
        before = diagnose_session(result)
        try:
            own: Tolerances = learned_together(archive, rest, {}).tolerances
        except BiodanceError:
            print(f"| {name} | {len(rest)}: too few to learn from | {told(before)} | - | - | - |", flush=True)
            continue
        after = diagnose_session(result, tolerances=own)
        old, new = limits(before), limits(after)
        both = [new[key] / old[key] for key in old if key in new]
        ratio = f"{np.median(both):.2f} (of {len(both)})" if both else "-"
        print(f"| {name} | {len(rest)} | {told(before)} | {told(after)} | {ratio} |", flush=True)


if __name__ == "__main__":
    main()

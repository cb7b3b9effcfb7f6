"""Identify real children with the adults' tables as they are, and with what is made of them for a child.

    BIODANCE_DATA=folder python benchmarks/bench_children.py [--out FILE.md]

The seven children and youths of biomechzoo: identified from the static trial and the straight walk; the walk with a
turn is kept, its forces are predicted. "Adult": the tables are believed as those of an adult. "Child": age 12
is told; a stature below 1.50 m says the same without an age.
"""

import argparse
import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from biodance.body.human import prior
from biodance.errors import BiodanceError
from biodance.lab.session.read import read_session
from biodance.pipeline.identification import identify_trials
from biodance.pipeline.session import examine

STRAIGHT_TURN = {
    "HC030A": ("HC030A05", "HC030A22"), "HC031A": ("HC031A06", "HC031A23"), "HC032A": ("HC032A03", "HC032A18"),
    "HC038A": ("HC038A11", "HC038A27"), "HC044A": ("HC044A15", "HC044A29"), "HC050A": ("HC050A11", "HC050A33"),
    "HC055A": ("HC055A09", "HC055A34"),
}  # fmt: skip
WAYS = {"adult": (0.0, ""), "child": (prior.CHILD_STATURE, "age = 12\n")}
"""By name: stature below which somebody is taken for a child, m; what session.toml says besides."""
OUT = Path(__file__).resolve().parent / "measured" / "children.md"
BEYOND = 2.0


@dataclass(frozen=True)
class Row:
    """One child one way: declared ``mass`` kg, ``stature`` m, whether taken for a ``child``; mean over the segments of
    the sd of their mass before and after, share of it; root mean square of their changes in sd of before, and the
    largest; kept forces' RMS N of table and identified body; largest sum of changes kg.
    """

    name: str
    way: str
    mass: float
    stature: float
    child: bool
    before: float
    after: float
    change: float
    largest: float
    lightest: float
    held: tuple[float, float]


def measured(data: Path, name: str, way: str, place: Path) -> Row:
    """Return the row of one child; raises BiodanceError where it cannot be identified."""
    stature, said = WAYS[way]
    prior.CHILD_STATURE = stature  # the only place where the package decides it
    shutil.copytree(data / "biomechzoo" / name, place)
    fit, keep = STRAIGHT_TURN[name]
    (place / "session.toml").write_text(
        f'[subject]\n{said}[trials."{fit}"]\nrole = "fit"\n[trials."{keep}"]\nrole = "validate"\n'
    )
    found = examine(read_session(place))
    assert found.body is not None
    done = identify_trials(found.body, found.trials, name=name, checks=found.checks)
    sip, table = done.identification.sip, found.body.sip
    at = 10 * np.arange(len(table.segments))
    assert table.covariance is not None
    assert sip.covariance is not None
    sd = [np.sqrt(np.diag(one.covariance)[at]) for one in (table, sip)]
    change = (sip.mass - table.mass) / sd[0]
    kept = [(one.table_agreement.rms[2], one.identified_agreement.rms[2]) for one in done.validations]
    held = np.mean(kept, axis=0) if kept else (float("nan"),) * 2
    subject = found.session.subject
    return Row(
        name, way, subject.mass, subject.stature, prior.is_child(subject), float(np.mean(sd[0] / table.mass)),
        float(np.mean(sd[1] / table.mass)), float(np.sqrt(np.mean(change**2))), float(np.abs(change).max()),
        float((sip.mass / table.mass).min()), (float(held[0]), float(held[1])),
    )  # fmt: skip


def line(row: Row) -> str:
    """Return the row of the page's table."""
    return (
        f"| {row.name} | {row.stature:.2f} m, {row.mass:.1f} kg | {row.way}{' (child)' if row.child else ''} | "
        f"{100 * row.before:.0f} | {100 * row.after:.0f} | {row.change:.2f} | {row.largest:.1f} | {row.lightest:.2f} | "
        f"{row.held[0]:.1f} / {row.held[1]:.1f} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--only", nargs="*", default=[*STRAIGHT_TURN])
    chosen = parser.parse_args()
    data = os.environ.get("BIODANCE_DATA")
    if not data:
        parser.error("BIODANCE_DATA does not name the folder with real recordings.")
    lines = [
        "| person | | tables | mass sd before, % | after, % | change, RMS in sd | largest | least mass / table's | "
        "kept Fz, table / identified, N |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as place:
        for name in chosen.only:
            for way in WAYS:
                try:
                    lines.append(line(measured(Path(data), name, way, Path(place) / f"{name} {way}")))
                except BiodanceError as error:
                    lines.append(f"| {name} | | {way} | refused: {error} | | | | | |")
                print(lines[-1], flush=True)
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""Masses and centres of mass of people of three laboratories, by segment, against their truth and the table.

    python -m benchmarks identification FOLDER --lab foreign third --people 12 [--first SEED] [--protocol dance]

Without ``--first`` the people are drawn by the date of the run. Rows and sessions are kept in FOLDER, so that a stopped
run goes on; `coverage` reads the rows.
"""

import argparse
from pathlib import Path

import numpy as np

from benchmarks.coverage import PARTS, held
from benchmarks.people import LABS, Row, better_than_table, errors, first_seed, rows, standard_errors


def table(some: list[Row]) -> list[str]:
    """Return the table of a group of people as lines of Markdown."""
    of = {(which, what): np.array([errors(row, which, what) for row in some])
          for which in ("table", "identified") for what in ("mass", "com")}  # fmt: skip
    bias = np.array([np.subtract(row["identified"]["mass"], row["true"]["mass"]) for row in some]).mean(axis=0)
    z = np.array([standard_errors(row) for row in some])
    head = "| segment | mass kg: table, identified | bias | rms z | covered % | CoM mm: table, identified | covered % |"
    lines = [head, "|---" * 7 + "|"]
    for i, name in enumerate(some[0]["segments"]):
        mass, com = ([of[which, what][:, i].mean() for which in ("table", "identified")] for what in ("mass", "com"))
        inside = [held(z[:, i, part]).mean() for part in PARTS.values()]
        lines.append(
            f"| {name} | {mass[0]:.2f} {mass[1]:.2f} | {bias[i]:+.2f} | {np.sqrt(np.mean(z[:, i, 0] ** 2)):.2f} | "
            f"{100 * inside[0]:.0f} | {1e3 * com[0]:.1f} {1e3 * com[1]:.1f} | {100 * inside[1]:.0f} |"
        )
    mass, com = ([of[which, what].mean() for which in ("table", "identified")] for what in ("mass", "com"))
    inside = [held(z[:, :, part]).mean() for part in PARTS.values()]
    gains = np.array([row["gain"] for row in some if row["gain"]])
    squats = f"force {np.median(gains[:, 0]):.2f}, moment {np.median(gains[:, 1]):.2f}" if len(gains) else "none kept"
    ratio = [after / before for before, after in (mass, com)]
    return [
        *lines,
        "",
        f"{len(some)} people: mass {mass[0]:.3f} -> {mass[1]:.3f} kg ({ratio[0]:.2f} x), CoM {1e3 * com[0]:.1f} -> "
        f"{1e3 * com[1]:.1f} mm ({ratio[1]:.2f} x). 95 % intervals hold {100 * inside[0]:.1f} % of the masses, "
        f"{100 * inside[1]:.1f} % of the CoM. Squats, table over identified, median: {squats}. Loads announced: "
        f"{sum(row['load'] == 'found' for row in some)}. Better in mass, CoM, both: {better_than_table(some)}.",
    ]


def main() -> None:
    """Run people and print a table for each laboratory."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path)
    ask.add_argument("--lab", nargs="+", choices=LABS, default=("own",))
    ask.add_argument("--people", type=int, default=12)
    ask.add_argument("--first", type=int, default=first_seed(), help="seed of the first person")
    ask.add_argument("--protocol", default="dance", help="what people of the own laboratory do")
    asked = ask.parse_args()
    for lab in asked.lab:
        seeds = range(asked.first, asked.first + asked.people)
        print("\n".join(["", f"## {lab}", "", *table(rows(lab, seeds, asked.folder, asked.protocol))]), flush=True)

"""How wide intervals must be in every laboratory: coverage against one factor on all standard deviations.

    python -m benchmarks coverage own=FOLDER/rows/own_*.json foreign=FOLDER/rows/foreign_*.json ...

A group is a name and the rows of `identification` or `chain`. Errors are in units of the standard deviation that
identification states, masses about the true mass, CoM per axis about the true joint centres. An interval in brackets is
of a bootstrap over people.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from benchmarks.people import Row, standard_errors
from biodance.identification.knowledge import SIGMAS
from biodance.records import Array

FACTORS, BAR = (0.7, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.4), (0.93, 0.97)
PARTS = {"mass": [0], "CoM": [1, 2, 3]}


def held(z: Array, factor: float = 1.0) -> Array:
    """Return the share (people,) of values that intervals ``factor`` times as wide hold, of ``z`` (people, ...)."""
    return np.mean(np.abs(z) <= factor * SIGMAS, axis=tuple(range(1, z.ndim)))


def spread(shares: Array, draws: int = 4000) -> Array:
    """Return the 95 % interval (2,) of the mean of ``shares`` (people,) by bootstrap over people."""
    drawn = np.random.default_rng(0).integers(0, len(shares), (draws, len(shares)))
    return np.asarray(np.percentile(shares[drawn].mean(axis=1), [2.5, 97.5]))


def range_in_bar(z: Array) -> str:
    """Return the factors between which the coverage lies within the bar, "none" where it jumps over it."""
    fine = np.arange(0.4, 3.0, 0.005)
    inside = [factor for factor in fine if BAR[0] <= held(z, factor).mean() <= BAR[1]]
    return f"{inside[0]:.2f} to {inside[-1]:.2f}" if inside else "none"


def factor_lines(groups: dict[str, Array], part: str) -> list[str]:
    """Return the coverage of every group against the factor as lines of Markdown."""
    lines = [f"| {part} | {' | '.join(f'{f:g}' for f in FACTORS)} | in the bar |", "|" + "---|" * (len(FACTORS) + 2)]
    for name, z in groups.items():
        shares = [held(z[:, :, PARTS[part]], factor) for factor in FACTORS]
        cells = [f"{100 * s.mean():.1f} ({100 * a:.0f}–{100 * b:.0f})" for s in shares for a, b in [spread(s)]]
        lines.append(f"| {name}, {len(z)} | {' | '.join(cells)} | {range_in_bar(z[:, :, PARTS[part]])} |")
    return lines


def rows_of(pattern: str) -> list[Row]:
    """Return the rows of all files of a ``pattern``."""
    return [json.loads(file.read_text()) for file in sorted(Path(pattern).parent.glob(Path(pattern).name))]


def main() -> None:
    """Print the tables over groups of kept rows."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("groups", nargs="+", help="NAME=FILES ...")
    named = dict(word.split("=", 1) for word in ask.parse_args().groups)
    groups = {name: np.array([standard_errors(row) for row in rows_of(files)]) for name, files in named.items()}
    print("\n".join([*factor_lines(groups, "mass"), "", *factor_lines(groups, "CoM")]))

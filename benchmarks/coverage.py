"""How many intervals of identification hold the truth, in every laboratory.

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

PARTS = {"mass": [0], "CoM": [1, 2, 3]}


def held(z: Array) -> Array:
    """Return the share (people,) of values that their intervals hold, of ``z`` (people, ...)."""
    return np.mean(np.abs(z) <= SIGMAS, axis=tuple(range(1, z.ndim)))


def spread(shares: Array, draws: int = 4000) -> Array:
    """Return the 95 % interval (2,) of the mean of ``shares`` (people,) by bootstrap over people."""
    drawn = np.random.default_rng(0).integers(0, len(shares), (draws, len(shares)))
    return np.asarray(np.percentile(shares[drawn].mean(axis=1), [2.5, 97.5]))


def rows_of(pattern: str) -> list[Row]:
    """Return the rows of all files of a ``pattern``."""
    return [json.loads(file.read_text()) for file in sorted(Path(pattern).parent.glob(Path(pattern).name))]


def main() -> None:
    """Print the tables over groups of kept rows."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("groups", nargs="+", help="NAME=FILES ...")
    named = dict(word.split("=", 1) for word in ask.parse_args().groups)
    groups = {name: np.array([standard_errors(row) for row in rows_of(files)]) for name, files in named.items()}
    for part, places in PARTS.items():
        for name, z in groups.items():
            shares = held(z[:, :, places])
            low, high = 100 * spread(shares)
            print(f"| {part} | {name}, {len(z)} | {100 * shares.mean():.1f} ({low:.0f}-{high:.0f}) |")

"""How wide intervals must be in every laboratory: coverage against one factor on all standard deviations, by segment.

    python benchmarks/bench_coverage.py own 0 23 --into FOLDER        # own people, protocol dance, a JSON each
    python benchmarks/bench_coverage.py table own=FOLDER/own_*.json foreign=people.jsonl ...

A group is a name and the rows of other benchmarks: .jsonl of `bench_people.py`, .json of `bench_third_lab.py`,
`bench_chain.py`, `bench_worth.py`. Errors are in units of the standard deviation that identification states, masses
about the true mass, CoM per axis about the true joint centres. An interval in brackets is of a bootstrap over people.
"""

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from bench_chain import identified
from virtual_visits import FRESH, subjects

from biodance.body.human.skeleton import SEGMENTS
from biodance.identification.knowledge import SIGMAS
from biodance.records import Array
from biodance.virtual_lab.simulate import simulate_session

FACTORS, BAR = (0.7, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.4), (0.93, 0.97)
PARTS = {"mass": [0], "CoM": [1, 2, 3], "CoM x": [1], "CoM y": [2], "CoM z": [3]}


def own(number: int, folder: Path) -> None:
    """Keep what a session of one person of our own laboratory gave, if it is not there."""
    kept = folder / f"own_{number}.json"
    if kept.is_file():
        return
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch) / "session"
        simulate_session(subjects(number + 1, FRESH)[number], "dance", place, seed=FRESH[1] + number)
        kept.write_text(json.dumps(identified(place), default=np.ndarray.tolist))


def standard_errors(row: dict[str, Any]) -> Array:
    """Return (12, 4): error of mass and of the three coordinates of the CoM over the stated standard deviation."""
    row = row.get("person", row)
    if "identified" in row:
        true, found, sd = row["true"], row["identified"], np.hstack([row["sd"]["mass"], row["sd"]["com"]])
        off = np.hstack([np.subtract(found[what], true[own]) for what, own in (("mass", "mass"), ("com", "own_com"))])
    else:
        off, sd = np.zeros((len(row["mass"]), 4)), np.array(row["sd"])
        off[:, 0] = np.subtract(row["found_mass"], row["mass"])
        off[:, 1:] = np.subtract(row["found_com"], row["own_com"])
    return np.asarray(off / sd)


def held(z: Array, factor: float) -> Array:
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


def segment_lines(groups: dict[str, Array]) -> list[str]:
    """Return root mean squares of errors over the stated deviation, sides together, as lines of Markdown."""
    kinds = list(dict.fromkeys(name.removeprefix("right_").removeprefix("left_") for name in SEGMENTS))
    of = {kind: [i for i, name in enumerate(SEGMENTS) if name.endswith(kind)] for kind in kinds}
    lines = [f"| | {' | '.join(kinds)} |", "|" + "---|" * (len(kinds) + 1)]
    for part in ("mass", "CoM x", "CoM y", "CoM z"):
        for name, z in groups.items():
            sizes = [np.sqrt(np.mean(z[:, of[kind]][:, :, PARTS[part]] ** 2)) for kind in kinds]
            lines.append(f"| {part}, {name} | {' | '.join(f'{size:.2f}' for size in sizes)} |")
    return lines


def rows_of(pattern: str) -> list[dict[str, Any]]:
    """Return the rows of all files of a ``pattern``."""
    files = sorted(Path(pattern).parent.glob(Path(pattern).name))
    texts = [f.read_text().splitlines() if f.suffix == ".jsonl" else [f.read_text()] for f in files]
    return [json.loads(text) for some in texts for text in some]


def main() -> None:
    """Run people of our own laboratory, or print the tables over groups of kept rows."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("what", choices=("own", "table"))
    ask.add_argument("words", nargs="+", help="own: first and last number; table: NAME=FILES ...")
    ask.add_argument("--into", type=Path, default=Path("coverage"))
    asked = ask.parse_args()
    if asked.what == "own":
        asked.into.mkdir(parents=True, exist_ok=True)
        for number in range(int(asked.words[0]), int(asked.words[1]) + 1):
            own(number, asked.into)
        return
    named = dict(word.split("=", 1) for word in asked.words)
    groups = {name: np.array([standard_errors(row) for row in rows_of(files)]) for name, files in named.items()}
    print("\n".join([*factor_lines(groups, "mass"), "", *factor_lines(groups, "CoM"), "", *segment_lines(groups)]))


if __name__ == "__main__":
    main()

"""Is as much known after a dance as was expected of it? The bodies of bench_dance.py dance what was designed for them.

    OMP_NUM_THREADS=1 python benchmarks/bench_achieved.py FOLDER [--protocols short,easy] [--bodies reference,careful]
        [--page docs/benchmarks/dance.md]

FOLDER holds the dances of bench_followable.py. An imprecise performer ("normal") dances each in our virtual laboratory,
the session is identified, and beside the standard deviations that were expected stand those that the identification
states, and what it is off by (root mean squares over the segments; CoM per axis). Rows are kept in FOLDER/achieved.
``--page`` writes the rows that are there into that page, between the marks of the table.
"""

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from bench_chain import covered, identified
from bench_dance import BODIES

from biodance.dance.dance import Dance
from biodance.dance.expectation import expect
from biodance.pipeline.simulate_dance import simulate_dance
from biodance.virtual_lab.movement.dancing import PERFORMERS

HEADING = (
    "| body | protocol | mass, kg: table's sd, expected, stated | off by: table, danced "
    "| CoM, mm: table's sd, expected, stated | off by: table, danced | 95 % intervals hold mass, CoM |\n|" + "---|" * 7
)
_FIRST_SEED = 900
_MARKS = ("<!-- achieved -->", "<!-- end of achieved -->")
_SIZES = (("mass", 1.0, 2), ("com", 1000.0, 1))


def found(name: str, protocol: str, folder: Path) -> dict[str, Any]:
    """Return the numbers of one body's dance, from the folder if they are there."""
    kept = folder / "achieved" / f"{name}_{protocol}.json"
    if not kept.exists():
        dance, seed = Dance.load(folder / f"{name}_{protocol}.npz"), _FIRST_SEED + list(BODIES).index(name)
        with tempfile.TemporaryDirectory() as scratch:
            place = Path(scratch) / "session"
            simulate_dance(BODIES[name][0], dance, place, seed=seed, performer=PERFORMERS["normal"])
            one = identified(place)
        one["expected"] = {key: getattr(expect(dance, steps=1), key)[-1] for key in ("mass", "com")}
        kept.parent.mkdir(exist_ok=True)
        kept.write_text(json.dumps(one, default=np.ndarray.tolist), encoding="utf-8")
    return dict(json.loads(kept.read_text(encoding="utf-8")))


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def row(name: str, protocol: str, folder: Path) -> str:
    """Return the row of one body and protocol."""
    one, cells = found(name, protocol, folder), []
    for key, factor, digits in _SIZES:
        sds = (one["table_sd"][key], one["expected"][key], one["sd"][key])
        off = (np.subtract(one[which][key], one["true"][key]) for which in ("table", "identified"))
        cells += [", ".join(f"{factor * _rms(part):.{digits}f}" for part in parts) for parts in (sds, off)]
    held = ", ".join(f"{100 * np.mean(covered(one, key)):.0f} %" for key, _, _ in _SIZES)
    return f"| {name} | {protocol} | {' | '.join(cells)} | {held} |"


def main() -> None:
    """Print the table, and write it into a page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--protocols", default="short,easy")
    parser.add_argument("--bodies", default=",".join(BODIES))
    parser.add_argument("--page", type=Path)
    chosen, rows = parser.parse_args(), list[str]()
    print(HEADING, flush=True)
    for protocol in chosen.protocols.split(","):
        for name in chosen.bodies.split(","):
            kept = (chosen.folder / "achieved" / f"{name}_{protocol}.json").exists()
            if kept or (not chosen.page and (chosen.folder / f"{name}_{protocol}.npz").exists()):
                rows.append(row(name, protocol, chosen.folder))
                print(rows[-1], flush=True)
    if chosen.page:
        before, rest = chosen.page.read_text(encoding="utf-8").split(_MARKS[0])
        text = "\n".join([_MARKS[0], "", HEADING, *rows, "", _MARKS[1]])
        chosen.page.write_text(before + text + rest.split(_MARKS[1])[1], encoding="utf-8")


if __name__ == "__main__":
    main()

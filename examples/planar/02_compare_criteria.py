"""All excitation criteria on one body: each designs a motion, each judges all of them, and what would be known
afterwards.

python examples/planar/02_compare_criteria.py [FIGURE.png]      without a name the figure goes into the temporary folder
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from planar_chain import planar_chain
from series import compared

SHOWN = {"MX": 1, "MY": 2, "ZZ": 9}


def main(picture: Path) -> None:
    """Print the table of scores; draw the standard deviation that each design leaves, as a share of the table's."""
    body = planar_chain()
    found = compared(body)
    print(found.table())
    columns = [10 * i + offset for i in range(3) for offset in SHOWN.values()]
    names = [f"{parameter}\n{segment.replace('_', ' ')}" for segment in body.segments for parameter in SHOWN]
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    axes = figure.subplots()
    for i, name in enumerate(found.names):
        share = found.sd_after[i, columns] / found.sd_before[columns]
        axes.bar(np.arange(len(columns)) + 0.11 * (i - 3), share, width=0.1, label=name.replace("_", " "))
    axes.set_xticks(range(len(columns)), names, fontsize=7)
    axes.set(
        ylabel="sd after / sd in the table",
        yscale="log",
        title="After one motion of 2 s, 25 Hz, noise 1 N and 1 N·m per sample",
    )
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/02_compare_criteria.png"))

"""The paper's Fig. 4: six motions of a planar chain, designed by different criteria, all judged by cond(W_b).

Left from the paper's start (all joints move in proportion, W_b is singular), right from seeded via points. Joint
ranges, masses and ends of the motions are assumed (see series.py); the dots are the values that the paper prints.

python examples/planar/01_excitation.py [FIGURE.png]      without a name the figure goes into the temporary folder
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from planar_chain import planar_chain
from series import paper_series, planar_base, seeded_series

LEFT = {"condition": "cond(W_b)", "mass_weighted": "sum of M cond(W_bi), eq. 12", "log_condition": "log cond(W_b)"}
RIGHT = {**LEFT, "d_optimal": "D-optimal", "a_optimal": "A-optimal"}
PRINTED = {1: (105, 62), 6: (8, 9)}


def main(picture: Path) -> None:
    """Print the base parameters (eq. 13) and the condition numbers; draw both families of runs."""
    body = planar_chain()
    print(*planar_base(body).relations(), *body.notes, sep="\n")
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    marks = dict(zip(RIGHT, ("s", "^", "v", "x", "+"), strict=True))
    runs = [(left, "paper's start", name, paper_series(body, name)) for name in LEFT]
    runs += [(right, "seeded start", name, seeded_series(body, name, starts=1)) for name in RIGHT]
    for axes, title, name, series in runs:
        print(f"{title}, {RIGHT[name]}:", " ".join(f"{value:.3g}" for value in series.condition))
        axes.semilogy(
            np.arange(1, 7),
            np.minimum(series.condition, 1e4),
            marker=marks[name],
            linewidth=1,
            label=f"min {RIGHT[name]}",
        )
        axes.set(xlabel="motion number", title=f"from the {title}", ylim=(1, 1.5e4))
    for motion, values in PRINTED.items():
        left.plot(
            [motion] * len(values), values, "ko", markersize=4, label="printed in the paper" if motion == 1 else "_"
        )
    left.set(ylabel="cond(W_b), cut at 10 000")
    left.legend(frameon=False, fontsize=7)
    right.legend(frameon=False, fontsize=7)
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/01_excitation.png"))

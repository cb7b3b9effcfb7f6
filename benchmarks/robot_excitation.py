"""The paper's figure 5 of a robot: the static criterion by the number of postures, the dynamic one by moves.

biodance dance --urdf hoap3.urdf --feet right_foot,left_foot --out FREE
biodance dance --urdf hoap3.urdf --feet right_foot,left_foot --limits ankles.toml --out BOUND
python benchmarks/robot_excitation.py OUT.png "free=FREE" "ankles within 6 degrees=BOUND" ...
"""

import sys
from pathlib import Path

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.problem.excitation import condition, dynamic_grams, excitation_blocks, static_grams, total, uprights
from biodance.records import Array

_LITTLE, _RATE = 1e-6, 100.0
_COLOURS = ("#000000", "#999999", "#0072B2")


def static_curve(dance: Dance) -> Array:
    """Return the static criterion (K,) kg after each posture that is held."""
    parts = excitation_blocks(dance.body)
    holds = [phase for phase in dance.phases if phase.kind == "hold" and phase.stance.over is None]
    ups = np.concatenate([uprights(dance.state(phase, np.array([phase.start]))) for phase in holds])
    return np.array([total(parts.weight, static_grams(ups[: k + 1]), parts.first)[0] for k in range(len(ups))])


def dynamic_curve(dance: Dance, *, part: str = "") -> Array:
    """Return the dynamic criterion (K,) kg after each move, of all segments or of the ``part`` "legs" or "others"."""
    parts, every = excitation_blocks(dance.body), list(range(len(dance.body.segments)))
    legs = np.array([any(word in name for word in ("thigh", "shank", "foot")) for name in dance.body.segments])
    weight = parts.weight * (legs if part == "legs" else ~legs if part else 1)
    gram, out = np.tile(_LITTLE * np.eye(6), (len(every), 1, 1)), []
    for phase in (phase for phase in dance.phases if phase.kind == "move"):
        time = np.linspace(phase.start, phase.end, round((phase.end - phase.start) * _RATE) + 1)
        gram = gram + dynamic_grams(dance.state(phase, time), every) / _RATE
        out.append(total(weight, gram, parts.second, measure=condition)[0])
    return np.array(out)


def main(out: str, *named: str) -> None:
    """Draw and print the curves of some dances, ``NAME=FOLDER`` each."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(7.1, 2.8), layout="constrained")
    panels = drawn.subplots(1, 3)
    whats = ("static", "dynamic, head, arms, trunk", "dynamic, legs")
    for word, colour in zip(named, _COLOURS, strict=False):
        name, folder = word.split("=")
        dance = Dance.load(Path(folder) / "dance.npz")
        rows = static_curve(dance), dynamic_curve(dance, part="others"), dynamic_curve(dance, part="legs")
        for axes, row, what in zip(panels, rows, whats, strict=True):
            axes.semilogy(np.arange(1, len(row) + 1), row, color=colour, lw=1.2, label=name)
            axes.set_title(what, fontsize=9)
            axes.set_xlabel("postures" if what == "static" else "moves")
            at = sorted({0, 1, 3, len(row) // 2, len(row) - 1})
            sys.stdout.write(f"{name}, {what}: " + ", ".join(f"{k + 1}: {row[k]:.4g}" for k in at) + "\n")
    panels[0].set_ylabel("sum of M cond, kg")
    drawn.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    drawn.savefig(out, dpi=130, metadata={"Software": None})


if __name__ == "__main__":
    main(*sys.argv[1:])

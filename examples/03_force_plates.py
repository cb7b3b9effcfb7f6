"""Read the force plates of a trial: corners, zero, and where the centre of pressure wandered under two feet.

python examples/03_force_plates.py [FIGURE.png]      without a name the figure goes into the temporary folder
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from biodance.lab.prepare import prepare
from biodance.lab.session.read import read_session
from biodance.records import Subject
from biodance.virtual_lab.simulate import simulate_session


def main(picture: Path) -> None:
    """Print what was decided about every plate; draw plates and centres of pressure from above."""
    with tempfile.TemporaryDirectory() as scratch:
        session = read_session(simulate_session(Subject(62.0, 1.70, "F"), "squat", Path(scratch) / "session", seed=1))
    trial = prepare(next(trial for trial in session.trials if trial.name == "slow_squat"))
    figure = Figure(figsize=(8, 4), layout="constrained")
    axes, close = figure.subplots(1, 2)
    for plate in trial.plates:
        print(plate.name, f"TYPE {plate.type}:", " ".join(plate.decisions))
        corners = plate.corners[[0, 1, 2, 3, 0]]
        axes.plot(corners[:, 0], corners[:, 1], color="black", linewidth=0.8)
        axes.annotate(plate.name, plate.centre[:2], ha="center")
        cop = plate.wrench.cop(height=plate.height)
        axes.plot(cop[:, 0], cop[:, 1], linewidth=0.8, label=f"centre of pressure on {plate.name}")
    total = trial.wrench.cop()
    close.plot(*(1000 * (total - np.nanmean(total, axis=0)))[:, :2].T, linewidth=0.8, color="black")
    print(f"mean vertical force {np.nanmean(trial.wrench.force[:, 2]):.1f} N")
    axes.set(xlabel="lab x, m", ylabel="lab y, m", aspect="equal", title="Slow squats from above")
    close.set(
        xlabel="x from its mean, mm",
        ylabel="y from its mean, mm",
        aspect="equal",
        title="centre of pressure of all plates",
    )
    figure.legend(loc="outside lower center", frameon=False, fontsize=8)
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/03_force_plates.png"))

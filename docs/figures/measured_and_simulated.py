"""The picture of the first page: one squat trial, measured and simulated, of a virtual visit (`make tutorials`)."""

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import biodance

CHANNELS = ("Fx, N", "Fy, N", "Fz, N", "Mx, N·m", "My, N·m", "Mz, N·m")


def main(picture: Path) -> None:
    """Draw six channels: the plates, the table's body, the identified body."""
    with tempfile.TemporaryDirectory() as scratch:
        person = biodance.Subject(75.0, 1.77, "M", 33.0)
        visit = biodance.simulate(person, "short", Path(scratch) / "visit", seed=3)
        trial = biodance.identify(visit).validations[0]
    time = trial.measured.time
    figure = Figure(figsize=(9.5, 4.2), layout="constrained")
    for channel, axes in enumerate(figure.subplots(2, 3, sharex=True).ravel()):
        axes.plot(time, trial.measured.value[:, channel], color="0.55", linewidth=3, label="plates")
        for wrench, colour, name in ((trial.table, "tab:blue", "table"), (trial.identified, "tab:red", "identified")):
            used = np.where(trial.use, wrench.value[:, channel], np.nan)
            axes.plot(time, used, color=colour, linewidth=1.1, label=name)
        axes.set_title(CHANNELS[channel], fontsize=9, loc="left")
        axes.tick_params(labelsize=8)
        axes.spines[["top", "right"]].set_visible(False)
        if channel > 2:
            axes.set_xlabel("time, s", fontsize=8)
    figure.legend(
        *figure.axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=3, fontsize=8, frameon=False
    )
    figure.savefig(picture, dpi=130)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "measured_and_simulated.png"))

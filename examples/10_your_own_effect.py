"""Add a cause that nobody thought of: an effect of your own, in one class.

The floor of this laboratory shakes at 5 Hz, which no effect of biodance describes: `ShakingFloor` does.

python examples/10_your_own_effect.py [FIGURE.png]      without a name the figure goes into the temporary folder
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import biodance
from biodance.effects import Case, Effect, Parameter

PERSON = biodance.Subject(62.0, 1.70, "F", 31.0)
FREQUENCY, AMPLITUDE = 5.0, 0.3  # Hz of the motor, m/s²


class ShakingFloor(Effect):
    """An ``acceleration`` (m/s²) amplitude of the floor, vertical, in phase with the start of the trial."""

    name = "shaking_floor"
    parameters = (Parameter("acceleration", "m/s²", 0.05, "treadmill: 5.6 N on 70 kg (arXiv 2303.14482)"),)
    separated_by = "A recording of the empty plate."
    advice = "Switch the motor off, or move the plate to another floor."

    def columns(self, case: Case) -> np.ndarray:
        """Return the wrench (T, 6, 1) N, N·m that one m/s² adds: gravity seems to change."""
        return (case.predicted / 9.80665 * np.sin(2 * np.pi * FREQUENCY * case.motion.time)[:, None])[:, :, None]


def main(picture: Path) -> None:
    """Print what the diagnosis names with and without the effect; draw the shaking."""
    with tempfile.TemporaryDirectory() as scratch:
        session = biodance.read_session(biodance.simulate(PERSON, "squat", Path(scratch) / "visit", seed=1))
    shaken = replace(session, trials=tuple(shake(trial) for trial in session.trials))
    result = biodance.examine(shaken)
    print(f"Without the effect: {biodance.diagnose(result).verdict}.")
    found = biodance.diagnose(result, effects=[ShakingFloor()])  # beside all effects of biodance
    print(f"With it: {found.verdict}. Written into the recording: {AMPLITUDE} m/s².")
    print(found.table().iloc[:, :5].to_string(index=False))
    figure = Figure(figsize=(7, 3.5), layout="constrained")
    shaken["squat_1"].plates[0].wrench.plot_force(axes=figure.subplots())
    figure.savefig(picture, dpi=120)


def shake(trial: biodance.Trial) -> biodance.Trial:
    """Return the trial on a floor that shakes: each plate reads more by the share by which gravity seems to grow."""
    share = AMPLITUDE / 9.80665 * np.sin(2 * np.pi * FREQUENCY * trial.plates[0].wrench.time)
    plates = (replace(p, wrench=replace(p.wrench, value=p.wrench.value * (1 + share[:, None]))) for p in trial.plates)
    return replace(trial, plates=tuple(plates))


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/10_your_own_effect.png"))

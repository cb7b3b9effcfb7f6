"""Add a rule that a dance must keep: a limit of your own, in one class.

The ceiling of this laboratory is low. `margins` tells the optimiser how much room is left over the wrists, with
slopes; `check` tells it once more from the finished motion. Design, verification and the table of margins use the
limit like all others.

python examples/11_your_own_limit.py [FIGURE.png]      without a name the figure goes into the temporary folder
"""

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import biodance
from biodance.dance.limits import CheckedMotion, Limit, Margins, Remaining, bounded

PERSON = biodance.Subject(65.0, 1.75, "F", 33.0)
ARMS = ("right_forearm_hand", "left_forearm_hand")
WRISTS = np.array([[0.0, -0.25, 0.0]] * 2)  # m, below the elbow, in the frames of the forearms


@dataclass(frozen=True)
class Ceiling(Limit):
    """``height`` m above the ground, over which no wrist comes."""

    height: float = bounded(1.5, 1.0, 3.0, "m")
    name, unit, scale = "ceiling", "m", 0.05

    def margins(self, state) -> Margins:
        """Return the room (T, 2) m over each wrist, with slopes."""
        place, slope = state.points([state.chain.body.segments.index(arm) for arm in ARMS], WRISTS)
        return Margins(self.height - place[:, :, 2], -slope[None, :, :, 2])

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return the room (T, 2) m over each wrist, from the finished motion."""
        place = motion.pose.points([motion.body.segments.index(arm) for arm in ARMS], WRISTS)
        return Remaining(self.height - place[:, :, 2], ARMS)


def main(picture: Path) -> None:
    """Print what is left of every limit; draw the arm that the ceiling bends."""
    made = biodance.design_dance(PERSON, "one_segment", seed=1, own_limits=[Ceiling(1.3)])
    if made.dance is None:
        raise SystemExit(made.reason)
    print(made)
    for margin in made.margins:
        print(f"{margin.limit:30s} {margin.worst:8.4f} {margin.unit:6s} left at {margin.where_s:5.1f} s")
    figure = Figure(figsize=(7, 4), layout="constrained")
    made.dance.motion(25).plot_angles("left_shoulder_flexion", "left_elbow_flexion", axes=figure.subplots())
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/11_your_own_limit.png"))

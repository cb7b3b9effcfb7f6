"""Design a dance for one person, and let other code check every limit.

Eight postures that make the left forearm and hand known. `verify_dance` judges the finished motion by code that the
design did not use.

python examples/09_dance.py [FIGURE.png]      without a name the figure goes into the temporary folder
"""

import sys
import tempfile
from pathlib import Path

from matplotlib.figure import Figure

import biodance

PERSON = biodance.Subject(65.0, 1.75, "F", 33.0)


def main(picture: Path) -> None:
    """Print what is left of every limit; draw the arm's joint angles."""
    made = biodance.design_dance(PERSON, "one_segment", seed=0)
    if made.dance is None:
        raise SystemExit(made.reason)
    print(made)
    for margin in biodance.verify_dance(made.dance, "one_segment"):
        print(f"{margin.limit:30s} {margin.worst:8.4f} {margin.unit:6s} left at {margin.where_s:5.1f} s")
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    made.dance.motion(25).plot_angles(
        "left_shoulder_flexion", "left_shoulder_adduction", "left_elbow_flexion", axes=axes
    )
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/09_dance.png"))

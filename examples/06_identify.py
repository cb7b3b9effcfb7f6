"""Identify the segment parameters of a simulated person, beside the table and with intervals.

python examples/06_identify.py [FIGURE.png]      without a name the figure goes into the temporary folder
"""

import sys
import tempfile
from pathlib import Path

from matplotlib.figure import Figure

import biodance


def main(picture: Path) -> None:
    """Print what the session cannot know; draw the mass of every segment with 95 % intervals."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = biodance.simulate(biodance.Subject(62.0, 1.70, "F"), "squat", Path(scratch) / "session", seed=1)
        visit = biodance.read_session(folder)
    found = biodance.identify(visit).identification
    print(found.status, *found.notes, sep="\n")
    print(
        f"{len(found.unknown)} of {len(found.known)} quantities cannot be known from these trials: they stay the "
        f"table's."
    )
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = found.plot_masses(axes=figure.subplots())
    axes.set_title("A minute of squats says little about single segments")
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/06_identify.png"))

"""Identify the segment parameters of a simulated person, beside the table and with intervals.

python examples/06_identify.py [FIGURE.png]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from biodance.identify.identification import identify
from biodance.lab.session import read_session
from biodance.pipeline.identification import fit_of
from biodance.pipeline.session import examine
from biodance.records import Subject
from biodance.virtual_lab.simulate import simulate


def main(picture: Path) -> None:
    """Print what the session cannot know; draw the mass of every segment with 95 % intervals."""
    with tempfile.TemporaryDirectory() as scratch:
        session = read_session(simulate(Subject(62.0, 1.70, "F"), "squat", Path(scratch) / "session", seed=1))
    seen = examine(session)
    if seen.body is None:
        raise SystemExit(seen.body_source)
    fits = [fit_of(result) for result in seen.trials if result.trial.role == "fit"]
    found = identify(seen.body, tuple(fit for fit in fits if fit is not None))
    print(found.status, *found.notes, sep="\n")
    print(f"{len(found.unknown)} of {len(found.known)} quantities cannot be known from these trials: they stay the table's.")
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    place = np.arange(len(seen.body.segments))
    for shift, label, sip in ((-0.15, "table", seen.body.sip), (0.15, "identified", found.sip)):
        interval = 1.96 * np.sqrt(np.diag(sip.covariance)[::10])
        axes.errorbar(sip.mass, place + shift, xerr=interval, fmt="o", markersize=3, capsize=2, label=label)
    axes.set_yticks(place, [name.replace("_", " ") for name in seen.body.segments], fontsize=8)
    axes.set(xlabel="mass, kg, with 95 % interval", title="A minute of squats says little about single segments")
    axes.invert_yaxis()
    axes.legend(frameon=False)
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "06_identify.png"))

"""Read one session as a laboratory left it, and look at what the force plates carried.

python examples/01_read_session.py [SESSION_FOLDER [FIGURE.png]]

Without a folder a session is simulated; without a name the figure goes into the temporary folder.
"""

import sys
import tempfile
from pathlib import Path

from matplotlib.figure import Figure

from biodance.lab.session.read import read_session
from biodance.records import Subject
from biodance.virtual_lab.simulate import simulate_session


def main(folder: Path | None, picture: Path) -> None:
    """Print who was recorded and what was decided while reading; draw the vertical force of every trial."""
    with tempfile.TemporaryDirectory() as scratch:
        where = folder or simulate_session(Subject(62.0, 1.70, "F"), "squat", Path(scratch) / "session", seed=1)
        session = read_session(where)
    print(f"{session.subject.mass:.1f} kg, {session.subject.stature:.2f} m, {len(session.trials)} trials")
    figure = Figure(figsize=(7, 3), layout="constrained")
    axes = figure.subplots()
    for trial in session.trials:
        markers = len(trial.markers.names) if trial.markers else 0
        print(
            f"{trial.name}: role {trial.role}, {markers} markers, {len(trial.plates)} plates; "
            f"{'; '.join(trial.history[:2])}"
        )
        if trial.plates:
            axes.plot(trial.wrench.time, trial.wrench.force[:, 2], label=f"{trial.name} ({trial.role})", linewidth=0.8)
    axes.axhline(9.80665 * session.subject.mass, color="black", linewidth=0.5)
    axes.set(xlabel="time, s", ylabel="vertical force on the subject, N", title="The line is the declared weight")
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    arguments = sys.argv[1:]
    picture = arguments[1] if arguments[1:] else f"{tempfile.gettempdir()}/01_read_session.png"
    main(Path(arguments[0]) if arguments else None, Path(picture))

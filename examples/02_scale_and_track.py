"""Scale a body on the static trial of a session and let it follow the markers of a squat.

python examples/02_scale_and_track.py [FIGURE.png]      without a name the figure goes into the temporary folder
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from biodance.body.human.scaling import scale
from biodance.lab.prepare import prepare
from biodance.lab.session.read import read_session
from biodance.motion.track import track
from biodance.records import Subject
from biodance.virtual_lab.simulate import simulate_session

SHOWN = ("right_hip_flexion", "right_knee_flexion", "trunk_flexion", "right_shoulder_flexion")


def main(picture: Path) -> None:
    """Print how the body was made and how well it follows the markers; draw four joint angles."""
    with tempfile.TemporaryDirectory() as scratch:
        session = read_session(simulate_session(Subject(62.0, 1.70, "F"), "squat", Path(scratch) / "session", seed=1))
    trials = {trial.name: prepare(trial) for trial in session.trials}
    body = scale(session.subject, trials["static"])
    motion = track(body, trials["squat_1"])
    print(*body.notes, *motion.notes, sep="\n")
    figure = Figure(figsize=(7, 5), layout="constrained")
    angles, distance = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for name in SHOWN:
        angles.plot(motion.time, np.degrees(motion.q[:, 7 + body.joint_index(name)]), label=name.replace("_", " "))
    distance.plot(motion.time, 1000 * np.sqrt(np.nanmean(motion.residual**2, axis=1)), color="black")
    angles.set(ylabel="angle, degrees", title="Squats of a simulated person")
    distance.set(xlabel="time, s", ylabel="RMS distance of\nthe markers, mm", ylim=(0, None))
    figure.legend(loc="outside lower center", frameon=False, fontsize=8, ncols=4)
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/02_scale_and_track.png"))

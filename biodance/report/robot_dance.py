"""What a robot needs of its dance: joint angles, over time for its controller and posture by posture for the person beside it."""

from pathlib import Path

import numpy as np

from biodance.dance.dance import Dance
from biodance.dance.problem.stance import stance_words
from biodance.records import Array

RATE = 100.0
"""Hz of the table of joint angles."""


def write_angles(dance: Dance, path: Path) -> None:
    """Write time (s), place of the root (m), its quaternion x y z w, and all joint angles (rad) at 100 Hz as CSV, lab frame, z up."""
    motion = dance.motion(RATE)
    names = ["time_s", *(f"root_{axis}_m" for axis in "xyz"), *(f"root_q{axis}" for axis in "xyzw")]
    names += [f"{joint.name}_rad" for joint in dance.body.joints]
    table = np.column_stack([motion.time, motion.q])
    lines = [",".join(names), *(",".join(f"{value:.9g}" for value in row) for row in table)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def angle_sheet(dance: Dance, angles: Array) -> str:
    """Return the postures as a Markdown table of joint angles, degrees: ``angles`` (P, n) rad of all postures of the dance."""
    joints = [joint.name for joint in dance.body.joints]
    lines = [
        "# The dance, posture by posture",
        "",
        f"Angles in degrees. {float(np.median(dance.move)):g} s to get to each posture (`dance.csv` says how), then "
        f"{float(dance.hold.max()):g} s of standing still. Feet that stand are flat and point straight ahead.",
        "",
        f"| | feet | {' | '.join(name.replace('_', ' ') for name in joints)} |",
        "|---" * (len(joints) + 2) + "|",
    ]
    for number, (stance, row) in enumerate(zip(dance.stances, np.degrees(angles), strict=True), start=1):
        lines.append(f"| {number} | {stance_words(stance)} | {' | '.join(f'{angle + 0.0:.1f}' for angle in row)} |")
    return "\n".join(lines) + "\n"

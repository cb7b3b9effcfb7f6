"""Draw a real gait cycle: hip, knee and ankle of both legs, and how far they lie from the laboratory's own software.

python examples/05_what_moved.py [FIGURE.png]      without a name the figure goes into the temporary folder

BIODANCE_DATA names the folder that holds biomechzoo/HC030A (free on the web, MIT licence; not part of biodance).
"""

import os
import sys
import tempfile
from pathlib import Path

from matplotlib.figure import Figure

import biodance

JOINTS = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")


def main(picture: Path) -> None:
    """Print the walk's cycles and the comparison with the angles in the file; draw the mean curves."""
    recordings = Path(os.environ["BIODANCE_DATA"]).resolve() / "biomechzoo" / "HC030A"
    with tempfile.TemporaryDirectory() as scratch:
        for name in ("HC030A01.c3d", "HC030A05.c3d"):  # static trial and one walk, nothing else
            (Path(scratch) / name).symlink_to(recordings / name)
        walk = biodance.describe_movement(scratch)["HC030A05"]
    print(walk)
    for one in walk.file_angles:
        if one.joint.endswith(JOINTS):
            print(f"{one.joint:26} {one.offset:+5.1f} deg beside {one.label}, correlation {one.correlation:.3f}")
    figure = Figure(figsize=(9, 3), layout="constrained")
    for axes, joint in zip(figure.subplots(1, 3), JOINTS, strict=True):
        for side, style, colour in (("left", "--", "tab:orange"), ("right", "-", "tab:blue")):
            axes.plot(walk.curve(joint, side).mean, style, color=colour, label=side)
        axes.set(xlabel="gait cycle, %", ylabel=f"{joint.replace('_', ' ')}, deg")
    axes.legend(frameon=False)
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/05_what_moved.png"))

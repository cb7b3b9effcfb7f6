"""Read a child's real walk: what the reader decided about plates and labels, and where the ground pushed.

python examples/04_real_recording.py [FIGURE.png]      without a name the figure goes into the temporary folder

BIODANCE_DATA names the folder that holds biomechzoo/HC030A (free on the web, MIT licence; not part of biodance).
"""

import os
import sys
import tempfile
from pathlib import Path

from matplotlib.figure import Figure

import biodance


def main(picture: Path) -> None:
    """Print the decisions of the reader; draw plates, heels and the centre of pressure from above."""
    session = biodance.read_session(Path(os.environ["BIODANCE_DATA"]) / "biomechzoo" / "HC030A")
    walk = session["HC030A05"]
    print(f"{session.subject.name}: {session.subject.mass:.1f} kg, {session.subject.stature:.2f} m, as the file says")
    for plate in walk.plates:
        print(plate.name, f"TYPE {plate.type}:", " ".join(plate.decisions))
    figure = Figure(figsize=(8, 3.5), layout="constrained")
    axes = figure.subplots()
    for plate in walk.plates:
        corners = plate.corners[[0, 1, 2, 3, 0]]
        axes.plot(corners[:, 1], corners[:, 0], color="black", linewidth=0.8)
        axes.annotate(plate.name, plate.centre[1::-1], ha="center")
        cop = plate.wrench.cop(height=plate.height)
        axes.plot(cop[:, 1], cop[:, 0], linewidth=2, label=f"centre of pressure on {plate.name}")
    for label, colour in (("LHEE", "tab:orange"), ("RHEE", "tab:blue")):
        heel = walk.markers.xyz[:, walk.markers.names.index(label)]
        axes.plot(heel[:, 1], heel[:, 0], ":", color=colour, label=label)
    axes.set(xlabel="lab y, m", ylabel="lab x, m", aspect="equal", title="A child walks over two plates")
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/04_real_recording.png"))

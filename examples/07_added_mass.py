"""Find a load that nobody declared, by comparing two visits.

Two virtual visits of one person: without a load, and with 4 kg on the left forearm. The first visit is the
reference; the second one is identified against it. `search` says which segment is heavier, by how much, and how
sure that is.

python examples/07_added_mass.py [FIGURE.png]      without a name the figure goes into the temporary folder
"""

import sys
import tempfile
from pathlib import Path

from matplotlib.figure import Figure

import biodance

PERSON = biodance.Subject(62.0, 1.70, "F", 31.0)
LOAD = "added_mass:target=left_forearm_hand,mass=4.0"


def main(picture: Path) -> None:
    """Print the load; draw what every segment weighs in the loaded visit."""
    with tempfile.TemporaryDirectory() as scratch:
        before = biodance.simulate(PERSON, "short", Path(scratch) / "before", seed=1)
        after = biodance.simulate(PERSON, "short", Path(scratch) / "after", seed=1, effects=[LOAD])
        reference = biodance.identify(before)
        loaded = biodance.identify(after, reference=reference)
    load = loaded.search.best
    print(reference, loaded, sep="\n")
    print(f"Hidden: 4.0 kg on the left forearm and hand. Found: {load.segment}, {load.mass:.2f} kg.")
    print("95 % interval: {:.2f} to {:.2f} kg.".format(*load.interval))
    print(f"Probability that there is no load: {loaded.search.p_no_load:.2g}.")
    figure = Figure(figsize=(7, 4), layout="constrained")
    loaded.identification.plot_masses(axes=figure.subplots())
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/07_added_mass.png"))

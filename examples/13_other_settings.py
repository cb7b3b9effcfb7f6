"""Examine a simulated visit in which the plate reads 6 % too much with other settings, and diagnose it once.

python examples/13_other_settings.py [FIGURE.png]      without a name the figure goes into the temporary folder
"""

import sys
import tempfile
from pathlib import Path

import biodance


def main(picture: Path) -> None:
    """Print what both settings leave and the cause found; draw measured and simulated wrench of the squat."""
    with tempfile.TemporaryDirectory() as scratch:
        subject, hidden = biodance.Subject(62.0, 1.70, "F", 31.0), ["plate_gain:target=Fz,gain=0.06"]
        folder = biodance.simulate(subject, "squat", Path(scratch) / "visit", seed=2, effects=hidden)
        visits = [biodance.read_session(folder, settings={"filter.cutoff": cutoff}) for cutoff in (10, 6)]
    results = [biodance.examine(visit) for visit in visits]
    for result in results:
        off = result["squat_1"].comparison.rms
        print(f"{result.session.settings}: the vertical force differs by {off[2]:.1f} N, RMS")
    found = biodance.diagnose(results[0])
    print(found.verdict, *found.findings, sep="\n  ")
    axes = results[0]["squat_1"].comparison.plot_wrench()
    axes[0].figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/13_other_settings.png"))

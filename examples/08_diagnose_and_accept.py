"""Name what is wrong with a visit, and see what accepting the cause gains.

A virtual visit is recorded on a plate whose vertical channel reads 5 % too much. The diagnosis does not know that.
It names the cause and its size; the gain is measured on trials that were kept back.

python examples/08_diagnose_and_accept.py [FIGURE.png]      without a name the figure goes into the temporary folder
"""

import sys
import tempfile
from pathlib import Path

from matplotlib.figure import Figure

import biodance

PERSON = biodance.Subject(62.0, 1.70, "F", 31.0)
FAULT = "plate_gain:target=Fz,gain=0.05"


def main(picture: Path) -> None:
    """Print verdict, cause and gain; draw how normal the residual is once the cause is accepted."""
    with tempfile.TemporaryDirectory() as scratch:
        visit = biodance.simulate(PERSON, "squat", Path(scratch) / "visit", seed=1, effects=[FAULT])
        found = biodance.diagnose(visit)
    print(found.verdict)
    print(found.table().iloc[:, :6].to_string(index=False))
    for finding in found.findings:
        print(finding.advice)
        if finding.gain is not None:
            before, after = finding.gain.rms_before[2], finding.gain.rms_after[2]
            print(
                f"Fz of {', '.join(finding.gain.trials)}: {before:.1f} N RMS before, {after:.1f} N with the cause "
                f"accepted."
            )
    figure = Figure(figsize=(7, 7), layout="constrained")
    found.diagnosis.plot_adequacy(axes=figure.subplots())
    figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else f"{tempfile.gettempdir()}/08_diagnose_and_accept.png"))

"""A recording as a stream: processor time of a frame, end against batch, and how soon a fault in the middle is named.

    OMP_NUM_THREADS=1 python -m benchmarks live FILE.c3d ...

A row a recording. The static trial is that of its folder. Faults begin in the middle: 30 N on Fz of the plate that then
bears most, the same plate falls silent, LASI and RASI are exchanged, a knee's marker sits 120 mm lower. Said is after
how many seconds the right one is named, or that it is not; what else is named is counted.
"""

import argparse
from pathlib import Path

import numpy as np
from stream_faults import FAULTS

from biodance.errors import BiodanceError
from biodance.identification.identification import identify_body
from biodance.pipeline.live import body_and_stream, replay

HEADING = (
    "| recording | s | Hz | ms a frame: median, 99 %, most | end against batch, largest difference "
    "| +30 N | plate silent | pelvis exchanged | knee's marker 120 mm off | other names |\n|" + "---|" * 10
)


def row(file: Path) -> str:
    """Return the row of one recording."""
    body, trial = body_and_stream(file)
    assert trial.markers is not None
    found, seconds = replay(body, trial), trial.markers.time
    ms = 1000 * found.frame_s
    said = [f"{np.median(ms):.1f}, {np.percentile(ms, 99):.1f}, {ms.max():.1f}"]
    if found.fit is None or found.identification is None:
        said.append("nothing identified")
    else:
        batch, other = identify_body(body, (found.fit,)).sip, found.identification.sip
        sds = [np.sqrt(np.diag(np.asarray(sip.covariance))) for sip in (other, batch)]
        said.append(f"{max(np.abs(other.phi - batch.phi).max(), np.abs(sds[0] - sds[1]).max()):.0e}")
    middle, others = float(seconds[0] + seconds[-1]) / 2, len(found.warnings)
    for fault in FAULTS:
        try:
            wrong, target, effect = fault(trial, middle)
            told = replay(body, wrong).warnings
        except (BiodanceError, ValueError) as error:
            said.append(f"not tried: {type(error).__name__}")
            continue
        mine = [one.time_s - middle for one in told if one.effect == effect and one.target.startswith(target)]
        others += len(told) - len(mine)
        said.append(f"{mine[0]:.1f} s" if mine else "not named")
    name = f"{file.parent.name}/{file.stem}"
    return f"| {name} | {seconds[-1] - seconds[0]:.0f} | {trial.markers.rate:.0f} | {' | '.join(said)} | {others} |"


def main() -> None:
    """Print the table."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("files", nargs="+", type=Path)
    print(HEADING, flush=True)
    for file in ask.parse_args().files:
        print(row(file), flush=True)

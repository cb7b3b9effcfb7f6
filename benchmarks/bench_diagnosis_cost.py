"""Measure what a diagnosis costs: processor time of each stage and the largest memory of the process.

    python benchmarks/bench_diagnosis_cost.py SESSION [SESSION ...]

Every session runs in a process of its own, as `biodance diagnose` would: imports, reading, tracking, identifying and
diagnosing, without the page. Machine code of numba must be in its cache (run it twice after an installation).
"""

import resource
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

_STAGES = ("imports", "reading", "tracking and identifying", "diagnosing")


def measure(folder: str) -> None:
    """Print processor seconds of the stages and the largest resident memory, MB, of one session."""
    seconds = [time.process_time()]
    from biodance.lab.session.read import read_session
    from biodance.pipeline.diagnosis import diagnose_session
    from biodance.pipeline.session import examine

    seconds.append(time.process_time())
    session = read_session(folder)
    seconds.append(time.process_time())
    result = examine(session)
    seconds.append(time.process_time())
    found = diagnose_session(result)
    seconds.append(time.process_time())
    moved = sum(one.motion.time[-1] - one.motion.time[0] for one in result.trials if one.motion is not None)
    parts = " | ".join(f"{b - a:.1f}" for a, b in pairwise(seconds))
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"| {Path(folder).name} | {len(result.trials)} | {moved:.0f} | {parts} | {seconds[-1]:.1f} | {largest:.0f} | "
          f"{found.verdict} |", flush=True)  # fmt: skip


def main() -> None:
    """Print the table, or one line of it."""
    if sys.argv[1] == "--one":
        measure(sys.argv[2])
        return
    print(f"| session | trials | s of movement | {' s | '.join(_STAGES)} s | all, s | peak, MB | verdict |")
    print("|---" * 10 + "|", flush=True)
    for folder in sys.argv[1:]:
        subprocess.run([sys.executable, __file__, "--one", folder], check=False)


if __name__ == "__main__":
    main()

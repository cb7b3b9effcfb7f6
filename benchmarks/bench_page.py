"""How long the everyday commands take: processor time with one thread and warm caches, memory, size of the page.

    BIODANCE_DATA=folder python benchmarks/bench_page.py --nine SESSION --seven SESSION [--against CHECKOUT]

`report` on a real static trial, walk and turn; `identify` on ``--nine`` (nine trials of ten seconds), `report` with all
tables on eleven simulated trials, and ``--seven`` (seven minutes of C3D) to parameters with intervals without a page.
With ``--against`` every line is run in turn with the version of another checkout, and the ratio is what counts on a
machine that others use. Budget: 80 s of processor time a version.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import biodance

HERE = Path(__file__).resolve().parents[1]
SEVEN = "import biodance, sys; biodance.identify(biodance.examine(biodance.read_session(sys.argv[1])))"


@dataclass(frozen=True)
class Cost:
    """Processor time s (user and system), wall time s, largest resident memory MB, page MB (0: none) of one run."""

    seconds: float
    wall: float
    memory: float
    page: float


def cost(command: list[str], checkout: Path, out: Path) -> Cost:
    """Run a command with the package of a checkout."""
    shutil.rmtree(out, ignore_errors=True)
    shutil.rmtree(out.with_name("tables"), ignore_errors=True)
    env = {**os.environ, "PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    env.pop("PYTHONDONTWRITEBYTECODE", None)
    began = time.perf_counter()
    run = subprocess.Popen(
        [sys.executable, *command], env=env, cwd=checkout, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    said = run.stderr.read().decode() if run.stderr else ""
    _, status, used = os.wait4(run.pid, 0)
    wall = time.perf_counter() - began
    run.returncode = os.waitstatus_to_exitcode(status)
    if run.returncode not in (0, 1) or "Traceback" in said:
        raise SystemExit(f"{command}: exit {run.returncode}\n{said[-2000:]}")
    page = out / "report.html"
    size = page.stat().st_size / 1e6 if page.is_file() else 0.0
    return Cost(used.ru_utime + used.ru_stime, wall, used.ru_maxrss / 1024, size)


def commands(chosen: argparse.Namespace, scratch: Path, out: Path) -> dict[str, list[str]]:
    """Return what is measured, by name."""
    real = Path(os.environ["BIODANCE_DATA"]).resolve() / "biomechzoo" / "HC030A"
    eleven = biodance.simulate(biodance.Subject(62.0, 1.70, "F", 30.0), "dance", scratch / "eleven", seed=1)
    cli, kept = ["-m", "biodance"], ["--out", str(out)]
    lines = {"nothing (`--help`)": [*cli, "--help"], "imports": ["-c", "import biodance.pipeline.front"]}
    lines["`report`, static, walk and turn (real)"] = [*cli, "report", str(real), *kept]
    if chosen.nine:
        lines["`identify`, nine trials"] = [*cli, "identify", str(chosen.nine.resolve()), *kept]
    if chosen.nine:
        lines["`diagnose`, nine trials"] = [*cli, "diagnose", str(chosen.nine.resolve()), *kept]
    lines["`diagnose`, static, walk and turn (real)"] = [*cli, "diagnose", str(real), *kept]
    tables = ["--tables", str(out.with_name("tables")), "--subject-page"]
    lines["`report`, eleven trials, tables, subject page"] = [*cli, "report", str(eleven), *kept, *tables]
    if chosen.seven:
        lines["seven minutes to parameters, no page"] = ["-c", SEVEN, str(chosen.seven.resolve())]
    return lines


def main() -> None:
    """Measure all, the versions in turn, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nine", type=Path)
    parser.add_argument("--seven", type=Path)
    parser.add_argument("--against", type=Path)
    parser.add_argument("--repeat", type=int, default=1)
    chosen = parser.parse_args()
    versions = [HERE, *([chosen.against.resolve()] if chosen.against else [])]
    heads = ["what", "processor time (s)", "wall (s)", "memory (MB)", "page (MB)"]
    heads += ["time before (s)", "memory before (MB)"]
    print("|", " | ".join(heads), "|")
    print("|---|---|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "out"
        for name, line in commands(chosen, Path(scratch), out).items():
            for version in versions:  # fills the caches
                cost(line, version, out) if "nothing" in name or "report`, static" in name else None
            seen = [[cost(line, version, out) for version in versions] for _ in range(chosen.repeat)]
            now, *before = ([np.min([one[k].seconds for one in seen]), seen[0][k]] for k in range(len(versions)))
            told = [f"{now[0]:.1f}", f"{now[1].wall:.1f}", f"{now[1].memory:.0f}", f"{now[1].page:.1f}"]
            told += [f"{b[0]:.1f} ({now[0] / b[0]:.2f})" for b in before] + [f"{b[1].memory:.0f}" for b in before]
            print("|", " | ".join([name, *told]), "|", flush=True)


if __name__ == "__main__":
    main()

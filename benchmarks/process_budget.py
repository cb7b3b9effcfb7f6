"""Where the processor time of one command goes: the whole process, imports by library, the rest by stage.

    python benchmarks/process_budget.py report FOLDER --out OUT [--force ...]

The stack is looked at every 4 ms of processor time. An import counts for the library that is loaded first in the stack
of imports; all else for the innermost of `_STAGES` that is at work. Machine code and bytecode must be in their caches:
run it twice. Wanted for docs/benchmarks (movement.md, cost).
"""

import collections
import gc
import os
import signal
import sys
import time
from types import FrameType

_EVERY = 0.004
"""s of processor time between two looks."""
_STAGES = {
    "reading": ("read_session",),
    "preparing": ("prepare_trial",),
    "scaling, joints by movement": ("body_of",),
    "optional joints": ("shown_joints", "with_forces"),
    "tracking, contact": ("examine_trial",),
    "identification": ("identify_body",),
    "mismatch of kinematics": ("mismatch",),
    "what the identified body predicts": ("_predicted", "added_mass"),
    "witnesses": ("hear", "weigh"),
    "quality checks": ("check_quality",),
    "diagnosis: rows, sizes shown": ("problem",),
    "diagnosis: candidate causes": ("candidates", "built", "name_causes"),
    "diagnosis: limits, adequacy, other": ("diagnose_session",),
    "movement: events, cycles, curves": ("describe_movement",),
    "tables": ("tabled",),
    "the page": ("write_report", "write_subject_page", "write_identification"),
}
_STAGE = {name: stage for stage, names in _STAGES.items() for name in names}


def _own(frame: FrameType) -> bool:
    return f"{os.sep}biodance{os.sep}" in frame.f_code.co_filename and "site-packages" not in frame.f_code.co_filename


def _library(path: str) -> str:
    """Return the library of a file, of scipy its part."""
    parts = path.split(f"site-packages{os.sep}", 1)[-1].split(os.sep)
    return ".".join(parts[: 2 if parts[0] == "scipy" else 1]).removesuffix(".py")


def _where(frame: FrameType | None) -> str:
    """Return the stage, or the import, that a stack is at work on."""
    loads, library, stage = False, "", ""
    while frame is not None and not stage:
        path, name = frame.f_code.co_filename, frame.f_code.co_name
        loads = loads or "importlib" in path
        if _own(frame) and name != "<module>":
            if loads:
                return f"import {library or 'biodance'}"
            stage = _STAGE.get(name, "")
        elif loads and "site-packages" in path:
            library = _library(path)
        frame = frame.f_back
    return f"import {library or 'biodance'}" if loads else stage or "other"


def main() -> None:
    """Run the command that follows and print the table."""
    seen: collections.Counter[str] = collections.Counter()
    signal.signal(signal.SIGPROF, lambda _, frame: seen.update([_where(frame)]))
    signal.setitimer(signal.ITIMER_PROF, _EVERY, _EVERY)
    gc.set_threshold(50_000)
    from biodance.cli import run

    run(sys.argv[1:])
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    share = time.process_time() / max(1, sum(seen.values()))
    print("| what | processor time (s) |\n|---|---|")
    for what, count in seen.most_common():
        print(f"| {what} | {count * share:.2f} |")
    print(f"| all | {time.process_time():.2f} |")


if __name__ == "__main__":
    main()

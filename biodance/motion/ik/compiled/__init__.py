"""What runs frame by frame in machine code (numba): inverse kinematics of a chain of joints.

The machine code is made at the first call (about half a minute, once per machine) and kept in ``__pycache__`` beside
the files. Arguments and scratch arrays travel in named tuples; functions fill what they are given. No function here
checks its input: its callers in ``motion`` do.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

STAMP = tuple(
    (path.name, path.stat().st_mtime, path.stat().st_size) for path in sorted(Path(__file__).parent.glob("*.py"))
)
"""State of all files of this folder."""


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile ``function`` at its first call and keep the machine code.

    numba looks for changes in the function's own file only and would keep what it inlined from the others, so the kept
    code carries the state of the whole folder (a private attribute of numba's; tests/test_motion_compiled.py sees that
    it works). Sums keep their order (no fastmath): else the process that compiles a function, which runs it inlined
    otherwise than what it keeps for later ones, gives other last digits than these.
    """
    dispatcher = numba.njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)(function)
    dispatcher._cache._cache_file._source_stamp = STAMP
    return dispatcher

"""The Python processes that biodance starts: none imports a module from the folder in which somebody works, where files
of strangers may lie (CWE-427).
"""

import os
import signal
import subprocess
import sys
from multiprocessing import forkserver
from pathlib import Path

_OWN = str(Path(__file__).resolve().parent.parent)
_SAFE = "PYTHONSAFEPATH"


def run_python(*arguments: str, timeout: float, input: bytes | None = None) -> "subprocess.CompletedProcess[bytes]":
    """Run this Python with ``arguments`` and return what became of it, with its output.

    It imports from where this process does, but for the working folder.

    Raises
    ------
    subprocess.TimeoutExpired
        It gives no answer within ``timeout`` s; it is ended.
    OSError
        It cannot be started.
    """
    here = os.path.realpath(os.getcwd())
    kept = [place for place in sys.path if os.path.isabs(place) and (place == _OWN or os.path.realpath(place) != here)]
    return subprocess.run(
        [sys.executable, *arguments],
        env=os.environ | {_SAFE: "1", "PYTHONPATH": os.pathsep.join(kept)},
        input=input,
        capture_output=True,
        timeout=timeout,
        check=False,
    )


def start_forkserver() -> None:
    """Start the process from which workers are forked: it leaves out the working folder, too. What this process starts
    otherwise is as before.
    """
    before = os.environ.get(_SAFE)
    os.environ[_SAFE] = "1"
    # Ctrl-C is for us to answer: what is started here never hears it, and for us it waits until then
    heard = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        forkserver.ensure_running()
    finally:
        if before is None:
            del os.environ[_SAFE]
        else:
            os.environ[_SAFE] = before
        signal.pthread_sigmask(signal.SIG_SETMASK, heard)

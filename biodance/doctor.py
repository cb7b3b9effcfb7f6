"""What works on this machine, and how to mend what does not. Every risky library is tried in a child process: it may
crash, not raise.
"""

import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from biodance import library
from biodance.child_process import run_python
from biodance.errors import BiodanceError

_PATIENCE = 60.0
"""Seconds a probe in a child process may take."""

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

_STILL = (
    "import pyvista; p = pyvista.Plotter(off_screen=True); p.add_mesh(pyvista.Sphere()); "
    "p.screenshot(return_img=True); p.close()"
)


@dataclass(frozen=True)
class MachineFinding:
    """One line of the doctor: ``needed`` False for what only some steps or tests use; ``text`` the version, or how
    to mend it.
    """

    name: str
    works: bool
    needed: bool
    text: str


@dataclass(frozen=True)
class Probe:
    """One thing to try: python ``code`` for a child process (its last printed line is the version), and how to
    ``mend`` its failure.
    """

    name: str
    code: str
    mend: str
    needed: bool = True


def _importing(module: str) -> str:
    return f"import {module} as m; print(getattr(m, '__version__', 'loads'))"


PROBES = (
    Probe("pinocchio", _importing("pinocchio"), "It needs the system library libgomp: apt-get install libgomp1; then "
                                                "pip install pin."),
    Probe("ezc3d (judge and writer)", _importing("ezc3d"), "pip install ezc3d"),
    Probe("scipy", _importing("scipy"), "pip install scipy"),
    Probe("cvxpy with Clarabel", "import clarabel, cvxpy; print(cvxpy.__version__)", "pip install cvxpy clarabel"),
    Probe("pandas with pyarrow", "import pandas, pyarrow; print(pandas.__version__)", "pip install pandas pyarrow"),
    Probe("trimesh", _importing("trimesh"), "pip install trimesh"),
    Probe("matplotlib", _importing("matplotlib"), "pip install matplotlib"),
    Probe("GL stills (pyvista)", _STILL, "pip install 'biodance[pictures]'; apt-get install libgl1 libegl1.",
    needed=False),
    Probe("opensim (comparisons)", _importing("opensim"), "pip install opensim; only the tests and benchmarks use it.",
    needed=False),
    Probe("mujoco (comparisons)", _importing("mujoco"), "pip install mujoco; only the tests use it.", needed=False),
)  # fmt: skip


def run_probe(probe: Probe) -> MachineFinding:
    """Run ``probe`` in a child process; a crash, an exception or no answer within `PATIENCE` is a finding that says
    how to mend it.
    """
    try:
        child = run_python("-c", probe.code, timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        return MachineFinding(probe.name, False, probe.needed, f"gives no answer within {_PATIENCE:g} s. {probe.mend}")
    said, lines = (text.decode(errors="replace").strip().splitlines() for text in (child.stdout, child.stderr))
    if child.returncode == 0:
        return MachineFinding(probe.name, True, probe.needed, (said or ["works"])[-1])
    why = lines[-1] if child.returncode > 0 and lines else f"the process died (code {child.returncode})"
    return MachineFinding(probe.name, False, probe.needed, f"{why}. {probe.mend}")


def _python() -> MachineFinding:
    right = (3, 11) <= sys.version_info[:2] < (3, 14)
    return MachineFinding(
        "python", right, True, platform.python_version() + ("" if right else ": install Python 3.11, 3.12 or 3.13.")
    )


def _folder(name: str) -> MachineFinding:
    try:
        return MachineFinding(f"data folder {name}", True, True, str(library.folder(name)))
    except BiodanceError as error:
        return MachineFinding(f"data folder {name}", False, True, str(error))


def _browser() -> MachineFinding:
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    text = found or "apt-get install chromium; only the tests of the pages use it."
    return MachineFinding("chromium (page tests)", bool(found), False, text)


def _writable() -> MachineFinding:
    place = Path.cwd()
    try:
        with tempfile.TemporaryFile(dir=place):
            return MachineFinding("writable folder", True, True, str(place))
    except OSError as error:
        return MachineFinding(
            "writable folder", False, True, f"{place}: {error.strerror}. Give --out a folder that you may write to."
        )


def examine_machine(*, tell: Callable[[str], None] = lambda _: None) -> tuple[MachineFinding, ...]:
    """Try everything, ``tell`` what is being tried, and return one finding each."""
    found = [_python(), _folder("anthropometry"), _folder("protocols")]
    for probe in PROBES:
        tell(probe.name)
        found.append(run_probe(probe))
    return (*found, _browser(), _writable())

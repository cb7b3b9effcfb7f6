"""Which software made a result, from which files, with which settings: enough to make it again."""

import platform
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from biodance.lab.session.read import visit_words
from biodance.library import PACKAGE
from biodance.pipeline.results import SessionResult
from biodance.settings import Value
from biodance.version import __version__

LIBRARIES = (
    *("numpy", "scipy", "numba", "llvmlite", "pin", "cvxpy", "clarabel"),
    *("pandas", "ezc3d", "trimesh", "pyvista", "matplotlib"),
)
_UNKNOWN = "unknown"


@dataclass(frozen=True)
class Provenance:
    """``created`` UTC time, ISO 8601: the only thing that differs when the same software runs again on the same files
    and machine; ``commit`` of biodance, "unknown" in an installed wheel, with "+changed" where files differ from it;
    ``versions`` library -> version; ``blas`` that numpy multiplies matrices with; ``inputs`` file name -> sha256;
    ``settings`` dotted key -> value, all of them; ``visit`` the ``date``, ``lab``, ``operator`` and ``condition`` of
    the session, "" where nobody says.
    """

    created: str
    commit: str
    versions: Mapping[str, str]
    blas: str
    inputs: Mapping[str, str]
    settings: Mapping[str, Value]
    visit: Mapping[str, str] = field(default_factory=dict)


def now() -> str:
    """Return the present UTC time to the second, ISO 8601."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _version(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:
        return "not installed"


@cache
def commit(package: Path = PACKAGE) -> str:
    """Return the git commit of the checkout that holds ``package``, with "+changed" where files of it differ; else
    "unknown".
    """
    if not (package.parent / ".git").exists():
        return _UNKNOWN
    try:
        found = _git(package.parent, "rev-parse", "HEAD")
        return found + ("+changed" if _git(package.parent, "status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.SubprocessError):
        return _UNKNOWN


def _git(folder: Path, *words: str) -> str:
    return subprocess.run(
        ["git", *words], cwd=folder, capture_output=True, text=True, check=True, timeout=10
    ).stdout.strip()


def blas() -> str:
    """Return which BLAS numpy runs on: the library and version it was built with, and the kernels of all that are
    loaded by now, where that can be asked.
    """
    import numpy as np

    built = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    said = f"{built.get('name', _UNKNOWN)} {built.get('version', '')}".strip()
    return " ".join([said, *_kernels()])


def _kernels() -> list[str]:
    """Return the kernel and the number of threads of every BLAS in this process."""
    from threadpoolctl import threadpool_info

    found = [one for one in threadpool_info() if one.get("user_api") == "blas"]
    return sorted({f"({one.get('architecture', _UNKNOWN)}, threads: {one['num_threads']})" for one in found})


def provenance(result: SessionResult, *, created: str) -> Provenance:
    """Collect the provenance of ``result``; ``created`` is the UTC time to write into it (see `now`)."""
    versions = {
        "biodance": __version__,
        "python": platform.python_version(),
        **{name: _version(name) for name in LIBRARIES},
    }
    inputs, folder = {}, result.session.folder
    for source in (trial.trial.source for trial in result.trials):
        inside = source.path.is_relative_to(folder)
        inputs[source.path.relative_to(folder).as_posix() if inside else source.path.name] = source.sha256
    visit = visit_words(result.session.folder, [trial.name for trial in result.trials])
    return Provenance(created, commit(), versions, blas(), inputs, result.settings.as_dict(), visit)

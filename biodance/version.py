"""The version of this package, and the commit that it is."""

from functools import cache
from pathlib import Path

__version__ = "0.1.0"
NO_COMMIT = "unknown"
_PACKAGE = Path(__file__).resolve().parent


@cache
def commit(package: Path = _PACKAGE) -> str:
    """Return the git commit of the checkout that holds ``package``, with "+changed" where files of it differ; else
    "unknown".
    """
    import subprocess

    if not (package.parent / ".git").exists():
        return NO_COMMIT
    try:
        found = _git(package.parent, "rev-parse", "HEAD")
        return found + ("+changed" if _git(package.parent, "status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.SubprocessError):
        return NO_COMMIT


def _git(folder: Path, *words: str) -> str:
    import subprocess

    return subprocess.run(
        ["git", *words], cwd=folder, capture_output=True, text=True, check=True, timeout=10
    ).stdout.strip()

"""Which folders a window may show and open: those in the user's home, where it was started, and in its results."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from biodance.errors import BiodanceError


def allowed_folder(path: str, roots: Sequence[Path]) -> Path:
    """Return a folder as it truly lies, links followed; BiodanceError where it is not in one of the ``roots``."""
    try:
        found = Path(path).resolve(strict=True)
    except (OSError, RuntimeError, ValueError) as error:
        raise BiodanceError(f"{path}: there is no such folder ({error}). Choose another one.") from error
    if not any(root == found or root in found.parents for root in roots):
        legal = ", ".join(map(str, roots))
        raise BiodanceError(f"{path}: is not in {legal}. Start biodance app with that folder to work in it.")
    if not found.is_dir():
        raise BiodanceError(f"{path}: is a file. Choose the folder that holds it.")
    return found


def folders_document(path: str, roots: Sequence[Path]) -> dict[str, Any]:
    """Return a ``folder`` ("" = the last of the ``roots``), the one ``above`` it ("" = none that may be shown), and the
    names of the ``folders`` in it; hidden ones, files, and links that lead elsewhere are left out.
    """
    folder = allowed_folder(path or str(roots[-1]), roots)
    try:
        below = sorted((one for one in folder.iterdir() if not one.name.startswith(".")), key=lambda one: one.name)
    except OSError as error:
        raise BiodanceError(f"{folder}: cannot be opened ({error.strerror}). Choose another one.") from error
    above = "" if folder in roots and not _within(folder.parent, roots) else str(folder.parent)
    shown = [one.name for one in below if _within(one, roots)]
    return {"folder": str(folder), "above": above, "folders": shown, "roots": [str(one) for one in roots]}


def _within(path: Path, roots: Sequence[Path]) -> bool:
    try:
        return bool(allowed_folder(str(path), roots))
    except BiodanceError:
        return False

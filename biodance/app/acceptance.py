"""``--accept`` in a window: what it would write is written beside, shown with before and after, then kept or not."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from biodance.app.outputs import run_command
from biodance.app.sessions import SessionPlace
from biodance.batch.summary import folder_name
from biodance.errors import BiodanceError
from biodance.library import parse_json


def preview_of_acceptance(place: SessionPlace, out: Path) -> dict[str, Any]:
    """Diagnose a session and write what acceptance would write into a folder beside; return before and after.

    Returns
    -------
    dict
        ``residuals`` as `residuals.residual_rows`; ``written`` files with what they are, ``not_applied`` causes with
        why. The recordings are not touched.
    """
    with _preview(place, out) as folder:
        told = parse_json(
            run_command("diagnose", str(place.folder), "--accept", f"--out={folder}", "--force", "--json")
        )
        residuals = parse_json(run_command(str(place.folder), str(folder), module="biodance.app.residuals"))
    accepted = told.get("accepted") or {}
    return {"residuals": residuals} | {key: accepted.get(key, []) for key in ("written", "not_applied", "corrections")}


def keep_acceptance(place: SessionPlace, out: Path) -> Path:
    """Give what `preview_of_acceptance` wrote its own place and return it; an earlier one is kept beside it.

    Raises
    ------
    BiodanceError
        There is no preview.
    """
    preview, kept = _preview_folder(place, out), out / "accepted" / folder_name(place.name)
    if not preview.is_dir():
        raise BiodanceError(f"{place.name}: there is nothing to keep. Look at before and after first.")
    if kept.exists():
        names = (kept.with_name(f"{kept.name} {number}") for number in range(2, 10_000))
        kept = next(path for path in names if not path.exists())
    preview.rename(kept)
    return kept


def _preview_folder(place: SessionPlace, out: Path) -> Path:
    return out / "accepted" / f"{folder_name(place.name)} (preview)"


@contextmanager
def _preview(place: SessionPlace, out: Path) -> Iterator[Path]:
    """Yield the folder of a preview, empty; it is gone where it fails."""
    folder = _preview_folder(place, out)
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield folder
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise

"""Where results go: a folder of their own, never over or among the raw recordings."""

from pathlib import Path

from biodance.errors import SessionRefused
from biodance.lab.readers import extensions
from biodance.lab.session.recordings import RESULTS, TEXT

DEFAULT = "biodance"


def results_folder(out: str | Path | None, session: str | Path, *, force: bool = False) -> Path:
    """Return the folder for the results of a session, made if missing; ``out`` None is ``biodance`` inside the session
    folder.

    ``force`` allows a folder that holds results of an earlier run (a results.json or report.html); they are overwritten
    one by one.

    Raises
    ------
    SessionRefused
        The folder is the session folder or one above it, is a file, holds recordings, holds anything at all without
        ``force``, or holds only files that biodance did not write.
    """
    session = Path(session).resolve()
    folder = (Path(out) if out is not None else session / DEFAULT).resolve()
    if folder == session or folder in session.parents:
        raise SessionRefused(
            f"{folder}: results must not lie among the recordings. Give another folder, for example "
            f"{session / DEFAULT}."
        )
    if folder.exists() and not folder.is_dir():
        raise SessionRefused(f"{folder}: is a file; the results need a folder. Choose another name.")
    files = [path for path in folder.iterdir() if not path.name.startswith(".")] if folder.is_dir() else []
    raw = [path.name for path in files if path.suffix.lower() in extensions() and path.suffix.lower() not in TEXT]
    ours = any(path.name in RESULTS for path in files)
    if raw and not ours:
        raise SessionRefused(
            f"{folder}: holds recordings ({raw[0]}); results are never written beside them. Give another folder."
        )
    if files and not force:
        raise SessionRefused(
            f"{folder}: holds files already and nothing is overwritten. Give another folder, or --force."
        )
    if files and not ours:
        raise SessionRefused(
            f"{folder}: holds files that biodance did not write ({files[0].name}). Give another folder."
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SessionRefused(
            f"{folder}: cannot be made ({error.strerror or error}). Choose a place where you may write."
        ) from error
    return folder

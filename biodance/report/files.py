"""Files that stand whole or not at all, and never over what is there."""

from collections.abc import Mapping
from pathlib import Path

from biodance.errors import BiodanceError


def refuse_page(path: Path, *, force: bool) -> None:
    """Raise BiodanceError where ``path`` does not end in .html, or as `refuse_file`."""
    if path.suffix.lower() != ".html":
        raise BiodanceError(f"{path}: a page is one file that ends in .html. Choose --out {path}.html.")
    refuse_file(path, force=force)


def refuse_file(path: Path, *, force: bool) -> None:
    """Raise BiodanceError where ``path`` is a folder, exists and ``force`` was not given, or its folder is missing."""
    if path.is_dir():
        raise BiodanceError(f"{path}: is a folder; one file is written. Choose another --out.")
    if path.exists() and not force:
        raise BiodanceError(f"{path}: exists already and is not overwritten. Choose another --out, or --force.")
    refuse_missing_folder(path)


def refuse_missing_folder(path: Path) -> None:
    """Raise BiodanceError where the folder of a file to write is missing."""
    if not path.parent.is_dir():
        raise BiodanceError(f"{path.parent}: there is no such folder. Make it, or choose another --out.")


def write_files(folder: Path, files: Mapping[str, str]) -> None:
    """Write every file under another name first and then rename it, so that a stopped run leaves no half file."""
    for name, text in files.items():
        part = folder / f".{name}.part"
        try:
            part.write_text(text, encoding="utf-8", newline="\n")
            part.replace(folder / name)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise BiodanceError(
                f"{folder / name}: cannot be written ({error.strerror or error}). Make room or choose another --out, "
                f"and run again."
            ) from error

"""What belongs to one run: ``manifest.json`` in a results folder binds its files to each other and to recordings."""

import hashlib
import json
import uuid
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from biodance.errors import FileRefused
from biodance.library import parse_json
from biodance.version import __version__

MANIFEST = "manifest.json"
"""Written last into a results folder."""


@dataclass(frozen=True)
class Manifest:
    """What a run left: ``run`` its number, ``version`` of biodance, ``session`` absolute folder of the
    recordings; SHA-256 by name of the recordings read (``inputs``) and of the files written (``outputs``).
    """

    run: str
    version: str
    session: str
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]


@dataclass(frozen=True)
class Verified:
    """A results folder beside its manifest: files of the run that are ``missing`` or ``changed``, those that are
    ``foreign`` to it, and the recordings that are not as they were read (``inputs_changed``).
    """

    folder: Path
    manifest: Manifest
    missing: tuple[str, ...]
    changed: tuple[str, ...]
    foreign: tuple[str, ...]
    inputs_changed: tuple[str, ...]

    @property
    def whole(self) -> bool:
        """Whether every file of the run is there as it was written."""
        return not (self.missing or self.changed)


def write_manifest(folder: Path, session: Path, inputs: Mapping[str, str]) -> None:
    """Bind the files in a ``folder`` to the recordings of a ``session``, whose ``inputs`` are name -> SHA-256."""
    outputs = {name: file_hash(folder / name) for name in files_in(folder)}
    one = Manifest(uuid.uuid4().hex, __version__, str(session.absolute()), dict(inputs), outputs)
    text = json.dumps(asdict(one), indent=1, sort_keys=True)
    (folder / MANIFEST).write_text(text + "\n", encoding="utf-8", errors="backslashreplace")


def read_manifest(folder: Path) -> Manifest | None:
    """Return the manifest of a results folder; None where there is none (an earlier version, or no results).

    Raises
    ------
    FileRefused
        It is damaged.
    """
    path = folder / MANIFEST
    if not path.is_file():
        return None
    try:
        found = Manifest(**parse_json(path.read_text(encoding="utf-8")))
        if all(isinstance(part, dict) for part in (found.inputs, found.outputs)):
            return found
    except (OSError, ValueError, TypeError) as error:
        raise FileRefused(f"{path}: is damaged ({error}). Run the session again.") from error
    raise FileRefused(f"{path}: is damaged (no list of files). Run the session again.")


def refuse_mixture(folder: Path, names: tuple[str, ...]) -> None:
    """Raise FileRefused where one of the files ``names`` in a results folder is not the one that its run wrote."""
    manifest = read_manifest(folder)
    for name in names if manifest else ():
        assert manifest is not None
        if not (folder / name).is_file():
            continue
        if name not in manifest.outputs:
            raise FileRefused(f"{folder / name}: is not of the run that wrote this folder. Run the session again.")
        if file_hash(folder / name) != manifest.outputs[name]:
            raise FileRefused(
                f"{folder / name}: is not as its run wrote it: changed by hand, damaged, or of another run. Run the "
                f"session again, or give that file itself."
            )


def check_results(folder: Path) -> Verified | None:
    """Return how a results folder stands beside its manifest; None where it has none."""
    manifest = read_manifest(folder)
    if manifest is None:
        return None
    there = set(files_in(folder))
    known = manifest.outputs
    changed = (name for name in sorted(there & set(known)) if file_hash(folder / name) != known[name])
    recordings = ((Path(manifest.session) / name, sha) for name, sha in sorted(manifest.inputs.items()))
    other = (str(path) for path, sha in recordings if not path.is_file() or file_hash(path) != sha)
    return Verified(
        folder, manifest, tuple(sorted(set(known) - there)), tuple(changed), tuple(sorted(there - set(known))),
        tuple(other),
    )  # fmt: skip


def results_below(place: Path) -> tuple[Path, ...]:
    """Return the folders at and below a place that hold a manifest, by name."""
    return tuple(sorted(path.parent for path in place.rglob(MANIFEST)))


def files_in(folder: Path) -> list[str]:
    """Return the names below a folder of all files, sorted, but the manifest and hidden ones."""
    found = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return sorted(one.as_posix() for one in found if one.name != MANIFEST and not one.name.startswith("."))


def file_hash(path: Path) -> str:
    """Return the hexadecimal SHA-256 of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()

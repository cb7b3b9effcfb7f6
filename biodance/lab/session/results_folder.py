"""Where results go: a folder of their own, never over or among the raw recordings, there whole or not at all. A run
writes into a folder beside its place (`ResultsFolder.part`).
"""

import atexit
import ctypes
import hashlib
import json
import os
import platform
import shutil
import uuid
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import MappingProxyType

from biodance.errors import FileRefused, SessionRefused
from biodance.lab.plain_text import flush
from biodance.lab.readers import extensions
from biodance.lab.session.recordings import RESULTS, TEXT
from biodance.library import parse_json
from biodance.settings import Value
from biodance.version import NO_COMMIT, __version__, commit

_MANIFEST = "manifest.json"  # Written last into a results folder
_NONE: Mapping[str, Value] = MappingProxyType({})


@dataclass(frozen=True)
class _Manifest:
    """What a run left: ``run`` its number, ``version`` and ``commit`` of biodance ("unknown" in an installed wheel),
    ``session`` absolute folder of the recordings, ``settings`` of the session (dotted key -> value; none where several
    sessions or none were read); SHA-256 by name of the recordings read (``inputs``) and of the files written
    (``outputs``).
    """

    run: str
    version: str
    session: str
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    commit: str = NO_COMMIT  # the last two: not in manifests before 2026-11-29
    settings: Mapping[str, Value] = field(default_factory=dict)

    @property
    def software(self) -> str:
        """Which biodance it was, in words."""
        return f"{self.version}, commit {self.commit[:12]}{self.commit[40:]}"


@dataclass(frozen=True)
class _Verified:
    """A results folder beside its manifest: files of the run that are ``missing`` or ``changed``, the recordings that
    are not as they were read (``inputs_changed``), and in what the provenance in results.json says otherwise
    (``otherwise``: "version", "commit" or "setting KEY").
    """

    folder: Path
    manifest: _Manifest
    missing: tuple[str, ...]
    changed: tuple[str, ...]
    inputs_changed: tuple[str, ...]
    otherwise: tuple[str, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether every file of the run is there as it was written, and says what the manifest says."""
        return not (self.missing or self.changed or self.otherwise)


def write_manifest(
    folder: Path, session: Path, inputs: Mapping[str, str], settings: Mapping[str, Value] = _NONE
) -> None:
    """Bind the files in a ``folder`` to a ``session``'s ``inputs`` (name -> SHA-256) and ``settings`` (by key)."""
    outputs = {name: file_hash(folder / name) for name in _files_in(folder)}
    place, chosen = str(session.absolute()), dict(settings)
    one = _Manifest(uuid.uuid4().hex, __version__, place, dict(inputs), outputs, commit(), chosen)
    text = json.dumps(asdict(one), indent=1, sort_keys=True)
    (folder / _MANIFEST).write_text(text + "\n", encoding="utf-8", errors="backslashreplace")


def read_manifest(folder: Path) -> _Manifest | None:
    """Return the manifest of a results folder; None where there is none (an earlier version, or no results).

    Raises
    ------
    FileRefused
        It is damaged.
    """
    path = folder / _MANIFEST
    if not path.is_file():
        return None
    try:
        found = _Manifest(**parse_json(path.read_text(encoding="utf-8")))
        if all(isinstance(part, dict) for part in (found.inputs, found.outputs, found.settings)):
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


def check_results(folder: Path) -> _Verified | None:
    """Return how a results folder stands beside its manifest; None where it has none."""
    manifest = read_manifest(folder)
    if manifest is None:
        return None
    missing, changed = _not_as_written(folder, manifest)
    recordings = ((Path(manifest.session) / name, sha) for name, sha in sorted(manifest.inputs.items()))
    other = (str(path) for path, sha in recordings if not os.path.isfile(path) or file_hash(path) != sha)
    return _Verified(folder, manifest, missing, changed, tuple(other), _said_otherwise(folder, manifest))


def _not_as_written(folder: Path, manifest: _Manifest) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the files of a run that are missing, and those that are changed."""
    there, known = set(_files_in(folder)), manifest.outputs
    changed = (name for name in sorted(there & set(known)) if file_hash(folder / name) != known[name])
    return tuple(sorted(set(known) - there)), tuple(changed)


def doubt_about(folder: Path) -> str:
    """Return a sentence on the files of a results folder that are not as its run wrote them; "" where all are, or where
    it has no manifest.
    """
    manifest = read_manifest(folder)
    odd = sorted({*(found for some in _not_as_written(folder, manifest) for found in some)}) if manifest else []
    return f"{folder}: not as its run wrote it: {', '.join(odd)} (see biodance verify)." if odd else ""


def _said_otherwise(folder: Path, manifest: _Manifest) -> tuple[str, ...]:
    """Return in what the provenance in results.json differs from the manifest; nothing where it cannot be read, which
    is a changed file, or where either does not say.
    """
    try:
        told = parse_json((folder / "results.json").read_text(encoding="utf-8"))["provenance"]
        version, made_by, settings = told["versions"]["biodance"], told["commit"], dict(told["settings"])
    except (OSError, ValueError, TypeError, KeyError):
        return ()
    known = manifest.settings
    differ = {"version": version != manifest.version, "commit": manifest.commit not in (NO_COMMIT, made_by)}
    keys = sorted({*settings, *known}) if known else []
    return (
        *(what for what, other in differ.items() if other),
        *(f"setting {key}" for key in keys if settings.get(key) != known.get(key)),
    )


def differing(found: Iterable[_Verified]) -> tuple[str, ...]:
    """Return in what results folders differ from each other that they were made by: a sentence for the version, the
    commit and each setting, with how many folders have which; folders that do not say are left out.
    """
    counts: dict[str, Counter[str]] = {}
    for one in (each.manifest for each in found):
        told = {"version": one.version, **({} if one.commit == NO_COMMIT else {"commit": one.commit})}
        for key, value in (*told.items(), *((f"setting {key}", value) for key, value in one.settings.items())):
            counts.setdefault(key, Counter())[str(value)] += 1
    return tuple(
        f"{key}: {', '.join(f'{value} in {count}' for value, count in sorted(some.items()))}"
        for key, some in counts.items()
        if len(some) > 1
    )


def results_below(place: Path) -> tuple[Path, ...]:
    """Return the folders at and below a place that hold a manifest, by name."""
    return tuple(sorted(path.parent for path in place.rglob(_MANIFEST)))


def _files_in(folder: Path) -> list[str]:
    """Return the names below a folder of all files, sorted, but the manifest and hidden ones."""
    found = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return sorted(one.as_posix() for one in found if one.name != _MANIFEST and not one.name.startswith("."))


def file_hash(path: Path) -> str:
    """Return the hexadecimal SHA-256 of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


_LOCK = ".biodance.lock"


@dataclass(frozen=True)
class ResultsFolder:
    """A folder of results in the making: ``part``, into which everything is written, takes the ``place``."""

    place: Path
    part: Path

    def finish(self, session: Path, inputs: Mapping[str, str], settings: Mapping[str, Value] = _NONE) -> Path | None:
        """Bind what was written to the recordings of a ``session`` (``inputs``: name -> SHA-256) and the ``settings``
        (key -> value), and put it in place.

        Return the folder to which the files of an earlier run's folder went that were not biodance's; None if there
        were none.

        Raises
        ------
        SessionRefused
            The disk is full, or the place cannot be written to; what was there is as before.
        """
        with _as_before(self.place):
            write_manifest(self.part, session, inputs, settings)
            (self.part / _LOCK).unlink(missing_ok=True)
            put_in_place(self.part, self.place)
            return _cleared(self.part, ours=_files_in(self.place)) if self.part.is_dir() else None
        return None


def inputs_of(paths: Mapping[Path, str], session: Path) -> dict[str, str]:
    """Return the hashes of recordings by their name below the ``session`` folder."""
    return {os.path.relpath(path, session): sha for path, sha in paths.items() if sha}


def put_in_place(part: Path, place: Path, *, alone: bool = False) -> None:
    """Flush a finished folder to the disk and let it change places with what lies at ``place``, in one step; what lay
    there is ``part`` then. ``alone``: no file of others is there.
    """
    with ThreadPoolExecutor(16) as pool:  # the disk takes many files at once in hardly longer than one
        deque(pool.map(flush, (*part.rglob("*"), part)), maxlen=0)
    if part.parent == place:  # a disk of its own: its folder cannot change its name
        earlier, new = read_manifest(place), _files_in(part)
        known = _files_in(place) if alone else earlier.outputs if earlier else RESULTS
        for name in (*new, *(one.name for one in part.glob(_MANIFEST))):
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (part / name).replace(place / name)
        for name in set(known) - {*new, _MANIFEST}:
            (place / name).unlink(missing_ok=True)
        shutil.rmtree(part)
    elif place.exists() and any(place.iterdir()):
        _exchange(part, place)
    else:
        part.replace(place)
    flush(place.parent)


def _exchange(one: Path, other: Path) -> None:
    """Let two folders change places; where the file system cannot do it at once, in three steps."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    here, exchange = -100, 2  # AT_FDCWD and RENAME_EXCHANGE of renameat2(2): both names change places at once
    if rename is not None and rename(here, os.fsencode(one), here, os.fsencode(other), exchange) == 0:
        return
    aside = one.with_name(f"{one.name}.earlier")
    other.replace(aside)
    one.replace(other)
    aside.replace(one)


def _cleared(folder: Path, *, ours: list[str]) -> Path | None:
    """Remove the files of an earlier run; return the folder in which those that biodance did not write are kept."""
    earlier = read_manifest(folder)
    known = set(earlier.outputs) if earlier else {*ours, *RESULTS}
    for name in known | {_MANIFEST, _LOCK}:
        (folder / name).unlink(missing_ok=True)
    left = _files_in(folder)
    if not left:
        shutil.rmtree(folder)
        return None
    base = folder.name.removeprefix(".").removesuffix(".part")
    names = (f"{base}-kept{number}" for number in ("", *range(2, 10_000)))
    kept = next(path for path in map(folder.with_name, names) if not path.exists())
    folder.replace(kept)
    return kept


def results_folder(out: str | Path, session: str | Path, *, force: bool = False) -> ResultsFolder:
    """Return where the results of a session are written, before they take their place.

    ``force`` allows a place that holds results of an earlier run (a results.json or report.html); all of them are
    replaced, and files that are not of biodance are kept beside it.

    Raises
    ------
    SessionRefused
        Another run is writing there; the place is the session folder or one above it, is a file, holds recordings,
        holds anything at all without ``force``, or holds only files that biodance did not write.
    """
    session = Path(os.path.realpath(session))  # unlike Path.resolve, it takes a circle of links
    folder = Path(os.path.realpath(out))
    if folder == session or folder in session.parents:
        raise SessionRefused(
            f"{folder}: results must not lie among the recordings. Give another folder, for example {session}-results."
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
    return ResultsFolder(folder, _taken(folder))


def made_folder(folder: Path) -> Path:
    """Return a folder, made if missing; SessionRefused if it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SessionRefused(
            f"{folder}: cannot be made ({error.strerror or error}). Choose a place where you may write."
        ) from error
    return folder


@contextmanager
def whole_folder(folder: Path, *, over: bool = False) -> Iterator[Path]:
    """Yield a folder beside ``folder`` to write into; when all is written, it is flushed to the disk and takes its
    place in one step. What fails or is stopped leaves ``folder`` as it was.

    ``folder`` must be missing or empty, unless ``over`` allows to replace all of it.

    Raises
    ------
    SessionRefused
        It holds files, is one, another run is writing there, or it cannot be written.
    """
    if folder.exists() and (not folder.is_dir() or (any(folder.iterdir()) and not over)):
        raise SessionRefused(f"{folder}: holds files already and nothing is overwritten. Give another folder.")
    place = Path(os.path.realpath(folder))
    part = _taken(place)
    try:
        with _as_before(folder):
            yield part
            (part / _LOCK).unlink(missing_ok=True)
            put_in_place(part, place, alone=True)
    finally:
        shutil.rmtree(part, ignore_errors=True)


@contextmanager
def _as_before(place: Path) -> Iterator[None]:
    """Say of what the disk refuses that ``place`` is as it was."""
    try:
        yield
    except OSError as error:
        raise SessionRefused(
            f"{place}: cannot be written ({error.strerror or error}). What was there is as before. Make room, or "
            f"choose another place, and run again."
        ) from error


def _taken(place: Path) -> Path:
    """Return the folder in which what takes its ``place`` is made, empty and of this process; SessionRefused where
    another one, still alive, has it.
    """
    part = place / ".part" if os.path.ismount(place) else place.with_name(f".{place.name}.part")
    lock, mine, holder = part / _LOCK, f"{os.getpid()} {platform.node()}", ""
    with suppress(OSError):
        holder = lock.read_text(encoding="ascii", errors="replace")
    if holder and holder != mine and _is_alive(holder):
        raise SessionRefused(
            f"{place}: another run of biodance (process {holder.replace(' ', ' on ')}) is writing there. "
            f"Wait for it, or give another folder; if it is not running any more, delete {part}."
        )
    try:
        shutil.rmtree(part, ignore_errors=True)  # of a run that was killed
        made_folder(part)
        with open(lock, "x", encoding="ascii", errors="replace") as stream:
            stream.write(mine)
    except OSError as error:
        raise SessionRefused(
            f"{place}: cannot be written to ({error.strerror or error}). Choose a place where you may write."
        ) from error
    atexit.register(shutil.rmtree, part, ignore_errors=True)
    return part


def _is_alive(holder: str) -> bool:
    """Return whether the process that a lock names may still run: one of another machine counts as alive."""
    number, _, machine = holder.partition(" ")
    if not number.isdecimal():
        return False
    if machine != platform.node() or os.name == "nt":  # there, signal 0 is no question but Ctrl-C
        return True
    try:
        os.kill(int(number), 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True

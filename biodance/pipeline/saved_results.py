"""What a results folder keeps: body and motions, and software, files and settings to make it all again."""

import json
import os
import platform
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from biodance.body.body import Body, read_body
from biodance.errors import FileRefused, SessionRefused, TrialRefused
from biodance.lab.plain_text import whole_file
from biodance.lab.plates.faults import PlateCorrection, corrected_trial
from biodance.lab.prepare import motion_filter
from biodance.lab.session.read import read_session, visit_words
from biodance.lab.session.results_folder import doubt_about, read_manifest, refuse_mixture
from biodance.library import refuse_large
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial import TrialResult, attempt, compare_wrenches, contact_of, prepare_trial
from biodance.records import Array, Motion, Session, Trial
from biodance.records.motion import BY_FRAME
from biodance.settings import Value
from biodance.version import __version__, commit

LIBRARIES = (
    *("numpy", "scipy", "numba", "llvmlite", "pin", "cvxpy", "clarabel"),
    *("pandas", "ezc3d", "trimesh", "pyvista", "matplotlib"),
)
_UNKNOWN = "unknown"


def now() -> str:
    """Return the present UTC time to the second, ISO 8601."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def blas() -> str:
    """Return which BLAS numpy was built with, and the kernels of all that are loaded, where that can be asked."""
    from threadpoolctl import threadpool_info

    built = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    said = f"{built.get('name', _UNKNOWN)} {built.get('version', '')}".strip()
    loaded = [one for one in threadpool_info() if one.get("user_api") == "blas"]
    kernels = {f"({one.get('architecture', _UNKNOWN)}, threads: {one['num_threads']})" for one in loaded}
    return " ".join([said, *sorted(kernels)])


def provenance(result: SessionResult, *, created: str) -> dict[str, Any]:
    """Return which software made a ``result``, from which files, with which settings.

    ``created_utc`` (see `now`) is the only thing that differs when the same software runs again on the same files and
    machine; ``commit`` of biodance, "unknown" in an installed wheel, with "+changed" where files differ from it;
    ``versions`` library -> version; ``blas`` that numpy multiplies matrices with; ``inputs_sha256`` by file name;
    ``settings`` dotted key -> value, all of them; ``visit`` the ``date``, ``lab``, ``operator`` and ``condition`` of
    the session, "" where nobody says.
    """
    versions = {"biodance": __version__, "python": platform.python_version()}
    for name in LIBRARIES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    inputs, folder = {}, result.session.folder
    for source in (trial.trial.source for trial in result.trials):
        inside = source.path.is_relative_to(folder)
        inputs[source.path.relative_to(folder).as_posix() if inside else source.path.name] = source.sha256
    return {
        "created_utc": created,
        "commit": commit(),
        "versions": versions,
        "blas": blas(),
        "inputs_sha256": inputs,
        "settings": result.settings.as_dict(),
        "visit": visit_words(folder, [trial.name for trial in result.trials]),
    }


BODY_FILE = "body.json"
"""File in which `biodance identify` and `report` keep the identified body."""
SCALED = "scaled_body.json"
"""The same where nothing was identified: scaled, with the table's parameters; nobody's earlier body (``--body``)."""
MOTIONS = "motions.npz"
"""File in which they keep the motions, and where the recordings lie."""
_TEXTS = ("marker_names", "notes", "joint_names")


@dataclass(frozen=True, eq=False)
class KeptResults:
    """A results folder as read: ``body`` with ``source`` in words; ``motions`` by trial; ``hashes`` of the recordings
    by trial, what their ``loads`` sum to after preparing (N·s, N·m·s), and their ``cutoffs`` (Hz); the ``corrections``
    that were made to plates before the body was fitted; ``session`` folder of the recordings, whose ``settings`` were
    chosen.
    """

    body: Body
    source: str
    motions: dict[str, Motion]
    hashes: dict[str, str]
    loads: dict[str, Array]
    cutoffs: dict[str, float]
    corrections: tuple[PlateCorrection, ...]
    session: Path
    settings: Mapping[str, Value]


def keep_motions(result: SessionResult, folder: Path) -> Path | None:
    """Write the motions of all trials into a results folder; return the path, None where there are none."""
    moved = [one for one in result.trials if one.motion is not None]
    if not moved:
        return None
    held: dict[str, np.ndarray] = {"session": np.array(os.path.relpath(result.session.folder, folder))}
    held["trials"] = np.array([one.name for one in moved])
    held["hashes"] = np.array([one.trial.source.sha256 for one in moved])
    held["loads"] = np.array([_load(one.trial) for one in moved])
    held["cutoffs"] = np.array([motion_filter(one.trial.settings).cutoff for one in moved])
    held["corrections"] = np.array(json.dumps([asdict(one) for one in result.corrections]))
    held["settings"] = np.array(json.dumps(result.settings.as_dict()))
    for k, one in enumerate(moved):
        held |= {f"{k}.{name}": np.asarray(getattr(one.motion, name)) for name in BY_FRAME}
        held |= {f"{k}.{name}": np.array(getattr(one.motion, name), dtype=str) for name in _TEXTS}
    with whole_file(folder / MOTIONS, over=True) as part:
        np.savez(part, **held)  # type: ignore[arg-type]
    return folder / MOTIONS


def kept_body(folder: Path) -> Path:
    """Return the file with the body of a results folder, which may itself be that file; it need not exist."""
    if folder.is_file():
        return folder
    return next((folder / name for name in (BODY_FILE, SCALED) if (folder / name).is_file()), folder / BODY_FILE)


def read_kept_body(folder: Path) -> tuple[Body, str]:
    """Return the body of a results folder, or of a body.json, and where it comes from in words. Raises FileRefused: the
    file is no body, or not the one that the run of the folder wrote.
    """
    if folder.is_dir():
        refuse_mixture(folder, (BODY_FILE, SCALED))
    return read_body(kept_body(folder))


def known_body(body: Body | str | Path | None) -> Body | None:
    """Return an earlier body: as given, or of a body.json or the folder that holds one; None without one. Raises
    FileRefused: the file is no body.
    """
    if body is None or isinstance(body, Body):
        return body
    path = Path(body)
    if (path / BODY_FILE).is_file():
        return read_kept_body(path)[0]
    return read_body(path / BODY_FILE if path.is_dir() else path)[0]


def read_kept(folder: Path) -> KeptResults:
    """Return what a results folder keeps.

    Raises
    ------
    SessionRefused
        It keeps no motions: it was made by an earlier version, or no trial gave one.
    FileRefused
        A file in it is none of biodance's, or not of the run that wrote the others.
    """
    body, source = read_kept_body(folder)
    if not (folder / MOTIONS).is_file():
        raise SessionRefused(f"{folder}: holds a body and no trial. Give the session folder instead.")
    refuse_mixture(folder, (MOTIONS,))
    try:
        # bytes, unpacked: eight hours of movement at 200 Hz
        refuse_large(folder / MOTIONS, 2**33)
        with open(folder / MOTIONS, "rb") as stream, np.load(stream, allow_pickle=False) as held:
            motions = {str(name): _motion(held, k) for k, name in enumerate(held["trials"])}
            hashes = dict(zip(motions, (str(one) for one in held["hashes"]), strict=True))
            loads = dict(zip(motions, held["loads"], strict=True))
            cutoffs = dict(zip(motions, map(float, held["cutoffs"]), strict=True))
            corrections = tuple(PlateCorrection(**one) for one in json.loads(str(held["corrections"])))
            session = Path(os.path.normpath(folder / str(held["session"])))
            settings = json.loads(str(held["settings"]))
    except FileRefused:
        raise
    except (BadZipFile, EOFError, OSError, ValueError, TypeError, KeyError, MemoryError, zlib.error) as error:
        raise FileRefused(f"{folder / MOTIONS}: is no file of motions ({error}). Run the session again.") from error
    manifest = read_manifest(folder)
    if manifest and not session.is_dir():  # the results were moved, the recordings were not
        session = Path(manifest.session)
    return KeptResults(body, source, motions, hashes, loads, cutoffs, corrections, session, settings)


def doubt_told(folder: Path, written: Path, said: str) -> tuple[Path, str]:
    """Return what was ``written`` and is ``said``, with files of its folder that are not as their run left them."""
    doubt = doubt_about(folder)
    return written, f"{said} What is exported is of its run, but look: {doubt}" if doubt else said


def _load(trial: Trial) -> Array:
    """Return the sum (6,) of a prepared trial's wrench over time; zeros without plates."""
    return np.nansum(trial.wrench.value, axis=0) if trial.plates else np.zeros(6)


def _motion(held: "np.lib.npyio.NpzFile", k: int) -> Motion:
    arrays: dict[str, Any] = {name: held[f"{k}.{name}"] for name in BY_FRAME}
    texts: dict[str, Any] = {name: tuple(str(one) for one in held[f"{k}.{name}"]) for name in _TEXTS}
    return Motion(**arrays, **texts)


def kept_trials(
    kept: KeptResults, names: tuple[str, ...], *, subject: str | None = None
) -> tuple[Session, tuple[TrialResult, ...]]:
    """Return the session of a results folder as read, and trials with their recordings prepared again; nothing is
    tracked or identified.

    Raises
    ------
    SessionRefused
        The recordings are not where they were.
    TrialRefused
        A recording is not the one that the motion was found in.
    """
    if not kept.session.is_dir():
        raise SessionRefused(
            f"{kept.session}: the recordings that these results come from are not there. Put them back, or give the "
            f"session folder."
        )
    session = read_session(kept.session, subject_name=subject, settings=kept.settings)
    return session, tuple(_again(session[name], kept, name) for name in names)


def _again(trial: Trial, kept: KeptResults, name: str) -> TrialResult:
    if trial.source.sha256 != kept.hashes[name]:
        raise TrialRefused(
            f"Trial {name}: {trial.source.path} has changed since the results were made. Run the session again."
        )
    trial = corrected_trial(trial, kept.corrections)
    filtered = replace(trial, settings=trial.settings.changed({"filter.cutoff": kept.cutoffs[name]}))
    ready, motion = prepare_trial(filtered), kept.motions[name]
    # the same recording, corrected and filtered alike, sums to the same wrench unless more was undone in it
    if not np.allclose(_load(ready.trial), kept.loads[name], rtol=1e-6, atol=1e-3):
        raise TrialRefused(
            f"Trial {name}: its plates were corrected when the results were made (a lab.toml, or a fault that was "
            "undone). Give the session folder."
        )
    one = TrialResult(ready.trial, ready.steps, motion=motion)
    contact = contact_of(one, kept.body)
    if contact is None:
        return one
    return replace(
        one, comparison=attempt([], "compare", lambda: compare_wrenches(ready.trial, kept.body, motion, contact))
    )

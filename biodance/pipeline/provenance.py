"""Which software made a result, from which files, with which settings: enough to make it again."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from biodance import __version__
from biodance.pipeline.results import SessionResult

LIBRARIES = ("numpy", "scipy", "pin", "ezc3d", "cvxpy", "clarabel", "matplotlib")


@dataclass(frozen=True)
class Provenance:
    """``created`` UTC time, ISO 8601: the only thing that differs when the same software runs again on the same files; ``versions``
    library -> version; ``inputs`` file name -> sha256; ``settings`` name -> value.
    """

    created: str
    versions: Mapping[str, str]
    inputs: Mapping[str, str]
    settings: Mapping[str, str]

    def as_dict(self) -> dict[str, Any]:
        """Return all fields as plain dictionaries."""
        return {
            "created_utc": self.created,
            "versions": dict(self.versions),
            "inputs_sha256": dict(self.inputs),
            "settings": dict(self.settings),
        }


def now() -> str:
    """Return the present UTC time to the second, ISO 8601."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _version(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:
        return "not installed"


def _name(path: Path, folder: Path) -> str:
    """Return the file's path inside the session folder; its name alone where it lies elsewhere."""
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else path.name


def provenance(result: SessionResult, *, created: str) -> Provenance:
    """Collect the provenance of ``result``; ``created`` is the UTC time to write into it (see `now`)."""
    versions = {"biodance": __version__, "python": platform.python_version(), **{name: _version(name) for name in LIBRARIES}}
    inputs = {_name(trial.trial.source.path, result.session.folder): trial.trial.source.sha256 for trial in result.trials}
    return Provenance(created, versions, inputs, dict(result.settings))

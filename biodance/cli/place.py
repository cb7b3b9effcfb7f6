"""Putting results in place: whole, bound to the recordings that they come from."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from biodance.cli.app import say

if TYPE_CHECKING:
    from biodance.lab.session.results_folder import ResultsFolder
    from biodance.records import Session


def put_session_results(place: "ResultsFolder", session: "Session") -> Path:
    """Put the results of a session in place and return the folder."""
    return put_results(place, session.folder, {trial.source.path: trial.source.sha256 for trial in session.trials})


def put_results(place: "ResultsFolder", source: Path, inputs: Mapping[Path, str]) -> Path:
    """Put results in place, bound to the recordings ``inputs`` (path -> SHA-256) of ``source``, and return the folder;
    say where files went that were there and are not of biodance.
    """
    from biodance.lab.session.results_folder import inputs_of

    kept = place.finish(source, inputs_of(inputs, source))
    if kept is not None:
        say(f"look: files in {place.place} that biodance did not write were kept in {kept}.")
    return place.place

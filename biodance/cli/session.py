"""Commands on a recorded session: inspect, report, identify, export."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from biodance.cli.app import DONE, NEEDS_A_PERSON, NOT_DONE, STOPPED, Force, Json, MarkersFile, Out, app, print_json, progress, say

if TYPE_CHECKING:
    from collections.abc import Callable

    from biodance.pipeline.identification import SessionIdentification
    from biodance.pipeline.results import SessionResult
    from biodance.records import Session


def reported(recording: "Session", folder: Path, tell: "Callable[[str], None]") -> "tuple[SessionResult, dict[str, Any]]":
    """Examine a session and report it into ``folder``; return the result and the content of results.json."""
    from biodance.pipeline.diagnosis import diagnosed
    from biodance.pipeline.session import examine
    from biodance.report.write import write_report

    result = examine(recording, tell=tell)
    found = diagnosed(result, tell=tell) if not result.stopped else None
    tell("writing the page")
    return result, write_report(result, folder, diagnosis=found)


def told(result: "SessionResult", folder: Path, found: "dict[str, Any]", json: bool) -> int:
    """Print what was reported and return the exit code."""
    from rich.console import Console

    from biodance.report.terminal import print_session

    if json:
        print_json(found)
    else:
        print_session(result, Console())
        sys.stdout.write(f"{folder / 'report.html'}\n")
    if result.stopped:
        say(f"Stopped by Ctrl-C: {folder} holds the trials that were done, and names the others.")
        return STOPPED
    return NEEDS_A_PERSON if result.needs_a_person else DONE


def compared(
    session: Path,
    reference: Path | None,
    out: Path,
    *,
    subject: str | None,
    markers: str | None,
    force: bool,
    tell: "Callable[[str], None]",
) -> "tuple[SessionResult, SessionIdentification | None, Path]":
    """Examine a session beside an earlier one of the same person; return what was found, what that one said, and the results' folder.

    What cannot be read or written is said before the long work starts.
    """
    from biodance.lab.results_folder import results_folder
    from biodance.lab.session import read_session
    from biodance.pipeline.session import examine, identified

    earlier = read_session(reference, subject_name=subject, markers=markers, tell=tell) if reference else None
    recording = read_session(session, subject_name=subject, markers=markers, tell=tell)
    folder = results_folder(out, session, force=force)
    before = identified(examine(earlier, tell=tell)) if earlier else None
    return examine(recording, reference=before, tell=tell), before, folder


def _told_identified(result: "SessionResult", folder: Path, found: "dict[str, Any]", json: bool) -> int:
    """Print what was identified and return the exit code."""
    from rich.console import Console

    from biodance.report.terminal import print_identification

    if json:
        print_json(found)
    else:
        print_identification(found, Console())
        sys.stdout.write(f"{folder / 'report.html'}\n")
    return NEEDS_A_PERSON if result.needs_a_person or found["status"] != "solved" else DONE


@app.command
def inspect(*paths: Path, markers: MarkersFile = None, json: Json = False) -> int:
    """Say what is in recordings: markers, gaps, plates, the weight on them, and every decision the readers take.

    Parameters
    ----------
    paths
        Files, or folders whose recordings are all read.
    """
    from rich.console import Console

    from biodance.lab.inspect import inspect_paths
    from biodance.report.terminal import print_inspected

    with progress() as tell:
        records = inspect_paths(paths, markers=markers, tell=tell)
    if json:
        print_json(records)
    else:
        print_inspected(records, Console())
    states = {record["status"] for record in records}
    return NOT_DONE if states == {"refused"} else NEEDS_A_PERSON if states - {"ok"} else DONE


@app.command
def report(
    session: Path, *, out: Out, subject: str | None = None, markers: MarkersFile = None, json: Json = False, force: Force = False
) -> int:
    """Take a session through all stages and write report.html and results.json.

    Parameters
    ----------
    session
        Folder with the static trial and the other trials.
    subject
        The person to report where C3D files hold several; without it a file with several persons is refused and names them.
    """
    from biodance.lab.results_folder import results_folder
    from biodance.lab.session import read_session

    with progress() as tell:
        recording = read_session(session, subject_name=subject, markers=markers, tell=tell)
        folder = results_folder(out, session, force=force)
        result, found = reported(recording, folder, tell)
    return told(result, folder, found, json)


@app.command
def identify(
    session: Path,
    *,
    out: Out,
    reference: Path | None = None,
    subject: str | None = None,
    markers: MarkersFile = None,
    json: Json = False,
    force: Force = False,
) -> int:
    """Identify what every segment weighs, with intervals, validate it on the trials kept, and look for an added mass.

    Parameters
    ----------
    session
        Folder with the static trial and the other trials.
    reference
        An earlier session of the same person without load: a load is then looked for against it instead of the table.
    subject
        The person to identify where C3D files hold several.
    """
    from biodance.pipeline.session import identified
    from biodance.report.write import write_identification

    with progress() as tell:
        result, _, folder = compared(session, reference, out, subject=subject, markers=markers, force=force, tell=tell)
        found = identified(result)
        tell("writing the page")
        document = write_identification(result, found, folder)
    return _told_identified(result, folder, document, json)


@app.command
def export(
    source: Path,
    *,
    format: Annotated[str, Parameter(help="osim, urdf, mjcf, biomod, csv; or trc, mot of one trial.")],
    out: Annotated[Path, Parameter(help="The file to write.")],
    trial: Annotated[str | None, Parameter(help="Name of the trial for trc and mot.")] = None,
    subject: Annotated[str | None, Parameter(help="The person to export where C3D files hold several.")] = None,
    markers: MarkersFile = None,
    force: Annotated[bool, Parameter(name="--force", negative="", help="Replace the file if it exists.")] = False,
) -> int:
    """Write a session, or the results of `biodance identify`, for another program.

    Parameters
    ----------
    source
        Session folder, or folder with the results of `biodance identify`.
    """
    from biodance.pipeline.export import export as write
    from biodance.pipeline.export import replaceable

    with progress() as tell, replaceable(out, force=force) as place:
        _, sentence = write(source, place, format=format, trial=trial, subject=subject, markers=markers, tell=tell)
    say(sentence)
    sys.stdout.write(f"{out}\n")
    return DONE

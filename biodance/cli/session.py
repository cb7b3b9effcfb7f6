"""Commands on a recorded session: inspect, report, identify, settings, export."""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from biodance.cli.app import (
    DONE,
    NEEDS_A_PERSON,
    NOT_DONE,
    STOPPED,
    BodyOption,
    ForceOption,
    JsonOption,
    LabOption,
    MarkersFile,
    OutOption,
    ReferenceOption,
    Set,
    Tables,
    app,
    print_json,
    say,
)
from biodance.cli.progress import progress

if TYPE_CHECKING:
    from collections.abc import Callable

    from biodance.diagnosis.diagnosis import Diagnosis
    from biodance.pipeline.identification import SessionIdentification
    from biodance.pipeline.movement import SessionMovement
    from biodance.pipeline.results import SessionResult
    from biodance.records import Session
    from biodance.uncertainty.tolerances import Tolerances


@dataclass(frozen=True)
class Reading:
    """How a folder is read: the person where files hold several, the marker set that was worn, the settings chosen;
    and what is known from earlier sessions: a reference, a body, the laboratory's file.
    """

    subject: str | None
    markers: str | None
    chosen: tuple[str, ...]
    reference: Path | None = None
    body: Path | None = None
    lab: Path | None = None

    def read(self, folder: Path, tell: "Callable[[str], None]") -> "Session":
        """Return the session in ``folder``."""
        from biodance.lab.session.read import read_session
        from biodance.settings import assignments

        return read_session(
            folder, subject_name=self.subject, markers=self.markers, settings=assignments(self.chosen), tell=tell
        )


def report_session(
    result: "SessionResult",
    folder: Path,
    tell: "Callable[[str], None]",
    *,
    tables: Path | None = None,
    reference: "SessionIdentification | None" = None,
    tolerances: "Tolerances | None" = None,
    for_subject: bool = False,
) -> "tuple[SessionResult, dict[str, Any]]":
    """Report an examined session into ``folder``, as tables into ``tables``, ``for_subject`` with the page for the
    person who was measured; return the result and the content of results.json.
    """
    from biodance.pipeline.diagnosis import diagnosed
    from biodance.pipeline.front_movement import describe_movement
    from biodance.pipeline.session import stopped_before
    from biodance.report.write import write_report, write_subject_page

    moved = describe_movement(result, tell=tell)
    try:
        stopped = result.stopped
        found = None if stopped else diagnosed(result, reference=reference, tolerances=tolerances, tell=tell)
    except KeyboardInterrupt:
        found, result = None, stopped_before(result, "the diagnosis")
    tell("writing the page")
    tabled(result, tables, found.diagnosis if found else None, movement=moved)
    if for_subject:
        write_subject_page(result, folder, diagnosis=found)
    return result, write_report(result, folder, diagnosis=found, movement=moved)


def tabled(
    result: "SessionResult",
    folder: Path | None,
    diagnosis: "Diagnosis | None" = None,
    *,
    movement: "SessionMovement | None" = None,
) -> None:
    """Write the tables of a result into a folder that is ready for them; nothing without one."""
    from biodance.pipeline.tables import session_tables
    from biodance.report.tables import write_tables

    if folder is not None:
        write_tables(session_tables(result, diagnosis, movement), folder)


def ready(tables: Path | None, session: Path, *, force: bool) -> Path | None:
    """Return the folder for tables, made; None where none are wanted."""
    from biodance.report.tables import tables_folder

    return None if tables is None else tables_folder(tables, session, force=force)


def print_reported(result: "SessionResult", folder: Path, found: "dict[str, Any]", json: bool) -> int:
    """Print what was reported and return the exit code."""
    from rich.console import Console

    from biodance.report.terminal import print_session

    if json:
        print_json(found)
    else:
        print_session(result, found["attention"], Console())
        sys.stdout.write(f"{folder / 'report.html'}\n")
    if result.stopped:
        say(f"Stopped by Ctrl-C: {folder} holds the trials that were done, and names the others.")
        return STOPPED
    return NEEDS_A_PERSON if result.needs_a_person else DONE


def examine_with_reference(
    session: Path,
    out: Path,
    options: Reading,
    *,
    force: bool,
    tell: "Callable[[str], None]",
) -> "tuple[SessionResult, SessionIdentification | None, Path]":
    """Examine a session beside an earlier one of the same person; return what was found, what that one said, and the
    results' folder.

    What cannot be read or written is said before the long work starts.
    """
    from biodance.lab.session.results_folder import results_folder
    from biodance.pipeline.carry import known_body, read_lab
    from biodance.pipeline.front import identify
    from biodance.pipeline.session import examine

    lab, known = read_lab(options.lab), known_body(options.body)
    earlier = lab.corrected(options.read(options.reference, tell)) if options.reference else None
    recording = lab.corrected(options.read(session, tell))
    folder = results_folder(out, session, force=force)
    before = identify(earlier, tell=tell) if earlier else None
    return examine(recording, reference=before, known=known, tell=tell), before, folder


def _told_identified(result: "SessionResult", folder: Path, found: "dict[str, Any]", json: bool) -> int:
    """Print what was identified and return the exit code."""
    from rich.console import Console

    from biodance.report.terminal import print_identification

    if json:
        print_json(found)
    else:
        print_identification(found, Console())
        sys.stdout.write(f"{folder / 'report.html'}\n")
    return NEEDS_A_PERSON if result.needs_a_person else DONE


@app.command(name="inspect")
def inspect_command(
    *paths: Path, subject: str | None = None, markers: MarkersFile = None, json: JsonOption = False
) -> int:
    """Say what is in recordings: markers, gaps, plates, the weight on them, and every decision the readers take.

    Parameters
    ----------
    paths
        Files, or folders whose recordings are all read.
    subject
        The person to look at where C3D files hold several.
    """
    from rich.console import Console

    from biodance.lab.inspect import inspect_paths
    from biodance.report.terminal import print_inspected

    with progress() as tell:
        records = inspect_paths(paths, subject=subject, markers=markers, tell=tell)
    if json:
        print_json(records)
    else:
        print_inspected(records, Console())
    states = {record["status"] for record in records}
    return NOT_DONE if states == {"refused"} else NEEDS_A_PERSON if states - {"ok"} else DONE


@app.command(name="report")
def report_command(
    session: Path,
    *,
    out: OutOption,
    reference: ReferenceOption = None,
    body: BodyOption = None,
    lab: LabOption = None,
    subject: str | None = None,
    markers: MarkersFile = None,
    chosen: Set = (),
    tables: Tables = None,
    subject_page: Annotated[
        bool,
        Parameter(name="--subject-page", negative="", help="Also write subject.html, for the person who was measured."),
    ] = False,
    json: JsonOption = False,
    force: ForceOption = False,
) -> int:
    """Take a session through all stages and write report.html and results.json.

    Parameters
    ----------
    session
        Folder with the static trial and the other trials.
    subject
        The person to report where C3D files hold several; without it a file with several persons is refused and names
        them.
    """
    from biodance.pipeline.carry import read_lab

    with progress() as tell:
        options, place = Reading(subject, markers, chosen, reference, body, lab), ready(tables, session, force=force)
        result, before, folder = examine_with_reference(session, out, options, force=force, tell=tell)
        known = read_lab(lab).tolerances
        result, found = report_session(
            result, folder, tell, tables=place, reference=before, tolerances=known, for_subject=subject_page
        )
    return print_reported(result, folder, found, json)


@app.command(name="identify")
def identify_command(
    session: Path,
    *,
    out: OutOption,
    reference: ReferenceOption = None,
    dance: Annotated[
        Path | None, Parameter(name="--dance", help="dance.npz that was shown: says how well it was danced.")
    ] = None,
    body: BodyOption = None,
    lab: LabOption = None,
    urdf: Annotated[
        Path | None, Parameter(help="URDF file of the robot that was recorded instead of a person.")
    ] = None,
    feet: Annotated[str | None, Parameter(help="Links of the robot's right and left foot: RIGHT,LEFT.")] = None,
    subject: str | None = None,
    chosen: Set = (),
    tables: Tables = None,
    markers: MarkersFile = None,
    json: JsonOption = False,
    force: ForceOption = False,
) -> int:
    """Identify what every segment weighs, with intervals, validate it on the trials kept, and look for an added mass.

    Parameters
    ----------
    session
        Folder with the static trial and the other trials; of a robot (--urdf), with encoder tables (CSV or Parquet: s,
        rad) and force plate files.
    subject
        The person to identify where C3D files hold several.
    """
    if urdf is not None or feet is not None:
        persons = {"--reference": reference, "--dance": dance, "--body": body, "--lab": lab, "--subject": subject}
        return _identify_robot(session, out, urdf, feet, {**persons, "--tables": tables}, json=json, force=force)
    from biodance.dance.dance import Dance
    from biodance.pipeline import front
    from biodance.pipeline.front_movement import describe_movement
    from biodance.report.write import write_identification

    with progress() as tell:
        place = ready(tables, session, force=force)
        shown = None if dance is None else Dance.load(dance)
        options = Reading(subject, markers, chosen, reference, body, lab)
        result, _, folder = examine_with_reference(session, out, options, force=force, tell=tell)
        found = front.identify(result, dance=shown)
        result = replace(result, identification=found)
        moved = describe_movement(result, tell=tell)
        tell("writing the page")
        tabled(result, place, movement=moved)
        document = write_identification(result, found, folder, movement=moved)
    return _told_identified(result, folder, document, json)


def _identify_robot(
    recording: Path,
    out: Path,
    urdf: Path | None,
    feet: str | None,
    others: "dict[str, Path | str | None]",
    *,
    json: bool,
    force: bool,
) -> int:
    """Identify a robot instead of a person."""
    from rich.console import Console

    from biodance.errors import BiodanceError
    from biodance.lab.session.results_folder import results_folder
    from biodance.pipeline.dance import named_feet
    from biodance.pipeline.robot import identify_robot
    from biodance.report.robot_write import write_robot
    from biodance.report.terminal import print_identification

    if urdf is None or feet is None:
        raise BiodanceError("A robot is told by both --urdf FILE and --feet RIGHT,LEFT; one of them is missing.")
    given = [name for name, value in others.items() if value is not None]
    if given:
        raise BiodanceError(f"{', '.join(given)} cannot be used with --urdf: they are for sessions of people.")
    with progress() as tell:
        both = named_feet(feet)
        folder = results_folder(out, recording, force=force)
        result = identify_robot(recording, urdf=urdf, feet=both, tell=tell)
        tell("writing the page")
        found = write_robot(result, folder)
    if json:
        print_json(found)
    else:
        print_identification(found, Console())
        sys.stdout.write(f"{folder / 'report.html'}\n")
    return NEEDS_A_PERSON if result.needs_a_person else DONE


@app.command
def settings(session: Path | None = None, *, chosen: Set = (), json: JsonOption = False) -> int:
    """Print everything an analyst may choose: value, unit, meaning and legal range, as it may stand in session.toml.

    Parameters
    ----------
    session
        A session folder, whose session.toml is then followed.
    """
    from biodance.lab.session.file import read_session_file
    from biodance.settings import USUAL, assignments

    found = (read_session_file(session).settings if session else USUAL).changed(assignments(chosen))
    if json:
        print_json([row._asdict() for row in found.all()])
    else:
        sys.stdout.write(found.to_toml())
    return DONE


@app.command(name="export")
def export_command(
    source: Path,
    *,
    format: Annotated[
        str, Parameter(help="osim, urdf, mjcf, biomod, glb, csv; trc, mot, c3d of one trial; opensim: a whole folder.")
    ],
    out: Annotated[Path, Parameter(help="The file to write.")],
    trial: Annotated[str | None, Parameter(help="Name of the trial for trc, mot and c3d.")] = None,
    subject: Annotated[str | None, Parameter(help="The person to export_command where C3D files hold several.")] = None,
    meshes: Annotated[
        Path | None, Parameter(help="Folder with a closed mesh a segment (right_thigh.stl, m) for glb and osim.")
    ] = None,
    markers: MarkersFile = None,
    force: Annotated[bool, Parameter(name="--force", negative="", help="Replace the file if it exists.")] = False,
) -> int:
    """Write a session, or the results of `biodance identify`, for another program.

    Parameters
    ----------
    source
        Session folder, or folder with the results of `biodance identify`; or hoap3, the robot from our own tables.
    """
    from biodance.pipeline.export import export as write
    from biodance.pipeline.export import replaceable

    with progress() as tell, replaceable(out, force=force) as place:
        _, sentence = write(
            source, place, format=format, trial=trial, subject=subject, markers=markers, meshes=meshes, tell=tell
        )
    say(sentence)
    sys.stdout.write(f"{out}\n")
    return DONE

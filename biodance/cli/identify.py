"""The command identify: a person, or a robot."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from biodance.cli.app import (
    DONE,
    NEEDS_A_PERSON,
    NO_ROBOT,
    USUAL_READING,
    Reading,
    Results,
    RobotFile,
    app,
    progress,
    show,
)
from biodance.cli.session import examine_with_reference, exit_code, put_results, put_session_results, tabled

if TYPE_CHECKING:
    from biodance.pipeline.results import SessionResult
    from biodance.pipeline.robot import RobotResult


def examine_robot(
    recording: Path, results: Results, robot: RobotFile, for_people: tuple[str, ...]
) -> "tuple[RobotResult, Path, dict[str, Any]]":
    """Return what a recording says, the folder it is written to, and its numbers; options ``for_people`` are
    refused.
    """
    from biodance.errors import BiodanceError
    from biodance.lab.session.results_folder import results_folder
    from biodance.pipeline.dance import named_feet
    from biodance.pipeline.robot import identify_robot
    from biodance.report.robot_write import write_robot

    urdf, feet = robot.named()
    if for_people:
        raise BiodanceError(f"{', '.join(for_people)} cannot be used with --urdf: they are for sessions of people.")
    with progress() as tell:
        both = named_feet(feet)
        place = results_folder(results.out, recording, force=results.force)
        result = identify_robot(recording, urdf=urdf, feet=both, mend=robot.mend, tell=tell)
        tell("writing the page")
        found = write_robot(result, place.part)
        folder = put_results(place, recording, {})
    results.show_page(folder)
    return result, folder, found


def diagnose_robot(recording: Path, results: Results, robot: RobotFile, for_people: tuple[str, ...]) -> int:
    """Say what about a robot or its laboratory is not as drawn, and return the exit code."""
    from biodance.report.terminal import print_robot_diagnosis

    result, folder, found = examine_robot(recording, results, robot, for_people)
    show(found, print_robot_diagnosis, json=results.json, path=folder / "report.html")
    return NEEDS_A_PERSON if result.needs_a_person else DONE


@app.command(name="identify")
def identify_command(
    session: Path,
    *,
    results: Results,
    reading: Reading = USUAL_READING,
    dance: Annotated[
        Path | None,
        Parameter(name="--dance", help="dance.npz that the person followed; reports how well it was performed."),
    ] = None,
    robot: RobotFile = NO_ROBOT,
) -> int:
    """Identify segment masses with credible intervals, validate them on held-out trials, and search for an added mass.

    Parameters
    ----------
    session
        Session folder: the static trial and the other trials. For a robot (--urdf): encoder tables (CSV or Parquet;
        s, rad) and force plate files.
    """
    if robot.given:
        for_people = (*reading.given(), *_given({"--dance": dance, "--tables": results.tables}))
        return _told_identified(*examine_robot(session, results, robot, for_people), results.json)
    from biodance.dance.dance import Dance
    from biodance.pipeline import front
    from biodance.pipeline.judged_trials import failed_checks
    from biodance.pipeline.movement import describe_movement
    from biodance.report.write import write_identification

    with progress() as tell:
        tables = results.make_tables_folder(session)
        shown = None if dance is None else Dance.load(dance)
        result, _, place = examine_with_reference(session, reading, results, tell, dance=shown)
        found = front.identify(result, dance=shown)
        result = replace(result, identification=found)
        tell("checking units, signs, labels and clocks")
        checks = failed_checks(result)
        moved = describe_movement(result, lab=reading.lab, tell=tell)
        tell("writing the page")
        tabled(result, tables, movement=moved)
        document = write_identification(result, found, place.part, checks=checks, movement=moved)
        folder = put_session_results(place, result.session)
    results.show_page(folder)
    return _told_identified(result, folder, document, results.json)


def _given(options: "dict[str, object]") -> tuple[str, ...]:
    """Return the names of the options that were given."""
    return tuple(name for name, value in options.items() if value is not None)


def _told_identified(result: "SessionResult | RobotResult", folder: Path, found: "dict[str, Any]", json: bool) -> int:
    """Print what was identified and return the exit code."""
    from biodance.report.terminal import print_identification

    show(found, print_identification, json=json, path=folder / "report.html")
    return exit_code(found)

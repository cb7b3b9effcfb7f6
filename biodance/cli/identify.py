"""The command identify: a person, or a robot."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from biodance.cli.app import DONE, NEEDS_A_PERSON, app, print_json
from biodance.cli.options import USUAL_READING, Reading, Results
from biodance.cli.progress import progress
from biodance.cli.session import examine_with_reference, tabled

if TYPE_CHECKING:
    from biodance.pipeline.results import SessionResult
    from biodance.pipeline.robot import RobotResult


@app.command(name="identify")
def identify_command(
    session: Path,
    *,
    results: Results,
    reading: Reading = USUAL_READING,
    dance: Annotated[
        Path | None, Parameter(name="--dance", help="dance.npz that was shown: says how well it was danced.")
    ] = None,
    urdf: Annotated[
        Path | None, Parameter(help="URDF file of the robot that was recorded instead of a person.")
    ] = None,
    feet: Annotated[str | None, Parameter(help="Links of the robot's right and left foot: RIGHT,LEFT.")] = None,
) -> int:
    """Identify what every segment weighs, with intervals, validate it on the trials kept, and look for an added mass.

    Parameters
    ----------
    session
        Folder with the static trial and the other trials; of a robot (--urdf), with encoder tables (CSV or Parquet: s,
        rad) and force plate files.
    """
    if urdf is not None or feet is not None:
        for_people = (*reading.given(), *_given({"--dance": dance, "--tables": results.tables}))
        return _identify_robot(session, results, urdf, feet, for_people)
    from biodance.dance.dance import Dance
    from biodance.pipeline import front
    from biodance.pipeline.front_movement import describe_movement
    from biodance.report.write import write_identification

    with progress() as tell:
        place = results.make_tables_folder(session)
        shown = None if dance is None else Dance.load(dance)
        result, _, folder = examine_with_reference(session, reading, results, tell)
        found = front.identify(result, dance=shown)
        result = replace(result, identification=found)
        moved = describe_movement(result, tell=tell)
        tell("writing the page")
        tabled(result, place, movement=moved)
        document = write_identification(result, found, folder, movement=moved)
    return _told_identified(result, folder, document, results.json)


def _given(options: "dict[str, object]") -> tuple[str, ...]:
    """Return the names of the options that were given."""
    return tuple(name for name, value in options.items() if value is not None)


def _identify_robot(
    recording: Path, results: Results, urdf: Path | None, feet: str | None, for_people: tuple[str, ...]
) -> int:
    """Identify a robot instead of a person; options ``for_people`` are refused."""
    from biodance.errors import BiodanceError
    from biodance.lab.session.results_folder import results_folder
    from biodance.pipeline.dance import named_feet
    from biodance.pipeline.robot import identify_robot
    from biodance.report.robot_write import write_robot

    if urdf is None or feet is None:
        raise BiodanceError("A robot is told by both --urdf FILE and --feet RIGHT,LEFT; one of them is missing.")
    if for_people:
        raise BiodanceError(f"{', '.join(for_people)} cannot be used with --urdf: they are for sessions of people.")
    with progress() as tell:
        both = named_feet(feet)
        folder = results_folder(results.out, recording, force=results.force)
        result = identify_robot(recording, urdf=urdf, feet=both, tell=tell)
        tell("writing the page")
        found = write_robot(result, folder)
    return _told_identified(result, folder, found, results.json)


def _told_identified(result: "SessionResult | RobotResult", folder: Path, found: "dict[str, Any]", json: bool) -> int:
    """Print what was identified and return the exit code."""
    from rich.console import Console

    from biodance.report.terminal import print_identification

    if json:
        print_json(found)
    else:
        print_identification(found, Console())
        sys.stdout.write(f"{folder / 'report.html'}\n")
    return NEEDS_A_PERSON if result.needs_a_person else DONE

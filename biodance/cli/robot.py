"""A robot instead of a person: what identify and diagnose do with --urdf."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from biodance.cli.app import DONE, NEEDS_A_PERSON, print_json
from biodance.cli.options import Results, RobotFile
from biodance.cli.progress import progress

if TYPE_CHECKING:
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
        folder = results_folder(results.out, recording, force=results.force)
        result = identify_robot(recording, urdf=urdf, feet=both, mend=robot.mend, tell=tell)
        tell("writing the page")
        found = write_robot(result, folder)
    results.show_page(folder)
    return result, folder, found


def diagnose_robot(recording: Path, results: Results, robot: RobotFile, for_people: tuple[str, ...]) -> int:
    """Say what about a robot or its laboratory is not as drawn, and return the exit code."""
    from rich.console import Console

    from biodance.report.terminal import print_robot_diagnosis

    result, folder, found = examine_robot(recording, results, robot, for_people)
    if results.json:
        print_json(found)
    else:
        print_robot_diagnosis(found, Console())
        sys.stdout.write(f"{folder / 'report.html'}\n")
    return NEEDS_A_PERSON if result.needs_a_person else DONE

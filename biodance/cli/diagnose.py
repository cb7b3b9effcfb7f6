"""The commands that ask what is wrong and what a body weighs: foresee, diagnose, identify; of a person, or a robot."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from biodance.cli import shared
from biodance.cli.session import exit_code, follow_with_reference, put_results, put_session_results

if TYPE_CHECKING:
    from biodance.pipeline.results import SessionResult
    from biodance.pipeline.robot import RobotResult


@shared.app.command(name="foresee")
def foresee_command(
    dance: Path,
    *,
    out: Annotated[Path | None, Parameter(help="Also write the forecast as a page, e.g. foresee.html.")] = None,
    json: shared.JsonOption = False,
    force: shared.ForceOption = False,
) -> int:
    """Predict, before recording, what a designed dance can detect: the detection limit of every cause, which causes it
    cannot tell apart, and what to change so that it detects more.

    Parameters
    ----------
    dance
        The dance.npz written by `biodance dance`, or its folder.
    """
    from biodance.pipeline.dance import foresee_dance, plate_sentence
    from biodance.report.files import refuse_page, write_files
    from biodance.report.pages.diagnosis import foresight_page
    from biodance.report.tables.diagnosis import foresight_document
    from biodance.report.terminal import print_foresight

    with shared.progress() as tell:
        tell("foreseeing what the dance will see")
        if out is not None:
            refuse_page(out, force=force)
        found, one, known = foresee_dance(dance)
        seated = any(stance.seat for stance in one.stances)
        document = foresight_document(found, seated=seated, plates=plate_sentence(one), known=known)
        if out is not None:
            page = foresight_page(document, f"the dance “{one.protocol}”" if one.protocol else "the dance")
            write_files(out.parent, {out.name: page})
    shared.show(document, print_foresight, json=json)
    return shared.DONE


@shared.app.command(name="diagnose")
def diagnose_command(
    session: Path,
    *,
    results: shared.Results,
    reading: shared.Reading = shared.USUAL_READING,
    accept: Annotated[
        bool,
        Parameter(
            help="Also apply the findings that are proven to make data that were not used fit better, and write the "
            "result: body.json, lab.toml and corrected trials. The recordings themselves are not changed."
        ),
    ] = False,
    robot: shared.RobotFile = shared.NO_ROBOT,
) -> int:
    """Diagnose why measured and simulated ground forces differ: the causes, their sizes with uncertainty, possible
    alternatives, and how much of the residual each cause explains.

    Parameters
    ----------
    session
        Session folder: the static trial and the other trials. For a robot (--urdf): as for `biodance identify`.
    """
    if robot.given:
        for_people = (*reading.given(), *(["--accept"] if accept else []), *(["--tables"] if results.tables else []))
        from biodance.report.robot import print_robot_diagnosis

        told, folder, document = examine_robot(session, results, robot, for_people)
        shared.show(document, print_robot_diagnosis, json=results.json, path=folder / "report.html")
        return shared.NEEDS_A_PERSON if told.needs_a_person else shared.DONE
    from biodance.pipeline import front
    from biodance.pipeline.lab_file import read_lab
    from biodance.pipeline.load import as_diagnosed
    from biodance.pipeline.movement import describe_movement
    from biodance.report.tables.frames import write_session_tables
    from biodance.report.terminal import print_diagnosis
    from biodance.report.write import write_diagnosis

    with shared.progress() as tell:
        tables, carried = results.make_tables_folder(session), read_lab(reading.lab)
        result, before, place = follow_with_reference(session, reading, results, tell)
        recorded, folder = result.session, place.part
        found = front.diagnose(result, reference=before, tolerances=carried.tolerances, tell=tell)
        result = as_diagnosed(found.judged or result, found.diagnosis)
        tell("writing the page")
        moved = describe_movement(result, lab=reading.lab, tell=tell)
        write_session_tables(tables, result, found.diagnosis, movement=moved)
        document = write_diagnosis(result, found, folder, accepted=accept, earlier=carried.corrections, movement=moved)
        folder = put_session_results(place, recorded)
    results.show_page(folder)
    shared.show(document, print_diagnosis, json=results.json, path=folder / "report.html")
    return shared.NEEDS_A_PERSON if document["failures"] else exit_code(document)


def examine_robot(
    recording: Path, results: shared.Results, robot: shared.RobotFile, for_people: tuple[str, ...]
) -> "tuple[RobotResult, Path, dict[str, Any]]":
    """Return what a recording says, the folder it is written to, and its numbers; options ``for_people`` are
    refused.
    """
    from biodance.errors import BiodanceError
    from biodance.lab.session.results_folder import results_folder
    from biodance.pipeline.dance import named_feet
    from biodance.pipeline.robot import identify_robot
    from biodance.report.robot import write_robot

    urdf, feet = robot.named()
    if for_people:
        raise BiodanceError(f"{', '.join(for_people)} cannot be used with --urdf: they are for sessions of people.")
    with shared.progress() as tell:
        both = named_feet(feet)
        place = results_folder(results.out, recording, force=results.force)
        result = identify_robot(recording, urdf=urdf, feet=both, mend=robot.mend, tell=tell)
        tell("writing the page")
        found = write_robot(result, place.part)
        folder = put_results(place, recording, {})
    results.show_page(folder)
    return result, folder, found


@shared.app.command(name="identify")
def identify_command(
    session: Path,
    *,
    results: shared.Results,
    reading: shared.Reading = shared.USUAL_READING,
    dance: Annotated[
        Path | None,
        Parameter(help="dance.npz that the person followed; reports how well it was performed."),
    ] = None,
    method: Annotated[
        Literal["posterior", "paper"],
        Parameter(help="posterior: with intervals; paper: the quadratic programme of Bonnet 2016, beside it."),
    ] = "posterior",
    robot: shared.RobotFile = shared.NO_ROBOT,
) -> int:
    """Identify segment masses with credible intervals, validate them on held-out trials, and search for an added mass.

    Parameters
    ----------
    session
        Session folder: the static trial and the other trials. For a robot (--urdf): encoder tables (CSV or Parquet;
        s, rad) and force plate files.
    """
    if robot.given:
        given = {"--dance": dance, "--tables": results.tables, "--method": None if method == "posterior" else method}
        for_people = (*reading.given(), *(name for name, value in given.items() if value is not None))
        return _told_identified(*examine_robot(session, results, robot, for_people), results.json)
    from biodance.dance.dance import Dance
    from biodance.pipeline.diagnosis import diagnosed_and_corrected
    from biodance.pipeline.front_dance import performance_of
    from biodance.pipeline.judged_trials import failed_checks
    from biodance.pipeline.lab_file import read_lab
    from biodance.pipeline.movement import describe_movement
    from biodance.pipeline.session import by_paper, identification_of
    from biodance.report.tables.frames import write_session_tables
    from biodance.report.write import write_identification

    with shared.progress() as tell:
        tables = results.make_tables_folder(session)
        shown = None if dance is None else Dance.load(dance)
        result, before, place = follow_with_reference(session, reading, results, tell, dance=shown)
        known = read_lab(reading.lab).tolerances
        result, _ = diagnosed_and_corrected(result, reference=before, tolerances=known, tell=tell)
        result = by_paper(result) if method == "paper" else result
        found = identification_of(result)
        if shown is not None:
            found = replace(found, performance=performance_of(result, shown))
            result = replace(result, identification=found)
        tell("checking units, signs, labels and clocks")
        checks = failed_checks(result)
        moved = describe_movement(result, lab=reading.lab, tell=tell)
        tell("writing the page")
        write_session_tables(tables, result, movement=moved)
        document = write_identification(result, found, place.part, checks=checks, movement=moved)
        folder = put_session_results(place, result.session)
    results.show_page(folder)
    return _told_identified(result, folder, document, results.json)


def _told_identified(result: "SessionResult | RobotResult", folder: Path, found: "dict[str, Any]", json: bool) -> int:
    """Print what was identified and return the exit code."""
    from biodance.report.terminal import print_identification

    shared.show(found, print_identification, json=json, path=folder / "report.html")
    return exit_code(found)

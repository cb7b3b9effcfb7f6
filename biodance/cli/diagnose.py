"""The command diagnose: what the simulation of a session gets wrong, and what naming it gains."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from biodance.cli.app import (
    DONE,
    NEEDS_A_PERSON,
    NO_ROBOT,
    USUAL_READING,
    ForceOption,
    JsonOption,
    Reading,
    Results,
    RobotFile,
    app,
    progress,
    show,
)
from biodance.cli.identify import diagnose_robot
from biodance.cli.session import examine_with_reference, exit_code, put_session_results, tabled


@app.command(name="foresee")
def foresee_command(
    dance: Path,
    *,
    out: Annotated[
        Path | None, Parameter(name="--out", help="Also write the forecast as a page, e.g. foresee.html.")
    ] = None,
    json: JsonOption = False,
    force: ForceOption = False,
) -> int:
    """Predict, before recording, what a designed dance can detect: the detection limit of every cause, which causes it
    cannot tell apart, and what to change so that it detects more.

    Parameters
    ----------
    dance
        The dance.npz written by `biodance dance`, or its folder.
    """
    from biodance.pipeline.dance_result import foresee_dance, plate_sentence
    from biodance.report.files import refuse_page, write_files
    from biodance.report.pages.foresight import foresight_page
    from biodance.report.tables.diagnosis import foresight_document
    from biodance.report.terminal import print_foresight

    with progress() as tell:
        tell("foreseeing what the dance will see")
        if out is not None:
            refuse_page(out, force=force)
        found, one = foresee_dance(dance)
        seated = any(stance.seat for stance in one.stances)
        document = foresight_document(found, seated=seated, plates=plate_sentence(one))
        if out is not None:
            page = foresight_page(document, f"the dance “{one.protocol}”" if one.protocol else "the dance")
            write_files(out.parent, {out.name: page})
    show(document, print_foresight, json=json)
    return DONE


@app.command(name="diagnose")
def diagnose_command(
    session: Path,
    *,
    results: Results,
    reading: Reading = USUAL_READING,
    accept: Annotated[
        bool,
        Parameter(
            name="--accept",
            negative="",
            help="Also apply the findings that are proven to make data that were not used fit better, and write the "
            "result: body.json, lab.toml and corrected trials. The recordings themselves are not changed.",
        ),
    ] = False,
    robot: RobotFile = NO_ROBOT,
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
        return diagnose_robot(session, results, robot, for_people)
    from biodance.pipeline import front
    from biodance.pipeline.lab_file import read_lab
    from biodance.pipeline.load import as_diagnosed
    from biodance.pipeline.movement import describe_movement
    from biodance.report.terminal import print_diagnosis
    from biodance.report.write import write_diagnosis

    with progress() as tell:
        tables, carried = results.make_tables_folder(session), read_lab(reading.lab)
        result, before, place = examine_with_reference(session, reading, results, tell)
        recorded, folder = result.session, place.part
        found = front.diagnose(result, reference=before, tolerances=carried.tolerances, accept=accept, tell=tell)
        result = found.mended.result if found.mended is not None else result
        result = as_diagnosed(result, found.diagnosis)
        tell("writing the page")
        moved = describe_movement(result, lab=reading.lab, tell=tell)
        tabled(result, tables, found.diagnosis, movement=moved)
        document = write_diagnosis(result, found, folder, accepted=accept, earlier=carried.corrections, movement=moved)
        folder = put_session_results(place, recorded)
    results.show_page(folder)
    show(document, print_diagnosis, json=results.json, path=folder / "report.html")
    return NEEDS_A_PERSON if document["failures"] else exit_code(document)

"""Commands on a session: report, compare, foresee, diagnose, identify; of a person, or a robot."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from biodance.cli import shared

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from biodance.dance.dance import Dance
    from biodance.lab.session.results_folder import ResultsFolder
    from biodance.pipeline.identification import SessionIdentification
    from biodance.pipeline.results import SessionResult
    from biodance.pipeline.robot import RobotResult
    from biodance.records import Session, Trial
    from biodance.report.write import Wanted
    from biodance.settings import Settings


_Accept = Annotated[
    bool,
    Parameter(
        help="Also apply the findings that are proven to make data that were not used fit better, and write the "
        "result: body.json, lab.toml and corrected trials. The recordings themselves are not changed."
    ),
]
_Danced = Annotated[
    Path | None, Parameter(help="dance.npz that the person followed; reports how well it was performed.")
]


def report_session(
    result: "SessionResult",
    folder: Path,
    tell: "Callable[[str], None]",
    wanted: "Wanted | None" = None,
    *,
    reference: "SessionIdentification | None" = None,
    dance: "Dance | None" = None,
) -> "tuple[SessionResult, dict[str, Any]]":
    """Diagnose a session that was `followed` and write it (`write_session`); stopped by Ctrl-C, without a diagnosis."""
    from biodance.pipeline.diagnosis import diagnosed_and_corrected
    from biodance.pipeline.lab_file import read_lab
    from biodance.pipeline.session import identified, stopped_before
    from biodance.report.write import Wanted, write_session

    found, wanted = None, wanted or Wanted()
    known = read_lab(wanted.lab).tolerances
    try:
        if result.stopped:
            # by Ctrl-C, while trials were followed: what is there is weighed, and nothing more is looked for
            result = identified(result, reference=reference, tell=tell)
        else:
            result, found = diagnosed_and_corrected(result, reference=reference, tolerances=known, tell=tell)
        if dance is not None:
            result = _as_danced(result, dance)
    except KeyboardInterrupt:
        found, result = None, stopped_before(result, "the diagnosis")
    return write_session(result, found, folder, wanted, tell=tell)


def _as_danced(result: "SessionResult", dance: "Dance") -> "SessionResult":
    """Return a session with how well a dance was danced; where nobody knows that, say so and tell all else."""
    from biodance.errors import SessionRefused
    from biodance.pipeline.front_dance import with_performance

    try:
        return with_performance(result, dance)
    except SessionRefused as why:
        shared.say(f"look: {why}")
        return result


def print_reported(result: "SessionResult", folder: Path, found: "dict[str, Any]", json: bool) -> int:
    """Print what was reported and return the exit code."""
    from biodance.report.terminal import print_session

    shared.show(found, partial(print_session, result), json=json, path=folder / "report.html")
    if result.stopped:
        shared.say(f"Stopped by Ctrl-C: {folder} holds the trials that were done, and names the others.")
        return shared.STOPPED
    return exit_code(found)


def _read_dance(file: Path | None) -> "Dance | None":
    """Return the dance that was shown, before the long work starts; None where none was."""
    if file is None:
        return None
    from biodance.dance.dance import Dance

    return Dance.load(file)


def exit_code(found: "dict[str, Any]") -> int:
    """Return the exit code of a document: whether somebody must act on anything that it says must be seen."""
    from biodance.report.tables.diagnosis import asks_nobody

    return shared.DONE if asks_nobody(found["attention"]) else shared.NEEDS_A_PERSON


def follow_with_reference(
    session: Path,
    reading: shared.Reading,
    results: shared.Results,
    tell: "Callable[[str], None]",
    *,
    dance: "Dance | None" = None,
) -> "tuple[SessionResult, SessionIdentification | None, ResultsFolder]":
    """Follow a session beside an earlier one of the same person; return what was found (`followed`), what that one
    said, and the results' folder in the making.

    What cannot be read or written is said before the long work starts, and so is a ``dance`` for which the plates are
    too small.
    """
    from biodance.errors import SessionRefused
    from biodance.lab.session.results_folder import results_folder
    from biodance.pipeline.lab_file import read_lab
    from biodance.pipeline.saved_results import known_body
    from biodance.pipeline.session import followed

    if reading.reference and reading.reference.resolve() == session.resolve():
        raise SessionRefused(f"{session}: is itself the --reference. Give an earlier session of the same person.")
    lab, known = read_lab(reading.lab), known_body(reading.body)
    earlier = lab.corrected(reading.read(reading.reference, tell)) if reading.reference else None
    recording = lab.corrected(reading.read(session, tell))
    place = results_folder(results.out, session, force=results.force)
    before = None
    if dance is not None:
        from biodance.pipeline.dance import plates_too_small

        if why := plates_too_small(dance, recording):
            shared.say(f"look: {why}")
    if earlier is not None:
        from biodance.pipeline.front import identify

        before = identify(earlier, tell=tell)
    return followed(recording, reference=before, known=known, tell=tell), before, place


@shared.app.command(name="report", group=shared.EVERYDAY)
def report_command(
    session: Path,
    *,
    results: shared.Results,
    reading: shared.Reading = shared.USUAL_READING,
    subject_page: Annotated[
        bool,
        Parameter(help="Also write subject.html, a plain-language page for the person measured."),
    ] = False,
    language: Annotated[
        str | None,
        Parameter(help="Write that page in this language: en, de, or the path of a catalogue of your own (*.po)."),
    ] = None,
    dance: _Danced = None,
    accept: _Accept = False,
) -> int:
    """Process a session through all stages and write report.html and results.json.

    Parameters
    ----------
    session
        Session folder: the static trial and the other trials; or one C3D file.
    """
    from biodance.report.pages.language import ENGLISH, read_language
    from biodance.report.write import Wanted

    spoken = language or (ENGLISH if subject_page else None)
    if spoken:
        read_language(spoken)  # what is wrong with it is said before the long work starts
    with shared.progress() as tell:
        tables = results.make_tables_folder(session)
        shown = _read_dance(dance)
        result, before, place = follow_with_reference(session, reading, results, tell, dance=shown)
        wanted = Wanted(tables=tables, lab=reading.lab, for_subject=spoken, accept=accept)
        result, found = report_session(result, place.part, tell, wanted, reference=before, dance=shown)
        folder = put_session(place, result.session)
    results.show_page(folder)
    return print_reported(result, folder, found, results.json)


@shared.app.command(name="compare", group=shared.EVERYDAY)
def compare_command(
    *visits: Path,
    out: shared.OutOption,
    json: shared.JsonOption = False,
    force: shared.ForceOption = False,
) -> int:
    """Compare two or more visits of one person: what changed from the first to the last beyond its uncertainty.

    Parameters
    ----------
    visits
        Session folders of one person, the earliest first.
    """
    from biodance.lab.session.results_folder import results_folder
    from biodance.pipeline.visits import compare_visits, read_visits
    from biodance.report.visits import COMPARE_PAGE, print_compared, write_visits

    with shared.progress() as tell:
        sessions = read_visits(visits, tell=tell)
        for one in sessions:  # the results lie among the recordings of none of them
            place = results_folder(out, one.folder, force=force)
        found = compare_visits(sessions, tell=tell)
        tell("writing the page")
        document = write_visits(found, place.part)
        trials = [trial for one in sessions for trial in one.trials]
        folder = put_results(place, sessions[0].folder, trials)
    shared.show(document, partial(print_compared, found), json=json, path=folder / COMPARE_PAGE)
    return exit_code(document)


def put_results(
    place: "ResultsFolder", source: Path, trials: "Iterable[Trial]" = (), settings: "Settings | None" = None
) -> Path:
    """Put results in place, bound to the recordings of their trials and to settings, and return the folder; say where
    files went that are not biodance's.
    """
    from biodance.lab.session.results_folder import inputs_of

    inputs = {trial.source.path: trial.source.sha256 for trial in trials}
    kept = place.finish(source, inputs_of(inputs, source), settings.as_dict() if settings else {})
    if kept is not None:
        shared.say(f"look: files in {place.place} that biodance did not write were kept in {kept}.")
    return place.place


def put_session(place: "ResultsFolder", session: "Session") -> Path:
    """Put the results of a session in place and return the folder."""
    return put_results(place, session.folder, session.trials, session.settings)


@shared.app.command(name="foresee", group=shared.DANCES)
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


@shared.app.command(name="diagnose", group=shared.ADVANCED)
def diagnose_command(
    session: Path,
    *,
    results: shared.Results,
    reading: shared.Reading = shared.USUAL_READING,
    accept: _Accept = False,
    robot: shared.RobotFile = shared.NO_ROBOT,
) -> int:
    """Diagnose why measured and simulated ground forces differ: the causes, their sizes with uncertainty, possible
    alternatives, and how much of the residual each cause explains.

    Parameters
    ----------
    session
        Session folder: the static trial and the other trials; or one C3D file. For a robot (--urdf): as for `biodance
        identify`.
    """
    if robot.given:
        for_people = (*reading.given(), *(["--accept"] if accept else []), *(["--tables"] if results.tables else []))
        from biodance.report.robot import print_robot_diagnosis

        told, folder, document = examine_robot(session, results, robot, for_people)
        shared.show(document, print_robot_diagnosis, json=results.json, path=folder / "report.html")
        return shared.NEEDS_A_PERSON if told.needs_a_person else shared.DONE
    from biodance.pipeline import front
    from biodance.pipeline.lab_file import read_lab
    from biodance.report.terminal import print_diagnosis
    from biodance.report.write import write_diagnosis

    with shared.progress() as tell:
        tables, carried = results.make_tables_folder(session), read_lab(reading.lab)
        result, before, place = follow_with_reference(session, reading, results, tell)
        found = front.diagnose(result, reference=before, tolerances=carried.tolerances, tell=tell)
        document = write_diagnosis(
            result, found, place.part, accept=carried.corrections if accept else None, tables=tables,
            lab=reading.lab, tell=tell,
        )  # fmt: skip
        folder = put_session(place, result.session)
    results.show_page(folder)
    shared.show(document, print_diagnosis, json=results.json, path=folder / "report.html")
    return shared.NEEDS_A_PERSON if document["failures"] else exit_code(document)


def examine_robot(
    recording: Path, results: shared.Results, robot: shared.RobotFile, for_people: tuple[str, ...]
) -> "tuple[RobotResult, Path, dict[str, Any]]":
    """Return what a recording says, where it is written, and its numbers; refuse options ``for_people``."""
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
        folder = put_results(place, recording)
    results.show_page(folder)
    return result, folder, found


@shared.app.command(name="identify", group=shared.ADVANCED)
def identify_command(
    session: Path,
    *,
    results: shared.Results,
    reading: shared.Reading = shared.USUAL_READING,
    dance: _Danced = None,
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
        Session folder: the static trial and the other trials; or one C3D file. For a robot (--urdf): encoder tables
        (CSV or Parquet; s, rad) and force plate files.
    """
    if robot.given:
        given = {"--dance": dance, "--tables": results.tables, "--method": None if method == "posterior" else method}
        for_people = (*reading.given(), *(name for name, value in given.items() if value is not None))
        return _told_identified(*examine_robot(session, results, robot, for_people), results.json)
    from biodance.pipeline.front import identified_visit
    from biodance.pipeline.lab_file import read_lab
    from biodance.report.write import write_identification

    with shared.progress() as tell:
        tables = results.make_tables_folder(session)
        shown = _read_dance(dance)
        result, before, place = follow_with_reference(session, reading, results, tell, dance=shown)
        known = read_lab(reading.lab).tolerances
        result = identified_visit(result, reference=before, tolerances=known, dance=shown, method=method, tell=tell)
        document = write_identification(result, place.part, tables=tables, lab=reading.lab, tell=tell)
        folder = put_session(place, result.session)
    results.show_page(folder)
    return _told_identified(result, folder, document, results.json)


def _told_identified(result: "SessionResult | RobotResult", folder: Path, found: "dict[str, Any]", json: bool) -> int:
    """Print what was identified and return the exit code."""
    from biodance.report.terminal import print_identification

    shared.show(found, print_identification, json=json, path=folder / "report.html")
    return exit_code(found)

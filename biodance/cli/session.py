"""The commands report and compare, and what the commands on a session share."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from biodance.cli import shared

if TYPE_CHECKING:
    from collections.abc import Callable

    from biodance.dance.dance import Dance
    from biodance.lab.session.results_folder import ResultsFolder
    from biodance.pipeline.identification import SessionIdentification
    from biodance.pipeline.results import SessionResult
    from biodance.records import Session
    from biodance.settings import Value


def report_session(
    result: "SessionResult",
    folder: Path,
    tell: "Callable[[str], None]",
    *,
    tables: Path | None = None,
    reference: "SessionIdentification | None" = None,
    lab: Path | None = None,
    for_subject: str | None = None,
) -> "tuple[SessionResult, dict[str, Any]]":
    """Diagnose a session that was `followed` and write it (`write_session`); stopped by Ctrl-C, without a diagnosis."""
    from biodance.pipeline.diagnosis import diagnosed_and_corrected
    from biodance.pipeline.lab_file import read_lab
    from biodance.pipeline.session import identified, stopped_before
    from biodance.report.write import write_session

    found = None
    try:
        known = read_lab(lab).tolerances
        if result.stopped:
            result = identified(result, reference=reference, tell=tell)
        else:
            result, found = diagnosed_and_corrected(result, reference=reference, tolerances=known, tell=tell)
    except KeyboardInterrupt:
        found, result = None, stopped_before(result, "the diagnosis")
    return write_session(result, found, folder, tables=tables, lab=lab, for_subject=for_subject, tell=tell)


def print_reported(result: "SessionResult", folder: Path, found: "dict[str, Any]", json: bool) -> int:
    """Print what was reported and return the exit code."""
    from biodance.report.terminal import print_session

    shared.show(found, partial(print_session, result), json=json, path=folder / "report.html")
    if result.stopped:
        shared.say(f"Stopped by Ctrl-C: {folder} holds the trials that were done, and names the others.")
        return shared.STOPPED
    return exit_code(found)


def exit_code(found: "dict[str, Any]") -> int:
    """Return the exit code of a document: whether somebody must act on anything that it says must be seen."""
    return shared.DONE if all(row["level"] == "note" for row in found["attention"]) else shared.NEEDS_A_PERSON


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


@shared.app.command(name="report")
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
) -> int:
    """Process a session through all stages and write report.html and results.json.

    Parameters
    ----------
    session
        Session folder: the static trial and the other trials.
    """
    from biodance.report.pages.language import ENGLISH, read_language

    spoken = language or (ENGLISH if subject_page else None)
    if spoken:
        read_language(spoken)  # what is wrong with it is said before the long work starts
    with shared.progress() as tell:
        tables = results.make_tables_folder(session)
        result, before, place = follow_with_reference(session, reading, results, tell)
        result, found = report_session(
            result, place.part, tell, tables=tables, reference=before, lab=reading.lab, for_subject=spoken
        )
        folder = put_session_results(place, result.session)
    results.show_page(folder)
    return print_reported(result, folder, found, results.json)


@shared.app.command(name="compare")
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
        inputs = {trial.source.path: trial.source.sha256 for one in sessions for trial in one.trials}
        folder = put_results(place, sessions[0].folder, inputs)
    shared.show(document, partial(print_compared, found), json=json, path=folder / COMPARE_PAGE)
    return exit_code(document)


def put_session_results(place: "ResultsFolder", session: "Session") -> Path:
    """Put the results of a session in place and return the folder."""
    inputs = {trial.source.path: trial.source.sha256 for trial in session.trials}
    return put_results(place, session.folder, inputs, session.settings.as_dict())


def put_results(
    place: "ResultsFolder", source: Path, inputs: Mapping[Path, str], settings: "Mapping[str, Value] | None" = None
) -> Path:
    """Put results in place, bound to the recordings ``inputs`` (path -> SHA-256) of ``source`` and to the ``settings``,
    and return the folder; say where files went that were there and are not of biodance.
    """
    from biodance.lab.session.results_folder import inputs_of

    kept = place.finish(source, inputs_of(inputs, source), settings or {})
    if kept is not None:
        shared.say(f"look: files in {place.place} that biodance did not write were kept in {kept}.")
    return place.place

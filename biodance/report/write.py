"""Write what was found into a folder: the page for the analyst and the numbers for programs."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from biodance.body.body import body_text
from biodance.diagnosis.diagnosis import Diagnosis, Finding
from biodance.effects import QualityCheck
from biodance.effects.labels_swapped import LabelsSwapped
from biodance.lab.plates.faults import APPLIED, PlateCorrection
from biodance.lab.session.results_folder import made_folder
from biodance.pipeline.accepted import CORRECTED, Written, accepted_corrections, write_corrected, write_mended
from biodance.pipeline.attention import identified_attention, session_attention
from biodance.pipeline.diagnosis import as_diagnosed
from biodance.pipeline.export import body_of_result
from biodance.pipeline.for_subject import account_for
from biodance.pipeline.judged_trials import failed_checks, identified_trials
from biodance.pipeline.lab_file import LAB, lab_text
from biodance.pipeline.movement import SessionMovement, describe_movement
from biodance.pipeline.replay import replay_scene
from biodance.pipeline.results import SessionDiagnosis, SessionResult
from biodance.pipeline.saved_results import BODY_FILE, SCALED, keep_motions, now, provenance
from biodance.pipeline.session import identification_of
from biodance.pipeline.still import stills_of
from biodance.records import Session
from biodance.records.attention import Attention
from biodance.report.files import write_files, write_results
from biodance.report.methods import METHODS, methods_text
from biodance.report.pages.diagnosis import diagnosis_page, diagnosis_section
from biodance.report.pages.movement import movement_section
from biodance.report.pages.session import page
from biodance.report.pages.subject import subject_page
from biodance.report.tables.diagnosis import ATTENTION_ROW, JUDGED_ROW, cause_name, diagnosis_document
from biodance.report.tables.frames import write_session_tables
from biodance.report.tables.identification import CORRECTED_ROW, identification_document
from biodance.report.tables.schema import Row, plain_values
from biodance.report.tables.session import (
    filter_document,
    gait_document,
    movement_document,
    results_document,
)

PAGE, SUBJECT_PAGE, ACCEPTED = "report.html", "subject.html", "accepted"


def write_session(
    result: SessionResult,
    found: SessionDiagnosis | None,
    folder: Path,
    *,
    tables: Path | None = None,
    lab: Path | None = None,
    for_subject: str | None = None,
    drawn: bool = True,
    accept: tuple[PlateCorrection, ...] | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[SessionResult, dict[str, Any]]:
    """Write ``results.json``, ``methods.md`` and, where ``drawn``, ``report.html`` of a session with its diagnosis,
    ``tables``, and a page ``for_subject`` in that language; return the session as it is told, and the numbers.

    With ``accept`` the folder `ACCEPTED` holds what `write_diagnosis` writes: the body beside the page is the one that
    the page tells of, and its motions are of it.
    """
    diagnosis = found.diagnosis if found else None
    result = as_diagnosed(result, diagnosis) if diagnosis else result
    moved = _described(result, diagnosis, tables, lab, tell)
    tell("writing the page" if drawn else "writing")
    if for_subject:
        write_files(folder, {SUBJECT_PAGE: subject_page(account_for(result, found, moved), for_subject)})
    made, first = provenance(result, created=now()), session_attention(result, diagnosis)
    numbers = {
        **results_document(result, made),
        "diagnosis": diagnosis_document(found) if found else None,
        "attention": ATTENTION_ROW.rows(first),
        "judged": JUDGED_ROW.rows(diagnosis.judged if diagnosis else ()),
        **_moved(result, moved),
    }
    # the paragraph on methods says what stands in results.json, so both are made of the same values
    told: dict[str, Any] = plain_values(numbers)
    files = {METHODS: methods_text(told)}
    if drawn:
        files |= {PAGE: _page(result, made, first, found, moved)} | _kept(result, folder)
    if accept is not None and found is not None:
        place = made_folder(folder / ACCEPTED)
        told["accepted"], more = _accepted(found.judged or result, found, place, accept)
        for one in told["accepted"]["written"]:
            one["file"] = f"{ACCEPTED}/{one['file']}"
        write_files(place, more)
    return result, write_results(folder, told, files)


def _described(
    result: SessionResult,
    diagnosis: Diagnosis | None,
    tables: Path | None,
    lab: Path | None,
    tell: Callable[[str], None],
) -> SessionMovement:
    """Write the ``tables`` of a session, where they are wanted, and return what moved in it."""
    moved = describe_movement(result, lab=lab, tell=tell)
    write_session_tables(tables, result, diagnosis, movement=moved)
    return moved


def _moved(result: SessionResult, movement: SessionMovement) -> dict[str, Any]:
    return {
        "filter": filter_document(result),
        "movement": movement_document(movement),
        "gait": gait_document(movement),
    }


def _kept(result: SessionResult, folder: Path) -> dict[str, str]:
    """Write the motions; return the body that belongs to them, for `export`. After a failed fit there is none."""
    fit = result.identification
    # the motions are of the body beside them: without one that is believed neither is of use to `export`
    if result.body is None or (fit is not None and fit.status != "solved"):
        return {}
    keep_motions(result, folder)
    return {BODY_FILE if fit is not None else SCALED: body_text(*body_of_result(result))}


def write_identification(
    result: SessionResult,
    folder: Path,
    *,
    tables: Path | None = None,
    lab: Path | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Write ``report.html``, ``results.json`` with the identification alone, ``body.json``, the identified body, and
    ``tables``; return the numbers. Checks of the recordings that failed are said first.

    After a failed fit there is no ``body.json``.
    """
    found = identification_of(result)
    tell("checking units, signs, labels and clocks")
    made, first = provenance(result, created=now()), identified_attention(result, failed_checks(result))
    moved = _described(result, None, tables, lab, tell)
    tell("writing the page")
    numbers = {
        "session": result.session.folder.name,
        "attention": ATTENTION_ROW.rows(first),
        "judged": JUDGED_ROW.rows(identified_trials(result)),
        **identification_document(found),
        "corrected": CORRECTED_ROW.rows(found.corrected),
        **_moved(result, moved),
        "provenance": made,
    }
    told: dict[str, Any] = plain_values(numbers)
    page = _page(result, made, first, None, moved)
    return write_results(folder, told, {METHODS: methods_text(told), PAGE: page} | _kept(result, folder))


def write_diagnosis(
    result: SessionResult,
    found: SessionDiagnosis,
    folder: Path,
    *,
    accept: tuple[PlateCorrection, ...] | None = None,
    tables: Path | None = None,
    lab: Path | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Write ``report.html``, ``results.json`` and ``tables`` of a diagnosis, and return the numbers.

    With ``accept``, the corrections made earlier, also what follows from the findings that are proven to gain:
    ``body.json``, ``lab.toml`` (with the earlier ones), the trials corrected, and copies of recordings with their
    labels put right.
    """
    result = as_diagnosed(found.judged or result, found.diagnosis)
    moved, made = _described(result, found.diagnosis, tables, lab, tell), provenance(result, created=now())
    tell("writing the page")
    numbers = {
        "session": result.session.folder.name,
        **diagnosis_document(found),
        **_moved(result, moved),
        "failures": {**result.failures, **found.failures},
        "provenance": made,
    }
    files = {PAGE: diagnosis_page(result, found, made)}
    if accept is not None:
        numbers["accepted"], more = _accepted(result, found, folder, accept)
        files |= more
    return write_results(folder, numbers, files)


def _accepted(
    result: SessionResult, found: SessionDiagnosis, folder: Path, earlier: tuple[PlateCorrection, ...]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Write what is proven: corrected trials, copies; return acceptance in words, and files left to write."""
    name, undone = f"session {result.session.folder.name}", found.mended.checks if found.mended else ()
    findings, proven = _not_put_right(found, undone), found.gain is not None and found.gain.proven
    copied, kept = write_mended(result.session, found.mended, folder) if found.mended else ((), ())
    made = accepted_corrections((one for one in findings if one.gain and one.gain.proven), name)
    files = _accepted_files(found if proven else None, findings, earlier, made, name)
    trials, refused, corrected = _corrected(result.session, undone, made, earlier, folder)
    written = (*copied, *(Written(file, what) for file, (_, what) in files.items()), *corrected)
    left = _not_applied(findings, proven=proven)
    others = {*left, *((one.effect, one.target) for one in made)}
    document = {
        "files": [*sorted(files), *(one.file for one in copied)],
        "corrections": [*dict.fromkeys(f"{one.text} Put right in a copy." for one in undone), *map(str, made)],
        "trials": trials,
        "not_in_recordings": [cause_name(key) for one in findings if (key := (one.effect, one.target)) not in others],
        "refused": [*refused, *kept],
        "written": [one._asdict() for one in written],
        "not_applied": [{"cause": cause_name(names), "why": why} for names, why in left.items()],
    }
    return document, {file: text for file, (text, _) in files.items()}


def _not_put_right(found: SessionDiagnosis, undone: Sequence[QualityCheck]) -> tuple[Finding, ...]:
    """Return the faults that no check put right in a copy already."""
    checks = (*undone, *(check for check in found.diagnosis.checks if check.mended))
    right = {(check.effect, check.target) for check in checks}
    return tuple(one for one in found.diagnosis.faults if (one.effect, one.target) not in right)


def _accepted_files(
    proven: SessionDiagnosis | None,
    findings: Sequence[Finding],
    earlier: tuple[PlateCorrection, ...],
    made: tuple[PlateCorrection, ...],
    name: str,
) -> dict[str, tuple[str, str]]:
    """Return by file its text and what it is: the body of a ``proven`` diagnosis, and the corrections that last."""
    files, body = {}, proven.accepted if proven else None
    if body is not None and body.status == "solved":
        named = ", ".join(cause_name((one.effect, one.target)) for one in findings if one.changes)
        text = body_text(body.identified, f"S{name[1:]}: identified with {named} accepted.")
        files[BODY_FILE] = (text, f"the body identified with {named} accepted")
    if made and (text := lab_text(earlier, made)):
        lasting = "; ".join(str(one) for one in made if one.fault.lasting)
        files[LAB] = (text, f"to be taken off other sessions: {lasting or 'as before'}")
    return files


def _corrected(
    session: Session,
    undone: Iterable[QualityCheck],
    made: tuple[PlateCorrection, ...],
    earlier: tuple[PlateCorrection, ...],
    folder: Path,
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[Written, ...]]:
    """Write the trials as corrected, if anything is; return their names, why others were not written, and what was."""
    put_right = {one.text: one.trials for one in undone if one.effect != LabelsSwapped.name}
    changes = put_right | {str(one): one.trials for one in made}
    if not changes:
        return (), (), ()
    trials, refused = write_corrected(session, earlier, made, folder / CORRECTED, undone=put_right)
    written = [
        Written(f"{CORRECTED}/{APPLIED}", f"says what was taken off: {'; '.join(changes)}"),
        Written(f"{CORRECTED}/session.toml", "subject and roles"),
    ]
    for name in trials:
        own = [text for text, of in changes.items() if not of or name in of]
        told = f"taken off: {'; '.join(own)}" if own else "as read: nothing was taken off"
        written.append(Written(f"{CORRECTED}/{name}.c3d", told))
    return trials, refused, tuple(written)


def _not_applied(findings: tuple[Finding, ...], *, proven: bool) -> dict[tuple[str, str], str]:
    """Return by cause why it was not accepted: corrections go by their own gain, all else by that of all."""
    out = {}
    for one in findings:
        recorded = bool(accepted_corrections((one,), ""))
        if one.gain is not None and one.gain.proven if recorded else proven and one.changes:
            continue
        why = "what it gains on data that were not used is not measured"
        if one.gain:
            low, high = (100 * x for x in one.gain.ci95)
            why = f"on data that were not used it removes {low:.0f} to {high:.0f} % of the difference: no proven gain"
        out[one.effect, one.target] = why
    return out


def _page(
    result: SessionResult,
    made: Row,
    attention: tuple[Attention, ...],
    found: SessionDiagnosis | None,
    moved: SessionMovement,
) -> str:
    return page(
        result, made, attention=attention, diagnosis=diagnosis_section(found) if found else "",
        movement=movement_section(moved), replay=replay_scene(result), stills=stills_of(result),
    )  # fmt: skip

"""Write what was found into a folder: the page for the analyst and the numbers for programs."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from biodance.body.body import body_text
from biodance.diagnosis.diagnosis import Finding
from biodance.effects import QualityCheck
from biodance.effects.labels_swapped import LabelsSwapped
from biodance.lab.plates.faults import APPLIED, PlateCorrection
from biodance.pipeline.accepted import CORRECTED, Written, accepted_corrections, write_corrected, write_mended
from biodance.pipeline.attention import corrected_attention, identified_attention, session_attention
from biodance.pipeline.diagnosis import as_diagnosed
from biodance.pipeline.export import body_of_result
from biodance.pipeline.for_subject import account_for
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.judged_trials import identified_trials
from biodance.pipeline.lab_file import LAB, lab_text
from biodance.pipeline.movement import SessionMovement, describe_movement
from biodance.pipeline.results import SessionDiagnosis, SessionResult
from biodance.pipeline.saved_results import BODY_FILE, SCALED, Provenance, keep_motions, now, provenance
from biodance.pipeline.still import frames_of
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
from biodance.report.tables.schema import plain_values
from biodance.report.tables.session import (
    PROVENANCE_ROW,
    filter_document,
    gait_document,
    movement_document,
    results_document,
)

PAGE, SUBJECT_PAGE = "report.html", "subject.html"


def write_session(
    result: SessionResult,
    found: SessionDiagnosis | None,
    folder: Path,
    *,
    tables: Path | None = None,
    lab: Path | None = None,
    for_subject: str | None = None,
    drawn: bool = True,
    tell: Callable[[str], None],
) -> tuple[SessionResult, dict[str, Any]]:
    """Write what was found in a session, its ``tables``, and a page ``for_subject`` in that language."""
    diagnosis = found.diagnosis if found else None
    result = as_diagnosed(result, diagnosis) if diagnosis else result
    moved = describe_movement(result, lab=lab, tell=tell)
    tell("writing the page" if drawn else "writing")
    write_session_tables(tables, result, diagnosis, movement=moved)
    if for_subject:
        write_files(folder, {SUBJECT_PAGE: subject_page(account_for(result, found, moved), for_subject)})
    return result, write_report(result, folder, diagnosis=found, movement=moved, drawn=drawn)


def write_report(
    result: SessionResult,
    folder: Path,
    *,
    diagnosis: SessionDiagnosis | None = None,
    movement: SessionMovement | None = None,
    drawn: bool = True,
) -> dict[str, Any]:
    """Write ``report.html`` (where ``drawn``), ``methods.md``, ``results.json``; return the latter's content."""
    made = provenance(result, created=now())
    first = (*diagnosis.diagnosis.attention, *corrected_attention(result)) if diagnosis else session_attention(result)
    judged = diagnosis.diagnosis.judged if diagnosis else ()
    numbers = {
        **results_document(result, made),
        "diagnosis": diagnosis_document(diagnosis) if diagnosis else None,
        "attention": ATTENTION_ROW.rows(first),
        "judged": JUDGED_ROW.rows(judged),
        "movement": movement_document(movement),
        "gait": gait_document(movement),
    }
    found: dict[str, Any] = plain_values(numbers)
    files = {METHODS: methods_text(found)}
    if drawn:
        files |= {PAGE: _page(result, made, first, diagnosis, movement)} | _kept(result, folder)
    return write_results(folder, found, files)


def _moved(result: SessionResult, movement: SessionMovement | None) -> dict[str, Any]:
    return {
        "filter": filter_document(result),
        "movement": movement_document(movement),
        "gait": gait_document(movement),
    }


def _kept(result: SessionResult, folder: Path) -> dict[str, str]:
    """Write the motions; return the body that belongs to them, for `export`. After a failed fit there is none."""
    fit = result.identification
    if result.body is None or (fit is not None and fit.status != "solved"):
        return {}
    keep_motions(result, folder)
    return {BODY_FILE if fit is not None else SCALED: body_text(*body_of_result(result))}


def write_identification(
    result: SessionResult,
    found: SessionIdentification,
    folder: Path,
    *,
    checks: tuple[QualityCheck, ...] = (),
    movement: SessionMovement | None = None,
) -> dict[str, Any]:
    """Write ``report.html``, ``results.json`` with the identification alone and ``body.json``, the identified body;
    return the numbers. ``checks`` of the recordings that failed are said first.

    After a failed fit there is no ``body.json``.
    """
    made = provenance(result, created=now())
    first = identified_attention(result, checks)
    numbers = {
        "session": result.session.folder.name,
        "attention": ATTENTION_ROW.rows(first),
        "judged": JUDGED_ROW.rows(identified_trials(result)),
        **identification_document(found),
        "corrected": CORRECTED_ROW.rows(found.corrected),
        **_moved(result, movement),
        "provenance": PROVENANCE_ROW.row(made),
    }
    told: dict[str, Any] = plain_values(numbers)
    page = _page(result, made, first, movement=movement)
    return write_results(folder, told, {METHODS: methods_text(told), PAGE: page} | _kept(result, folder))


def write_diagnosis(
    result: SessionResult,
    found: SessionDiagnosis,
    folder: Path,
    *,
    accepted: bool,
    earlier: tuple[PlateCorrection, ...] = (),
    movement: SessionMovement | None = None,
) -> dict[str, Any]:
    """Write ``report.html`` and ``results.json`` of a diagnosis, and return the numbers.

    With ``accepted`` also what follows from the findings that are proven to gain: ``body.json``, ``lab.toml`` (with the
    corrections made ``earlier``), the trials corrected, and copies of recordings with their labels put right.
    """
    made = provenance(result, created=now())
    numbers = {
        "session": result.session.folder.name,
        **diagnosis_document(found),
        **_moved(result, movement),
        "failures": {**result.failures, **found.failures},
        "provenance": PROVENANCE_ROW.row(made),
    }
    files = {PAGE: diagnosis_page(result, found, made)}
    if accepted:
        numbers["accepted"], more = _accepted(result, found, folder, earlier)
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
    rewritten = (*(one.text for one in undone if one.effect != LabelsSwapped.name), *map(str, made))
    trials, refused = write_corrected(result.session, earlier, made, folder / CORRECTED) if rewritten else ((), ())
    written = (*copied, *(Written(file, what) for file, (_, what) in files.items()), *_of_trials(trials, rewritten))
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


def _of_trials(trials: tuple[str, ...], changes: tuple[str, ...]) -> list[Written]:
    """Return what was written of trials with these ``changes``."""
    told = "; ".join(changes)
    beside = Written(f"{CORRECTED}/{APPLIED}", f"says what was taken off: {told}")
    roles = Written(f"{CORRECTED}/session.toml", "subject and roles")
    return [beside, roles, *(Written(f"{CORRECTED}/{one}.c3d", f"taken off: {told}") for one in trials)] if told else []


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
    made: Provenance,
    attention: tuple[Attention, ...],
    diagnosis: SessionDiagnosis | None = None,
    movement: SessionMovement | None = None,
) -> str:
    told, moved = diagnosis_section(diagnosis) if diagnosis else "", movement_section(movement) if movement else ""
    return page(result, made, attention=attention, diagnosis=told, movement=moved, replay=frames_of(result))

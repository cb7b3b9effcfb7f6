"""Write what was found into a folder: the page for the analyst and the numbers for programs."""

from pathlib import Path
from typing import Any

from biodance.body.body_file import body_text
from biodance.effects import QualityCheck
from biodance.effects.labels_swapped import LabelsSwapped
from biodance.lab.corrections import PlateCorrection
from biodance.pipeline.accepted import CORRECTED, write_corrected, write_mended
from biodance.pipeline.attention import identified_attention, session_attention
from biodance.pipeline.diagnosis import SessionDiagnosis
from biodance.pipeline.export import body_of_result
from biodance.pipeline.for_subject import account_for
from biodance.pipeline.gains import accepted_corrections
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.judged_trials import identified_trials
from biodance.pipeline.lab_file import LAB, lab_text
from biodance.pipeline.movement import SessionMovement
from biodance.pipeline.provenance import Provenance, now, provenance
from biodance.pipeline.results import SessionResult
from biodance.pipeline.saved_results import BODY, SCALED, keep_motions
from biodance.pipeline.session_frames import frames_of
from biodance.records.attention import Attention
from biodance.report.documents.diagnosis import attention_document, diagnosis_document, judged_document
from biodance.report.documents.identification import identification_document
from biodance.report.documents.methods import METHODS, methods_text
from biodance.report.documents.plain import plain_values, to_text
from biodance.report.documents.session import movement_document, provenance_document, results_document
from biodance.report.files import write_files
from biodance.report.pages.diagnosis import diagnosis_page, diagnosis_section
from biodance.report.pages.movement import movement_section
from biodance.report.pages.session import page
from biodance.report.pages.subject import subject_page

PAGE, SUBJECT_PAGE, _NUMBERS = "report.html", "subject.html", "results.json"


def write_report(
    result: SessionResult,
    folder: Path,
    *,
    diagnosis: SessionDiagnosis | None = None,
    movement: SessionMovement | None = None,
    drawn: bool = True,
) -> dict[str, Any]:
    """Write ``report.html`` (where ``drawn``), ``methods.md`` and ``results.json`` into ``folder`` (which exists) and
    return the content of the latter.
    """
    made = provenance(result, created=now())
    first = diagnosis.diagnosis.attention if diagnosis else session_attention(result)
    judged = diagnosis.diagnosis.judged if diagnosis else ()
    numbers = {
        **results_document(result, made),
        "diagnosis": diagnosis_document(diagnosis) if diagnosis else None,
        "attention": attention_document(first),
        "judged": judged_document(judged),
        "movement": movement_document(movement) if movement else None,
    }
    found: dict[str, Any] = plain_values(numbers)
    files = {_NUMBERS: to_text(found), METHODS: methods_text(found)}
    if drawn:
        files |= {PAGE: _page(result, made, diagnosis, movement)} | _kept(result, folder)
    write_files(folder, files)
    return found


def _kept(result: SessionResult, folder: Path) -> dict[str, str]:
    """Write the motions; return the body that belongs to them, for `export`. After a failed fit there is none."""
    fit = result.identification
    if result.body is None or (fit is not None and fit.status != "solved"):
        return {}
    keep_motions(result, folder)
    return {BODY if fit is not None else SCALED: body_text(*body_of_result(result))}


def write_subject_page(result: SessionResult, folder: Path, *, diagnosis: SessionDiagnosis | None = None) -> Path:
    """Write ``subject.html``, the page for the person who was measured, into ``folder`` and return its path."""
    write_files(folder, {SUBJECT_PAGE: subject_page(account_for(result, diagnosis))})
    return folder / SUBJECT_PAGE


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
        "attention": attention_document(first),
        "judged": judged_document(identified_trials(result)),
        **identification_document(found),
        "movement": movement_document(movement) if movement else None,
        "provenance": provenance_document(made),
    }
    told: dict[str, Any] = plain_values(numbers)
    page = _page(result, made, movement=movement, attention=first)
    files = {_NUMBERS: to_text(told), METHODS: methods_text(told), PAGE: page}
    write_files(folder, files | _kept(result, folder))
    return told


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

    With ``accepted`` also what follows from the findings: ``body.json``, ``lab.toml`` (with the corrections made
    ``earlier``) and the trials corrected.
    """
    made = provenance(result, created=now())
    failures = {**result.failures, **found.failures}
    numbers = {
        "session": result.session.folder.name,
        **diagnosis_document(found),
        "movement": movement_document(movement) if movement else None,
        "failures": failures,
        "provenance": provenance_document(made),
    }
    files = {PAGE: diagnosis_page(result, found, made)}
    if accepted:
        numbers["accepted"], more = _accepted(result, found, folder, earlier)
        files |= more
    write_files(folder, {_NUMBERS: to_text(numbers), **files})
    return dict(plain_values(numbers))


def _accepted(
    result: SessionResult, found: SessionDiagnosis, folder: Path, earlier: tuple[PlateCorrection, ...]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Write the corrected trials; return what acceptance gave in words, and the texts of the files that are left to
    write.
    """
    name, findings, files = result.session.folder.name, found.diagnosis.faults, {}
    if found.accepted is not None and found.accepted.status == "solved":
        named = ", ".join(f"{one.effect} {one.target}".strip() for one in findings)
        files[BODY] = body_text(found.accepted.identified, f"Session {name}: identified with {named} accepted.")
    labels = found.mended.checks if found.mended else ()
    undone = {(one.effect, one.target) for one in labels}
    made = accepted_corrections([f for f in findings if (f.effect, f.target) not in undone], f"session {name}")
    if text := lab_text(earlier, made):
        files[LAB] = text
    rewritten = made or any(one.effect != LabelsSwapped.name for one in labels)
    written, refused = write_corrected(result.session, earlier, made, folder / CORRECTED) if rewritten else ((), ())
    mended, kept = write_mended(result.session, found.mended, folder) if found.mended else ((), ())
    exchanged = dict.fromkeys(f"{one.text} Put right in a copy." for one in labels)
    prepared = {(one.effect, one.target) for one in found.diagnosis.checks if one.mended}
    others = {*((one.effect, one.target) for one in made), *undone, *prepared}
    rest = [f"{f.effect} {f.target}".strip() for f in findings if (f.effect, f.target) not in others]
    in_body = BODY in files
    told = {
        "files": [*sorted(files), *mended],
        "corrections": [*exchanged, *(str(one) for one in made)],
        "trials": written,
        "not_in_recordings": rest if in_body else [],
        "refused": [
            *refused,
            *kept,
            *(f"For {one} no file was written: correct it yourself." for one in rest * (not in_body)),
        ],
    }
    return told, files


def _page(
    result: SessionResult,
    made: Provenance,
    diagnosis: SessionDiagnosis | None = None,
    movement: SessionMovement | None = None,
    attention: tuple[Attention, ...] | None = None,
) -> str:
    told = diagnosis_section(diagnosis) if diagnosis else ""
    moved = movement_section(movement) if movement else ""
    attention = diagnosis.diagnosis.attention if diagnosis else attention
    frames = frames_of(result)
    return page(result, made, attention=attention, diagnosis=told, movement=moved, replay=frames)

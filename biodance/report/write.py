"""Write what was found into a folder: the page for the analyst, the numbers for programs, and a paragraph on the
methods with its references, of which each clause says a value of results.json, or goes without it.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from biodance.body.body import body_text
from biodance.diagnosis.diagnosis import Diagnosis, Finding
from biodance.display import cause_in_words, spaced
from biodance.effects import QualityCheck
from biodance.effects.labels_swapped import LabelsSwapped
from biodance.inference.hypotheses import Key
from biodance.lab.plates.faults import APPLIED, PlateCorrection
from biodance.lab.session.results_folder import made_folder
from biodance.pipeline.accepted import CORRECTED, Written, accepted_corrections, write_corrected, write_mended
from biodance.pipeline.attention import identified_attention, session_attention
from biodance.pipeline.diagnosis import as_diagnosed
from biodance.pipeline.export import body_of_result
from biodance.pipeline.judged_trials import failed_checks, identified_trials
from biodance.pipeline.lab_file import LAB, lab_text, read_lab
from biodance.pipeline.movement import SessionMovement, account_for, describe_movement
from biodance.pipeline.results import MendedCopy, SessionDiagnosis, SessionResult
from biodance.pipeline.saved_results import BODY_FILE, SCALED, keep_motions, now, provenance
from biodance.pipeline.session import identification_of
from biodance.pipeline.still import replay_scene, stills_of
from biodance.records import SIDES, Session
from biodance.records.attention import Attention
from biodance.report.files import write_files, write_results
from biodance.report.pages.diagnosis import diagnosis_page, diagnosis_section
from biodance.report.pages.movement import movement_section
from biodance.report.pages.session import page
from biodance.report.pages.subject import subject_page
from biodance.report.tables.diagnosis import ATTENTION_ROW, JUDGED_ROW, cause_name, diagnosis_document
from biodance.report.tables.identification import CORRECTED_ROW, identification_document
from biodance.report.tables.schema import Row, plain_values
from biodance.report.tables.session import (
    filter_document,
    gait_document,
    movement_document,
    results_document,
    write_session_tables,
)
from biodance.report.wording import DIAGNOSED, format_number

METHODS = "methods.md"
REFERENCES: Mapping[str, str] = {
    "Bonnet": "Bonnet V. et al. (2016). IEEE Transactions on Robotics. doi:10.1109/TRO.2016.2583062",
    "Baker": "Baker R. (2001). Gait & Posture 13:1. doi:10.1016/S0966-6362(00)00083-7",
    "Carpentier": "Carpentier J. et al. (2019). IEEE/SICE SII (Pinocchio). doi:10.1109/SII.2019.8700380",
    "Davis": "Davis R. et al. (1991). Human Movement Science 10:575. doi:10.1016/0167-9457(91)90046-Z",
    "de Leva": "de Leva P. (1996). Journal of Biomechanics 29:1223. doi:10.1016/0021-9290(95)00178-6",
    "Harrington": "Harrington M. et al. (2007). Journal of Biomechanics 40:595. doi:10.1016/j.jbiomech.2006.02.003",
    "Robertson": "Robertson D., Dowling J. (2003). J. Electromyogr. Kinesiol. 13. doi:10.1016/S1050-6411(03)00080-4",
    "Wensing": "Wensing P. et al. (2018). IEEE Robotics and Automation Letters 3:60. doi:10.1109/LRA.2017.2729659",
    "Wu": "Wu G. et al. (2002). Journal of Biomechanics 35:543. doi:10.1016/S0021-9290(01)00222-6",
    "Zeni": "Zeni J. et al. (2008). Gait & Posture 27:710. doi:10.1016/j.gaitpost.2007.07.007",
}
"""Short name -> reference, as far as a clause names it."""


@dataclass(frozen=True)
class MethodClause:
    """One clause: ``places`` of results.json whose values it says (``"subject/mass_kg subject/height_m"``); ``say`` a
    format of them, or a function that makes the sentence ("" = there is nothing to say); ``cites`` short names of
    `REFERENCES` by a word that must be in the sentence ("": always).
    """

    places: str
    say: str | Callable[..., str]
    cites: Mapping[str, str] = field(default_factory=dict)

    @property
    def keys(self) -> list[list[str]]:
        """The paths of its values."""
        return [place.split("/") for place in self.places.split()]


def methods_text(document: Mapping[str, Any]) -> str:
    """Return the paragraph as Markdown for the content of a results.json (of report or of identify)."""
    said, cited = [], []
    for clause in CLAUSES:
        # a clause of which any value is not known is left out, with what it cites
        values = [_value(document, path) for path in clause.keys]
        if any(value is None for value in values):
            continue
        sentence = clause.say.format(*values) if isinstance(clause.say, str) else clause.say(*values)
        if sentence:
            said.append(sentence)
            cited += [name for name, word in clause.cites.items() if word in sentence]
    references = "\n".join(f"- {REFERENCES[name]}" for name in sorted(dict.fromkeys(cited)))
    text = f"# Methods\n\n{' '.join(said)}\n"
    return text + (f"\n## References\n\n{references}\n" if references else "")


def _value(document: Mapping[str, Any], path: Sequence[str]) -> Any:
    """Return the value at a path, or None; identification stands at the top of its own results.json."""
    whole = document.get("identification") is None and path[0] == "identification"
    found: Any = document
    for key in path[1:] if whole else path:
        if not isinstance(found, Mapping) or key not in found:
            return None
        found = found[key]
    return found


def _count(some: Any, one: str, many: str | None = None) -> str:
    number = some if isinstance(some, int) else len(some)
    return f"{number} {one if number == 1 else many or one + 's'}"


def _trials(trials: list[dict[str, Any]]) -> str:
    used = [one for one in trials if isinstance(one, dict) and one["status"] != "refused"]
    rates = sorted({f"{one['rate_hz']:g}" for one in used if one["rate_hz"]})
    plates = max((len(one["plates"]) for one in used), default=0)
    told = f"{_count(used, 'trial')} with markers at {' and '.join(rates)} Hz" if rates else _count(used, "trial")
    return f"{told} and {_count(plates, 'force plate')} entered the analysis." if used else ""


def _filter(kind: str, order: float, trials: list[dict[str, Any]]) -> str:
    if not trials:
        return ""
    used = ([one[key] for one in trials] for key in ("markers_hz", "forces_hz"))
    ends = ((min(cutoffs), max(cutoffs)) for cutoffs in used)
    markers, forces = (f"{low:g} Hz" if low == high else f"{low:g} to {high:g} Hz" for low, high in ends)
    both = "" if forces == markers else f" (forces: {forces})"
    own = any(one["chosen_by"] == "trial" for one in trials)
    how = ", in each trial where the filtered markers lie nearest to the path of rigid segments" if own else ""
    words = spaced(kind).replace("butterworth", "Butterworth")
    return (
        f"Joint coordinates and forces were low-pass filtered forwards and backwards ({words}, order {order:g} in each "
        f"direction, {markers}{both}{how})."
    )


def _segments(segments: list[dict[str, Any]], trials: list[str], rank: int, count: int) -> str:
    if not segments:
        return ""
    return (
        f"The inertial parameters of {_count(segments, 'segment')} were identified from the ground reaction wrench of "
        f"{', '.join(trials)} as a Bayesian linear regression with the table as prior, physically consistent by linear "
        f"matrix inequalities (after Bonnet et al., 2016; Wensing et al., 2018); the data reached {rank} of {count} "
        f"base parameters."
    )


def _validated(trials: list[dict[str, Any]]) -> str:
    if not trials:
        return ""
    before, after = (sum(t[kind]["rms"][2] for t in trials) / len(trials) for kind in ("table", "identified"))
    return (
        f"On {_count(trials, 'trial')} not used for the identification the RMS difference of the vertical force was "
        f"{format_number(before, 1)} N with the table and {format_number(after, 1)} N with the identified parameters."
    )


def _movement(trials: list[dict[str, Any]]) -> str:
    kinds = [cycle["kind"] for one in trials for cycle in one["cycles"]]
    words = {"gait": "gait cycle", "squat": "squat", "sit_to_stand": "rise from a chair", "jump": "jump"}
    found = [
        _count(kinds.count(kind), word, "rises from a chair" if kind == "sit_to_stand" else None)
        for kind, word in words.items()
        if kind in kinds
    ]
    if not found:
        return ""
    steps = (
        " Foot events were taken from the force plates (20 N) where a foot stood on one alone, else from the movement "
        f"of the feet relative to the pelvis (after Zeni et al., 2008).{_by_hand(trials)}"
    )
    pelvis = "; the pelvis in the lab follows Baker (2001)" if "gait" in kinds else ""
    return (
        f"Joint angles follow the ISB recommendations (Wu et al., 2002){pelvis}. Curves were normalised to 101 points "
        f"over {', '.join(found)}.{steps if 'gait' in kinds else ''}"
    )


def _by_hand(trials: list[dict[str, Any]]) -> str:
    feet = [
        f"the {side} foot in {one['trial']}"
        for one in trials
        for side in SIDES
        if any(event["side"] == side and event["source"] == "hand" for event in one.get("events", ()))
    ]
    return f" Those of {', of '.join(feet)} were set by hand." if feet else ""


_MOVED = {
    True: "Joint centres were then corrected by the movement where it showed them.",
    False: "Joints were not moved.",
}
CLAUSES: tuple[MethodClause, ...] = (
    MethodClause(
        "provenance/versions/biodance provenance/commit",
        "Recordings were processed with biodance {} (commit {:.12}).",
    ),
    MethodClause("trials", _trials),
    MethodClause(
        "subject/mass_kg subject/height_m",
        "The subject's mass was {:.1f} kg and the stature {:.2f} m.",
    ),
    MethodClause(
        "mass_check/mass_on_plates_kg mass_check/difference_percent",
        "In quiet standing the plates carried {:.1f} kg, {:+.1f} % of the declared mass.",
    ),
    MethodClause(
        "provenance/settings/table provenance/settings/hip",
        lambda table, hip: (
            f"A model of rigid segments was scaled on the static trial; segment masses and inertias were taken from "
            f"the table {table}, hip joint centres from the regression of {hip.title()}."
        ),
        {"de Leva": "de_leva", "Harrington": "Harrington", "Davis": "Davis"},
    ),
    MethodClause("provenance/settings/joints", lambda joints: _MOVED[joints == "functional"]),
    MethodClause(
        "provenance/settings/filter.kind provenance/settings/filter.order filter/trials",
        _filter,
        {"Robertson": "critically damped"},
    ),
    MethodClause(
        "provenance/versions/pin",
        "Rigid-body dynamics were computed with Pinocchio {} (Carpentier et al., 2019).",
        {"Carpentier": ""},
    ),
    MethodClause(
        "identification/segments identification/trials identification/base_parameters/rank "
        "identification/base_parameters/count",
        _segments,
        {"Bonnet": "", "Wensing": ""},
    ),
    MethodClause("identification/validation", _validated),
    MethodClause("movement/trials", _movement, {"Wu": "", "Zeni": "Zeni", "Baker": "Baker"}),
    MethodClause(
        "movement/parameters movement/mass_kg",
        "Joint moments (of the muscles) and powers were computed by inverse dynamics with the {} parameters and "
        "divided by {:.1f} kg.",
    ),
    MethodClause("diagnosis/verdict", lambda one: f"The automatic diagnosis of the recording {DIAGNOSED[one]}."),
)
"""In the order in which they are said."""


PAGE, SUBJECT_PAGE, ACCEPTED = "report.html", "subject.html", "accepted"


@dataclass(frozen=True)
class Wanted:
    """What is wanted of a report: a folder for ``tables``; a laboratory's file ``lab``, whose people are the norm;
    a page ``for_subject`` in that language; the analyst's page, where ``drawn``; and to ``accept`` what is proven: the
    folder `ACCEPTED` then holds what `write_diagnosis` writes, as the body beside the page is the one that the page
    tells of, and its motions are of it.
    """

    tables: Path | None = None
    lab: Path | None = None
    for_subject: str | None = None
    drawn: bool = True
    accept: bool = False


def write_session(
    result: SessionResult,
    found: SessionDiagnosis | None,
    folder: Path,
    wanted: Wanted | None = None,
    *,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[SessionResult, dict[str, Any]]:
    """Write ``results.json``, ``methods.md`` and what is ``wanted`` of a session with its diagnosis; return the session
    as it is told, and the numbers.
    """
    wanted, diagnosis = wanted or Wanted(), found.diagnosis if found else None
    result = as_diagnosed(result, diagnosis) if diagnosis else result
    moved = _described(result, diagnosis, wanted.tables, wanted.lab, tell)
    tell("writing the page" if wanted.drawn else "writing")
    if wanted.for_subject:
        write_files(folder, {SUBJECT_PAGE: subject_page(account_for(result, found, moved), wanted.for_subject)})
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
    if wanted.drawn:
        files |= {PAGE: _page(result, made, first, found, moved)} | _kept(result, folder)
    if wanted.accept and found is not None:
        place = made_folder(folder / ACCEPTED)
        told["accepted"], more = _accepted(found.judged or result, found, place, read_lab(wanted.lab).corrections)
        for one in told["accepted"]["written"]:
            one["file"] = f"{ACCEPTED}/{one['file']}"
        write_files(place, more)
        if not told["accepted"]["written"]:
            place.rmdir()
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
    name, mended = f"session {result.session.folder.name}", found.mended or MendedCopy({}, ())
    unsure, undone = mended.unsure, () if mended.unsure else mended.checks
    findings, proven = _not_put_right(found, mended.checks), found.gain is not None and found.gain.proven and not unsure
    copied, kept = write_mended(result.session, mended, folder)
    made = accepted_corrections((one for one in findings if one.gain and one.gain.proven and not unsure), name)
    files = _accepted_files(found if proven else None, findings, earlier, made, name)
    trials, refused, corrected = _corrected(result.session, undone, made, earlier, folder)
    written = (*copied, *(Written(file, what) for file, (_, what) in files.items()), *corrected)
    others = {*(left := _not_applied(findings, unsure, proven=proven)), *((one.effect, one.target) for one in made)}
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
    right = {(c.effect, c.target) for c in (*undone, *(c for c in found.diagnosis.checks if c.mended))}
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
        named = ", ".join(cause_in_words(one.effect, one.target) for one in findings if one.changes)
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
        own = "; ".join(text for text, of in changes.items() if not of or name in of)
        written.append(
            Written(f"{CORRECTED}/{name}.c3d", f"taken off: {own}" if own else "as read: nothing was taken off")
        )
    return trials, refused, tuple(written)


def _not_applied(findings: tuple[Finding, ...], unsure: Mapping[Key, str], *, proven: bool) -> dict[Key, str]:
    """Return by cause why it was not accepted: corrections go by their own gain, all else by that of all."""
    out = dict(unsure)
    for one in findings:
        recorded = bool(accepted_corrections((one,), ""))
        if not unsure and (one.gain is not None and one.gain.proven if recorded else proven and one.changes):
            continue
        why = "what it gains on data that were not used is not measured"
        if one.gain and not unsure:
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

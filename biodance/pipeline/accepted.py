"""Copies of a session in which faults are undone: corrected trials and labels put right, as accepting the findings
writes them; the copy without faults that are too large for statistics, in which all else is judged, since a large fault
has small companions everywhere; and what accepting changes.

The body is identified again from the corrected trials, and every finding gains on its own what is lost, on data that
were not used, when all findings but this one are accepted. Those data are the trials that were kept; where none was,
each half of the movement, judged with the body that the other half gives. What makes them worse is no repair; where
nobody moves, or the finding changes nothing, they tell nothing of it.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import compress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.accept import Gain, Residuals, accept, case_fit, gain_by_naming, join_residuals, residuals_of
from biodance.diagnosis.consequence import NAMED
from biodance.diagnosis.diagnosis import Finding
from biodance.diagnosis.repairs import failed_check
from biodance.display import cause_in_words, spaced
from biodance.effects import Case, Cause, NamedCause, QualityCheck, Recorded
from biodance.effects.labels_swapped import WORSE, LabelsSwapped, exchanges, named_exchanges, renamed
from biodance.errors import BiodanceError, NotSolved, TrialRefused
from biodance.identification.added_mass import tables_by_sides
from biodance.identification.identification import Identification, identify_body
from biodance.identification.statistics import Fit, standing_point
from biodance.inference.decision import Inferred
from biodance.inference.hypotheses import Key
from biodance.inference.session import is_moving
from biodance.lab.c3d.results import write_exchanged
from biodance.lab.c3d.write import write_trial
from biodance.lab.markers.upright import standing_mass
from biodance.lab.plates import faults
from biodance.pipeline.identification import FITTED_ROLES, KEPT_ROLES, SessionIdentification
from biodance.pipeline.judged_trials import cases_of, recorded_of, windows
from biodance.pipeline.results import MendedCopy, SessionDiagnosis, SessionResult
from biodance.pipeline.session import examine, followed
from biodance.records import Array, Role, Session, Sip, Trial

CORRECTED = "corrected"
"""Folder with the trials that were corrected."""
MENDED = "mended"
"""Folder with the copies of recordings whose exchanged labels were put right."""


class Written(NamedTuple):
    """One ``file`` that accepting has written, its path in the folder of results, and ``what`` was changed in it."""

    file: str
    what: str


def write_corrected(
    session: Session,
    earlier: tuple[faults.PlateCorrection, ...],
    accepted: tuple[faults.PlateCorrection, ...],
    folder: Path,
    *,
    undone: Iterable[str] = (),
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Write the trials of a session without the causes ``accepted`` as C3D into ``folder``, with the session.toml that
    makes them a session; return their names, and why others could not be written.

    Markers and plates are as read (m turned to mm, z up, plates TYPE 2), other analog channels are left out. What was
    corrected ``earlier`` is in ``session`` already, and so is what was ``undone`` in it (a sentence each); `APPLIED`
    says that all of it is off, so that none is corrected twice.
    """
    folder.mkdir()
    said = "".join(f"# {sentence}\n" for sentence in undone)
    text = said + faults.corrections_text(faults.joined_corrections(earlier, accepted))
    (folder / faults.APPLIED).write_text(text, encoding="utf-8", newline="\n")
    (folder / "session.toml").write_text(_session_toml(session), encoding="utf-8", newline="\n")
    written, refused = [], []
    for trial in session.trials:
        try:
            write_trial(faults.corrected_trial(trial, accepted), folder / f"{trial.name}.c3d")
            written.append(trial.name)
        except BiodanceError as error:
            refused.append(f"Trial {trial.name} was not written corrected. {error}")
    return tuple(written), tuple(refused)


def _session_toml(session: Session) -> str:
    """Return what session.toml says of the subject (nothing guessed), an own marker set, plates and trials."""
    subject = session.subject
    # session.toml tells the mass without devices; reading adds them again
    said = {"mass_kg": subject.mass - sum(subject.devices.values()), "height_m": subject.stature, "age": subject.age}
    guessed = {{"mass": "mass_kg", "stature": "height_m"}.get(what, what) for what in subject.guessed}
    lines = ["[subject]", *(f"{key} = {float(x)}" for key, x in said.items() if np.isfinite(x) and key not in guessed)]
    lines += [f'sex = "{subject.sex}"'] * (subject.sex in ("F", "M") and "sex" not in guessed)
    lines += [f'prosthesis = "{subject.prosthesis}"'] * bool(subject.prosthesis)
    lines += ["", "[devices]", *(f"{segment} = {kg}" for segment, kg in subject.devices.items())] * bool(
        subject.devices
    )
    own = {trial.marker_set for trial in session.trials if trial.marker_set.endswith(".toml")}
    for file in own:
        lines += ["", "[markers]", f"file = {json.dumps(str(Path(file).resolve()))}"]
    feet = {f"plate{n}": plate.foot for trial in session.trials for n, plate in enumerate(trial.plates, start=1)}
    for name, foot in feet.items():
        lines += ["", f"[plates.{name}]", f'foot = "{foot}"'] * bool(foot)
    for trial in session.trials:  # what it says of labels is done in the copy
        spans = [[one.start, one.end, *([one.side] if one.side else [])] for one in trial.left_out]
        kinds = {True: "strike", False: "off"}
        events = [f'{{side = "{e.side}", kind = "{kinds[e.down]}", time = {e.time}}}' for e in trial.events]
        lines += ["", f"[trials.{json.dumps(trial.name)}]", f'role = "{trial.role}"']
        lines += [f"leave_out = {json.dumps(spans)}"] * bool(spans)
        lines += [f"events = [{', '.join(events)}]"] * bool(events)
    return "\n".join(lines) + "\n"


def with_right_labels(
    result: SessionResult,
    recorded: Recorded,
    *,
    reference: SessionIdentification | None = None,
    tell: Callable[[str], None],
) -> tuple[SessionResult, MendedCopy] | None:
    """Return the session, ``recorded`` as checks see it, examined again with those labels exchanged that carry each
    other's names, and which; None where none do.

    Proven before it is kept: a trial that the body follows clearly worse with other names (`WORSE`) keeps its own.
    """
    found = recorded.once(exchanges)
    while found:
        tell("examining a copy with the labels exchanged")
        trials = tuple(renamed(trial, found.get(trial.name, {})) for trial in result.session.trials)
        mended = followed(replace(result.session, trials=trials), reference=reference, known=result.placed.known)
        worse = {
            after.name
            for before, after in zip(result.trials, mended.trials, strict=True)
            if before.fit and after.fit and after.fit.total_rms > WORSE * before.fit.total_rms
        } & found.keys()
        # a trial that the body follows worse was no exchange; without it all others are judged anew
        if not worse:
            return mended, MendedCopy(found, named_exchanges(result.session, found))
        found = {name: pairs for name, pairs in found.items() if name not in worse}
    return None


def write_mended(session: Session, right: MendedCopy, folder: Path) -> tuple[tuple[Written, ...], tuple[str, ...]]:
    """Write copies of C3D files, labels put right, else byte by byte, into ``folder``/mended; what, and what not."""
    written, refused = [], []
    for trial in session.trials:
        pairs, file = right.exchanged.get(trial.name, {}), trial.source.path
        if pairs and trial.source.format == "C3D":
            path = write_exchanged(file, folder / MENDED / file.name, pairs)
            written.append(
                Written(f"{MENDED}/{path.name}", f"names exchanged: {', '.join(f'{a} and {b}' for a, b in pairs)}")
            )
        elif pairs:
            refused.append(f"Trial {trial.name} was not written with its labels put right: only C3D files are copied.")
    return tuple(written), tuple(refused)


def _undone(trial: Trial, found: Iterable[tuple[Cause, QualityCheck]]) -> Trial:
    """Return a trial as read without what was found in it."""
    for kind, one in found:
        trial = kind.undone(trial, one) if trial.plates and one.meant(trial) else trial
    return trial


def _without_all(session: Session, found: Iterable[tuple[Cause, QualityCheck]]) -> Session:
    """Return a session as read without what was found in it; a person whom its plates weighed is weighed again."""
    trials, subject = tuple(_undone(trial, found) for trial in session.trials), session.subject
    if "mass" in subject.guessed:
        weighed = map(standing_mass, sorted(trials, key=lambda trial: trial.role != "static"))
        subject = replace(subject, mass=next((mass for mass in weighed if mass is not None), float("nan")))
    return replace(session, trials=trials, subject=subject)


_ROUNDS = 3
"""How often it is looked again: with one fault undone, another one shows."""


def with_faults_undone(
    result: SessionResult,
    chosen: Mapping[str, Cause],
    *,
    reference: SessionIdentification | None,
    tell: Callable[[str], None],
) -> tuple[SessionResult, Recorded, MendedCopy | None]:
    """Return a copy of the session, examined again with its labels put right (`with_right_labels`) and without what the
    checks of the ``chosen`` causes find and can undo (`Checked.undone`); what checks see of it; and what was undone,
    None where the session is as it was.
    """
    recorded, mended = recorded_of(result), MendedCopy({}, ())
    # labels first: under wrong names the body moves as nobody does, and forces seem wrong beside it
    if LabelsSwapped.name in chosen and (right := with_right_labels(result, recorded, reference=reference, tell=tell)):
        result, mended = right
        recorded = recorded_of(result)
    undoing = [kind for kind in chosen.values() if kind.undoes()]
    found: list[QualityCheck] = []
    for _ in range(_ROUNDS):
        known = {(one.effect, one.target, one.trials) for one in found}
        failed = [(kind, one) for kind in undoing for one in recorded.once(kind.check) if not one.ok]
        failed = [pair for pair in failed if any(_undone(t, [pair]) is not t for t in result.session.trials)]
        new = [(kind, one) for kind, one in failed if (one.effect, one.target, one.trials) not in known]
        if not new:
            break
        found += [replace(one, advice=kind.advice) for kind, one in new]
        tell(f"examining a copy without {', '.join(sorted({spaced(one.effect) for _, one in new}))}")
        again = _without_all(result.session, new)
        result = followed(again, reference=reference, known=result.placed.known, earlier=result)
        recorded = recorded_of(result)
    checks = (*mended.checks, *found)
    return result, recorded, replace(mended, checks=checks) if checks else None


_Mend = Callable[[Case], Case]
_Fits = tuple[Fit, ...]
_SAME = 0.01
"""N, N·m: residuals that differ nowhere by more are the same."""


@dataclass(frozen=True, eq=False)
class _Corrected:
    """The body ``identified`` without some causes; what bodies leave of data ``used`` and ``kept`` (None: too few)."""

    identified: Identification
    used: Residuals | None
    kept: Residuals | None


def accepted_corrections(findings: Iterable[Finding], source: str) -> tuple[faults.PlateCorrection, ...]:
    """Return the ``findings`` that can be corrected in recordings, found in ``source``."""
    out = []
    for one in findings:
        fault = faults.PLATE_FAULTS.get(one.effect)
        size = {p.name: p for p in one.parameters}.get(fault.parameter) if fault else None
        if size is not None and np.isfinite(size.value):
            out.append(faults.PlateCorrection(one.effect, one.target, size.value, size.sd, source, one.trials))
    return tuple(out)


_INSIDE = (faults.OFFSET.name, faults.DELAY.name, faults.GAIN.name)
"""Causes that statistics find and that are taken off before the body is fitted: zeros, clocks, gains."""


def with_proven_corrections(
    result: SessionResult,
    diagnosed: SessionDiagnosis,
    *,
    reference: SessionIdentification | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> SessionResult:
    """Return the session examined again without what is proven: what checks undid in the copy that was judged, and the
    zeros, delays and gains that are `proven` in its posterior or known there as tolerances
    (`Inferred.known_tolerances`), each as unsure in the fit as there; a proven limb that is lighter than the other is
    fitted as a declared one. The identification names them all (``corrected``). The same session where there are none;
    what is only suspected stays.
    """
    checks, inferred = diagnosed.mended.checks if diagnosed.mended else (), diagnosed.inferred
    if diagnosed.mended and diagnosed.mended.unsure:
        return result
    undone = tuple(failed_check(one) for one in checks)
    own: tuple[Finding, ...] = ()
    if inferred is not None:
        named = (f for f in inferred.diagnosis.findings if proven(f, inferred.search.prior))
        own = (*named, *(f for f in inferred.known_tolerances() if f.effect in _INSIDE))
    own = tuple(one for one in own if (one.effect, one.target) not in {(c.effect, c.target) for c in checks})
    base = diagnosed.judged or result
    if own:
        tell("identifying without what is proven to be wrong")
        corrections = accepted_corrections(own, f"session {result.session.folder.name}")
        subject = reduce(lambda who, one: one.cause.declared(who, one.target), own, base.session.subject)
        session = replace(base.session, subject=subject)
        base = examine(session, reference=reference, known=result.placed.known, corrections=corrections, earlier=base)
    # where the copy tells no body there is nothing that its corrections could have made better
    if not (undone or own) or base.identification is None:
        return result
    return replace(base, identification=replace(base.identification, corrected=(*undone, *own)))


def proven(one: Finding, prior: Mapping[Key, float]) -> bool:
    """Return whether a finding is taken off before the fit: a zero, a delay, a gain or an unequal limb without which
    data that were not used for it fit better, and which is there with the probability `NAMED` rather than another cause
    of its set (of log ``prior`` probabilities by effect and target).
    """
    if not (one.effect in _INSIDE or one.cause.of_person()) or one.gain is None or not one.gain.proven:
        return False
    # P(this cause) = P(any of the set) x its share of the set, by log Bayes factor + log prior of each member
    logs = np.array([alias.log_bayes_factor + prior.get((alias.effect, alias.target), 0.0) for alias in one.set])
    same = np.array([alias.effect == one.effect for alias in one.set])
    shares = np.exp(logs - logs.max())
    return bool(one.probability * shares[same].sum() / shares.sum() >= NAMED)


def accepted(result: SessionResult, inferred: Inferred, before: Identification | None) -> SessionDiagnosis:
    """Return the diagnosis with what accepting its findings changes against the identification ``before``, None where
    nothing was identified. A finding whose own gain lies wholly at or below zero is taken back, the worst first, and
    the rest accepted again.
    """
    if not inferred.named or before is None:
        return SessionDiagnosis(inferred.diagnosis, inferred, before)
    # one finding less changes the sizes and gains of all others: everything is judged again
    while inferred.diagnosis.findings:
        try:
            found = _accepted(result, inferred, before)
        except TrialRefused as why:  # named in standing, and no movement to identify from
            inferred = noted(inferred, f"What accepting the findings changes is not known. {why}")
            break
        except NotSolved as why:
            failures = {"what accepting changes": str(why)}
            return SessionDiagnosis(inferred.diagnosis, inferred, before, failures=failures)
        # The finding with the lowest gain of those that only make worse what was not used; None without any.
        gains = {k: one.gain.ci95 for k, one in enumerate(found.findings) if one.gain and one.gain.ci95[1] <= 0}
        worst = min(gains, key=lambda k: sum(gains[k])) if gains else None
        if worst is None or found.inferred is None:
            return found
        gone, (low, high) = found.findings[worst], (-100 * x for x in reversed(gains[worst]))
        inferred = found.inferred.refuted(worst)
        there = (gone.effect, gone.target) in inferred.idle
        told = "is shown by the markers, and left out of the simulation" if there else "was taken back"
        said = f"accepting it makes data that were not used {low:.0f} to {high:.0f} % worse."
        inferred = noted(inferred, f"{cause_in_words(gone.effect, gone.target)} {told}: {said}")
    return SessionDiagnosis(inferred.diagnosis, inferred, before)


def noted(inferred: Inferred, *notes: str) -> Inferred:
    """Return the same with more ``notes`` for the reader."""
    return replace(inferred, diagnosis=replace(inferred.diagnosis, notes=(*inferred.diagnosis.notes, *notes)))


def _phi(result: SessionResult, found: Inferred) -> Array:
    """Return the parameters (10N,) in use: those of the posterior, the table's where only observations judge."""
    assert result.body is not None
    return found.phi if found.phi.size else result.body.sip.phi


def _accepted(result: SessionResult, inferred: Inferred, before: Identification) -> SessionDiagnosis:
    """Return what accepting the findings changes, with all gains."""
    phi, every = _phi(result, inferred), inferred.named
    found = _corrected(result, partial(accept, named=every), phi)
    as_is = _corrected(result, partial(accept, named=()), phi, before)
    findings = tuple(replace(one, changes=_changes(before, found.identified)) for one in inferred.diagnosis.findings)
    single, habits = len(every) == 1, (None,) * (len(findings) - len(every))  # a habit is nothing to accept
    gains = [
        _gain_of_person(result, inferred, k, before) if one.effect.of_person()
        else _gain(as_is if single else _without(result, inferred, k), found) if _acts(result, one) else None
        for k, one in enumerate(every)
    ]  # fmt: skip
    findings = tuple(replace(one, gain=gain) for one, gain in zip(findings, (*gains, *habits), strict=True))
    told = replace(inferred, diagnosis=replace(inferred.diagnosis, findings=findings))
    left = (as_is.kept, found.kept) if as_is.kept and found.kept else None
    gain = gains[0] if single else _gain(as_is, found)
    return SessionDiagnosis(told.diagnosis, told, before, found.identified, left, gain=gain)


def _gain_of_person(result: SessionResult, inferred: Inferred, index: int, before: Identification) -> Gain | None:
    """Return a finding's gain against sides alike, by halves: trials that are kept move both sides alike."""
    alike, rest = tables_by_sides(before)[0][0], inferred.without(index)
    try:
        return _gain(
            _corrected(result, partial(accept, named=rest.named), _phi(result, rest), prior=alike, halves=True),
            _corrected(result, partial(accept, named=inferred.named), _phi(result, inferred), halves=True),
        )
    except NotSolved:
        return None


def _without(result: SessionResult, inferred: Inferred, index: int) -> _Corrected | None:
    """Return the session corrected for all findings but one, their sizes fitted again; None where no body fits."""
    rest = inferred.without(index)
    try:
        return _corrected(result, partial(accept, named=rest.named), _phi(result, rest))
    except NotSolved:
        return None


def _acts(result: SessionResult, one: NamedCause) -> bool:
    """Return whether a cause does anything in the data that judge its gain: a touch that is over does nothing there."""
    judged = windows(result.trials, KEPT_ROLES) or windows(result.trials, FITTED_ROLES)
    return not one.course or any(window.trial.name in one.course for window in judged)


def _gain(before: _Corrected | None, after: _Corrected) -> Gain | None:
    """Return what the second gains on the data not used; None where these are too few, or the same is left of them."""
    if before is None or before.kept is None or after.kept is None or before.used is None or after.used is None:
        return None
    if all(np.allclose(a, b, rtol=0, atol=_SAME) for a, b in zip(before.kept.left, after.kept.left, strict=True)):
        return None
    try:
        return gain_by_naming(before.kept, after.kept, fitted=(before.used, after.used))
    except BiodanceError:
        return None


def _corrected(
    result: SessionResult, mend: _Mend, phi: Array, as_is: Identification | None = None, *,
    prior: Sip | None = None, halves: bool = False,
) -> _Corrected:  # fmt: skip
    """Return the session with every trial mended, seen with the parameters ``phi`` (10N,), and identified again, after
    ``prior`` where that is given; judged by the ``halves`` of the movement also where trials were kept. ``as_is``: the
    body identified from the trials as they are, where it is known.
    """
    body, fitted, judged = _mended(result, FITTED_ROLES, mend, phi)
    kept = () if halves else _mended(result, KEPT_ROLES, mend, phi)[2]
    found = as_is or identify_body(body, fitted, prior=prior)
    about = standing_point(kept or fitted)
    if not kept:
        return _Corrected(found, *(_by_halves(body, judged, about, prior) if judged else (None, None)))
    return _Corrected(found, *(residuals_of(found.identified, some, about) for some in (fitted, kept)))


def _mended(result: SessionResult, roles: tuple[Role, ...], mend: _Mend, phi: Array) -> tuple[Body, _Fits, _Fits]:
    """Return the body, the trials of the ``roles``, mended, and those of them by which a gain is judged, as causes are:
    somebody moves (sway and another body look like any fault of a plate while one stands), for a second and more.
    """
    assert result.body is not None
    found = windows(result.trials, roles)
    cases = [mend(replace(case, phi=phi)) for case in cases_of(result.body, found)]
    fits = tuple(case_fit(case, window.use) for case, window in zip(cases, found, strict=True))
    judged = [is_moving(case) and window.seconds > 0 for case, window in zip(cases, found, strict=True)]
    return (cases[0].body if cases else result.body), fits, tuple(compress(fits, judged))


def _by_halves(body: Body, fits: _Fits, about: Array, prior: Sip | None) -> tuple[Residuals | None, Residuals | None]:
    """Return what the body of each half of the movement leaves of that half, and of the other; None for nothing."""
    # frames in use are counted through all trials: those up to half of their number are the first half
    first = np.cumsum(np.concatenate([fit.use for fit in fits]))
    early = np.split(2 * first <= first[-1], np.cumsum([fit.use.size for fit in fits])[:-1])
    parts = [
        tuple(replace(fit, use=fit.use & (there == now)) for fit, there in zip(fits, early, strict=True))
        for now in (True, False)
    ]
    halves = [tuple(fit for fit in half if fit.use.any()) for half in parts]
    try:
        bodies = [identify_body(body, half, prior=prior).identified for half in halves]
    except (TrialRefused, NotSolved):
        return None, None
    used, kept = (
        join_residuals(*(residuals_of(one, half, about) for one, half in zip(bodies, some, strict=True)))
        for some in (halves, halves[::-1])
    )
    return used, kept


def _changes(before: Identification, after: Identification) -> tuple[str, ...]:
    """Say which segment masses change most when the findings are accepted."""
    then, now = (dict(zip(one.sip.segments, one.sip.mass.tolist(), strict=True)) for one in (before, after))
    change = {name: now.get(name, 0.0) - mass for name, mass in then.items()}
    most = sorted(change, key=lambda name: -abs(change[name]))[:3]
    return tuple(
        f"{spaced(name)}: {then[name]:.2f} kg becomes {now.get(name, 0.0):.2f} kg"
        for name in most
        if abs(change[name]) >= 0.01
    )

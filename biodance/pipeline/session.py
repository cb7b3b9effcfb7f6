"""A whole session through all stages. One trial that fails never stops the others."""

from collections.abc import Callable
from dataclasses import replace
from itertools import repeat

import numpy as np

from biodance.body.body import Body
from biodance.body.tables.choice import reference as reference_person
from biodance.errors import SessionRefused, TrialRefused
from biodance.identification.loads import with_declared_limbs
from biodance.identification.paper_programme import identify_as_paper
from biodance.lab.plates.faults import PlateCorrection, corrected_trial
from biodance.motion.contact import carried_elsewhere
from biodance.motion.newton import QuietStanding
from biodance.pipeline.body import body_of, force_gains, refuse_another_reference, shown_joints, starting_from
from biodance.pipeline.identification import (
    FITTED_ROLES,
    SessionIdentification,
    can_identify,
    fits_of_roles,
    identify_trials,
    mass_check,
    predicted,
    standing_check,
    trial_checks,
    weigh,
    with_weighed_mass,
)
from biodance.pipeline.judged_trials import half_steps_left_out
from biodance.pipeline.results import Placed, SessionResult
from biodance.pipeline.trial import ON_A_FRAME, Step, TrialResult, attempt, examine_trial, prepare_trial
from biodance.records import Markers, Session
from biodance.threads import one_thread


def stopped_before(result: SessionResult, what: str) -> SessionResult:
    """Return the result with a step that says that Ctrl-C ended the run before ``what`` was done."""
    return replace(result, steps=(*result.steps, _stop(what)))


def _stop(what: str) -> Step:
    return Step("stop", "refused", f"Not done: the run was stopped by Ctrl-C before {what}.")


def _examined(
    read: tuple[TrialResult, ...],
    placed: Placed,
    mass: float,
    earlier: tuple[TrialResult | None, ...],
    tell: Callable[[str], None],
) -> tuple[TrialResult, ...]:
    """Return the trials tracked (unless ``earlier``) and compared, with checks; those Ctrl-C left undone say so."""
    results: list[TrialResult] = []
    try:
        for k, (one, before) in enumerate(zip(read, earlier, strict=True), 1):
            tell(f"tracking {one.trial.name}, {k} of {len(read)}")
            results.append(examine_trial(one, placed.body, mass=mass, before=before))
    except KeyboardInterrupt:
        results += [replace(one, steps=(*one.steps, _stop("this trial"))) for one in read[len(results) :]]
    results = half_steps_left_out(results, placed.body, mass)
    moving = any(step.name == ON_A_FRAME for step in placed.steps)
    return tuple(replace(one, checks=tuple(trial_checks(one, mass, on_a_frame=moving))) for one in results)


def _placed(
    session: Session, read: tuple[TrialResult, ...], known: Body | None, earlier: SessionResult | None
) -> Placed:
    """Return who moves in the trials ``read``; the ``earlier`` body where nothing of it has changed."""
    subject = session.subject
    hidden = tuple(  # frames of each trial in which something else carries, so that they place no joint
        carried_elsewhere(one.trial, weight=one.trial.settings.gravity * subject.mass)
        if one.usable and one.trial.markers is not None and one.trial.plates
        else np.zeros(0, dtype=bool)
        for one in read
    )
    if earlier is not None:
        before = earlier.placed
        # scaling and joints rest on markers, person and hidden frames alone: equal ones give an equal body
        # as mappings: what is unknown (NaN) of a person equals itself in them, and in records up to Python 3.12 alone
        same = vars(earlier.subject) == vars(subject) and before.known is known
        same = same and all(map(np.array_equal, hidden, before.hidden))
        if same and _same_markers(read, earlier.trials):
            return before
    steps: list[Step] = []
    plain, source = body_of(subject, read, session.settings, steps)
    if plain is None:
        return Placed(None, source, steps=tuple(steps), known=known, hidden=hidden)
    prior = None
    if known is not None:
        plain, prior, source = starting_from(known, plain, subject.mass, source)
    else:
        plain, limbs = with_declared_limbs(plain, subject)
        source = f"{source} {limbs}".strip()
    body, gains = shown_joints(plain, read, steps)
    return Placed(body, source, plain, gains, prior, tuple(steps), known, hidden)


def _same_markers(some: tuple[TrialResult, ...], others: tuple[TrialResult, ...]) -> bool:
    """Return whether the trials of two examinations have equal markers."""

    def same(ours: Markers | None, theirs: Markers | None) -> bool:
        if ours is None or theirs is None or ours.names != theirs.names:
            return ours is theirs
        return np.array_equal(ours.time, theirs.time) and np.array_equal(ours.xyz, theirs.xyz, equal_nan=True)

    return all(same(one.trial.markers, other.trial.markers) for one, other in zip(some, others, strict=True))


def examine(
    session: Session,
    *,
    reference: SessionIdentification | None = None,
    known: Body | None = None,
    corrections: tuple[PlateCorrection, ...] = (),
    earlier: SessionResult | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> SessionResult:
    """Take a session through all stages: prepare, scale, track, compare, identify; one trial that fails never stops the
    others.

    Ctrl-C ends the work after the trials that are done; the others say so (``SessionResult.stopped``).

    Parameters
    ----------
    session : Session
        As `read_session` returns it, with its settings.
    reference : SessionIdentification, optional
        What an earlier, unloaded session of the same person said: a load is then looked for against it, not the table.
    known : Body, optional
        The body as identified in an earlier session (``body.json``): its inertial parameters are then what is known
        before, not the table's. Lengths and joints are measured anew.
    corrections : tuple of PlateCorrection
        Faults of the plates to take off first; what is not known of their sizes counts in every interval.
    earlier : SessionResult, optional
        The same session examined with its plates as they were: what only markers tell is taken from there, where they
        are the same.
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    SessionResult
        All that was found; what the data could not carry is a step with its reason.

    Raises
    ------
    UnknownName
        There is no such table of segment inertial parameters for the subject's sex.
    SessionRefused
        ``reference`` or ``known`` is of another person.

    See Also
    --------
    identify : What the segments weigh.
    diagnose : What the simulation gets wrong.

    Examples
    --------
    >>> result = biodance.examine(session)
    >>> result["squat_1"].motion
    Motion(23 joint angles, 611 frames at 100 Hz, 6.10 s)
    """
    found = followed(session, reference=reference, known=known, corrections=corrections, earlier=earlier, tell=tell)
    try:
        return identified(found, reference=reference, tell=tell)
    except KeyboardInterrupt:
        return stopped_before(found, "the segments were identified")


@one_thread()
def followed(
    session: Session,
    *,
    reference: SessionIdentification | None = None,
    known: Body | None = None,
    corrections: tuple[PlateCorrection, ...] = (),
    earlier: SessionResult | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> SessionResult:
    """Return a session through all stages of `examine` but the last: `identified` does that, where somebody asks for
    the masses of just these recordings; a diagnosis asks for those of the copy in which it put labels and plates right.
    """
    reference_person(session.settings.table, session.subject)
    session = replace(session, trials=tuple(corrected_trial(trial, corrections) for trial in session.trials))
    session = with_weighed_mass(session)
    prepared = []
    for k, trial in enumerate(sorted(session.trials, key=lambda trial: trial.role != "static"), 1):
        tell(f"preparing {trial.name}, {k} of {len(session.trials)}")
        prepared.append(prepare_trial(trial))
    read = tuple(prepared)
    tell("scaling the body")
    placed = _placed(session, read, known, earlier)
    body, mass = placed.body, session.subject.mass
    if body is not None and reference is not None:
        refuse_another_reference(reference.identification.body, body, mass, reference.name)
    # the same body follows the same markers as before: what it did is not computed again
    same = earlier.trials if earlier and placed is earlier.placed else tuple(repeat(None, len(read)))
    done = _examined(read, placed, mass, same, tell)
    steps, standing, limits = list(placed.steps), best_standing(done), session.settings.checks
    before = earlier.joint_forces if earlier and placed is earlier.placed else ()
    weighed = attempt(steps, "weighing", lambda: weigh(session, standing))
    return SessionResult(
        session,
        placed,
        tuple(steps),
        done,
        checks=(*mass_check(session.subject, weighed, limits), *standing_check(standing, limits)),
        standing=standing,
        weighed=weighed,
        corrections=corrections,
        joint_forces=force_gains(placed.plain, done, before) if placed.plain is not None and placed.taken else (),
    )


def identify_result(
    result: SessionResult, body: Body, reference: SessionIdentification | None
) -> SessionIdentification:
    """Identify the ``body`` of a `followed` session, beside an earlier one; see `identify_trials`."""
    return identify_trials(
        body, result.trials, name=result.session.folder.name, reference=reference, checks=result.checks,
        prior=result.placed.prior, corrections=result.corrections, weighed=result.weighed,
    )  # fmt: skip


@one_thread()
def identified(
    result: SessionResult,
    *,
    reference: SessionIdentification | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> SessionResult:
    """Return a `followed` session with what its segments weigh, unless it has that, or there is nothing to weigh by."""
    body, steps = result.body, list(result.steps)
    known = result.identification is not None or any(step.name == "identify" for step in steps)
    if known or body is None or not can_identify(result.trials):
        return result
    tell("identifying the segments")
    found = attempt(steps, "identify", lambda: identify_result(result, body, reference))
    return replace(result, steps=tuple(steps), identification=found)


def best_standing(results: tuple[TrialResult, ...]) -> QuietStanding | None:
    """Return the quiet standing of a static trial, else of a check, else the longest; None without any."""
    found = [(result.trial.role, result.standing) for result in results if result.standing is not None]
    order = {"static": 0, "check": 1}
    # of one role the longest: start - end is the smallest
    return min(found, key=lambda pair: (order.get(pair[0], 2), pair[1].start - pair[1].end), default=("", None))[1]


def identification_of(result: SessionResult) -> SessionIdentification:
    """Return the identification of a session. Raises SessionRefused: there is none; the message says why."""
    if result.identification is not None:
        return result.identification
    folder = result.session.folder
    said = [step.text for step in result.steps if step.name in ("subject", "identify") and step.status != "done"]
    fits = [trial for trial in result.trials if trial.trial.role == "fit"]
    reasons = " ".join(dict.fromkeys([*said, *(reason for trial in fits for reason in trial.reasons)]))
    none = "no trial has the role fit. Set roles in session.toml."
    why = "no trial to fit has motion and fully measured ground contact." if fits else none
    outside = [f"{c.what}, {c.where}: {c.value} ({c.limit})." for c in result.checks if fits and not c.inside]
    also = f"Outside the limit: {' '.join(outside)}" if outside else ""
    raise SessionRefused(" ".join(filter(None, (f"{folder}: nothing can be identified, {why}", also, reasons))))


def by_paper(result: SessionResult) -> SessionResult:
    """Return an identified session with the parameters of the paper's programme (eq. 8) from the same trials, validated
    on the same kept ones; its posterior stays beside it (``identification.posterior``), with loads and changes, which
    the programme does not know. As it is where nothing was identified.
    """
    beside = result.identification
    if beside is None:
        return result
    fits = fits_of_roles(result.trials, FITTED_ROLES, *result.corrections)
    try:
        found = identify_as_paper(beside.identification, fits)
    except TrialRefused:
        return result
    one = replace(
        beside, identification=found, posterior=beside, notes=found.notes, fitted=(), validations=(), gain=None
    )
    if found.status == "failed":
        one = replace(one, failures={**beside.failures, "segments": found.cause}, agreements={}, shown=None)
    else:
        one = replace(predicted(one, result.trials, result.weighed, result.corrections), shown=None)
    return replace(result, identification=one)

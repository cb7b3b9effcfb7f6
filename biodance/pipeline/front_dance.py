"""What is conducted before a visit: a dance to be recorded, or a laboratory to be simulated."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.problem.chain import ROOT
from biodance.dance.problem.splines import Phase
from biodance.errors import BiodanceError, SessionRefused, refuse_unknown
from biodance.motion.dynamics import predict_wrench
from biodance.records import SIDES, Array, Subject
from biodance.spatial import zero_moment_point
from biodance.virtual_lab.causes import Hidden, parse_cause
from biodance.virtual_lab.movement import STAND, Protocol, TrialPlan, read_protocol
from biodance.virtual_lab.movement.performance import (
    ARM,
    PERFORMERS,
    USUAL_PERFORMER,
    Performance,
    Performer,
    Shown,
    copy_dance,
)
from biodance.virtual_lab.movement.posing import septic
from biodance.virtual_lab.person import Person
from biodance.virtual_lab.simulate import check_simulated
from biodance.virtual_lab.simulate import simulate_session as write_session
from biodance.virtual_lab.visit import FIRST_VISIT, Instruments, LabVisit, draw_laboratory, perform_in

if TYPE_CHECKING:
    from biodance.dance.limits import Limit, Margin
    from biodance.pipeline.dance import DanceResult
    from biodance.pipeline.results import SessionResult


_RATE = 100.0
LIFT = 0.4
"""Share of a move in which a foot leaves the ground, at its beginning, or comes back, at its end."""
_OTHERS = "squat"
"""Protocol from which the static trial and the squats kept for validation are taken, of who stands."""
_STILL = Performer(tracking=0.0, pace=1.0)
_BENT = {
    f"{side}_{joint}": math.radians(by) for side in SIDES for joint, by in (("hip_flexion", 90), ("knee_flexion", 85))
}
"""rad by which who sits is bent while the markers are glued, and in the static trial."""


def stretches(dance: Dance) -> tuple[Shown, ...]:
    """Return the dance in stretches between the steps that change a foot's place, which are not recorded."""
    motion, groups = dance.motion(_RATE), [[0]]
    for p in range(1, len(dance.stances)):
        # a posture on feet set anew begins another stretch
        same = np.array_equal(dance.stances[p].ankle, dance.stances[p - 1].ankle)
        groups[-1].append(p) if same else groups.append([p])
    out = []
    for number, group in enumerate(groups, start=1):
        if len(group) > 1:
            # a move belongs to the posture it leads to: that into the first one of a stretch is the step, not
            # recorded
            own = [phase for phase in dance.phases if phase.posture in group]
            phases = [phase for phase in own if phase.kind == "hold" or phase.posture > group[0]]
            rows = (motion.time >= phases[0].start - 1e-9) & (motion.time <= phases[-1].end + 1e-9)
            part, feet = motion.at(rows), phases[0].stance
            raised = np.max([_raised(dance, phase, part.time) for phase in phases], axis=0)
            point = zero_moment_point(predict_wrench(dance.body, part).value)[:, :2]
            out.append(Shown(f"dance_{number}", dance.body, part, feet.ankle, raised, point, feet.seat))
    return tuple(out)


def _on_the_stool(dance: Dance, danced: tuple[Shown, ...]) -> tuple[Shown, ...]:
    """Return what is recorded on a stool, too: sitting still (static), and a second round to validate on."""
    x = np.zeros((round(4.0 * _RATE) + 1, dance.chain.size))  # s of sitting still
    x[:, 2] = danced[0].seat
    stood = {side: zip(ARM, np.radians(STAND.values[f"{side}_arm"]), strict=True) for side in SIDES}
    arms = {f"{side}_{name}": angle for side, pairs in stood.items() for name, angle in pairs}
    for name, angle in (_BENT | arms).items():
        x[:, ROOT + dance.body.joint_index(name)] = angle
    still = dance.chain.motion(np.arange(len(x)) / _RATE, x, *np.zeros((2, *x.shape)))
    nothing = np.zeros((len(x), 2))
    static = Shown("static", dance.body, still, danced[0].ankle, nothing, nothing, danced[0].seat, "static")
    return (static, *(replace(one, name=f"again_{one.name}", role="validate") for one in danced))


def _raised(dance: Dance, phase: Phase, time: Array) -> Array:
    """Return how far each foot is raised during ``phase`` (T, 2), zero outside."""
    inside, out = (time >= phase.start - 1e-9) & (time <= phase.end + 1e-9), np.zeros((time.size, 2))
    for foot in {0, 1} - set(phase.stance.planted):
        up = np.ones(time.size)
        if phase.kind == "move":
            # up in the first share of a move from a stance in which the foot stood, down in the last of one into such
            way = (time - phase.start) / (phase.end - phase.start)
            before, after = (foot in dance.stances[p].planted for p in (phase.posture - 1, phase.posture))
            up = (septic(way / LIFT) if before else up) * (septic((1 - way) / LIFT) if after else 1.0)
        out[:, foot] = inside * up
    return out


def simulate_dance(
    subject: Subject,
    dance: Dance,
    out: Path,
    *,
    seed: int,
    performer: Performer = USUAL_PERFORMER,
    hidden: tuple[Hidden, ...] = (),
) -> Path:
    """Write the session of a virtual person who dances ``dance``: static, the dance in stretches, two trials of squats
    for validation; on a stool, which stands on the plate, sitting still and a second round instead.

    ``seed`` is the person; ``hidden`` causes as in `virtual_lab.causes`. The same arguments write the same
    bytes.

    Raises
    ------
    BiodanceError
        The folder is not empty, or the subject is outside the range of the virtual body.
    """
    danced = stretches(dance)
    seated = all(one.seat for one in danced)
    others = [trial for trial in read_protocol(_OTHERS).trials if trial.role in ("static", "validate") and not seated]
    shown = {one.name: one for one in (*danced, *(_on_the_stool(dance, danced) if seated else ()))}
    trials = [one.plan(round(float(np.ptp(one.motion.time)) * performer.pace, 1)) for one in shown.values()]
    plan = Protocol(dance.protocol, (*others, *trials))

    def performed(instruments: Instruments, person: Person, trial: TrialPlan) -> Performance:
        if trial.name not in shown:
            return perform_in(instruments, person, trial)
        lab = instruments.visit.laboratory
        done = copy_dance(
            person.with_markers_moved(instruments.visit.marker_shifts),
            one := shown[trial.name],
            instruments.visit.number,
            centre=np.array(lab.centre),
            heading=lab.heading,
            performer=_STILL if one.role == "static" else performer,
            tolerances=instruments.visit.tolerances,
        )
        return replace(done, forces=instruments.visit.forces)

    bent = _BENT if seated else {}
    return write_session(subject, plan, out, seed=seed, hidden=hidden, performed=performed, bent=bent)


def design_dance(
    subject: Subject,
    protocol: str | Path = "full",
    *,
    limits: str | Path | None = None,
    own_limits: "Iterable[Limit | type[Limit]]" = (),
    plate: tuple[float, float] | None = None,
    seed: int = 0,
    tell: Callable[[str, int, int], None] = lambda *_: None,
) -> "DanceResult":
    """Return a dance for one person: safe, balanced, and telling much about every segment.

    Parameters
    ----------
    subject : Subject
        Mass kg, stature m, sex, age years (strength falls with it).
    protocol : str or pathlib.Path
        "short", "easy", "patient", "chair", "one_segment", "full", or a TOML file.
    limits : str or pathlib.Path, optional
        TOML file with what this person can and may do.
    own_limits : iterable of Limit, optional
        Limits of your own, kept beside those of the protocol or in place of one of the same name
        (`biodance.dance.limits`).
    plate : tuple of float, optional
        Force plate from side to side and ahead of the person, m, on which all feet are set; by default the protocol's.
    seed : int
        The same seed gives the same dance.
    tell : callable, optional
        Called with what is being done, how many parts are finished, and of how many (0: not counted).

    Returns
    -------
    DanceResult
        Its `dance` is None where no dance keeps all limits; then `reason` says which limit forbids it.

    Raises
    ------
    UnknownName
        There is no such protocol; the legal names are listed.
    BiodanceError
        Mass or stature are out of range, or protocol and person contradict each other.

    See Also
    --------
    verify_dance : Judge a dance by code that its design did not use.

    References
    ----------
    Exciting motions by the condition number of the sub-regressors, weighted with the segments' masses;
    docs/derivations.md.

    Examples
    --------
    >>> made = biodance.design_dance(biodance.Subject(65.0, 1.75, "F", 33.0), "short")  # doctest: +SKIP
    >>> made.dance.save("short.npz")  # doctest: +SKIP
    >>> biodance.design_dance(biodance.Subject(6.5, 1.75, "F", 33.0), "short")
    Traceback (most recent call last):
        ...
    biodance.errors.BiodanceError: The mass is 6.5 kg; a dance is designed for 30 to 200 kg. Correct it.
    """
    from biodance.dance.problem.person import HEALTHY, read_person
    from biodance.dance.problem.plan import read_plan
    from biodance.pipeline.dance import dancer, make_dance

    plan = read_plan(protocol)
    plan = plan if plate is None else replace(plan, plate=plate)
    person = read_person(Path(limits)) if limits else HEALTHY
    body = dancer(subject, plan)
    return make_dance(body, plan, person, subject=subject, limits=own_limits, seed=seed, tell=tell)


def verify_dance(
    dance: "Dance | str | Path",
    protocol: str | Path | None = None,
    *,
    limits: str | Path | None = None,
    own_limits: "Iterable[Limit | type[Limit]]" = (),
    body: Body | None = None,
) -> "tuple[Margin, ...]":
    """Return what is left of every limit over a whole dance, judged by code that its design did not use.

    Parameters
    ----------
    dance : Dance, str or pathlib.Path
        A dance, or the file that `biodance dance` wrote (dance.npz).
    protocol : str or pathlib.Path, optional
        Whose limits hold, by name or TOML file; by default the dance's own, by name.
    limits : str or pathlib.Path, optional
        TOML file with what this person can and may do.
    own_limits : iterable of Limit, optional
        Limits of your own, judged beside those of the protocol or in place of one of the same name; those with which
        a dance was designed (`design_dance`) are given again.
    body : Body, optional
        Who dances it; by default the person for whom it was designed.

    Returns
    -------
    tuple of Margin
        Each with `limit`, `worst` in `unit` (negative: broken) at `where_s` s.

    Raises
    ------
    FileRefused
        The file is no dance.
    UnknownName
        There is no such protocol; the legal names are listed.

    Examples
    --------
    >>> margins = biodance.verify_dance("dance.npz")
    >>> all(margin.worst >= 0 for margin in margins)
    True
    """
    from biodance.dance.problem.person import HEALTHY, fit_to_person, read_person
    from biodance.dance.problem.plan import read_plan
    from biodance.dance.verify import verify

    one = dance if isinstance(dance, Dance) else Dance.load(dance)
    plan = read_plan(protocol or one.protocol).with_limits(own_limits)
    own, plan, _ = fit_to_person(body or one.body, plan, read_person(Path(limits)) if limits else HEALTHY)
    return verify(own, one, plan.limits)


def simulate(
    subject: Subject,
    protocol: str | None,
    out: str | Path,
    *,
    seed: int = 0,
    effects: Iterable[str] = (),
    dance: "Dance | str | Path | None" = None,
    performer: str = "normal",
    lab_seed: int | None = None,
) -> Path:
    """Write a simulated visit as a laboratory would have: C3D files and session.toml, the truth apart in
    ``truth/truth.json``.

    Parameters
    ----------
    subject : Subject
        Who is simulated; mass kg, stature m.
    protocol : str or None
        Name of a protocol: dance, short, squat, standing ...; a wrong name lists all. None with a dance.
    out : str or pathlib.Path
        Folder to write; it must be empty or missing.
    seed : int
        The same seed gives the same person and the same files.
    effects : iterable of str
        Causes to hide, as ``plate_gain:target=Fz,gain=0.04``.
    dance : Dance, str or pathlib.Path, optional
        A designed dance (dance.npz), performed instead of a protocol: static, the dance in its stretches, two trials of
        squats to validate on. Feet stay where they are planted, and the zero-moment point stays in the support.
    performer : str
        How well it is copied: "steady" 2 degrees off in every joint (root mean square), "normal" 5, "restless" 7; the
        tempo wanders by 5, 10, 20 %, about a duration 1.1, 1.2, 1.2 times the planned one; sway 0.7, 1 and 1.5 times
        the usual.
    lab_seed : int, optional
        Number of a laboratory of the family (`virtual_lab.visit`): other plates, cameras, soft tissue,
        tolerances. None = the usual one.

    Returns
    -------
    pathlib.Path
        The folder.

    Raises
    ------
    UnknownName
        There is no such protocol, cause or performer.
    FileRefused
        The file is no dance.
    BiodanceError
        A cause lacks a parameter, the folder is not empty, or both a protocol and a dance are named, or none.

    Examples
    --------
    >>> folder = biodance.simulate(biodance.Subject(62.0, 1.70, "F", 31.0), "standing", "simulated", seed=1)
    >>> sorted(path.name for path in folder.iterdir())
    ['session.toml', 'standing_1.c3d', 'standing_2.c3d', 'static.c3d', 'truth']
    """
    check_simulated(subject)
    hidden = tuple(parse_cause(text) for text in effects)
    if (protocol is None) == (dance is None):
        raise BiodanceError("Simulating needs either a protocol or a dance. Give one of the two.")
    if dance is not None or protocol is None:
        if lab_seed is not None:
            raise BiodanceError("A laboratory of the family is for protocols. Give --protocol with --lab-seed.")
        refuse_unknown("performer", performer, PERFORMERS)
        one = dance if isinstance(dance, Dance) else Dance.load(str(dance))
        return simulate_dance(subject, one, Path(out), seed=seed, performer=PERFORMERS[performer], hidden=hidden)
    plan = read_protocol(protocol)
    visit = FIRST_VISIT if lab_seed is None else LabVisit(laboratory=draw_laboratory(lab_seed))
    return write_session(subject, plan, Path(out), seed=seed, hidden=hidden, visit=visit)


def virtual_subject(
    dance: "Dance | None", *, sex: str | None, height: float | None, mass: float | None, age: float
) -> Subject:
    """Return the person to simulate: as said, else the one for whom the ``dance`` was designed. Raises BiodanceError:
    sex, height or mass is missing, and the dance does not know its person either.
    """
    known = dance.subject if dance is not None else None
    said = {"sex": sex, "height": height, "mass": mass}
    kept = {"sex": known.sex, "height": known.stature, "mass": known.mass} if known else {}
    who = {name: value if value is not None else kept.get(name) for name, value in said.items()}
    missing = [name for name, value in who.items() if value is None]
    if missing:
        where = "the dance does not say for whom it was designed" if dance is not None else "a protocol is for anybody"
        raise BiodanceError(f"Simulating needs a person, and {where}: add --{', --'.join(missing)}.")
    years = known.age if known is not None and np.isnan(age) else age
    return Subject(float(who["mass"]), float(who["height"]), who["sex"], years)  # type: ignore[arg-type]


def with_performance(result: "SessionResult", dance: "Dance | str | Path") -> "SessionResult":
    """Return an identified visit with how well a dance was danced in its trials with role fit, and what the page that
    led noted (`dance_log*.json` in its folder).

    Raises
    ------
    SessionRefused
        Nothing was identified.
    FileRefused
        The file is no dance, or a log is none.
    BiodanceError
        The dance is of another body, or nothing was recorded.
    """
    from biodance.dance.expectation import score_performance
    from biodance.dance.visit_log import read_visit_logs
    from biodance.pipeline.identification import FITTED_ROLES
    from biodance.pipeline.session import identification_of
    from biodance.pipeline.trial import trial_fit

    found = identification_of(result)
    one = dance if isinstance(dance, Dance) else Dance.load(dance)
    if result.body is None:
        why = f"{result.placed.source} So nobody knows how the dance was danced."
        raise SessionRefused(f"{result.session.folder}: {why}")
    fits = [trial_fit(trial) for trial in result.trials if trial.trial.role in FITTED_ROLES]
    scored = score_performance(one, result.body, tuple((fit.motion, fit.use) for fit in fits if fit))
    scored = replace(scored, logs=read_visit_logs(Path(result.session.folder), one))
    return replace(result, identification=replace(found, performance=scored))

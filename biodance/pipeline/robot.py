"""From a robot's recording and its URDF file to what its links weigh, with every doubt about the recording in a
sentence.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.body.robot.urdf import read_urdf
from biodance.errors import BiodanceError, TrialRefused
from biodance.identification.added_mass import LoadSearch
from biodance.identification.base_parameters import BaseEstimate
from biodance.identification.identification import Identification
from biodance.identification.knowledge import SIGMAS
from biodance.identification.robot import RobotMotion, identify_links, robot_fit, surprise
from biodance.identification.validation import TrialValidation, residual_ratio
from biodance.lab.filters import LowPass, low_pass
from biodance.lab.robot.encoders import for_joints
from biodance.lab.robot.recording import RobotRecording, RobotTrial, read_robot_recording
from biodance.motion.clocks import PlateFit, fit_plate, on_motion_clock, onto_plate
from biodance.motion.comparison import compare
from biodance.motion.grounded import RATE, Grounded, even_angles, ground
from biodance.motion.regressor import predict_wrench
from biodance.pipeline.identification import SessionIdentification
from biodance.records import Array, Wrench
from biodance.records.attention import Attention, Judged, strongest_first
from biodance.spatial import wrench_about_point

_SAME = 0.9
"""Least correlation of the paths of the centre of pressure, needed and measured, of one motion."""
_SCALES = (0.7, 1.4)
"""Legal sizes of the measured path over the needed one."""
_WEIGHTS = (0.5, 2.0)
"""Legal weight on the plate over that of the drawing."""
_ODD, _FAITHFUL = 1.6, 0.99
"""Beyond this surprise, or below this correlation, exchanged columns are looked for."""
_BETTER = 0.25
"""They are named if, exchanged back, they leave so much of what the correlation lacks to one."""
_APART = 1.0
"""s: clocks further apart are said first."""
_KEPT = 0.2
"""Share of every trial, at its end, that is kept where no trial is."""
_COARSE = 20.0
"""Hz at which exchanged columns are looked for."""
_NO_SEARCH = "Of a robot, what differs from the drawing is told link by link instead."


@dataclass(frozen=True, eq=False)
class MatchedTrial:
    """One trial with plate and encoders brought together: ``motion`` to identify from, ``plate`` when and where,
    ``measured`` wrench, filtered, on the plate's clock, ``surprise`` of the drawing at it.
    """

    recorded: RobotTrial
    motion: RobotMotion
    plate: PlateFit
    measured: Wrench
    surprise: float


@dataclass(frozen=True, eq=False)
class RobotResult:
    """What a recording says about a robot: ``identified`` as of people, ``alone`` the base parameters as
    the paper counts them (every frame independent), ``trials``, ``attention``, ``judged``, and the ``urdf``.
    """

    recording: RobotRecording
    urdf: Path
    body: Body
    trials: tuple[MatchedTrial, ...]
    identified: SessionIdentification
    alone: BaseEstimate
    attention: tuple[Attention, ...]
    judged: tuple[Judged, ...]

    @property
    def needs_a_person(self) -> bool:
        """Whether anything stronger than a note was said."""
        return any(one.level != "note" for one in self.attention)


def identify_robot(
    recording: str | Path, *, urdf: str | Path, feet: tuple[str, str], tell: Callable[[str], None] = lambda _: None
) -> RobotResult:
    """Identify what every link of a robot weighs from joint encoders and a force plate.

    Parameters
    ----------
    recording : str or pathlib.Path
        Folder with encoder tables (CSV or Parquet; s, rad) and force plate files (C3D, AMTI, CSV).
    urdf : str or pathlib.Path
        The robot; its masses are the prior.
    feet : tuple of str
        Links of the right and the left foot.
    tell : callable, optional
        Is told what is being done.

    Returns
    -------
    RobotResult
        Parameters with intervals, validation on motion that was kept, what a person should know.

    Raises
    ------
    BiodanceError
        The URDF or the recording cannot be used; the message says what to do.

    References
    ----------
    Bonnet et al. 2016, sections II and IV.C-D.

    Examples
    --------
    >>> biodance.identify_robot("run", urdf="hoap3.urdf", feet=("right_foot", "left_foot"))  # doctest: +SKIP
    """
    tell("reading the robot")
    body = read_urdf(urdf, feet=feet)
    found = read_robot_recording(recording, tuple(joint.name for joint in body.joints))
    trials, refused = bring_together(body, found, tell=tell)
    fitted, kept = _parted(trials)
    if not fitted:
        reasons = " ".join(refused.values()) or "No trial has the role fit."
        raise TrialRefused(reasons)
    tell("identifying")
    done, alone = identify_links(body, tuple(one.motion for one in fitted))
    tell("validating")
    identified = _validated(found.folder.name, done, fitted, kept)
    said = strongest_first([*_refusals(refused), *told_of(trials), *_weights(done)])
    judged = tuple(Judged(one.recorded.name, float(one.motion.fit.use.sum()) / RATE) for one in trials)
    lost = tuple(Judged(name, 0.0, why, missed=True) for name, why in refused.items())
    return RobotResult(found, Path(urdf), body, tuple(trials), identified, alone, said, (*judged, *lost))


def bring_together(
    body: Body, recording: RobotRecording, *, tell: Callable[[str], None] = lambda _: None
) -> tuple[list[MatchedTrial], dict[str, str]]:
    """Return the trials in which plate and encoders are of one motion, and why others are not, by name."""
    trials, refused = list[MatchedTrial](), dict[str, str]()
    for one in recording.trials:
        tell(f"{one.name}: bringing plate and encoders together")
        try:
            trials.append(_matched(body, one, recording.fixed))
        except BiodanceError as why:
            refused[one.name] = str(why)
    return trials, refused


def _matched(body: Body, one: RobotTrial, fixed: dict[str, float]) -> MatchedTrial:
    """Return one trial with plate and encoders brought together."""
    where = str(one.files[0])
    limits = (np.asarray(body.limits.lower), np.asarray(body.limits.upper))
    encoders = for_joints(one.encoders, tuple(j.name for j in body.joints), limits, where=where, fixed=fixed)
    time, angle = even_angles(encoders)
    measured = Wrench(one.wrench.time, low_pass(one.wrench.value, one.wrench.rate, LowPass()))
    carried = float(np.median(measured.value[:, 2])) / -float(body.gravity[2])
    weight = float(body.sip.mass.sum())
    if not _WEIGHTS[0] < carried / weight < _WEIGHTS[1]:
        raise TrialRefused(
            f"{one.files[1]}: carries {carried:.2f} kg (median), {body.name} weighs {weight:.2f} kg. Is it the plate "
            f"of this robot, in N, zeroed while empty?"
        )
    grounded, fit = _stood(body, time, angle, measured)
    motion = robot_fit(one.name, grounded, angle, on_motion_clock(measured, time, fit))
    odd = surprise(body, motion)
    foreign = fit.correlation < _SAME or not _SCALES[0] < fit.scale < _SCALES[1]
    if odd > _ODD or fit.correlation < _FAITHFUL:
        pair = _exchanged(body, time, angle, measured, limits, 1 - fit.correlation)
        if pair:
            raise TrialRefused(
                f"{where}: the columns of {pair[0]} and {pair[1]} are exchanged: exchanged back, the motion needs what "
                f"the plate shows. Correct the headings."
            )
    if foreign:
        raise TrialRefused(
            f"{one.files[1]}: is not the plate of this motion ({where}): at no delay does its centre of pressure "
            f"follow what the encoders need (best correlation {fit.correlation:.2f}, least {_SAME:g}; size "
            f"{fit.scale:.2f}, legal {_SCALES[0]:g} to {_SCALES[1]:g}). Pair the files of one run; else look for a "
            f"wrong sign or zero of an encoder, or hands on the robot."
        )
    return MatchedTrial(replace(one, encoders=encoders), motion, fit, measured, odd)


def _stood(
    body: Body, time: Array, angle: Array, measured: Wrench, *, settings: LowPass | None = None
) -> tuple[Grounded, PlateFit]:
    """Return the motion and its place on the plate; where the angles leave open which foot stands, the plate tells."""
    tried = []
    for lean in (None, 0, 1):
        found = ground(body, time, angle, settings=settings, lean=lean)
        tried.append((found, fit_plate(predict_wrench(body, found.motion), measured, found.use)))
        if not found.unclear:
            break
    return max(tried, key=lambda pair: pair[1].correlation)


def _exchanged(
    body: Body, time: Array, angle: Array, measured: Wrench, limits: tuple[Array, Array], lacking: float
) -> tuple[str, str] | None:
    """Return the two joints whose exchange lets the plate follow from the encoders; None if no exchange does."""
    step, slow = round(RATE / _COARSE), LowPass(cutoff=0.2 * _COARSE)
    measured = Wrench(measured.time, low_pass(measured.value, measured.rate, slow))
    coarse, few = time[::step], angle[::step]
    low, high = limits[0] - 0.35, limits[1] + 0.35
    inside = (few.min(axis=0)[:, None] >= low) & (few.max(axis=0)[:, None] <= high)
    moving = few.std(axis=0) > 0.01
    best, pair = min(_BETTER * lacking, 2 * (1 - _FAITHFUL)), None
    for i, j in combinations(range(few.shape[1]), 2):
        if not (inside[i, j] and inside[j, i] and (moving[i] or moving[j])):
            continue
        other = few.copy()
        other[:, [i, j]] = few[:, [j, i]]
        size = _lacking(body, coarse, other, measured)
        if size < best:
            best, pair = size, (body.joints[i].name, body.joints[j].name)
    return pair


def _lacking(body: Body, time: Array, angle: Array, measured: Wrench) -> float:
    """Return what the correlation at a coarse motion lacks to one; infinite where nothing fits."""
    try:
        found, fit = _stood(body, time, angle, measured, settings=LowPass(cutoff=0.2 * _COARSE))
        legal = _SCALES[0] < fit.scale < _SCALES[1] and found.use.any()
        return 1 - fit.correlation if legal else np.inf
    except BiodanceError:
        return np.inf


def _parted(trials: list[MatchedTrial]) -> tuple[list[MatchedTrial], list[MatchedTrial]]:
    """Return the trials to identify from and those kept; where none was kept, the end of every one is."""
    fitted = [one for one in trials if one.recorded.role == "fit"]
    kept = [one for one in trials if one.recorded.role in ("validate", "check")]
    if kept or not fitted:
        return fitted, kept
    first, last = [], []
    for one in fitted:
        use = np.flatnonzero(one.motion.fit.use)
        cut = use[int((1 - _KEPT) * use.size)] if use.size else 0
        early = np.arange(one.motion.fit.use.size) < cut
        first.append(_limited(one, one.motion.fit.use & early))
        last.append(_limited(one, one.motion.fit.use & ~early))
    return first, last


def _limited(one: MatchedTrial, use: "np.ndarray") -> MatchedTrial:
    return replace(one, motion=replace(one.motion, fit=replace(one.motion.fit, use=use)))


def _validated(
    name: str, done: Identification, fitted: list[MatchedTrial], kept: list[MatchedTrial]
) -> SessionIdentification:
    """Return the identification beside what drawing and identified robot predict of every trial."""
    search = LoadSearch((), float("nan"), "the drawing", doubts=(_NO_SEARCH,))
    if done.status == "failed":
        return SessionIdentification(
            name, done, (), (), {}, None, search, notes=done.notes, failures={"links": done.cause}
        )
    first, last = (tuple(_validation(done, one) for one in some) for some in (fitted, kept))
    notes, gain = list(done.notes), None
    try:
        gain = residual_ratio(last) if last else None
    except BiodanceError as why:
        notes.append(str(why))
    agreements = {one.name: one.identified_agreement for one in (*first, *last)}
    return SessionIdentification(name, done, first, last, agreements, gain, search, notes=tuple(notes))


def _validation(done: Identification, one: MatchedTrial) -> TrialValidation:
    """Return one trial in the plate's frame; drawing and identified robot stand each where it fits best."""
    motion, use = one.motion.fit.motion, one.motion.fit.use
    predicted = []
    for body in (done.body, done.identified):
        needed = predict_wrench(body, motion)
        fit = fit_plate(needed, one.measured, one.motion.grounded.use)
        predicted.append(onto_plate(needed.value, fit))
    still = replace(one.plate, place=(0.0, 0.0), yaw=0.0)
    measured = on_motion_clock(one.measured, motion.time, still)
    point = Wrench(motion.time, measured).cop()[use]
    about = np.nanmean(point, axis=0)
    truth, table, found = (Wrench(motion.time, wrench_about_point(value, about)) for value in (measured, *predicted))
    return TrialValidation(
        one.recorded.name, about, truth, table, found, use, compare(truth, table, use), compare(truth, found, use)
    )


def _refusals(refused: dict[str, str]) -> list[Attention]:
    return [Attention("warn", why, name, "trial") for name, why in refused.items()]


def told_of(trials: list[MatchedTrial]) -> list[Attention]:
    """Return what a person should know of the recordings: clocks, plates, encoders, what contradicts the drawing."""
    out = []
    for one in trials:
        name, late = one.recorded.name, one.plate.delay
        clocks = (
            f"What the encoders show at t the plate shows at t {late:+.3f} s; brought together by the motion "
            f"(correlation {one.plate.correlation:.3f})."
        )
        out.append(Attention("warn" if abs(late) > _APART else "note", clocks, name, "time_delay"))
        if one.surprise > _ODD:
            words = (
                f"The plate differs from the drawing by {one.surprise:.1f} times what its masses may be off by: look "
                f"for a load, an encoder with another zero or sign, or hands on the robot."
            )
            out.append(Attention("warn", words, name, "drawing"))
        out += [Attention("warn", text, name, "plate") for text in one.recorded.warnings]
        out += [Attention("note", text, name, "encoders") for text in one.recorded.encoders.notes]
    return out


def _weights(done: Identification) -> list[Attention]:
    """Return what weighs more or less than drawn, beyond doubt."""
    if done.status == "failed":
        return [Attention("fail", done.cause, "", "identification")]
    total = np.zeros(done.sip.phi.size)
    total[::10] = 1.0
    drawn, mass = float(done.body.sip.mass.sum()), float(done.sip.mass.sum())
    reach = SIGMAS * float(np.sqrt(total @ done.sip.covariance @ total))
    out = []
    if abs(mass - drawn) > reach:
        out.append(
            f"The robot weighs {mass:.2f} ± {reach:.2f} kg, {abs(mass - drawn):.2f} kg "
            f"{'less' if mass < drawn else 'more'} than drawn ({drawn:.2f} kg)."
        )
    for known in done.known:
        reach = SIGMAS * known.sd
        if known.quantity == "mass" and known.verdict != "cannot be known" and abs(known.value - known.table) > reach:
            change = known.value - known.table
            out.append(
                f"{known.segment} is {abs(change):.3f} ± {reach:.3f} kg {'lighter' if change < 0 else 'heavier'} than "
                f"drawn: covers or cables {'off' if change < 0 else 'on'}?"
            )
    return [Attention("note", text, "", "mass") for text in out]

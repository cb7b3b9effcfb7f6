"""From a robot's recording and its URDF file to what its links weigh, with every doubt in a sentence."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.body.urdf import read_urdf
from biodance.diagnosis.robot import RobotFinding, robot_causes
from biodance.display import cause_in_words
from biodance.effects.plate_crosstalk import PlateCrosstalk
from biodance.effects.plate_gain import PlateGain
from biodance.effects.time_delay import TimeDelay
from biodance.errors import TrialRefused
from biodance.identification.added_mass import LoadSearch
from biodance.identification.base_parameters import BaseEstimate
from biodance.identification.identification import Identification
from biodance.identification.knowledge import SIGMAS
from biodance.identification.robot import identify_links
from biodance.identification.validation import TrialValidation
from biodance.lab.prepare import LowPass, low_pass
from biodance.lab.robot import RobotRecording, read_robot_recording
from biodance.motion.dynamics import Agreement, compare, predict_wrench
from biodance.motion.grounded import RATE, fit_plate, onto_plate
from biodance.pipeline.identification import SessionIdentification, kept_gain
from biodance.pipeline.robot_trials import ODD, MatchedTrial, bring_together
from biodance.records import Wrench
from biodance.records.attention import Attention, Judged, strongest_first
from biodance.spatial import cross, elementary_rotation, quaternion_matrix, wrench_about_point


def of_file(notes: tuple[str, ...]) -> list[Attention]:
    """Return what was made of the robot's file."""
    return [Attention("warn" if note.startswith("Mended") else "note", note, "", "drawing") for note in notes]


def attention_of(trials: list[MatchedTrial]) -> list[Attention]:
    """Return what a person should know of the recordings: clocks, plates, encoders, what contradicts the drawing."""
    out = []
    for one in trials:
        name, late = one.recorded.name, one.plate.delay
        clocks = (
            f"What the encoders show at t the plate shows at t {late:+.3f} s; brought together by the motion "
            f"(correlation {one.plate.correlation:.3f})."
        )
        out.append(Attention("warn" if abs(late) > 1.0 else "note", clocks, name, TimeDelay.name))  # s
        if one.innovation > ODD:
            words = (
                f"The plate differs from the drawing by {one.innovation:.1f} times what its masses may be off by: look "
                f"for a load, an encoder with another zero or sign, or hands on the robot."
            )
            out.append(Attention("warn", words, name, "drawing"))
        out += [Attention("warn", text, name, "plate") for text in one.recorded.warnings]
        out += [Attention("note", text, name, "encoders") for text in one.recorded.encoders.notes]
    return out


def cause_words(causes: tuple[RobotFinding, ...], *, doubtful: bool = False) -> list[Attention]:
    """Return what is not as drawn; ``doubtful`` where the motion kept is not predicted better without the causes."""
    if doubtful:
        names = ", ".join(f"{cause_in_words(one.cause.kind)} of {one.cause.where}" for one in causes)
        text = (
            f"Something is not as drawn that resembles {names}; without it the motion kept is not predicted better, so "
            f"nothing is named and nothing was taken out."
        )
        return [Attention("warn", text, "", "drawing")]
    out = []
    for one in causes:
        others = " or ".join(f"{cause_in_words(rival.kind)} of {rival.where}" for rival in one.rivals[:3])
        more = f" The recording does not tell it from: {others}." if others else ""
        text = f"{_finding_sentence(one)} It was taken out before the masses were identified.{more}"
        out.append(Attention("warn", text, "", one.cause.kind))
    return out


def _finding_sentence(one: RobotFinding) -> str:
    """Return a finding as a sentence, with its 95 % interval."""
    where, value, reach = one.cause.where, one.value, SIGMAS * one.sd
    angle = f"{np.degrees(value):.2f} ± {np.degrees(reach):.2f} degrees"
    several = len(one.cause.joints) > 1
    verb, its = ("give", "their encoders") if several else ("gives", "its encoder")
    match one.cause.kind:
        case "encoder_zero":
            return f"The encoder of {where} reads {angle} too much: its zero is not the drawing's."
        case "flexible_joint":
            return f"{where} {verb} under load behind {its}: {angle} per N·m."
        case "soft_sole":
            return f"Ground or sole give {where} under a standing foot: {angle} per N·m."
        case "backlash":
            return f"{where} {'have' if several else 'has'} play: {angle} between the two sides."
        case PlateGain.name:
            too = "large" if value > 0 else "small"
            return f"The plate reads {where} {100 * abs(value):.1f} ± {100 * reach:.1f} % too {too}."
        case PlateCrosstalk.name:
            return f"The plate's crosstalk from {where} is {100 * value:.1f} ± {100 * reach:.1f} %."
        case _:
            name = f"{cause_in_words(one.cause.kind)} of {where}"
            return f"The {name} is {value:.3g} ± {reach:.2g} {one.cause.unit}."


def misweighed(found: SessionIdentification) -> list[Attention]:
    """Return where the plate carries another weight than the identified robot has."""
    out = []
    for one in found.validations or found.fitted:
        seen, needed = (float(np.mean(wrench.value[one.use, 2])) for wrench in (one.measured, one.identified))
        text = (
            f"The plate carries {seen:.1f} N, the robot that moments and weight together tell weighs {needed:.1f} "
            f"N: look at the plate's zero and its gain of Fz; the recording does not tell which."
        )
        # The identified robot may differ from what the plate carries by 2 % of its weight.
        out += [Attention("warn", text, one.name, "plate")] * (abs(seen - needed) > 0.02 * needed)
    return out


def weights(done: Identification) -> list[Attention]:
    """Return what weighs more or less than drawn, beyond doubt."""
    if done.status == "failed":
        return [Attention("fail", done.cause, "", "identification")]
    total = np.zeros(done.sip.phi.size)
    total[::10] = 1.0  # picks the masses: their sum is total'phi, its variance total'C total
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


_NEAR = 0.3
"""s: clocks that were brought together are not moved further for validation."""
_SLOW = 1.0
"""Hz: faster, what is left is noise of encoders and contact, the same with and without a cause."""
_NO_SEARCH = "Of a robot, what differs from the drawing is told link by link instead."


@dataclass(frozen=True, eq=False)
class RobotResult:
    """What a recording says about a robot: ``identified`` as of people, ``alone`` the base parameters as
    the paper counts them (every frame independent), ``causes`` of what is not as drawn (taken out before), ``in_root``
    agreements of drawing and identified robot by trial in the root's frame (paper Table II), ``trials``,
    ``attention``, ``judged``, the ``urdf``, and the ``verdict``: clean, named or unexplained.
    """

    recording: RobotRecording
    urdf: Path
    body: Body
    trials: tuple[MatchedTrial, ...]
    identified: SessionIdentification
    alone: BaseEstimate
    in_root: dict[str, tuple[Agreement, Agreement]]
    causes: tuple[RobotFinding, ...]
    attention: tuple[Attention, ...]
    judged: tuple[Judged, ...]
    verdict: str = "clean"

    @property
    def needs_a_person(self) -> bool:
        """Whether anything stronger than a note was said."""
        return any(one.level != "note" for one in self.attention)


def identify_robot(
    recording: str | Path,
    *,
    urdf: str | Path,
    feet: tuple[str, str],
    mend: bool = False,
    tell: Callable[[str], None] = lambda _: None,
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
    mend : bool, default False
        Take a solid box in place of a link of the file that is no possible body.
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
    body = read_urdf(urdf, feet=feet, mend=mend)
    found = read_robot_recording(recording, tuple(joint.name for joint in body.joints))
    trials, refused = bring_together(body, found, tell=tell)
    fitted, kept = _fitted_and_kept(trials)
    if not fitted:
        reasons = " ".join(refused.values()) or "No trial has the role fit."
        raise TrialRefused(reasons)
    tell("identifying")
    name = found.folder.name
    plain, alone = _identified(body, name, fitted, kept)
    tell("looking for what is not as drawn")
    found_causes, mended = robot_causes(body, tuple(fitted), tuple(kept))
    causes: tuple[RobotFinding, ...] = ()
    best, used = plain, (*fitted, *kept)
    if found_causes:
        count = len(fitted)
        other, other_alone = _identified(body, name, mended[:count], mended[count:])
        # named only where the motion that was kept is predicted better without them
        if _residual_rms(other) < _residual_rms(plain):
            causes, best, alone, used = found_causes, other, other_alone, mended
    doubtful = bool(found_causes) and not causes
    seen, wrong = (*best.fitted, *best.validations), misweighed(best)
    in_root = {v.name: _in_root(one, v) for one, v in zip(used, seen, strict=bool(seen))}
    words = (*cause_words(found_causes, doubtful=doubtful), *wrong, *weights(best.identification))
    lost = [Attention("warn", why, name, "trial") for name, why in refused.items()]
    said = strongest_first([*of_file(body.notes), *lost, *attention_of(trials), *words])
    judged = tuple(Judged(one.recorded.name, float(one.fit.use.sum()) / RATE) for one in trials)
    missed = tuple(Judged(name, 0.0, why, missed=True) for name, why in refused.items())
    verdict = "named" if causes else "unexplained" if doubtful or wrong else "clean"
    return RobotResult(
        found, Path(urdf), body, tuple(trials), best, alone, in_root, causes, said, (*judged, *missed), verdict
    )


def _identified(
    body: Body, name: str, fitted: Sequence[MatchedTrial], kept: Sequence[MatchedTrial]
) -> tuple[SessionIdentification, BaseEstimate]:
    """Identify from the ``fitted`` trials, with what is predicted of every trial; and the base parameters alone."""
    done, alone = identify_links(body, tuple(fitted))
    search = LoadSearch((), float("nan"), "the drawing", doubts=(_NO_SEARCH,))
    one = SessionIdentification(name, done, (), (), {}, None, search, notes=done.notes)
    if done.status == "failed":
        return replace(one, failures={"links": done.cause}), alone
    first, last = (tuple(_validation(done, trial) for trial in some) for some in (fitted, kept))
    notes = list(done.notes)
    gain = kept_gain(last, notes)
    agreements = {trial.name: trial.identified_agreement for trial in (*first, *last)}
    told = replace(one, fitted=first, validations=last, agreements=agreements, gain=gain, notes=tuple(notes))
    return told, alone


def _residual_rms(one: SessionIdentification) -> float:
    """Return what is left of kept motions below `_SLOW`, where causes show: mean logarithm of the RMS."""
    rms = []
    for trial in one.validations or one.fitted:
        slow = low_pass(trial.measured.value - trial.identified.value, trial.measured.rate, LowPass(cutoff=_SLOW))
        rms.append(np.sqrt(np.mean(slow[trial.use] ** 2, axis=0)))
    return float(np.mean(np.log(rms))) if rms else float("inf")


def _fitted_and_kept(trials: list[MatchedTrial]) -> tuple[list[MatchedTrial], list[MatchedTrial]]:
    """Return the trials to identify from and those kept; where none was kept, the end of every one is."""
    fitted = [one for one in trials if one.recorded.role == "fit"]
    kept = [one for one in trials if one.recorded.role in ("validate", "check")]
    if kept or not fitted:
        return fitted, kept
    first, last = [], []
    for one in fitted:
        # cut where the last share of what may be used begins, not of all that was recorded
        use = np.flatnonzero(one.fit.use)
        cut = use[int(0.8 * use.size)] if use.size else 0  # the last fifth of every trial
        early = np.arange(one.fit.use.size) < cut
        first.append(replace(one, fit=replace(one.fit, use=one.fit.use & early)))
        last.append(replace(one, fit=replace(one.fit, use=one.fit.use & ~early)))
    return first, last


def _validation(done: Identification, one: MatchedTrial) -> TrialValidation:
    """Return one trial in the plate's frame; drawing and identified robot stand each where it fits best."""
    motion, use = one.fit.motion, one.fit.use
    measured = onto_plate(one.fit.wrench.value, one.plate)
    predicted = []
    for body in (done.body, done.identified):
        needed = predict_wrench(body, motion)
        fit = fit_plate(needed, Wrench(motion.time, measured), one.grounded.use, within=_NEAR)
        predicted.append(onto_plate(needed.value, fit))
    about = np.nanmean(Wrench(motion.time, measured).cop()[use], axis=0)
    truth, table, found = (Wrench(motion.time, wrench_about_point(value, about)) for value in (measured, *predicted))
    return TrialValidation(
        one.recorded.name, about, truth, table, found, use, compare(truth, table, use), compare(truth, found, use)
    )


def _in_root(one: MatchedTrial, seen: TrialValidation) -> tuple[Agreement, Agreement]:
    """Return both agreements in the axes of the robot's root, as the paper compares: there all channels move."""
    q = one.fit.motion.q
    on_plate = elementary_rotation("z", one.plate.yaw)
    turn = on_plate @ quaternion_matrix(q[:, 3:7])
    # from the root, as it stands on the plate, to the point that the moments are about
    arm = seen.about - [*one.plate.place, 0.0] - q[:, :3] @ on_plate.T

    def turned(wrench: Wrench) -> Wrench:
        force, moment = wrench.value[:, :3], wrench.value[:, 3:]
        # M about the root = M about the point + arm x F
        moment = moment + cross(arm, force)
        both = [np.einsum("tji,tj->ti", turn, part) for part in (force, moment)]
        return Wrench(wrench.time, np.concatenate(both, axis=1))

    truth, table, found = (turned(one) for one in (seen.measured, seen.table, seen.identified))
    return compare(truth, table, seen.use), compare(truth, found, seen.use)

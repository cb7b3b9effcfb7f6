"""From a robot's recording and its URDF file to what its links weigh, with every doubt about the recording in a
sentence.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.body.robot.urdf import read_urdf
from biodance.diagnosis.robot import RobotFinding, robot_causes
from biodance.errors import BiodanceError, TrialRefused
from biodance.identification.added_mass import LoadSearch
from biodance.identification.base_parameters import BaseEstimate
from biodance.identification.identification import Identification
from biodance.identification.robot import identify_links
from biodance.identification.validation import TrialValidation, residual_ratio
from biodance.lab.robot.recording import RobotRecording, read_robot_recording
from biodance.motion.clocks import fit_plate, onto_plate
from biodance.motion.comparison import compare
from biodance.motion.grounded import RATE
from biodance.motion.regressor import predict_wrench
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.robot_trials import MatchedTrial, bring_together
from biodance.pipeline.robot_words import cause_words, refusals, told_of, weights
from biodance.records import Wrench
from biodance.records.attention import Attention, Judged, strongest_first
from biodance.spatial import wrench_about_point

_KEPT = 0.2
"""Share of every trial, at its end, that is kept where no trial is."""
_NO_SEARCH = "Of a robot, what differs from the drawing is told link by link instead."


@dataclass(frozen=True, eq=False)
class RobotResult:
    """What a recording says about a robot: ``identified`` as of people, ``alone`` the base parameters as
    the paper counts them (every frame independent), ``causes`` of what is not as drawn (taken out before), ``trials``,
    ``attention``, ``judged``, and the ``urdf``.
    """

    recording: RobotRecording
    urdf: Path
    body: Body
    trials: tuple[MatchedTrial, ...]
    identified: SessionIdentification
    alone: BaseEstimate
    causes: tuple[RobotFinding, ...]
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
    tell("looking for what is not as drawn")
    causes, fitted, kept = _without_causes(body, fitted, kept)
    tell("identifying")
    done, alone = identify_links(body, tuple(one.motion for one in fitted))
    tell("validating")
    identified = _validated(found.folder.name, done, fitted, kept)
    said = strongest_first([*refusals(refused), *told_of(trials), *cause_words(causes), *weights(done)])
    judged = tuple(Judged(one.recorded.name, float(one.motion.fit.use.sum()) / RATE) for one in trials)
    lost = tuple(Judged(name, 0.0, why, missed=True) for name, why in refused.items())
    return RobotResult(found, Path(urdf), body, tuple(trials), identified, alone, causes, said, (*judged, *lost))


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


def _without_causes(
    body: Body, fitted: list[MatchedTrial], kept: list[MatchedTrial]
) -> tuple[tuple[RobotFinding, ...], list[MatchedTrial], list[MatchedTrial]]:
    """Return what is not as drawn, and the trials without it."""
    causes, motions = robot_causes(body, tuple(one.motion for one in fitted), tuple(one.motion for one in kept))
    trials = [replace(one, motion=motion) for one, motion in zip((*fitted, *kept), motions, strict=True)]
    return causes, trials[: len(fitted)], trials[len(fitted) :]


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
    measured = onto_plate(one.motion.fit.wrench.value, one.plate)
    predicted = []
    for body in (done.body, done.identified):
        needed = predict_wrench(body, motion)
        fit = fit_plate(needed, Wrench(motion.time, measured), one.motion.grounded.use)
        predicted.append(onto_plate(needed.value, fit))
    point = Wrench(motion.time, measured).cop()[use]
    about = np.nanmean(point, axis=0)
    truth, table, found = (Wrench(motion.time, wrench_about_point(value, about)) for value in (measured, *predicted))
    return TrialValidation(
        one.recorded.name, about, truth, table, found, use, compare(truth, table, use), compare(truth, found, use)
    )

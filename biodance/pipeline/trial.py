"""One trial through all its steps, and what was found in it: gaps, motion, contact, simulated wrench beside the
measured one, quiet standing.

All records are frozen; arrays are in SI units in the lab frame (z up); a wrench is the ground's action on the subject
about the lab origin.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from biodance import display
from biodance.body.body import Body
from biodance.body.human.conventional import ConventionalModel
from biodance.body.human.skeleton import marker_groups
from biodance.cycles import TrialMovement, trial_movement
from biodance.diagnosis.spectrum import SHORTEST_RUN
from biodance.errors import BiodanceError, TrialRefused
from biodance.identification.statistics import Fit, believable, standing_point
from biodance.lab.c3d.subject import NO_OUTPUTS, read_outputs
from biodance.lab.markers.sets import canonical, read_marker_set
from biodance.lab.markers.signals import MarkerGaps, report_gaps
from biodance.lab.markers.time_axis import of_postures
from biodance.lab.plates.faults import PlateCorrection, correction_doubts
from biodance.lab.prepare import highest_frequency, motion_filter, prepare
from biodance.motion.contact import Contact, ground_contact
from biodance.motion.dynamics import compare, predict_wrench
from biodance.motion.newton import QuietStanding, quiet_standing
from biodance.motion.soles import Soles, soles_from_body, soles_from_markers
from biodance.motion.track import Followed, asked_cutoff, with_cutoff
from biodance.records import CHANNEL_TITLES, Array, LeftOut, Mask, Motion, Sip, Trial, Wrench, runs
from biodance.records.attention import seconds_left_out
from biodance.records.motion import AngleState

if TYPE_CHECKING:
    import pandas as pd


Status = Literal["ok", "warning", "refused"]


@dataclass(frozen=True)
class Step:
    """One step on one trial or on the session.

    ``status`` "done"; "refused": the data cannot carry it, ``text`` says why and what to do; "failed": a fault of
    biodance itself.
    """

    name: str
    status: Literal["done", "refused", "failed"]
    text: str = ""


ON_A_FRAME = "scale on a frame"
"""Name of the step that scales a body on one frame of a moving trial, without a static one."""


@dataclass(frozen=True, eq=False)
class MarkerFit:
    """Distances (m) to the model: by marker ``names`` (K), NaN = never seen, in all, ``by_group`` of the body."""

    names: tuple[str, ...]
    rms: Array
    max: Array
    total_rms: float
    total_max: float
    by_group: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class WrenchComparison:
    """Measured beside simulated wrench.

    ``time`` (T,) s; ``measured``, ``simulated`` (T, 6) N, N·m about the lab origin; ``used`` (T,) True where the plates
    measure all that the ground does; ``rms`` (6,) N, N·m and ``correlation`` (6,) over the used frames, NaN = not
    defined; ``notes`` why frames were left out.
    """

    time: Array
    measured: Array
    simulated: Array
    used: NDArray[np.bool_]
    rms: Array
    correlation: Array
    notes: tuple[str, ...] = ()

    def table(self) -> "pd.DataFrame":
        """Return measured and simulated wrench over time, and whether a frame is used.

        Returns
        -------
        pandas.DataFrame
            Index time (s); ``Fx measured (N)`` ..., ``Fx simulated (N)`` ... about the lab origin, ``used``.

        Examples
        --------
        >>> result["squat_1"].comparison.table().shape[1]
        13
        """
        import pandas as pd

        titles = [title.replace(" (", f" {which} (") for which in ("measured", "simulated") for title in CHANNEL_TITLES]
        out = pd.DataFrame(np.hstack([self.measured, self.simulated]), pd.Index(self.time, name="time (s)"), titles)
        return out.assign(used=self.used)

    def plot_wrench(self) -> NDArray[Any]:
        """Draw the measured beside the simulated wrench; frames that are not used are grey.

        Returns
        -------
        numpy.ndarray
            (6,) matplotlib axes: Fx, Fy, Fz, Mx, My, Mz over time.

        Examples
        --------
        >>> result["squat_1"].comparison.plot_wrench()[2].get_ylabel()
        'Fz (N)'
        """
        return display.side_by_side(self.time, self.measured, self.simulated, self.used, CHANNEL_TITLES)


OPEN = "posture left open"
"""The check of frames in which the markers do not fix the posture; they are left out of all comparisons of forces."""


@dataclass(frozen=True)
class Check:
    """One row of the quality table: ``value`` with its unit, the ``limit`` it is held against, whether ``inside``."""

    what: str
    where: str
    value: str
    limit: str
    inside: bool
    advice: str = ""


class WeighedBy(Enum):
    """How a session was weighed."""

    STANDING = "quiet standing"
    STRIDES = "whole strides"
    NEWTON = "the force against the trunk"


@dataclass(frozen=True)
class Weighing:
    """The ``mass`` kg on the plates with its standard deviation ``sd``, ``by`` what, in which ``trials``."""

    mass: float
    sd: float
    by: WeighedBy
    trials: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class ForceGain:
    """RMS difference (N) of forces ``without`` and ``with_them``, the joints; ``plain`` (T, 6) N, N·m without them."""

    trial: str
    without: tuple[float, ...]
    with_them: tuple[float, ...]
    plain: Array


def forces_told(forces: Sequence[ForceGain]) -> tuple[str, ...]:
    """Return in one sentence what the joints shown bring to the forces, horizontal and vertical; () without any."""
    if not forces:
        return ()
    # (trials, 3) N RMS by axis; over the axes squares add up, over the trials their mean counts
    without, with_them = (np.array([getattr(one, name) for one in forces]) for name in ("without", "with_them"))
    told = []
    for name, axes in (("horizontal", slice(0, 2)), ("vertical", slice(2, 3))):
        before, after = (float(np.sqrt(np.mean(np.sum(x[:, axes] ** 2, axis=1)))) for x in (without, with_them))
        change = 100 * (after / before - 1)
        word = "hardly changes" if abs(change) < 1 else f"{'falls' if change < 0 else 'grows'} by {abs(change):.0f} %"
        told.append(f"that of the {name} force {word} ({before:.1f} to {after:.1f} N)")
    return (
        f"Measured and simulated forces chose none of these joints; their RMS difference with them: {', '.join(told)}.",
    )


@dataclass(frozen=True, eq=False)
class TrialResult:
    """One trial after the ``steps`` so far: ``trial`` prepared (as read where preparing was refused); ``gaps`` as
    recorded, before any was filled; ``contact`` of the feet with the ground by the tracked body; ``recorded`` as read,
    until it is tracked.

    None where the data could not carry a result.
    """

    trial: Trial
    steps: tuple[Step, ...]
    gaps: tuple[MarkerGaps, ...] = ()
    fit: MarkerFit | None = None
    motion: Motion | None = None
    comparison: WrenchComparison | None = None
    standing: QuietStanding | None = None
    checks: tuple[Check, ...] = ()
    contact: Contact | None = None
    left_out: Mapping[LeftOut, float] = field(default_factory=dict)
    recorded: Trial | None = None

    def __repr__(self) -> str:
        close = f", markers {1000 * self.fit.total_rms:.1f} mm from the body" if self.fit else ""
        return f"TrialResult({self.name!r}, {self.trial.role}, {self.status}{close})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), None, self.reasons)

    @property
    def name(self) -> str:
        """Name of the trial."""
        return self.trial.name

    @property
    def moved(self) -> Motion:
        """The motion. Raises TrialRefused: the trial gives none; the message says why."""
        if self.motion is None:
            raise TrialRefused(f"Trial {self.name}: it gives no motion. {self.reason}".strip())
        return self.motion

    @property
    def usable(self) -> bool:
        """Whether all steps so far were done."""
        return all(step.status == "done" for step in self.steps)

    @property
    def compared_s(self) -> float:
        """For how many seconds the measured wrench is compared with the simulated one, after all gates."""
        found = self.comparison
        if found is None or self.motion is None or self.motion.time.size < 2:
            return 0.0
        left = (self.left_out.get(reason, 0.0) for reason in (LeftOut.FORCES_DIFFER, LeftOut.SHORT_RUN))
        return max(0.0, float(found.used.sum()) / self.motion.rate - sum(left))

    @property
    def gaps_percent(self) -> float:
        """Share of all marker samples that were not seen, %; NaN without markers."""
        return float(np.mean([gap.percent for gap in self.gaps])) if self.gaps else float("nan")

    @property
    def status(self) -> Status:
        """State: "refused" where nothing after preparing was done, "warning": a person must look, else "ok"."""
        if all(step.status != "done" or step.name == "prepare" for step in self.steps):
            return "refused"
        return "warning" if self.reasons or not all(check.inside for check in self.checks) else "ok"

    @property
    def reasons(self) -> tuple[str, ...]:
        """All refusals and warnings of this trial, each once, in order."""
        refusals = [step.text for step in self.steps if step.status != "done"]
        return tuple(dict.fromkeys([*refusals, *self.trial.warnings]))

    @property
    def reason(self) -> str:
        """The `reasons` and the checks outside their limits as one text; "" if there are none."""
        outside = [f"{one.what}: {one.value}, should be {one.limit}." for one in self.checks if not one.inside]
        return " ".join([*self.reasons, *(f"{said[:1].upper()}{said[1:]}" for said in outside)])


def trial_fit(result: TrialResult, corrections: tuple[PlateCorrection, ...] = ()) -> Fit | None:
    """Return what a trial gives to fit, with the doubt of ``corrections`` made in it; None without any frame."""
    found, trial = result.comparison, result.trial
    if found is None or result.motion is None or not found.used.any():
        return None
    doubts = {"doubts": correction_doubts(trial, corrections)} if corrections else {}
    measured, cutoff = Wrench(found.time, found.measured), highest_frequency(trial.settings)
    return Fit(trial.name, result.motion, measured, found.used, trial.settings.outlier, cutoff=cutoff, **doubts)


T = TypeVar("T")

log = logging.getLogger(__name__)


def attempt(steps: list[Step], name: str, work: Callable[[], T]) -> T | None:
    """Do ``work``, append what became of it to ``steps`` and return its result; None where it was refused or failed.

    A `BiodanceError` is a refusal: the data cannot carry this step. Any other exception is a fault of biodance: it is
    named as such, its traceback goes to the log (level debug), and the remaining steps are done all the same. Memory
    that is short ends the session.
    """
    try:
        value = work()
    except BiodanceError as error:
        steps.append(Step(name, "refused", str(error)))
        return None
    except MemoryError:
        raise  # of the machine, not of this step
    except Exception as error:
        log.debug("step %s failed", name, exc_info=True)
        fault = (
            f"biodance itself failed in the step {name} ({type(error).__name__}: {error}); the rest was done. "
            f"Please report this."
        )
        steps.append(Step(name, "failed", fault))
        return None
    steps.append(Step(name, "done"))
    return value


def prepare_trial(trial: Trial) -> TrialResult:
    """Return one trial prepared; a refusal is a step, and the trial stays as it was read."""
    steps: list[Step] = []
    done, markers = attempt(steps, "prepare", lambda: prepare(trial)), trial.markers
    if markers is not None and trial.marker_set:  # gaps of other markers concern nobody
        markers = canonical(markers, read_marker_set(trial.marker_set))
    gaps = () if markers is None else report_gaps(markers)
    return TrialResult(done or trial, tuple(steps), gaps, recorded=trial)


def filtered_as_it_asks(read: TrialResult, at: Followed | None, before: TrialResult | None = None) -> Trial:
    """Return a prepared trial whose forces and joint coordinates have the cut-off that its own markers ask for under
    the body that follows them, which is known where the same markers were examined ``before``; as it is where they ask
    for none, see `asked_cutoff`.
    """
    trial = read.trial
    if at is None or not trial.marker_set or read.recorded is None:
        return trial
    known = before.trial.settings.filter.cutoff if before is not None else "auto"
    cutoff = None if known == "auto" else known
    if before is None or read.recorded.settings.filter.cutoff != "auto":
        cutoff = asked_cutoff(read.recorded, at)
    return trial if cutoff is None else prepare(with_cutoff(read.recorded, cutoff))


def marker_fit(motion: Motion, groups: Mapping[str, str] | None = None) -> MarkerFit:
    """Return the distances (m) of markers to the model, by marker, in all, and by ``groups`` (marker -> group)."""
    squares = motion.residual**2
    seen = np.isfinite(squares)
    count = seen.sum(axis=0)
    total = np.where(seen, squares, 0.0)
    rms = np.sqrt(np.divide(total.sum(axis=0), count, out=np.full(count.shape, np.nan), where=count > 0))
    # a marker that was never seen has neither; NaN, without numpy's warning of empty means
    largest = np.where(count > 0, np.where(seen, motion.residual, -np.inf).max(axis=0, initial=-np.inf), np.nan)
    overall = np.sqrt(total.sum() / count.sum()) if count.any() else np.nan
    member = np.array([(groups or {}).get(name, "") for name in motion.marker_names])
    named = [one for one in dict.fromkeys(member.tolist()) if one and count[member == one].any()]
    by_group = {one: float(np.sqrt(total[:, member == one].sum() / count[member == one].sum())) for one in named}
    most = float(np.nanmax(largest)) if count.any() else np.nan
    return MarkerFit(motion.marker_names, rms, largest, float(overall), most, by_group)


def feet(trial: Trial, body: Body | None, motion: Motion | None) -> Soles:
    """Return the soles of the moving body, else of the foot markers. Raises TrialRefused: there is no motion, and no
    heel or toe marker.
    """
    if body is not None and motion is not None:
        return soles_from_body(body, motion)
    if trial.markers is None:
        raise TrialRefused(f"Trial {trial.name}: it has no markers, so nobody knows where the feet are.")
    return soles_from_markers(trial.markers, read_marker_set(trial.marker_set))


def at_an_end(trial: Trial, motion: Motion) -> Mask:
    """Return (T,) the frames of a movement within half a period of the cut-off from its first or last one: what lies
    beyond is made up by the low-pass, and so is a part of their acceleration.
    """
    if trial.role == "static" or of_postures(motion.time):
        return np.zeros(motion.time.size, dtype=bool)
    reach = 0.5 / motion_filter(trial.settings).cutoff
    return (motion.time < motion.time[0] + reach) | (motion.time > motion.time[-1] - reach)


def compare_wrenches(trial: Trial, body: Body, motion: Motion, contact: Contact) -> WrenchComparison:
    """Compare the measured wrench of a prepared trial with the one that ``motion`` needs, over the fully measured
    frames. Raises TrialRefused: no frame is fully measured; the message says why.
    """
    measured, simulated = trial.wrench, predict_wrench(body, motion)
    if np.nanmax(measured.force[:, 2], initial=0.0) < trial.settings.standing.force:
        raise TrialRefused(f"Trial {trial.name}: nobody stands on the plates, so there is no wrench to compare with.")
    if not contact.measured.any():
        raise TrialRefused(
            f"Trial {trial.name}: {' '.join(contact.notes)} So measured and simulated wrench cannot be compared."
        )
    # a posture that the markers leave open, or only fillings of their gaps fix, is a guess, and so are accelerations
    chosen = contact.measured & (motion.frame_state == AngleState.MEASURED) & ~at_an_end(trial, motion)
    if not chosen.any():
        raise TrialRefused(
            f"Trial {trial.name}: in no fully measured frame away from its ends do the markers fix the posture. "
            "See the gaps of the trial."
        )
    agreement = compare(measured, simulated, chosen)
    known = np.isfinite(measured.value).all(axis=1) & np.isfinite(simulated.value).all(axis=1)
    correlation = np.array([np.nan if value is None else value for value in agreement.correlation])
    notes = (*contact.notes, *agreement.notes)
    return WrenchComparison(
        measured.time, measured.value, simulated.value, chosen & known, agreement.rms, correlation, notes
    )


def track_trial(trial: Trial, at: Followed | None) -> Motion:
    """Return the motion of the body that follows the trial's markers; None: there is no body, or nothing to follow.

    Raises
    ------
    TrialRefused
        There are no markers, no known marker set, no body, or the markers do not determine the posture.
    """
    if trial.markers is None:
        raise TrialRefused(f"Trial {trial.name}: it has no markers, so no motion; only its plates are reported.")
    if not trial.marker_set:
        raise TrialRefused(
            f"Trial {trial.name}: its {len(trial.markers.names)} labels are of no known marker set, so no body can "
            "follow them. Label them as in anthropometry/marker_sets, or describe your own set in a TOML file of that "
            "form and give it with --markers FILE, or say [markers] file or map in session.toml."
        )
    if at is None:
        raise TrialRefused(f"Trial {trial.name}: there is no body to follow the markers (see the session).")
    return at.motion(trial)


def examine_trial(
    read: TrialResult, body: Body | None, *, mass: float, before: TrialResult | None = None
) -> TrialResult:
    """Take a prepared trial (`prepare_trial`) through the remaining steps; ``mass`` kg of the body, NaN = unknown;
    ``before`` the same trial, examined with other forces: the body has followed these markers. What has no markers or
    no body is not tracked, what has no plates is not compared: each is a step with its reason.
    """
    if not read.usable:
        return read
    worn, steps = read.trial.markers, list(read.steps)
    at = Followed(body, worn) if body is not None and worn is not None else None
    trial, followed = filtered_as_it_asks(read, at, before), before.motion if before else None
    motion = attempt(steps, "track", lambda: followed if followed is not None else track_trial(trial, at))
    groups = dict(zip(body.markers.names, marker_groups(body), strict=True)) if body else {}
    fit = marker_fit(motion, groups) if motion else None
    if not trial.plates:
        none = f"Trial {trial.name}: it has no usable force plate, so there is no wrench to compare with."
        return TrialResult(trial, (*steps, Step("wrench", "refused", none)), read.gaps, fit, motion)
    if not trial.marker_set:
        # no body can follow unknown labels, but whoever stands still can be weighed
        everything = np.asarray(np.isfinite(trial.wrench.value).all(axis=1))
        standing = attempt(steps, "standing", lambda: quiet_standing(trial, everything, None, None))
        return TrialResult(trial, tuple(steps), read.gaps, standing=standing)
    contact = attempt(steps, "contact", lambda: ground_contact(trial, feet(trial, body, motion), mass=mass))
    return compared(TrialResult(trial, tuple(steps), read.gaps, fit, motion, contact=contact), body)


def compared(one: TrialResult, body: Body | None) -> TrialResult:
    """Return a trial with what its contact lets judge: quiet standing, the wrenches, and what is left out of them."""
    contact, motion = one.contact, one.motion
    if contact is None:
        return one
    steps = [step for step in one.steps if step.name not in ("standing", "compare")]  # of an earlier contact
    standing = attempt(steps, "standing", lambda: quiet_standing(one.trial, contact.measured, body, motion))
    if body is None or motion is None:
        return replace(one, steps=tuple(steps), standing=standing)
    comparison = attempt(steps, "compare", lambda: compare_wrenches(one.trial, body, motion, contact))
    done = replace(one, steps=tuple(steps), comparison=comparison, standing=standing)
    return replace(done, left_out=_left_out(done, contact, body))


def _left_out(one: TrialResult, contact: Contact, body: Body) -> dict[LeftOut, float]:
    """Return how many seconds each gate takes out of the comparison of the wrenches of a trial."""
    if one.motion is None or one.motion.time.size < 2:
        return {}
    masks, fit = dict(contact.left_out), trial_fit(one)
    masks[LeftOut.POSTURE_OPEN] = one.motion.frame_state != AngleState.MEASURED
    masks[LeftOut.AT_AN_END] = at_an_end(one.trial, one.motion)
    if fit is not None:
        # gates in their order: frames that forces contradict, then what is left in runs too short to judge
        kept = believable(body, fit, standing_point((fit,)))[0].use
        masks[LeftOut.FORCES_DIFFER] = fit.use & ~kept
        masks[LeftOut.SHORT_RUN] = kept.copy()
        for start, stop in runs(kept):
            masks[LeftOut.SHORT_RUN][start:stop] = stop - start < SHORTEST_RUN * one.motion.rate
    return seconds_left_out(masks, one.motion.rate)


def movement_of(
    one: TrialResult, body: Body | None, sip: Sip | None, conventional: ConventionalModel | None = None
) -> TrialMovement:
    """Return what moved in one examined trial; ``sip`` None: moments with the body's own parameters. Raises
    TrialRefused: the trial gives no motion, or one too short.
    """
    if body is None or one.motion is None:
        raise TrialRefused(f"Trial {one.name}: it gives no motion. {one.reason}".strip())
    outputs, contact = NO_OUTPUTS, contact_of(one, body)
    with suppress(BiodanceError):  # what else its file holds, where that can be read again
        outputs = read_outputs(one.trial.source.path) if one.trial.source.format == "C3D" else NO_OUTPUTS
    legs = conventional.of(one.trial) if conventional else None
    return trial_movement(one.trial, body, one.motion, sip=sip, contact=contact, outputs=outputs, conventional=legs)


def contact_of(one: TrialResult, body: Body) -> Contact | None:
    """Return the ground contact of an examined trial; None without plates, or where it is refused."""
    if one.contact is not None or not one.trial.plates or one.motion is None:
        return one.contact
    with suppress(BiodanceError):
        return ground_contact(one.trial, soles_from_body(body, one.motion), mass=float(body.sip.mass.sum()))
    return None

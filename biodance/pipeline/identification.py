"""A session's masses, stage by stage, what they are worth on kept trials, an added load; and the quality table."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Literal

import numpy as np

from biodance import display
from biodance.body.body import Body
from biodance.body.tables.error_sizes import error_size
from biodance.diagnosis.diagnosis import Finding
from biodance.errors import BiodanceError, NotSolved, TrialRefused
from biodance.identification.added_mass import LoadSearch, added_mass
from biodance.identification.identification import Identification, identify_body
from biodance.identification.knowledge import SIGMAS
from biodance.identification.loads import nearest_segment
from biodance.identification.sessions import Difference, differences
from biodance.identification.statistics import Fit, standing_point
from biodance.identification.torques import Impact, TorqueBands, impacts, torques_on_plates
from biodance.identification.validation import (
    ResidualRatio,
    TrialValidation,
    plate_readings,
    residual_ratio,
    tissue_beside,
    validate,
)
from biodance.lab.plates.faults import PlateCorrection
from biodance.motion.dynamics import Agreement, compare, predict_wrench
from biodance.motion.newton import QuietStanding
from biodance.observations import recording
from biodance.observations.stride_force import StrideForce
from biodance.pipeline.trial import OPEN, Check, TrialResult, WeighedBy, Weighing, trial_fit
from biodance.records import ROLES, Role, Session, Sip, Subject
from biodance.settings import TOUCH_FORCE, CheckLimits
from biodance.threads import Sendable, one_thread
from biodance.uncertainty.plates import around_zero

if TYPE_CHECKING:
    import pandas as pd

    from biodance.dance.expectation import PerformanceScore


_MASS = "mass on the plates against declared"
_GROUPS = "marker distance, RMS by group"
_MARKERS = ("marker distance, RMS", "marker distance, largest")


def load_doubts(checks: Iterable[Check], *, weighed: bool) -> tuple[str, ...]:
    """Return why no load may be stated from a session: which of its ``checks`` failed.

    Markers far from the body make every mass doubtful. A weight other than declared is a load, a wrong declaration or
    a wrong plate, which only a session of the same person ``weighed`` without load can tell apart.
    """
    asked = _MARKERS if weighed else (*_MARKERS, _MASS)
    return tuple(
        f"{one.what}, {one.where}: {one.value} ({one.limit}). {one.advice}"
        for one in checks
        if not one.inside and one.what in asked
    )


def _upper(what: str, where: str, value: float, limit: float, unit: str, advice: str) -> Check:
    inside = bool(value <= limit)
    # as few digits as leave the printed value on the same side of its limit
    digits = next((k for k in (1, 2, 3) if (float(f"{value:.{k}f}") <= limit) is inside), 4)
    return Check(what, where, f"{value:.{digits}f} {unit}", f"at most {limit:.4g} {unit}", inside, advice)


def _group_check(
    by_group: Mapping[str, float], name: str, limits: CheckLimits, more: float, advice: str
) -> list[Check]:
    """Hold the markers of legs, trunk, arms and head each against so much ``more`` than their own limit; the one
    nearest to it speaks.
    """
    allowed = {group: more * getattr(limits, f"marker_{group}") for group in ("legs", "trunk", "arms", "head")}
    worst = max(by_group, key=lambda group: by_group[group] / allowed[group], default="")
    if not worst:
        return []
    said = ", ".join(f"{group} {1000 * limit:.3g}" for group, limit in allowed.items())
    value = f"{1000 * by_group[worst]:.1f} mm ({worst})"
    return [Check(_GROUPS, name, value, f"at most {said} mm", by_group[worst] <= allowed[worst], advice)]


def mass_check(subject: Subject, weighed: Weighing | None, limits: CheckLimits) -> list[Check]:
    """Compare the mass on the plates, by its 95 % interval, with the declared mass, where both are known."""
    if weighed is None or not np.isfinite(subject.declared_mass):
        return []
    half = 1.96 * weighed.sd  # kg
    difference, unsure = 100 * abs(weighed.mass / subject.mass - 1), 100 * half / subject.mass
    advice = f"{weighed.mass:.1f} ± {half:.1f} kg by {weighed.by.value}: weigh again, or check the plates' zero."
    said, limit = f"{difference:.1f} ± {unsure:.1f} %", f"at most {limits.mass:g} %"
    return [Check(_MASS, ", ".join(weighed.trials), said, limit, bool(difference - unsure <= limits.mass), advice)]


def standing_check(standing: QuietStanding | None, limits: CheckLimits) -> list[Check]:
    """Compare the mean centre of mass with the mean centre of pressure in quiet standing."""
    if standing is None or not standing.com.size:
        return []
    distance = 1000 * float(np.hypot(standing.com_ahead, standing.com_left))
    advice = "Check the plates' place in the lab, and the markers of pelvis and trunk."
    what = "centre of mass off the centre of pressure, standing"
    return [_upper(what, standing.trial, distance, 1000 * limits.standing, "mm", advice)]


def trial_checks(result: TrialResult, mass: float, *, on_a_frame: bool = False) -> list[Check]:
    """Check marker distances, gaps, measured frames and forces of one trial of a body of ``mass`` kg; ``on_a_frame``:
    its markers lie where a frame of movement had them, which adds what skin does there to what it does elsewhere.
    """
    name, limits, found = result.trial.name, result.trial.settings.checks, []
    # Two independent errors of one size where the static trial has none.
    more = math.sqrt(2) if on_a_frame else 1.0
    if result.fit:
        advice = "See the worst marker in the trial's figure: placed, labelled and filled rightly?"
        far = (result.fit.total_rms, limits.marker_rms), (result.fit.total_max, limits.marker_largest)
        for what, (size, limit) in zip(_MARKERS, far, strict=True):
            found.append(_upper(what, name, 1000 * size, 1000 * more * limit, "mm", advice))
        found += _group_check(result.fit.by_group, name, limits, more, advice)
    if result.motion is not None:
        share = 100 * float(np.mean(~result.motion.determined))
        advice = "See the gaps: which segment lost its markers?"
        found.append(_upper(OPEN, name, share, limits.open, "%", advice))
    if result.gaps:
        advice = "Fill the gaps in the capture software."
        found.append(_upper("markers not seen", name, result.gaps_percent, limits.gaps, "%", advice))
    comparison = result.comparison
    if comparison and result.trial.role != "static":
        seconds = comparison.used.sum() * float(np.median(np.diff(comparison.time)))
        advice = "Step onto the plates only, or record more of the trial on them."
        least, inside = f"at least {limits.seconds:g} s", seconds >= limits.seconds
        found.append(Check("fully measured", name, f"{seconds:.2f} s", least, inside, advice))
    if comparison and comparison.used.any():
        weight = mass * result.trial.settings.gravity
        share = 100 * float(np.max(comparison.rms[:3])) / weight
        # the error of a simulated force is that of its accelerations, by which the measured one moves about the weight
        force = comparison.measured[comparison.used, :3] - [0.0, 0.0, weight]
        moving = float(np.sqrt(np.mean(np.sum(force**2, axis=1)))) / weight
        limit = np.ceil(max(limits.force, limits.force_moving * moving))
        advice = "See the trial's wrench figure: is it an offset, a delay or a scale?"
        found.append(_upper("force difference, worst axis", name, share, float(limit), "% of weight", advice))
    return found


UNEXPLAINED = 0.5
"""kg between plates and identified body over the fit trials: more than the scale's uncertainty, shoes and a zero
allow.
"""


def unexplained_mass(fitted: tuple[TrialValidation, ...], gravity: float) -> float:
    """Return how many kg more the plates carry than the identified body, in the mean over the fitted trials."""
    # in the mean nobody accelerates upwards, so that the vertical force left over is a weight
    beyond = np.concatenate([(trial.measured.force - trial.identified.force)[trial.use, 2] for trial in fitted])
    return float(beyond.mean()) / gravity


def weight_notes(fitted: tuple[TrialValidation, ...], gravity: float) -> list[str]:
    """Say where plates and body differ in weight: the table's total is pinned to the declared mass."""
    missing = unexplained_mass(fitted, gravity)
    said = (
        f"The plates carry {abs(missing):.2f} kg {'more' if missing > 0 else 'less'} than the identified body, whose "
        "total is tied to the declared mass: a load, or a wrong mass_kg. Until that is settled the masses of single "
        "segments and their changes absorb it; see Added mass."
    )
    return [said] if abs(missing) > UNEXPLAINED else []


_STANDING, _MOVING = 0.002, 0.005
"""Standard deviation of a weight as a share of it: in quiet standing; of one person between movements (a belt at two
speeds 0.35 %, standing against walking)."""
NOT_WEIGHED = (
    "Nobody stands still, walks in whole steps or moves on the plates for long enough, so the declared mass cannot be "
    "checked. Record a few seconds of quiet standing on the plates."
)
"""What is said of a session that no plate weighs."""


def weigh(session: Session, standing: QuietStanding | None) -> Weighing | None:
    """Return what a session weighs; None where nobody stands still on the plates, walks over them in whole steps, or
    moves on them for half a second without a break.

    Of several steps or trials the median counts: one with a foot half beside the plates weighs too little.
    """
    if standing is not None:
        return Weighing(standing.mass, _STANDING * standing.mass, WeighedBy.STANDING, (standing.trial,))
    mass = session.subject.mass
    seen = [recording(trial, mass=mass) for trial in session.trials if trial.plates and trial.role != "skip"]
    strides = [one for trial in seen for one in StrideForce().whole(trial) if one.unit == "kg"]
    told = [(one.trial.name, one.newton.mass, one.newton.mass_sd) for one in seen if one.newton]
    by_strides = _median([(one.trial, one.value, one.sd) for one in strides], WeighedBy.STRIDES)
    return by_strides or _median(told, WeighedBy.NEWTON)


def with_weighed_mass(session: Session) -> Session:
    """Return a session with the mass that moving on the plates shows, where nobody declared or stood it."""
    found = None if np.isfinite(session.subject.mass) else weigh(session, None)
    if found is None:
        return session
    said = f"{found.mass:.1f} ± {1.96 * found.sd:.1f} kg were weighed by {found.by.value} in {', '.join(found.trials)}."
    return replace(session, subject=replace(session.subject, mass=found.mass), notes=(*session.notes, said))


def _median(found: list[tuple[str, float, float]], by: WeighedBy) -> Weighing | None:
    """Return the median of some weights (trial, kg, sd); None without a finite one."""
    known = [one for one in found if np.isfinite(one[1])]
    if not known:
        return None
    masses = np.array([value for _, value, _ in known])
    mass = float(np.median(masses))
    # 1.4826 MAD is the sd of normal values; that of their mean is smaller by the root of their number
    scatter = 1.4826 * float(np.median(np.abs(masses - mass))) / len(known) ** 0.5
    sd = float(np.linalg.norm([_MOVING * mass, scatter, min(own for *_, own in known)]))
    return Weighing(mass, sd, by, tuple(dict.fromkeys(name for name, *_ in known)))


PLATES_READ = (
    "Within the tolerances of plates these read {} beside the body, in the mean of the trials that were fitted. What "
    "table and identified body predict of the kept trials on these plates holds what each of them leaves to the plates."
)
"""What is said of plates whose errors the fitted trials tell."""
FITTED_ROLES: tuple[Role, ...] = ("fit",)
KEPT_ROLES: tuple[Role, ...] = ("validate", "check")


@dataclass(frozen=True, eq=False)
class SessionIdentification(Sendable):
    """All that identification found in a visit.

    Parameters
    ----------
    name : str
        Of the session.
    identification : Identification
        What the segments weigh.
    fitted, validations : tuple
        The trials used and the trials kept, each with table and identified body, about the mean centre of pressure.
    agreements : mapping
        Trial -> how well the identified body agrees with the plates, about the lab origin.
    gain : Gain or None
        RMS residual of the table over that of the identified body on the trials kept; None without an interval.
    search : AddedMass
        The loads looked for, against ``search.reference``.
    changes : tuple
        Since the reference session; () without one.
    shown : TrialResult or None
        The first trial kept (else fitted) whose plates tell what each foot carries: of its joints are `torques` and
        `impacts`.
    performance : PerformanceScore or None
        How well the dance that was shown was danced; None where none was named.
    notes : tuple of str
        What a person should know.
    failures : mapping
        What could not be computed ("segments", "reference", "differences"), each with cause and cure: without segments
        the fields that need them are empty.
    corrected : tuple of Finding
        What was proven to be wrong with the recordings, and was taken off before the fit (`with_proven_corrections`).
    posterior : SessionIdentification or None
        Beside one by the paper's programme (`by_paper`) that of the posterior; None for the latter.

    Examples
    --------
    >>> identified.status
    'solved'
    """

    name: str
    identification: Identification
    fitted: tuple[TrialValidation, ...]
    validations: tuple[TrialValidation, ...]
    agreements: Mapping[str, Agreement]
    gain: ResidualRatio | None
    search: LoadSearch
    changes: tuple[Difference, ...] = ()
    shown: TrialResult | None = None
    performance: "PerformanceScore | None" = None
    notes: tuple[str, ...] = ()
    failures: Mapping[str, str] = field(default_factory=dict)
    corrected: tuple[Finding, ...] = ()
    posterior: "SessionIdentification | None" = None

    def __repr__(self) -> str:
        sip = self.identification.sip
        return (
            f"SessionIdentification({self.name!r}: {self.status}, {len(sip.segments)} segments, "
            f"{sip.mass.sum():.1f} kg)"
        )

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table(), self.notes)

    @property
    def method(self) -> Literal["posterior", "paper"]:
        """How it was identified."""
        return "posterior" if self.posterior is None else "paper"

    @property
    def status(self) -> Literal["solved", "failed"]:
        """Whether the fit was solved; a failed one keeps the table's values and says so."""
        return self.identification.status

    @property
    def proven(self) -> Sip | None:
        """What joint moments are computed with: identified parameters that kept trials prove, None for the table's."""
        return self.identification.sip if self.gain is not None and self.gain.is_proven else None

    @cached_property
    def torques(self) -> TorqueBands | None:
        """Joint torques with bands in the trial ``shown``, computed when asked for; None without one."""
        one = self.shown
        if one is None or one.motion is None or one.comparison is None:
            return None
        return torques_on_plates(self.identification, one.trial, one.motion, one.comparison.used)

    @cached_property
    def impacts(self) -> tuple[Impact, ...]:
        """Pull of each quantity and what it means for knee and hip in `torques`, largest first."""
        if self.torques is None or self.shown is None or self.shown.motion is None:
            return ()
        return impacts(self.identification, self.shown.motion, self.torques.use)

    def table(self, quantity: str = "mass") -> "pd.DataFrame":
        """Return one row for each segment, see `Identification.table`.

        Parameters
        ----------
        quantity : str
            "mass", "com x" ... or "Ixx" ....

        Returns
        -------
        pandas.DataFrame
            Table and identified value with intervals, each with its unit.

        Examples
        --------
        >>> list(identified.table().columns[:3])
        ['table (kg)', 'table sd (kg)', 'identified (kg)']
        """
        return self.identification.table(quantity)


def can_identify(results: tuple[TrialResult, ...]) -> bool:
    """Whether any trial with role fit can be identified from."""
    return bool(fits_of_roles(results, FITTED_ROLES))


@one_thread()
def identify_trials(
    body: Body,
    results: tuple[TrialResult, ...],
    *,
    name: str,
    reference: SessionIdentification | None = None,
    checks: tuple[Check, ...] = (),
    prior: Sip | None = None,
    corrections: tuple[PlateCorrection, ...] = (),
    weighed: Weighing | None = None,
) -> SessionIdentification:
    """Identify ``body`` from the trials with role fit, validate on those kept, and look for a load.

    ``name`` of the session; ``reference`` an earlier, unloaded session of the same person: what changed since is told,
    and a load is looked for against it; without it, against the table. ``checks`` of the session: where they or those
    of the trials failed, no load is stated (`load_doubts`). ``prior`` is what is known of the body before (by default
    the table). ``corrections`` were made in the trials: their standard deviations count in every interval.
    ``weighed`` on the plates: the mass that parts the gain into mass and distribution, by default the identified one.

    Raises
    ------
    TrialRefused
        No trial with role fit has motion and fully measured ground contact.
    """
    fits = fits_of_roles(results, FITTED_ROLES, *corrections)
    if not fits:
        raise TrialRefused(
            f"Session {name} has no trial with role fit in which markers and plates measure all, so nothing can be "
            "identified. Record movement on the plates, or set roles in session.toml."
        )
    found = identify_body(body, fits, prior=prior)
    failures = {"segments": found.cause} if found.status == "failed" else {}
    if reference is not None and "segments" in reference.failures:
        failures["reference"] = (
            f"Session {reference.name} tells no body to compare with, so loads are looked for against the table and "
            f"no change is told. {reference.failures['segments']}"
        )
        reference = None
    # what is wrong with a kept trial cannot be in the body, which was fitted without it
    own = (*checks, *(check for one in results if one.trial.role in FITTED_ROLES for check in one.checks))
    earlier = () if reference is None else (f"Session {reference.name}: {one}" for one in reference.search.doubts)
    doubts = (*load_doubts(own, weighed=reference is not None), *earlier)
    search = added_mass(found, reference=reference.identification if reference else None, doubts=doubts)
    lies_on = nearest_segment(body, tuple(fit.motion for fit in fits), search.best.segment, search.best.place)
    load = replace(search, lies_on=lies_on, reference=f"session {reference.name}" if reference else search.reference)
    # after a failed fit the body is the table, and no change since is one of the person
    changes: tuple[Difference, ...] = ()
    if reference is not None and found.status != "failed":
        try:
            changes = differences(reference.identification, found)
        except NotSolved as why:
            failures["differences"] = str(why)
    one = SessionIdentification(name, found, (), (), {}, None, load, changes, notes=found.notes, failures=failures)
    told = one if found.status == "failed" else predicted(one, results, weighed, corrections)
    return _weighed(told, reference) if reference is not None and found.status == "solved" else told


def _weighed(one: SessionIdentification, reference: SessionIdentification) -> SessionIdentification:
    """Return the same with a note of what plates and scale say about the weight of both sessions, where they differ."""
    # (declared, on the plates over the fitted trials) kg, in the session before and in this one
    then, now = (
        (
            float(some.identification.posterior.prior.mass.sum()),
            float(some.identification.sip.mass.sum())
            + unexplained_mass(some.fitted, -float(some.identification.body.gravity[2])),
        )
        for some in (reference, one)
    )
    declared, carried = now[0] - then[0], now[1] - then[1]
    gain, scale = around_zero("plate_gain Fz") * then[1], error_size("scale", "mass")
    # each of two sessions errs by itself: the sd of a difference is the root of 2 times as large
    limits = [SIGMAS * np.sqrt(2.0) * sd for sd in (scale, gain)]
    if abs(declared) <= limits[0] and abs(carried) <= limits[1]:
        return one
    note = (
        f"Declared are {then[0]:.1f} kg in session {reference.name} and {now[0]:.1f} kg here ({declared:+.2f} ± "
        f"{limits[0]:.2f} kg); the plates carry {then[1]:.1f} and {now[1]:.1f} kg ({carried:+.2f} kg, "
        f"± {limits[1]:.2f} kg unless their gain is the same). A load is looked for beyond the mass of session "
        f"{reference.name}, whatever is declared here."
    )
    return replace(one, notes=(*one.notes, note))


def predicted(
    one: SessionIdentification,
    results: tuple[TrialResult, ...],
    weighed: Weighing | None,
    corrections: tuple[PlateCorrection, ...] = (),
) -> SessionIdentification:
    """Return the same with what the identified body predicts of all trials, in which ``corrections`` were made."""
    told_of = [one for one in results if one.motion is not None and one.comparison is not None and one.trial.plates]
    shown = (one for role in (*KEPT_ROLES, *FITTED_ROLES) for one in told_of if one.trial.role == role)
    found, identified, mass = one.identification, one.identification.identified, weighed.mass if weighed else None
    parts = [fits_of_roles(results, roles, *corrections) for roles in (FITTED_ROLES, KEPT_ROLES)]
    about, every = standing_point(parts[0]), fits_of_roles(results, ROLES)
    notes, on_same, plates, tissue = list(one.notes), _on_fitted_plates(results), None, None
    if on_same.intersection(fit.name for fit in parts[1]):
        beside, table = (one.posterior or one).identification, found.body.sip
        # the table of a person of the weighed mass: all ten parameters of a segment grow with it
        share = (mass or table.mass.sum()) / table.mass.sum()
        weighed_table = replace(found.body, sip=Sip(table.segments, share * table.phi, table.covariance))
        of_table, own = plate_readings(beside, parts[0], weighed_table, identified)
        plates, told = (of_table, own), own.told(parts[0], identified)
        tissue = tissue_beside(beside, parts[0], identified, own)
        notes += [PLATES_READ.format(told)] * bool(told)
    judged = partial(validate, found.body, identified, about=about, mass=mass)
    fitted = tuple(judged(fit) for fit in parts[0])
    on_these = partial(judged, plates=plates, tissue=tissue)
    kept = tuple((on_these if fit.name in on_same else judged)(fit) for fit in parts[1])
    if not kept:
        notes.append(
            "No trial was kept for validation, so the gain is not proven. Record squats, or give a trial the role "
            "validate."
        )
    notes += weight_notes(fitted, -float(found.body.gravity[2]))
    return replace(
        one,
        fitted=fitted,
        validations=kept,
        agreements={f.name: compare(f.wrench, predict_wrench(identified, f.motion), f.use) for f in every},
        gain=kept_gain(kept, notes),
        shown=next(shown, None),  # the first trial kept, else fitted, whose plates tell what each foot carries
        notes=tuple(notes),
    )


def _on_fitted_plates(results: tuple[TrialResult, ...]) -> frozenset[str]:
    """Return the trials that stand on no other plates than those that were fitted: of others nothing was told."""
    on = {
        one.name: {p.name for p in one.trial.plates if (np.abs(p.wrench.value[:, 2]) > TOUCH_FORCE).any()}
        for one in results
    }
    fitted = set[str]().union(*(on[one.name] for one in results if one.trial.role in FITTED_ROLES))
    return frozenset(name for name, plates in on.items() if plates <= fitted)


def fits_of_roles(results: tuple[TrialResult, ...], roles: tuple[Role, ...], *made: PlateCorrection) -> tuple[Fit, ...]:
    """Return the trials of some roles as identification takes them, less the corrections ``made``."""
    found = [trial_fit(result, made) for result in results if result.trial.role in roles]
    return tuple(fit for fit in found if fit is not None)


def kept_gain(kept: tuple[TrialValidation, ...], notes: list[str]) -> ResidualRatio | None:
    """Return the gain on the trials that were kept; None without any, or, said in ``notes``, without an interval."""
    try:
        return residual_ratio(kept) if kept else None
    except BiodanceError as error:
        notes.append(str(error))
        return None

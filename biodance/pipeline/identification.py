"""What the session says about the body: identification from the fit trials, validation on the others, search for a
load.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
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
from biodance.identification.validation import ResidualRatio, TrialValidation, residual_ratio, validate
from biodance.lab.corrections import PlateCorrection
from biodance.motion.dynamics import Agreement, compare, predict_wrench
from biodance.pipeline.checks import load_doubts, unexplained_mass, weight_notes
from biodance.pipeline.trial_result import Check, TrialResult, Weighing, trial_fit
from biodance.records import ROLES, Role, Sip
from biodance.threads import Sendable, one_thread
from biodance.uncertainty.plates import around_zero

if TYPE_CHECKING:
    import pandas as pd

    from biodance.dance.expectation import PerformanceScore

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
        """How far each quantity was pulled from its prior and what it means for knee and hip in the trial of
        `torques`, the largest impact first.
        """
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
    own = (*checks, *(check for one in results if one.trial.role in FITTED_ROLES for check in one.checks))
    earlier = () if reference is None else (f"Session {reference.name}: {one}" for one in reference.search.doubts)
    doubts = (*load_doubts(own, weighed=reference is not None), *earlier)
    search = added_mass(found, reference=reference.identification if reference else None, doubts=doubts)
    lies_on = nearest_segment(body, tuple(fit.motion for fit in fits), search.best.segment, search.best.place)
    load = replace(search, lies_on=lies_on, reference=f"session {reference.name}" if reference else search.reference)
    changes = _changes(reference, found, failures)
    one = SessionIdentification(name, found, (), (), {}, None, load, changes, notes=found.notes, failures=failures)
    told = one if found.status == "failed" else predicted(one, results, weighed)
    return _weighed(told, reference) if reference is not None and found.status == "solved" else told


def _weighed(one: SessionIdentification, reference: SessionIdentification) -> SessionIdentification:
    """Return the same with a note of what plates and scale say about the weight of both sessions, where they differ."""
    then, now = (_weights(some) for some in (reference, one))
    declared, carried = now[0] - then[0], now[1] - then[1]
    gain, scale = around_zero("plate_gain Fz") * then[1], error_size("scale", "mass")
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


def _weights(one: SessionIdentification) -> tuple[float, float]:
    """Return the declared mass and what the plates carried over the fitted trials, kg."""
    gravity = -float(one.identification.body.gravity[2])
    body = float(one.identification.sip.mass.sum())
    return float(one.identification.posterior.prior.mass.sum()), body + unexplained_mass(one.fitted, gravity)


def _changes(
    reference: SessionIdentification | None, found: Identification, failures: dict[str, str]
) -> tuple[Difference, ...]:
    """Return what changed since the session ``reference``; why that cannot be told is added to ``failures``."""
    if reference is None or found.status == "failed":
        return ()
    try:
        return differences(reference.identification, found)
    except NotSolved as why:
        failures["differences"] = str(why)
        return ()


def predicted(
    one: SessionIdentification, results: tuple[TrialResult, ...], weighed: Weighing | None
) -> SessionIdentification:
    """Return the same with what the identified body predicts of all trials."""
    found, identified, mass = one.identification, one.identification.identified, weighed.mass if weighed else None
    parts = [fits_of_roles(results, roles) for roles in (FITTED_ROLES, KEPT_ROLES)]
    about, every = standing_point(parts[0]), fits_of_roles(results, ROLES)
    fitted, kept = (
        tuple(validate(found.body, identified, fit, about=about, mass=mass) for fit in some) for some in parts
    )
    notes = list(one.notes)
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
        shown=_shown(results),
        notes=tuple(notes),
    )


def _shown(results: tuple[TrialResult, ...]) -> TrialResult | None:
    """Return the first trial kept, else the first fitted, whose plates tell what each foot carries."""
    told = [one for one in results if one.motion is not None and one.comparison is not None and one.trial.plates]
    return next((one for role in (*KEPT_ROLES, *FITTED_ROLES) for one in told if one.trial.role == role), None)


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

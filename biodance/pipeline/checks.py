"""What a session weighs on the plates (in quiet standing, else over whole strides, else by Newton against the trunk),
and the quality table: a few numbers of a session beside the limits they are held against.

The limits, and where they come from, are `biodance.settings.CheckLimits`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from biodance.identification.validation import TrialValidation
from biodance.motion.quiet_standing import QuietStanding
from biodance.observations import recording
from biodance.observations.stride_force import StrideForce
from biodance.pipeline.trial_result import Check, TrialResult, WeighedBy, Weighing
from biodance.records import Session, Subject
from biodance.settings import CheckLimits

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
    digits = next((k for k in (1, 2, 3) if (float(f"{value:.{k}f}") <= limit) is inside), 4)
    return Check(what, where, f"{value:.{digits}f} {unit}", f"at most {limit:g} {unit}", inside, advice)


def _group_check(by_group: Mapping[str, float], name: str, limits: CheckLimits, advice: str) -> list[Check]:
    """Hold the markers of legs, trunk, arms and head each against their own limit; the one nearest to it speaks."""
    allowed = {group: getattr(limits, f"marker_{group}") for group in ("legs", "trunk", "arms", "head")}
    worst = max(by_group, key=lambda group: by_group[group] / allowed[group], default="")
    if not worst:
        return []
    said = ", ".join(f"{group} {1000 * limit:g}" for group, limit in allowed.items())
    value = f"{1000 * by_group[worst]:.1f} mm, {worst}"
    return [Check(_GROUPS, name, value, f"at most {said} mm", by_group[worst] <= allowed[worst], advice)]


def mass_check(subject: Subject, weighed: Weighing | None, limits: CheckLimits) -> list[Check]:
    """Compare the mass on the plates with the declared mass, where both are known."""
    if weighed is None or not np.isfinite(subject.mass) or "mass" in subject.guessed:
        return []
    difference = abs(100 * (weighed.mass / subject.mass - 1))
    advice = f"{weighed.mass:.1f} ± {weighed.sd:.1f} kg by {weighed.by.value}: weigh again, or check the plates' zero."
    return [_upper(_MASS, ", ".join(weighed.trials), difference, limits.mass, "%", advice)]


def standing_check(standing: QuietStanding | None, limits: CheckLimits) -> list[Check]:
    """Compare the mean centre of mass with the mean centre of pressure in quiet standing."""
    if standing is None or not standing.com.size:
        return []
    distance = 1000 * float(np.hypot(standing.com_ahead, standing.com_left))
    advice = "Check the plates' place in the lab, and the markers of pelvis and trunk."
    what = "centre of mass off the centre of pressure, standing"
    return [_upper(what, standing.trial, distance, 1000 * limits.standing, "mm", advice)]


def trial_checks(result: TrialResult, mass: float) -> list[Check]:
    """Check marker distances, gaps, measured frames and forces of one trial; ``mass`` kg of the body, for the body
    weight.
    """
    name, limits, found = result.trial.name, result.trial.settings.checks, []
    if result.fit:
        advice = "See the worst marker in the trial's figure: placed, labelled and filled rightly?"
        far = (result.fit.total_rms, limits.marker_rms), (result.fit.total_max, limits.marker_largest)
        for what, (size, limit) in zip(_MARKERS, far, strict=True):
            found.append(_upper(what, name, 1000 * size, 1000 * limit, "mm", advice))
        found += _group_check(result.fit.by_group, name, limits, advice)
    if result.motion is not None:
        share = 100 * float(np.mean(~result.motion.determined))
        advice = "See the gaps: which segment lost its markers?"
        found.append(_upper("posture left open", name, share, limits.open, "%", advice))
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
    beyond = np.concatenate([(trial.measured.force - trial.identified.force)[trial.use, 2] for trial in fitted])
    return float(beyond.mean()) / gravity


def weight_notes(fitted: tuple[TrialValidation, ...], gravity: float) -> list[str]:
    """Say it where the plates carry another weight than the identified body has: the table's total is pinned to the
    declared mass.
    """
    missing = unexplained_mass(fitted, gravity)
    if abs(missing) <= UNEXPLAINED:
        return []
    return [
        f"The plates carry {abs(missing):.2f} kg {'more' if missing > 0 else 'less'} than the identified body, whose "
        "total is tied to the declared mass: a load, or a wrong mass_kg. Until that is settled the masses of single "
        "segments and their changes absorb it; see Added mass."
    ]


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
    strides = [one for trial in seen for one in StrideForce().observe(trial) if one.unit == "kg"]
    whole = [(one.trial, one.value, one.sd) for one in strides if not one.what.endswith(", alone")]
    told = [(one.trial.name, one.newton.mass, one.newton.mass_sd) for one in seen if one.newton]
    return _median(whole, WeighedBy.STRIDES) or _median(told, WeighedBy.NEWTON)


def with_weighed_mass(session: Session) -> Session:
    """Return a session whose subject has the mass that the plates show while somebody moves on them, where nobody
    declared one or stood still: by whole strides, or by the force against the trunk's acceleration.
    """
    found = None if np.isfinite(session.subject.mass) else weigh(session, None)
    if found is None:
        return session
    said = f"{found.mass:.1f} ± {found.sd:.1f} kg were weighed by {found.by.value} in {', '.join(found.trials)}."
    return replace(session, subject=replace(session.subject, mass=found.mass), notes=(*session.notes, said))


def _median(found: list[tuple[str, float, float]], by: WeighedBy) -> Weighing | None:
    """Return the median of some weights (trial, kg, sd); None without a finite one."""
    known = [one for one in found if np.isfinite(one[1])]
    if not known:
        return None
    masses = np.array([value for _, value, _ in known])
    mass = float(np.median(masses))
    scatter = 1.4826 * float(np.median(np.abs(masses - mass))) / len(known) ** 0.5
    sd = float(np.linalg.norm([_MOVING * mass, scatter, min(own for *_, own in known)]))
    return Weighing(mass, sd, by, tuple(dict.fromkeys(name for name, *_ in known)))

"""What a session weighs on the plates: in quiet standing, else over whole strides, else by Newton against the trunk."""

import numpy as np

from biodance.motion.quiet_standing import QuietStanding
from biodance.observations import recording
from biodance.observations.stride_force import StrideForce
from biodance.pipeline.trial_result import WeighedBy, Weighing
from biodance.records import Session

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

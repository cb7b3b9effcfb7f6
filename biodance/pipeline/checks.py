"""The quality table: a few numbers of a session beside the limits they are held against.

Limits: the RMS marker distance after the advice of OpenSim's user guide (below 2 cm); the largest one is a hand's breadth, which a swapped
or lost label exceeds and a head that turns on the trunk (one segment here) does not; forces after Hicks et al. 2015
(doi:10.1115/1.4029304: residual forces below 5 % of the external force); the mass limit is shoes, clothes and a meal; the others are the
house's own.
"""

import numpy as np

from biodance.motion.regressor import GRAVITY
from biodance.pipeline.results import Check, Standing, TrialResult
from biodance.records import Subject

MASS = 2.0
"""% between the mass on the plates and the declared mass."""
RMS, LARGEST = 0.020, 0.080
"""m, distance of the markers to the model."""
GAPS = 5.0
"""% of marker samples not seen."""
OPEN = 1.0
"""% of frames in which the markers seen do not fix the posture."""
SECONDS = 0.5
"""s of a trial in which the plates measure all ground contact."""
FORCE = 5.0
"""% of body weight, RMS difference of measured and simulated force."""
STANDING = 0.050
"""m between the mean centre of mass and the mean centre of pressure in quiet standing."""


def _upper(what: str, where: str, value: float, limit: float, unit: str, advice: str) -> Check:
    return Check(what, where, f"{value:.1f} {unit}", f"at most {limit:g} {unit}", bool(value <= limit), advice)


def mass_check(subject: Subject, standing: Standing | None) -> list[Check]:
    """Compare the mass on the plates with the declared mass, where both are known."""
    if standing is None or not np.isfinite(subject.mass) or "mass" in subject.guessed:
        return []
    difference = abs(100 * (standing.mass / subject.mass - 1))
    return [_upper("mass on the plates against declared", standing.trial, difference, MASS, "%", "Weigh again, or check the plates' zero.")]


def standing_check(standing: Standing | None) -> list[Check]:
    """Compare the mean centre of mass with the mean centre of pressure in quiet standing."""
    if standing is None or not standing.com.size:
        return []
    distance = 1000 * float(np.hypot(standing.com_ahead, standing.com_left))
    advice = "Check the plates' place in the lab, and the markers of pelvis and trunk."
    return [_upper("centre of mass off the centre of pressure, standing", standing.trial, distance, 1000 * STANDING, "mm", advice)]


def trial_checks(result: TrialResult, mass: float) -> list[Check]:
    """Check marker distances, gaps, measured frames and forces of one trial; ``mass`` kg of the body, for the body weight."""
    name, found = result.trial.name, []
    if result.fit:
        advice = "See the worst marker in the trial's figure: placed, labelled and filled rightly?"
        found.append(_upper("marker distance, RMS", name, 1000 * result.fit.total_rms, 1000 * RMS, "mm", advice))
        found.append(_upper("marker distance, largest", name, 1000 * result.fit.total_max, 1000 * LARGEST, "mm", advice))
    if result.motion is not None:
        share = 100 * float(np.mean(~result.motion.determined))
        found.append(_upper("posture left open", name, share, OPEN, "%", "See the gaps: which segment lost its markers?"))
    if result.gaps:
        found.append(_upper("markers not seen", name, result.gaps_percent, GAPS, "%", "Fill the gaps in the capture software."))
    comparison = result.comparison
    if comparison and result.trial.role != "static":
        seconds = comparison.used.sum() * float(np.median(np.diff(comparison.time)))
        advice = "Step onto the plates only, or record more of the trial on them."
        found.append(Check("fully measured", name, f"{seconds:.2f} s", f"at least {SECONDS:g} s", seconds >= SECONDS, advice))
    if comparison and comparison.used.any():
        share = 100 * float(np.max(comparison.rms[:3])) / (mass * -GRAVITY[2])
        advice = "See the trial's wrench figure: is it an offset, a delay or a scale?"
        found.append(_upper("force difference, worst axis", name, share, FORCE, "% of weight", advice))
    return found

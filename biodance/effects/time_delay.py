"""Forces and markers are not recorded at the same instant.

Signature: the residual is the time derivative of the wrench: large where forces change fast, nothing in holds.
Look-alikes: another filter on forces than on markers. Separated by fast alternating movements and by dropping a marker
on the plate.
"""

import numpy as np
from scipy.interpolate import make_interp_spline

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.records import Array


def moved_in_time(time: Array, value: Array, delay: Array) -> Array:
    """Return ``value`` (T, n) late by ``delay`` (T,) s (quintic spline); held constant beyond the ends."""
    spline = make_interp_spline(time, value, k=min(5, time.size - 1))
    return np.asarray(spline(np.clip(time - delay, time[0], time[-1])))


class TimeDelay(Effect):
    """A ``delay`` (s) of all forces against the markers; forces late = positive."""

    name = "time_delay"
    parameters = (
        Parameter(
            "delay", "s", 0.005, "2.1 to 10 ms measured between systems (van den Bogert 2000; Lemaire & Kuo 2024)"
        ),
    )
    screened_at = (-4.0, 4.0, 12.0)  # -20, 20, 60 ms: seen from none, the evidence of 20 ms is 169 instead of 16,000
    separated_by = "Fast alternating movements (arms at 2-3 Hz) in every direction."
    advice = "Drop a marker on the plate: its stop and the force must come in one frame; correct the trigger."

    def transform(self, case: Case, theta: Array) -> Case:
        """Return the case whose forces come ``theta[0]`` seconds late."""
        time = case.motion.time
        late = moved_in_time(time, case.predicted, np.full(time.size, float(np.ravel(theta)[0])))
        return case.with_added(case.trial.plates[0], late - case.predicted)

    def removed(self, case: Case, theta: Array) -> Array:
        """Return what was measured less the same ``theta[0]`` seconds earlier."""
        value, time = case.trial.wrench.value, case.motion.time
        return value - moved_in_time(time, value, np.full(time.size, -float(np.ravel(theta)[0])))


EFFECT = TimeDelay

"""Forces and markers are not recorded at the same instant."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import make_interp_spline

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.quality_check import QualityCheck, Quantity, Recorded
from biodance.effects._base.words import ACCEPT, About, CauseWords, CheckKind
from biodance.motion.newton import LagAndMass
from biodance.records import Array, Trial, Wrench

_LARGE = 0.06
"""s beyond which statistics do not look for a delay (``screened_at``): gates have then thrown away what shows it."""
_EXPLAINS = 0.5
"""Share of the rest at no lag that the lag must leave at most."""
_SAME = 0.02
"""s: lags of several trials that differ by less are one: trunk and centre of mass differ by 9 ms between movements."""
_LABORATORY = 0.006
"""s: standard deviation of the lag of clean recordings between laboratories (`observations.newton`)."""


def moved_in_time(time: Array, value: Array, delay: Array) -> Array:
    """Return ``value`` (T, n) late by ``delay`` (T,) s (quintic spline); held constant beyond the ends."""
    spline = make_interp_spline(time, value, k=min(5, time.size - 1))
    # late by d: value at t - d; beyond the ends the first and last sample.
    return np.asarray(spline(np.clip(time - delay, time[0], time[-1])))


class TimeDelay(Effect):
    """A ``delay`` (s) of all forces against the markers; forces late = positive."""

    name = "time_delay"
    prior = 0.04
    parameters = (
        Parameter(
            "delay",
            "s",
            0.005,
            "2.1 to 10 ms measured between systems (van den Bogert 2000; Lemaire & Kuo 2024)",
            # s that matter: a third of a frame at 100 Hz.
            least=0.003,
            alike=0.002,
        ),
    )
    screened_at = (-4.0, 4.0, 12.0)  # -20, 20, 60 ms: seen from none, the evidence of 20 ms is 169 instead of 16,000
    separated_by = "Fast alternating movements (arms at 2-3 Hz) in every direction."
    advice = "Drop a marker on the plate: its stop and the force must come in one frame; correct the trigger."
    about = About(
        what="Forces and markers are not recorded at the same instant.",
        signature=(
            "The residual is the time derivative of the wrench: large where forces change fast, nothing in holds."
        ),
        look_alikes="Another filter on forces than on markers.",
        settled_by="Fast alternating movements and by dropping a marker on the plate.",
    )
    words = CauseWords(
        "{forces} {size} {more}{between}",
        f"Shift the forces{ACCEPT}",
        "a delay",
        ("late", "early"),
        ("forces late", "forces early"),
    )
    explains = (CheckKind.FORCES,)
    followed = (Quantity("delay", "s", name, "", 0.002, 0.004, 0.15, 0.003),)
    """Typical sizes of seven real visits of one laboratory (docs/benchmarks/plates.md)."""

    def transform(self, case: Case, theta: Array) -> Case:
        """Return the case whose forces come ``theta[0]`` seconds late."""
        time = case.motion.time
        late = moved_in_time(time, case.predicted, np.full(time.size, float(np.ravel(theta)[0])))
        return case.with_added(case.trial.plates[0], late - case.predicted)

    def removed(self, case: Case, theta: Array) -> Array:
        """Return what was measured less the same ``theta[0]`` seconds earlier."""
        value, time = case.trial.wrench.value, case.motion.time
        return value - moved_in_time(time, value, np.full(time.size, -float(np.ravel(theta)[0])))

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the delays that Newton shows and that are too large for statistics: one of all trials, or of some."""
        told = {name: one for name, one in recorded.newton.items() if np.isfinite(one.lag)}
        # So late that gates hide it; the lag explains most of what none leaves: 1 - r² at it over 1 - r² at none.
        late = {
            name: one
            for name, one in told.items()
            if abs(one.lag) > _LARGE and 1 - one.correlation**2 < _EXPLAINS * (1 - one.unmoved**2)
        }
        lags = [one.lag for one in late.values()]
        if not told:
            return ()
        if not late:
            text = "The total force goes with the trunk to within 60 ms."
            return (QualityCheck("clock of the forces", True, text),)
        if len(late) == len(told) and np.ptp(lags) < _SAME:
            return (cls._late(late, ()),)
        return tuple(cls._late({name: one}, (name,)) for name, one in late.items())

    @classmethod
    def _late(cls, found: dict[str, LagAndMass], trials: tuple[str, ...]) -> QualityCheck:
        weight = np.array([one.lag_sd**-2 for one in found.values()])
        lag = float(weight @ [one.lag for one in found.values()] / weight.sum())
        where = f"In {trials[0]}" if trials else "In all trials that tell"
        text = f"{where} the forces come {1000 * abs(lag):.0f} ms {'late' if lag > 0 else 'early'}."
        # Laboratories differ in their lag, however well the trials agree.
        sd = float(np.hypot(weight.sum() ** -0.5, _LABORATORY))
        return QualityCheck("clock of the forces", False, text, cls.name, "", lag, "delay", "s", sd=sd, trials=trials)

    @classmethod
    def undone(cls, trial: Trial, found: QualityCheck) -> Trial:
        """Return the trial with its forces moved to their instant: their times are."""
        plates = tuple(replace(p, wrench=Wrench(p.wrench.time - found.size, p.wrench.value)) for p in trial.plates)
        return replace(trial, plates=plates)


EFFECT = TimeDelay

"""The clocks of forces and markers run at different rates."""

from dataclasses import dataclass, replace

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.words import ACCEPT, About, CauseWords, CheckKind
from biodance.effects.time_delay import TimeDelay, moved_in_time
from biodance.records import Array

_MINUTE = 60.0
"""s of a session where none is at hand."""
_RATE = 0.01 / _MINUTE
"""s per recorded second by which clocks that are not one typically run apart: two crystals of 50 to 100 ppm part by up
to 6 to 12 ms a minute. That it is not more is judgement: software clocks are worse.
"""


@dataclass(frozen=True)
class ClockDrift(Effect):
    """A ``stretch`` (s over the session): forces this much later at the end than at the start, against the markers.

    Clocks differ in their rates: the typical stretch is in proportion to what was recorded, ``seconds`` s.
    """

    seconds: float = _MINUTE

    name = "clock_drift"
    parameters = (
        Parameter(
            "stretch",
            "s",
            _RATE * _MINUTE,
            "1-2.5 % rate errors of older video systems (ISBS 1723); a few ms in synchronised labs",
            # s that matter: a third of a frame at 100 Hz.
            least=0.003,
        ),
    )
    grows = TimeDelay
    separated_by = "The first trial repeated at the end of a long session."
    advice = "Run cameras and forces from one clock; drop a marker on the plate before and after."
    about = About(
        what="The clocks of forces and markers run at different rates.",
        signature="A delay that grows during the session, zero in its middle.",
        look_alikes="A delay in one trial only; drift of the plate.",
        settled_by="A long session and by a trial repeated at the end.",
    )
    words = CauseWords(
        "the clocks of cameras and plates drift {size}{between} apart", f"Use one clock{ACCEPT}", "a drifting clock"
    )
    explains = (CheckKind.FORCES,)

    def sized_for(self, case: Case) -> "ClockDrift":
        """Return the effect in the session of ``case``."""
        share, time = float(np.ptp(case.session_time)), case.motion.time
        return replace(self, seconds=float(time[-1] - time[0]) / share) if share > 0 else self

    @property
    def typical(self) -> Array:
        """(1,) s: typical stretch of this session."""
        return np.array([_RATE * self.seconds])

    def transform(self, case: Case, theta: Array) -> Case:
        """Return the case whose forces are late by stretch times (session time - 1/2)."""
        delay = float(np.ravel(theta)[0]) * (case.session_time - 0.5)
        late = moved_in_time(case.motion.time, case.predicted, delay)
        return case.with_added(case.trial.plates[0], late - case.predicted)

    def removed(self, case: Case, theta: Array) -> Array:
        """Return what was measured less the same where it belongs in time."""
        value, delay = case.trial.wrench.value, float(np.ravel(theta)[0]) * (case.session_time - 0.5)
        return value - moved_in_time(case.motion.time, value, -delay)


EFFECT = ClockDrift

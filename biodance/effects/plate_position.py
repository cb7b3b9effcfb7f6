"""A force plate lies elsewhere than the laboratory's file says."""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter, axis_vector, plate_axis_targets
from biodance.effects._base.words import MEASURE_CORNERS, About, CauseWords, CheckKind
from biodance.records import Array

_LEAST = 0.003
"""m that matters: laboratories that check have 2 to 5 mm and 0.2 degrees (Collins 2009,
doi:10.1016/j.gaitpost.2008.10.060)."""
_USUAL = 0.006
"""m up to which laboratories have it without calling it a fault: plates 2 to 5 mm off (Collins 2009)."""
_ALIKE = 0.005
"""Standard deviation of what careful laboratories have: no size is surer against "as the file says"."""


class PlatePosition(Effect):
    """A ``shift`` (m) along a lab axis of where the file puts the plate, relative to where it is; target
    ``plate1:x``.
    """

    name = "plate_position"
    by_load = True
    parameters = (
        Parameter(
            "shift",
            "m",
            0.010,
            "centre-of-pressure errors up to 30 mm (PMID 11091955); 1-2 mm wand errors",
            least=_LEAST,
            usual=_USUAL,
            alike=_ALIKE,
        ),
    )
    separated_by = "Standing at several places, squats and a pole pressed onto marked points."
    advice = "Measure the plate's corners with markers and enter them again (FORCE_PLATFORM:CORNERS)."
    about = About(
        what="A force plate lies elsewhere than the laboratory's file says.",
        signature="Moments that follow the force, M = shift x f: for a shift along x mostly My following Fz.",
        look_alikes=(
            "Offset of the moments, cross-talk Fz->Mx or My, and above all the trunk's centre of mass, which other "
            "tools move instead."
        ),
        settled_by=(
            "The centre of pressure against the foot markers, by Fz dynamics, and by a pole pressed on the plate."
        ),
    )
    words = CauseWords(
        "{plate} lies {size}{between} along {axis} from where the file says", MEASURE_CORNERS, "a plate elsewhere"
    )
    explains = (CheckKind.PRESSURE,)

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return every axis of every plate."""
        return plate_axis_targets(case)

    def columns(self, case: Case) -> Array:
        """Return the moment of the predicted force over a shift of one metre."""
        force = case.predicted_on(self.plate_of(case))[:, :3]
        return np.concatenate([np.zeros_like(force), np.cross(axis_vector(self.target), force)], axis=1)[:, :, None]


EFFECT = PlatePosition

"""A force plate lies elsewhere than the laboratory's file says.

Signature: moments that follow the force, M = shift x f: for a shift along x mostly My following Fz. Look-alikes: offset
of the moments, cross-talk Fz->Mx or My, and above all the trunk's centre of mass, which other tools move instead.
Separated by the centre of pressure against the foot markers, by Fz dynamics, and by a pole pressed on the plate.
"""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter, axis_vector, plate_axis_targets
from biodance.records import Array


class PlatePosition(Effect):
    """A ``shift`` (m) along a lab axis of where the file puts the plate, relative to where it is; target
    ``plate1:x``.
    """

    name = "plate_position"
    by_load = True
    prior = 0.04
    parameters = (
        Parameter("shift", "m", 0.010, "centre-of-pressure errors up to 30 mm (PMID 11091955); 1-2 mm wand errors"),
    )
    separated_by = "Standing at several places, squats and a pole pressed onto marked points."
    advice = "Measure the plate's corners with markers and enter them again (FORCE_PLATFORM:CORNERS)."

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return every axis of every plate."""
        return plate_axis_targets(case)

    def columns(self, case: Case) -> Array:
        """Return the moment of the predicted force over a shift of one metre."""
        force = case.predicted_on(self.plate_of(case))[:, :3]
        return np.concatenate([np.zeros_like(force), np.cross(axis_vector(self.target), force)], axis=1)[:, :, None]


EFFECT = PlatePosition

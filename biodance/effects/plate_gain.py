"""A channel of a force plate reads a constant factor too much.

Signature: the residual of one channel follows that channel itself. Look-alikes: all six gains together are a wrong body
mass, exactly; the gain of Fz alone re-fits into the segment masses and leaves the fit as good as before. Separated by
the scale's weight and by differences between channels.
"""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter, channel_index, plate_channels
from biodance.records import Array
from biodance.spatial import wrench_about_origin


class PlateGain(Effect):
    """A relative ``gain`` (0.04: reads 4 % too much) of channel ``target`` about the plate's centre."""

    name = "plate_gain"
    parameters = (
        Parameter("gain", "1", 0.02, "3-5 N under dead loads of some hundred newtons (Cappello 2011, PMID 21392999)"),
    )
    separated_by = "Squats against standing: the channel's own size must change."
    advice = "Check the channel with dead weights; correct sensitivity or calibration matrix."

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return every channel of every plate."""
        return plate_channels(case)

    def columns(self, case: Case) -> Array:
        """Return the predicted channel itself, moved to the lab origin."""
        plate = self.plate_of(case)
        only = case.predicted_on(plate) * np.eye(6)[channel_index(self.target)]
        return wrench_about_origin(only, plate.centre)[:, :, None]


EFFECT = PlateGain

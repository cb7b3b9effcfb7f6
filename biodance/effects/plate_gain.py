"""A channel of a force plate reads a constant factor too much.

Signature: the residual of one channel follows that channel itself. Look-alikes: all six gains together are a wrong body
mass, exactly; the gain of Fz alone re-fits into the segment masses and leaves the fit as good as before. Separated by
the scale's weight and by differences between channels.
"""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import ChannelEffect, Parameter
from biodance.records import Array
from biodance.spatial import wrench_shift


class PlateGain(ChannelEffect):
    """A relative ``gain`` (0.04: reads 4 % too much) of channel ``target`` about the plate's centre."""

    name = "plate_gain"
    by_load = True
    parameters = (
        Parameter("gain", "1", 0.02, "3-5 N under dead loads of some hundred newtons (Cappello 2011, PMID 21392999)"),
    )
    separated_by = "Squats against standing: the channel's own size must change."
    advice = "Check the channel with dead weights; correct sensitivity or calibration matrix."

    def in_channel(self, case: Case) -> Array:
        """Return the predicted channel itself."""
        return case.predicted_on(self.plate_of(case))[:, self.channel]

    def in_proportion(self, case: Case, theta: Array) -> Array:
        """Return the gain of its channel about the plate's centre."""
        there, only = wrench_shift(self.plate_of(case).centre), np.diag(np.eye(6)[self.channel])
        return np.asarray(theta[0] * np.linalg.inv(there) @ only @ there)


EFFECT = PlateGain

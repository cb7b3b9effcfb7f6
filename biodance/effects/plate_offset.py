"""A channel of a force plate does not read zero when nobody stands on it.

Signature: a constant in one channel, whatever the movement and whatever its speed. Look-alikes: for Fz a wrong body
mass (which scales all channels), for moments a shifted plate or a CoM that is off in the trunk (which follow Fz), for
Fx a tilted plate. Separated by movements that change Fz (squats) and by an unloaded recording.
"""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import ChannelEffect, Parameter
from biodance.records import Array


class PlateOffset(ChannelEffect):
    """A constant ``offset`` (N or N·m) about the plate's centre in channel ``target``."""

    name = "plate_offset"
    parameters = (Parameter("offset", "N or N·m", 5.0, "re-zeroing rule of +-5 N in laboratory guides (Codamotion)"),)
    separated_by = "Postures of different weight on the plate: squats, one leg, sitting down beside it."
    advice = "Record the empty plate before and after, and re-zero it."

    def in_channel(self, case: Case) -> Array:
        """Return one; zero in a trial that saw the plate empty: there its reading was taken off."""
        return np.full(case.motion.time.size, 0.0 if self.plate_of(case).tared else 1.0)


EFFECT = PlateOffset

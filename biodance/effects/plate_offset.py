"""A channel of a force plate does not read zero when nobody stands on it.

Signature: a constant in one channel, whatever the movement and whatever its speed. Look-alikes: for Fz a wrong body
mass (which scales all channels), for moments a shifted plate or a CoM that is off in the trunk (which follow Fz), for
Fx a tilted plate. Separated by movements that change Fz (squats) and by an unloaded recording.
"""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter, channel_index, plate_channels
from biodance.records import Array
from biodance.spatial import wrench_about_origin


class PlateOffset(Effect):
    """A constant ``offset`` (N or N·m) about the plate's centre in channel ``target``."""

    name = "plate_offset"
    parameters = (Parameter("offset", "N or N·m", 5.0, "re-zeroing rule of +-5 N in laboratory guides (Codamotion)"),)
    separated_by = "Postures of different weight on the plate: squats, one leg, sitting down beside it."
    advice = "Record the empty plate before and after, and re-zero it."

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return every channel of every plate."""
        return plate_channels(case)

    def columns(self, case: Case) -> Array:
        """Return one in the channel, moved to the lab origin."""
        unit = np.tile(np.eye(6)[channel_index(self.target)], (case.motion.time.size, 1))
        return wrench_about_origin(unit, self.plate_of(case).centre)[:, :, None]


EFFECT = PlateOffset

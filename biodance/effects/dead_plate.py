"""A force plate reads the same whatever happens: a stuck or unplugged channel, an amplifier at its end.

Signature: a constant force, far from zero, through a whole recording in which the person moves or stands on other
plates. Look-alikes: the offset of an empty plate (small beside a person), somebody who stands very still. Separated by
a step on the plate.
"""

from biodance.effects._base.left_out import checks_of_defects
from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded


class DeadPlate(DiscreteEffect):
    """A plate that does not measure; the reader leaves it out."""

    name = "dead_plate"
    separated_by = "A step on the plate, and a recording of it empty."
    advice = "Check the cable, the amplifier and the zero of this plate; until then keep the feet off it."

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the plates that readers left out as dead."""
        return checks_of_defects(recorded.session, cls.name, check="plates that measure", quantity="force")


EFFECT = DeadPlate

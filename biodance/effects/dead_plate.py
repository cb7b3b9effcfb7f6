"""A force plate reads the same whatever happens: a stuck or unplugged channel, an amplifier at its end."""

from biodance.effects._base.left_out import checks_of_defects
from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded
from biodance.effects._base.words import About, CauseWords


class DeadPlate(DiscreteEffect):
    """A plate that does not measure; the reader leaves it out."""

    name = "dead_plate"
    separated_by = "A step on the plate, and a recording of it empty."
    advice = "Check the cable, the amplifier and the zero of this plate; until then keep the feet off it."
    about = About(
        what="A force plate reads the same whatever happens: a stuck or unplugged channel, an amplifier at its end.",
        signature=(
            "A constant force, far from zero, through a whole recording in which the person moves or stands on other "
            "plates."
        ),
        look_alikes="The offset of an empty plate (small beside a person), somebody who stands very still.",
        settled_by="A step on the plate.",
    )
    words = CauseWords("{it} measures nothing", "Leave it out, or record again.", "a dead plate")

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the plates that readers left out as dead."""
        return checks_of_defects(recorded.session, cls.name, check="plates that measure", quantity="force")


EFFECT = DeadPlate

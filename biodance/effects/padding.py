"""The recording program or a filter repeated the first or last sample of all channels where it had none."""

from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded, checks_of_defects
from biodance.effects._base.words import About, CauseWords


class Padding(DiscreteEffect):
    """Samples at an end of the recording that nobody measured; the reader leaves them out."""

    name = "padding"
    separated_by = "A recording that begins earlier and ends later than what is judged."
    advice = "Start the recording earlier, or switch padding off where the forces are filtered and exported."
    about = About(
        what="The recording program or a filter repeated the first or last sample of all channels where it had none.",
        signature=(
            "For some ten milliseconds at an end of the recording all channels hold one sample to the last digit, "
            "while the person moves."
        ),
        look_alikes=(
            "An amplifier at its end (one channel, at its extreme), a plate set to zero while unloaded (all channels "
            "at zero), a recording that hung (markers rest, too)."
        ),
        settled_by=(
            "A longer recording. Samples that were put in front move all forces by as much: that is a time delay, and"
            " named as one."
        ),
    )
    words = CauseWords("the forces begin or end with copies of one value", "Cut them off.", "padding")

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return what readers left out as padding."""
        return checks_of_defects(recorded.session, cls.name, check="ends of the recordings", quantity="time")


EFFECT = Padding

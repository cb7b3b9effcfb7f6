"""A marker jumps away and back within three frames: a reflection, or another marker, was taken for it."""

from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded, marker_checks
from biodance.effects._base.words import About, CauseWords
from biodance.lab.markers.signals import MarkerFault


class MarkerSpikes(DiscreteEffect):
    """A marker that jumps away and back within three frames."""

    name = "marker_spikes"
    separated_by = "The path of the marker: it leaves and comes back faster than any body."
    advice = (
        "Correct these frames in the recording software (a reflection was taken for the marker), or leave a gap; "
        "these frames are not used here."
    )
    about = About(
        what="A marker jumps away and back within three frames: a reflection, or another marker, was taken for it.",
        signature=(
            "One to three frames that lie off the way of the frames on both sides by more than skin and wands swing, "
            "and that no body can reach and leave so fast."
        ),
        look_alikes="The impact of a heel (millimetres), labels that are exchanged for longer (`labels_swapped`).",
        settled_by="The marker's path.",
    )
    words = CauseWords("some frames of {pairs} lie far off their way", "Fill these frames again.", "spikes")

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return one check for each such marker, or one that says there is none."""
        return marker_checks(recorded, MarkerFault.SPIKE, cls.name)


EFFECT = MarkerSpikes

"""A marker jumps away and back within three frames: a reflection, or another marker, was taken for it.

Signature: one to three frames that lie off the way of the frames on both sides by more than skin and wands swing, and
that no body can reach and leave so fast. Look-alikes: the impact of a heel (millimetres), labels that are exchanged for
longer (`labels_swapped`). Separated by the marker's path.
"""

from biodance.effects._base.marker_faults import marker_checks
from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded
from biodance.lab.markers.signals import MarkerFault


class MarkerSpikes(DiscreteEffect):
    """A marker that jumps away and back within three frames."""

    name = "marker_spikes"
    separated_by = "The path of the marker: it leaves and comes back faster than any body."
    advice = (
        "Correct these frames in the recording software (a reflection was taken for the marker), or leave a gap; "
        "these frames are not used here."
    )

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return one check for each such marker, or one that says there is none."""
        return marker_checks(recorded, MarkerFault.SPIKE, cls.name)


EFFECT = MarkerSpikes

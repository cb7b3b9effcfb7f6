"""A marker stands still to the last bit while the others move: a gap that a program filled with the last value.

Signature: the same three numbers in frame after frame, then a jump to where the marker really is. Look-alikes: a foot
on the ground (its camera noise goes on), a recording that hung (all markers stand still). Separated by the last digits.
"""

from biodance.effects._base.marker_faults import marker_checks
from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded
from biodance.lab.markers.signals import MarkerFault


class FrozenMarkers(DiscreteEffect):
    """A marker that holds its last value."""

    name = "frozen_markers"
    separated_by = "The last digits of the marker, frame after frame."
    advice = (
        "Undo this filling of gaps in the recording software and export again, or leave the gap; "
        "these frames are not used here."
    )

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return one check for each such marker, or one that says there is none."""
        return marker_checks(recorded, MarkerFault.FROZEN, cls.name)


EFFECT = FrozenMarkers

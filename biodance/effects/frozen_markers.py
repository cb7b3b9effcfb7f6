"""A marker stands still to the last bit while the others move: a gap that a program filled with the last value."""

from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded, marker_checks
from biodance.effects._base.words import About, CauseWords
from biodance.lab.markers.signals import MarkerFault


class FrozenMarkers(DiscreteEffect):
    """A marker that holds its last value."""

    name = "frozen_markers"
    separated_by = "The last digits of the marker, frame after frame."
    advice = (
        "Undo this filling of gaps in the recording software and export again, or leave the gap; "
        "these frames are not used here."
    )
    about = About(
        what=(
            "A marker stands still to the last bit while the others move: a gap that a program filled with the last "
            "value."
        ),
        signature="The same three numbers in frame after frame, then a jump to where the marker really is.",
        look_alikes="A foot on the ground (its camera noise goes on), a recording that hung (all markers stand still).",
        settled_by="The last digits.",
    )
    words = CauseWords("{pairs} stood still to the last bit for a while", "Leave gaps open instead.", "frozen markers")

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return one check for each such marker, or one that says there is none."""
        return marker_checks(recorded, MarkerFault.FROZEN, cls.name)


EFFECT = FrozenMarkers

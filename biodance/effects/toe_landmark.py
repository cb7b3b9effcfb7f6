"""The markers of the feet sit elsewhere than on the second ray and the heel: a habit of a laboratory, on both feet."""

from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded
from biodance.effects._base.words import About, CauseWords


class ToeLandmark(DiscreteEffect):
    """Toe markers lie ``inwards`` (m) of the middle of the forefoot, heel markers ``backwards`` (m) of the heel;
    target: the side, or ``both``. No fault of an instrument.
    """

    name = "toe_landmark"
    separated_by = "The same foot on both plates, walks in both directions, markers on the first and the fifth ray."
    advice = (
        "Nothing is broken: put a second marker on the fifth ray of each foot, or walk over the plates both ways, so "
        "that feet and plates are told apart."
    )
    about = About(
        what=(
            "The markers of the feet sit elsewhere than on the second ray and the heel: a habit of a laboratory, on "
            "both feet."
        ),
        signature=(
            "The pressure lies outwards (or inwards) of the line from heel to toe marker in BOTH feet, half as far "
            "early in stance, or ahead of the heel marker in both."
        ),
        look_alikes=(
            "With the right foot on one plate and the left foot on another, two plates that lie elsewhere in opposite"
            " directions, or one that does."
        ),
        settled_by="The same foot on two plates, walks both ways, and two toe markers, on the first and the fifth ray.",
    )
    words = CauseWords(
        "the toe markers sit {size}{between} from the line of the foot",
        "Check where they sit.",
        "a toe marker elsewhere",
    )
    habit = True

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return no check: what both feet share is seen by observations (`diagnosis.witness_landmark`)."""
        return ()


EFFECT = ToeLandmark

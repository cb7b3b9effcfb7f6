"""Something that no plate measures carries a part of the person for a while: a chair, a rail, a helper."""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded
from biodance.effects._base.words import About, CauseWords
from biodance.motion.contact import ground_contact, share_lacking
from biodance.motion.soles import soles_from_body
from biodance.records import Array, LeftOut
from biodance.settings import STANDARD_GRAVITY

_HELD = ("pelvis", "left_forearm_hand", "right_forearm_hand")
"""Segments by which people are carried beside their feet: they sit, or hold on."""
_LARGEST = 90.0
"""Percentile of the force that stands for the largest: the bump of sitting down is over in a tenth of the frames."""


class UnmeasuredContact(DiscreteEffect):
    """A force (N, the largest) on the segment ``target`` that no plate measures; its frames are left out."""

    name = "unmeasured_contact"
    separated_by = "A plate under the chair, or the movement without it."
    advice = (
        "Stand the chair on a plate, or record the movement without it. The frames in which it carries are left out of "
        "everything; the others count."
    )
    about = About(
        what="Something that no plate measures carries a part of the person for a while: a chair, a rail, a helper.",
        signature=(
            "By Newton the ground carries weight (1 + a / g), with a the acceleration of pelvis and trunk; the plates"
            " lack a good part of it for a while, and nothing of it at all other times."
        ),
        look_alikes=(
            "A foot beside the plates, which the markers of the feet show; late forces, which have too much as often "
            "as too little."
        ),
        settled_by="The markers of what is held still.",
    )
    words = CauseWords("something that no plate measures carries the {it}", "Record again without it.", "a support")

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return one check per segment that something carries, or one that says that nothing does."""
        found: dict[str, dict[str, float]] = {}
        cases = [case for case in recorded.cases if case.trial.plates]
        for case in cases:
            weight = case.trial.settings.gravity * float(case.body.sip.mass.sum())
            contact = ground_contact(case.trial, soles_from_body(case.body, case.motion), mass=case.body.sip.mass.sum())
            when = contact.left_out.get(LeftOut.CARRIED_ELSEWHERE)
            if when is not None:
                size = float(np.percentile(weight * share_lacking(case.trial, weight=weight)[when], _LARGEST))
                speeds = {name: _speed(case, name)[when].mean() for name in _HELD if name in case.body.segments}
                # Of the segments that can be carried, the one that moves least.
                stillest = min(speeds, key=lambda name: speeds[name], default=_HELD[0])
                found.setdefault(stillest, {})[case.trial.name] = size
        what = "contact beside the plates"
        if not found:
            return (QualityCheck(what, True, "Nothing beside the plates carries the person."),) if cases else ()
        return tuple(
            QualityCheck(
                what, False, _said(segment, sizes), cls.name, segment, max(sizes.values()), "force", "N", mended=True
            )
            for segment, sizes in found.items()
        )


def _said(segment: str, sizes: dict[str, float]) -> str:
    heaviest = max(sizes, key=lambda name: sizes[name])
    return (
        f"Something that no plate measures carries up to {sizes[heaviest] / STANDARD_GRAVITY:.0f} kg at the "
        f"{segment.replace('_', ' ')}, in {', '.join(sizes)} (most in {heaviest})."
    )


def _speed(case: Case, segment: str) -> Array:
    """Return the speed (T,) m/s of the markers on a segment; infinite where none is seen throughout."""
    markers, own = case.trial.markers, case.body.markers
    names = [n for n, on in zip(own.names, own.segment, strict=True) if on == case.body.segment_index(segment)]
    seen = [markers[n] for n in names if markers is not None and n in markers and np.isfinite(markers[n]).all()]
    if not seen:
        return np.full(case.motion.time.size, np.inf)
    return np.asarray(np.linalg.norm(np.gradient(np.mean(seen, axis=0), case.motion.time, axis=0), axis=1))


EFFECT = UnmeasuredContact

"""Why a diagnosis says no more than it does, in words: the one room in which a `Reason` becomes a sentence."""

from biodance.diagnosis.diagnosis import Diagnosis
from biodance.diagnosis.reasons import Reason

_NOTES = {
    Reason.UNUSUAL_BODY: (
        "What the plates measured fits only a body that is more unlike the table than people are: the person may be, a "
        "joint may lie elsewhere than the markers say, or a load that nobody noted, a gain or a wrong declared mass "
        "hides in it."
    ),
    Reason.OUTSIDE_TOLERANCES: (
        "What the plates measured fits only if something that is small in every laboratory is many times as large "
        "here, and none of the causes looked for is it."
    ),
    Reason.OUTSIDE_EVERY_LABORATORY: (
        "It is so large that it would be none of what is small even where all of that is twice as large."
    ),
    Reason.WITHOUT_RESEMBLED: "What is only resembled explains nothing: what is left is judged without it.",
    Reason.SEVERAL_CROSSTALKS: (
        "Several channels would have to disturb each other at once. That is what a plate looks like that lies or is "
        "turned otherwise than the file says, or whose matrix is another one: none of these cross-talks is named."
    ),
    Reason.ONLY_STANDING: (
        "Only quiet standing could be compared with the whole body: sway, soft tissue and a plate's zero look alike "
        "there, so this comparison names no cause that has a size. A few squats on the plates tell them apart."
    ),
    Reason.LOUD_LABORATORY: (
        "What no cause explains is {about} times as large as where tolerances were learned, in most bands and channels "
        "alike: taken for how loud this laboratory is, so that a fault must be larger to be seen."
    ),
    Reason.MAY_NOT_MATTER: (
        "{about} is only what this resembles: such a cause is known so poorly that what is there may be less than what "
        "matters."
    ),
    Reason.SIZE_VARIES: (
        "{about} is only what this resembles: a true cause has one size in every trial, band and channel, under every "
        "load and at every place, and the size of this one hangs on {varies_with}."
    ),
}
STRANGE_IN_WORDS = {
    Reason.UNUSUAL_BODY: f"w{_NOTES[Reason.UNUSUAL_BODY][1:-1]}",
    Reason.OUTSIDE_TOLERANCES: (
        "what the plates measured fits only if something that is small elsewhere is many times as large here"
    ),
    Reason.SEVERAL_CROSSTALKS: (
        "what the plates measured fits only several cross-talks at once, as of a plate that lies elsewhere"
    ),
    Reason.WITHOUT_RESEMBLED: (
        "nothing is left that matters and is unlike sessions without fault, with and without what it resembles"
    ),
}
"""What is strange where nothing else is left, to go on a sentence with."""
_EACH = (Reason.MAY_NOT_MATTER, Reason.SIZE_VARIES)
"""Reasons that are said of each cause on its own."""
_DOUBTS = {
    Reason.ONLY_STANDING: "standing alone tells no cause",
    Reason.MOVEMENT_NOT_JUDGED: "none of the movement could be judged, and standing still tells little",
    Reason.BODY_DOUBTFUL: "{about}",
    Reason.UNDESCRIBED_JOINTS: "the body moves at joints ({about}) for which nobody has learned yet what is usual",
    Reason.UNSEEN_JOINTS: "no marker shows what moves at {about}, and the plates measure it all the same",
    Reason.TOLERANCES_DO_NOT_HOLD: "its markers move more on the body than where tolerances were learned",
    Reason.EXCLUDED_BY_WITNESSES: (
        "what the simulation would explain by a {about} is none, as feet, clocks and weights show"
    ),
}


def reason_notes(one: Diagnosis) -> tuple[str, ...]:
    """Return the reasons of a diagnosis as sentences for the reader."""
    notes, varies = [], {_name(f.effect, f.target): f.varies_with for f in one.resembles}
    for reason, about in one.why.items():
        for name in about if reason in _EACH else (", ".join(about),):
            if reason in _NOTES:
                notes.append(_NOTES[reason].format(about=name, varies_with=varies.get(name, "")))
    return tuple(notes)


def doubt_in_words(one: Diagnosis) -> str:
    """Return why no cause can be told, to go on a sentence with; "" where one can."""
    return next((_DOUBTS[why].format(about=", ".join(about)) for why, about in one.why.items() if why in _DOUBTS), "")


def _name(effect: str, target: str) -> str:
    return f"{effect.replace('_', ' ')} {target}".strip()

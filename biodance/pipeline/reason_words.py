"""Why a diagnosis says no more than it does, in words: the one room in which a `Reason` becomes a sentence."""

from biodance.diagnosis.consequence import LIMIT
from biodance.diagnosis.diagnosis import Diagnosis
from biodance.diagnosis.reasons import Reason
from biodance.display import listed, spaced
from biodance.pipeline.finding_words import in_words

_SENTENCES = {
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
    Reason.NOT_COMPARED: "No movement could be compared with a body.",
    Reason.MOVEMENT_NOT_JUDGED: "None of the movement could be judged, and standing still tells little.",
    Reason.PERSON_UNKNOWN: "Mass or stature is not known, so there is no body.",
    Reason.BODY_NOT_SCALED: "No static trial scales the body, so its forces are too unsure to name a cause.",
    Reason.BODY_DOUBTFUL: "The forces fit this body, but {about}.",
    Reason.LIMIT_BROKEN: "No cause was found for what is outside its limit: {about}.",
    Reason.UNDESCRIBED_JOINTS: "The body moves at joints ({about}) for which nobody has learned yet what is usual.",
    Reason.UNSEEN_JOINTS: "No marker shows what moves at {about}, and the plates measure it all the same.",
    Reason.TOLERANCES_DO_NOT_HOLD: "Its markers move more on the body than where tolerances were learned.",
    Reason.EXCLUDED_BY_WITNESSES: (
        "What the simulation would explain by a {about} is none, as feet, clocks and weights show."
    ),
}
_EACH = (Reason.MAY_NOT_MATTER, Reason.SIZE_VARIES)
"""Reasons that are said of each cause on its own."""


def reason_notes(one: Diagnosis) -> tuple[str, ...]:
    """Return why a diagnosis says no more, and what it only resembles, as sentences for the reader."""
    notes, varies = [], {f"{spaced(f.effect)} {f.target}".strip(): f.varies_with for f in one.resembles}
    for reason, about in one.why.items():
        for name in about if reason in _EACH else (listed(about),):
            sentence = _left(one) if reason is Reason.FORCES_LEFT else _SENTENCES[reason]
            notes.append(sentence.format(about=name, varies_with=varies.get(name, "")))
    if one.resembles:
        notes.append(f"It resembles {' and '.join(map(in_words, one.resembles))}, which is not enough.")
    return tuple(notes)


def _left(one: Diagnosis) -> str:
    """Return where what is left is largest, with its size."""
    row = next((row for row in one.adequacy if row.matters and row.z > LIMIT), None)
    if row is None:
        return "What is left of the forces is unlike sessions without fault."
    return (
        f"{row.channel} at {row.band_hz[0]:g} to {row.band_hz[1]:g} Hz is {row.size:.2g} {row.unit} off "
        f"({row.z:.1f} standard deviations of sessions without fault), most in {row.trial} around {row.second:.1f} s."
    )

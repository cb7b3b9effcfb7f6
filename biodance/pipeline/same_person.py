"""Is an earlier body or session of the person who is measured here? Weight and length of the legs answer."""

import numpy as np

from biodance.body.body import Body
from biodance.errors import SessionRefused
from biodance.records import SIDES

ANOTHER_MASS = 0.15
"""Share of the body mass by which nobody differs from an earlier session: more is another person."""
ANOTHER_LEG = 0.04
"""The same of the length of the legs, mean of both sides: another day's markers and calibration change it by less than
1 %, a hip 50 mm from its place by 3 %.
"""


def refuse_another_body(known: Body, body: Body, mass: float) -> None:
    """Refuse an earlier body ``known`` of somebody else than the person of ``body``, declared as ``mass`` kg.

    Raises
    ------
    SessionRefused
        It weighs so much less or more, or its legs are so much shorter or longer, that it is another person's.
    """
    before = float(known.sip.mass.sum())
    if abs(mass / before - 1) > ANOTHER_MASS:
        raise SessionRefused(
            f"The body that was given weighs {before:.1f} kg, {mass:.1f} kg are declared here: it is of another "
            f"person. Give the same person's body.json."
        )
    if unlike := _unlike_legs(known, body):
        raise SessionRefused(f"The body that was given {unlike}. Give the same person's body.json.")


def refuse_another_reference(known: Body, body: Body, mass: float, name: str) -> None:
    """Refuse a reference session ``name`` with the body ``known`` of somebody else; one who weighs more here may carry
    a load.

    Raises
    ------
    SessionRefused
        It weighs so much more, or its legs are so much shorter or longer, that it is another person's.
    """
    before = float(known.sip.mass.sum())
    if mass < (1 - ANOTHER_MASS) * before:
        raise SessionRefused(
            f"The reference, session {name}, is of somebody of {before:.1f} kg, {mass:.1f} kg are declared here: it is "
            "of another person, or of this one with a load. Give an unloaded session of the same person."
        )
    if unlike := _unlike_legs(known, body):
        raise SessionRefused(f"The reference, session {name}, {unlike}. Give a session of the same person.")


def _unlike_legs(known: Body, body: Body) -> str:
    """Return how legs differ if they are of two persons, in words; "" if they need not be."""
    before, now = _leg(known), _leg(body)
    if not (before > 0 and now > 0) or abs(now / before - 1) <= ANOTHER_LEG:
        return ""
    legs = f"has legs of {before:.2f} m from hip to ankle, {now:.2f} m are measured here"
    return f"{legs}: it is of another person, or of one who has grown since"


def _leg(body: Body) -> float:
    """Return the length (m) from hip to knee to ankle, mean of both sides; 0 where a leg has neither."""
    length = {joint.name: float(np.linalg.norm(joint.translation)) for joint in body.joints}
    ends = [f"{side}_{joint}" for side in SIDES for joint in ("knee_flexion", "ankle_dorsiflexion")]
    return sum(length[end] for end in ends) / len(SIDES) if all(end in length for end in ends) else 0.0

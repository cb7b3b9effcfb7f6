"""The declared body mass is wrong: clothes, shoes, an old entry, another scale."""

from dataclasses import dataclass, replace

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.words import ACCEPT, About, CauseWords, CheckKind, SessionEntry
from biodance.records import Array

WRONG = 0.3
"""Share of the mass by which a declared one may be wrong: more is a unit, another person, or no mass at all. A guess
has it as its standard deviation.
"""
_USUAL = 0.01
"""Share of the mass up to which laboratories have it without calling it a fault: clothes and shoes, 0.7 kg of 70, which
are smaller on a child.
"""
_ADULT = 70.0
"""kg: whom sizes are told of where nobody is at hand."""


@dataclass(frozen=True)
class BodyMass(Effect):
    """An ``error`` (kg): the person weighs this much more than declared, in proportion everywhere.

    By strides and Newton two of eight people of one laboratory weigh more than 0.7 kg otherwise than declared, and so
    does somebody in five of nine laboratories (``prior``): 1.9 kg root mean square of sixteen sessions, as three times
    the typical size says. ``mass`` kg of the person, to whom the typical and the usual size are in proportion.
    """

    mass: float = _ADULT

    name = "body_mass"
    prior = 0.25
    parameters = (
        Parameter(
            "error",
            "kg",
            _USUAL * _ADULT,
            "1 % of body mass for clothes and shoes",
            # kg that matter: clinic scale and clothes, 0.2 kg.
            least=0.3,
        ),
    )
    separated_by = "Weigh the person on the plate and on a scale, as dressed for the recording."
    advice = "Enter the mass of the day, with clothes and shoes."
    about = About(
        what="The declared body mass is wrong: clothes, shoes, an old entry, another scale.",
        signature="The whole residual is a share of the whole wrench, in all channels alike.",
        look_alikes=(
            "All six gains together (exactly), a load near the body's centre (pelvis, trunk, thighs), another value "
            "of gravity."
        ),
        settled_by="Weighing the person on the plate and on a scale.",
    )
    words = CauseWords(
        "the person weighs {size} {more} than declared{between}",
        f"Weigh again{ACCEPT}",
        "a wrong body mass",
        ("more", "less"),
        entry=SessionEntry.MASS,
    )
    explains = (CheckKind.WEIGHT, CheckKind.FORCES)

    def sized_for(self, case: Case) -> "BodyMass":
        """Return the effect in the person of ``case``."""
        return replace(self, mass=float(case.body.sip.mass.sum()))

    @property
    def typical(self) -> Array:
        """(1,) kg: typical size in this person."""
        return np.array([_USUAL * self.mass])

    @property
    def usual(self) -> Array:
        """(1,) kg: what this person's clothes and shoes weigh."""
        return np.array([_USUAL * self.mass])

    def columns(self, case: Case) -> Array:
        """Return the predicted wrench per kilogram of body mass."""
        return (case.predicted / case.phi[::10].sum())[:, :, None]

    def possible_in(self, case: Case, theta: Array) -> bool:
        """Return whether a scale or a form can be so wrong: by at most `WRONG` of the person's mass."""
        return bool(abs(theta[0]) <= WRONG * case.body.sip.mass.sum())


EFFECT = BodyMass

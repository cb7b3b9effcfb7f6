"""The declared body mass is wrong: clothes, shoes, an old entry, another scale.

Signature: the whole residual is a share of the whole wrench, in all channels alike. Look-alikes: all six gains together
(exactly), a load near the body's centre (pelvis, trunk, thighs), another value of gravity. Separated by weighing the
person on the plate and on a scale.
"""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.records import Array

_WRONG = 0.3
"""Share of the mass by which a declared one may be wrong: more is a unit, another person, or no mass at all."""


class BodyMass(Effect):
    """An ``error`` (kg): the person weighs this much more than declared, in proportion everywhere."""

    name = "body_mass"
    prior = 0.1
    parameters = (Parameter("error", "kg", 1.5, "1-4 % of body mass for clothes and shoes"),)
    separated_by = "Weigh the person on the plate and on a scale, as dressed for the recording."
    advice = "Enter the mass of the day, with clothes and shoes."

    def columns(self, case: Case) -> Array:
        """Return the predicted wrench per kilogram of body mass."""
        return (case.predicted / case.phi[::10].sum())[:, :, None]

    def in_proportion(self, case: Case, theta: Array) -> Array:
        """Return the share of the body's mass, of every channel."""
        return np.asarray(theta[0] / case.phi[::10].sum() * np.eye(6))

    def possible_in(self, case: Case, theta: Array) -> bool:
        """Return whether a scale or a form can be so wrong: by at most `_WRONG` of the person's mass."""
        return bool(abs(theta[0]) <= _WRONG * case.body.sip.mass.sum())


EFFECT = BodyMass

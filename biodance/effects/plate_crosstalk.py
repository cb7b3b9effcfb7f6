"""A load on one channel of a force plate shows in another channel."""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.words import CALIBRATE, About, CauseWords, CheckKind
from biodance.records import CHANNELS, Array
from biodance.spatial import wrench_about_origin

_LEAST = {"1": 0.002, "m": 0.001, "1/m": 0.01}
"""1, m, 1/m that matter: makers' accuracy, 0.05 to 0.2 % of full scale."""
_USUAL = {"m": 0.006}
"""As a plate beside its place, which looks like it."""
_ALIKE = 0.005
"""Standard deviation of what careful laboratories have: no size is surer against "as the file says"."""


class PlateCrosstalk(Effect):
    """``ratio`` of the second channel to the first (1, or m for a moment from a force) about the plate's centre;
    target ``Fz->My``.
    """

    name = "plate_crosstalk"
    by_load = True
    parameters = (
        Parameter(
            "ratio",
            "1 or m or 1/m",
            0.01,
            "maker's limit of 2 % for classic strain-gauge plates",
            least=_LEAST,
            usual=_USUAL,
            alike=_ALIKE,
        ),
    )
    single = True
    separated_by = "Squats, which change Fz, at several places of the plate."
    advice = "Load the plate with dead weights at its middle and corners; enter the maker's full calibration matrix."
    about = About(
        what="A load on one channel of a force plate shows in another channel.",
        signature="The residual of the second channel follows the first one (nearly always Fz, the largest).",
        look_alikes=(
            "A tilted plate or laboratory (Fz into Fx, Fy), a shifted plate or an offset (Fz into Mx, My while Fz "
            "hardly changes)."
        ),
        settled_by="Movements that change Fz much and by standing at other places of the plate.",
    )
    words = CauseWords("{size}{between} of {it} leaks into {other}", CALIBRATE, "a cross-talk")
    explains = (CheckKind.PRESSURE, CheckKind.FORCES)
    rarer = 1.0

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return every ordered pair of different channels, of every plate when there are several."""
        pairs = tuple(f"{a}->{b}" for a in CHANNELS for b in CHANNELS if a != b)
        if len(case.trial.plates) == 1:
            return pairs
        return tuple(f"{plate.name}:{pair}" for plate in case.trial.plates for pair in pairs)

    def columns(self, case: Case) -> Array:
        """Return the predicted first channel in the place of the second, moved to the lab origin."""
        plate = self.plate_of(case)
        first, _, second = self.target.rpartition(":")[2].partition("->")
        change = case.predicted_on(plate)[:, CHANNELS.index(first), None] * np.eye(6)[CHANNELS.index(second)]
        return wrench_about_origin(change, plate.centre)[:, :, None]


EFFECT = PlateCrosstalk

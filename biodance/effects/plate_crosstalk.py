"""A load on one channel of a force plate shows in another channel."""

from biodance.effects._base.effect import Parameter
from biodance.effects._base.installed_plate import InstalledPlate
from biodance.effects._base.words import CALIBRATE, About, CauseWords, CheckKind
from biodance.lab.plates.faults import CROSSTALK

_LEAST = {"1": 0.002, "m": 0.001, "1/m": 0.01}
"""1, m, 1/m that matter: makers' accuracy, 0.05 to 0.2 % of full scale."""
_USUAL = {"m": 0.006}
"""As a plate beside its place, which looks like it."""


class PlateCrosstalk(InstalledPlate):
    """``ratio`` of the second channel to the first (1, or m for a moment from a force) about the plate's centre;
    target ``Fz->My``.
    """

    name = "plate_crosstalk"
    fault = CROSSTALK
    by_load = True
    parameters = (
        Parameter(
            "ratio",
            "1 or m or 1/m",
            0.01,
            "maker's limit of 2 % for classic strain-gauge plates",
            least=_LEAST,
            usual=_USUAL,
            alike=0.005,
        ),
    )
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


EFFECT = PlateCrosstalk

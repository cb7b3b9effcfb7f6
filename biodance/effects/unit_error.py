"""Numbers stand in another unit than the file says: pounds for newtons, millimetres for metres, N·mm for N·m."""

import numpy as np

from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded, overruled_files
from biodance.effects._base.words import RECORD_AGAIN, About, CauseWords, CheckKind
from biodance.records import Trial
from biodance.settings import STANDARD_GRAVITY

FACTORS = {
    1000.0: "newtons declared as kilonewtons, or a gain that was forgotten",
    STANDARD_GRAVITY: "newtons declared as kilograms-force",
    4.4482216: "newtons declared as pounds",
    2.2046226: "kilograms declared as pounds, in the plates or in the mass",
    1 / 2.2046226: "pounds declared as kilograms, in the plates or in the mass",
    1 / 4.4482216: "pounds declared as newtons",
    1 / STANDARD_GRAVITY: "kilograms-force declared as newtons",
    1e-3: "kilonewtons declared as newtons",
}
_NEAR = 0.06
"""How near the ratio of weights must come to a factor: shoes, clothes and movement."""
_EVEN = 0.15
"""Largest spread of the ratio within a trial, or somebody steps on and off."""
_WORDS = {
    "markers": r"UNITS is '[^']+'; .* can only be in (?:mm|cm|m), so lengths are",
    "corners": r"they were taken as (?:m|mm), the only unit",
    "origin": r"makes no sense in the file's unit and was taken in units of ([\d.e-]+) m",
    "moments": r"only when taken ([\d.]+) times as large as the file's units say",
}


class UnitError(DiscreteEffect):
    """A unit that the reader had to overrule, or a weight on the plates that is a well-known factor off."""

    name = "unit_error"
    separated_by = "The person's weight on the plate and on a scale."
    advice = (
        "Correct the unit in the recording software (C3D: POINT:UNITS, ANALOG:UNITS, FORCE_PLATFORM) and export again."
    )
    about = About(
        what=(
            "Numbers stand in another unit than the file says: pounds for newtons, millimetres for metres, N·mm for "
            "N·m."
        ),
        signature=(
            "Every channel of a plate, or all moments, or all markers, are one of a few well-known factors too large "
            "or too small."
        ),
        look_alikes=(
            "None; no person weighs 4.45 times as much. A foot beside the plate makes the weight too small, but by no"
            " fixed factor."
        ),
        settled_by="The scale's weight and by the size of the person and the plates.",
    )
    words = CauseWords("a unit is mistaken{factor}", RECORD_AGAIN, "a mistaken unit")
    explains = (CheckKind.WEIGHT, CheckKind.MARKERS, CheckKind.FORCES)
    raw = True

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return what the reader overruled, and whether the plates carry the person's weight up to a factor."""
        return (*overruled_files(recorded.session, _WORDS, check="units", effect=cls.name), *cls._weight(recorded))

    @classmethod
    def _weight(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        mass = recorded.session.subject.mass
        if not mass > 0 or "mass" in recorded.session.subject.guessed:
            return ()
        found = ((trial.name, weight_ratio(trial, mass)) for trial in recorded.session.trials)
        ratios = {name: ratio for name, ratio in found if ratio is not None}
        if not ratios:
            return ()
        middle = float(np.median(list(ratios.values())))
        # In which trials least and most.
        ends = dict.fromkeys((min(ratios, key=ratios.__getitem__), max(ratios, key=ratios.__getitem__)))
        words = " to ".join(f"{float(f'{ratios[name]:.3g}'):g} ({name})" for name in ends)
        carried = (
            f"The plates carry {words} times the declared weight (median of a trial while loaded, movement included)"
        )
        for factor, meaning in FACTORS.items():
            if abs(middle / factor - 1) < _NEAR:
                said = f"{carried}: {meaning}."
                return (QualityCheck("weight on the plates", False, said, cls.name, "", factor, "factor", "1"),)
        return (QualityCheck("weight on the plates", True, f"{carried}: no unit is mistaken."),)


def weight_ratio(trial: Trial, mass: float) -> float | None:
    """Return the loaded plates' vertical force over the weight of ``mass`` kg (median); None where it is no steady
    whole.
    """
    if not trial.plates or any(p.wrench.time.shape != trial.plates[0].wrench.time.shape for p in trial.plates):
        return None
    vertical = np.sum([plate.wrench.value[:, 2] for plate in trial.plates], axis=0)
    if not vertical.size or not np.nanmax(np.abs(vertical)) > 0:
        return None
    # Quartiles of the loaded samples: a steady whole is one in which they agree.
    low, middle, high = np.nanpercentile(vertical[np.abs(vertical) > 0.1 * np.nanmax(np.abs(vertical))], [25, 50, 75])
    return float(middle / (mass * STANDARD_GRAVITY)) if middle > 0 and (high - low) < _EVEN * middle else None


EFFECT = UnitError

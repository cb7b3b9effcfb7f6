"""A channel or an axis of a force plate points the other way, or axes are exchanged: cabling, corners counted from
another one.
"""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded, overruled_files
from biodance.effects._base.words import RECORD_AGAIN, About, CauseWords, CheckKind
from biodance.records import CHANNELS, Array
from biodance.spatial import wrench_about_point

ALONE = 0.95
"""Share of the vertical force that a plate must carry in the frames that judge it."""
MOVING = np.array([3.0, 3.0, np.inf, 3.0, 3.0, 1.5])
"""N, N·m: smallest standard deviation of the needed channel that says anything; the sign of Fz is gravity's."""
MIRRORED = 0.5
"""Share of the squared residual that must be left when the sign is turned (measured: below 0.25 where it is wrong,
above 5 where not).
"""
_SECONDS = 2.0
_WORDS = {
    "corners": r"corners run the wrong way round",
    "axes": r"the plate axes were turned by (\d+) degrees",
    "Fz": r"Fz alone was turned round",
    "shear": r"shear channels seem to have the wrong sign",
}


class AxisError(DiscreteEffect):
    """A turned sign or exchanged axes: overruled by the reader, or seen against the needed wrench."""

    name = "axis_error"
    separated_by = "Push the plate with a foot forwards, then to the left, then stand at its left edge."
    advice = (
        "Check cabling, polarity of the channels and the order of FORCE_PLATFORM:CORNERS; push the plate in "
        "known directions."
    )
    about = About(
        what=(
            "A channel or an axis of a force plate points the other way, or axes are exchanged: cabling, corners "
            "counted from another one."
        ),
        signature=(
            "One channel is the mirror image of what the motion needs; or only a quarter turn of the plate puts the "
            "load under the feet."
        ),
        look_alikes="A rotation of the plate by 90 or 180 degrees, which is the same thing.",
        settled_by="Pushing the plate forwards and to the left.",
    )
    words = CauseWords("the sign or order of {it} is wrong", RECORD_AGAIN, "a wrong axis")
    explains = (CheckKind.FORCES,)
    raw = True

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return what the reader overruled, and the channels that mirror what the motion needs."""
        names = list(dict.fromkeys(plate.name for case in recorded.cases for plate in case.trial.plates))
        signs = (quality for name in names for quality in cls._signs(recorded.cases, name))
        return (*overruled_files(recorded.session, _WORDS, check="axes of the plates", effect=cls.name), *signs)

    @classmethod
    def _signs(cls, cases: tuple[Case, ...], plate: str) -> tuple[QualityCheck, ...]:
        seen = (case for case in cases if np.all(case.body.free))  # an unseen trunk needs other shear than is computed
        pairs = [pair for case in seen if (pair := on_one_plate(case, plate)) is not None]
        if not pairs:
            return ()
        measured, needed = (np.concatenate([pair[k] for pair in pairs]) for k in range(2))
        wrong = sign_turned(measured, needed)
        if not wrong:
            return (
                QualityCheck("signs of the channels", True, f"No channel of {plate} mirrors what the motion needs."),
            )
        prefix = "" if len(cases[0].trial.plates) == 1 else f"{plate}:"
        return tuple(
            QualityCheck(
                "signs of the channels",
                False,
                f"{plate} {name} has the opposite sign of what the motion needs.",
                cls.name,
                f"{prefix}{name}",
            )
            for name in wrong
        )


def on_one_plate(case: Case, name: str) -> tuple[Array, Array] | None:
    """Return measured and needed wrench (n, 6) about a plate's centre where it carries the person alone, less their
    means and what follows the needed vertical force (a centre of mass that is a little off does); None without two
    seconds of that.
    """
    plate = next((plate for plate in case.trial.plates if plate.name == name), None)
    if plate is None:
        return None
    total, own, needed = case.trial.wrench.value[:, 2], plate.wrench.value, case.predicted
    alone = (own[:, 2] > ALONE * total) & (own[:, 2] > 0.5 * needed[:, 2]) & np.isfinite(own).all(axis=1)
    if alone.sum() < _SECONDS * case.motion.rate:
        return None
    measured, needed = (wrench_about_point(value[alone], plate.centre) for value in (own, needed))
    nuisance = np.stack([np.ones(alone.sum()), needed[:, 2]], axis=1)
    both = np.hstack([measured, needed])
    rest = both - nuisance @ np.linalg.lstsq(nuisance, both, rcond=None)[0]
    return rest[:, :6], rest[:, 6:]


def sign_turned(measured: Array, needed: Array) -> tuple[str, ...]:
    """Return the channels of ``measured`` (n, 6) that agree with ``needed`` (n, 6) only once their sign is turned."""
    as_is, turned = np.sum((measured - needed) ** 2, axis=0), np.sum((measured + needed) ** 2, axis=0)
    wrong = (needed.std(axis=0) > MOVING) & (turned < MIRRORED * as_is)
    return tuple(name for name, bad in zip(CHANNELS, wrong, strict=True) if bad)


EFFECT = AxisError

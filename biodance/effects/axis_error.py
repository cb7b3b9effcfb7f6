"""A channel or an axis of a force plate points the other way, or axes are exchanged."""

from dataclasses import replace

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded, overruled_files
from biodance.effects._base.words import RECORD_AGAIN, About, CauseWords, CheckKind
from biodance.identification.posterior import prior_factor
from biodance.lab.plates.faults import CROSSTALK, GAIN
from biodance.motion.dynamics import regressor
from biodance.records import CHANNELS, Array, Plate, Trial
from biodance.spatial import wrench_about_point
from biodance.uncertainty.caution import widened_prior

ALONE = 0.95
"""Share of the vertical force that a plate must carry in the frames that judge it."""
MOVING = np.array([3.0, 3.0, np.inf, 3.0, 3.0, 1.5])
"""N, N·m: smallest standard deviation of the needed channel that says anything; the sign of Fz is gravity's."""
MIRRORED = 0.5
"""Share of the squared residual that must be left when the sign is turned (measured: below 0.25 where it is wrong,
above 5 where not).
"""
_TURNED = -2.0
"""Gain of a channel with the wrong sign: it reads minus what is there, and so does its own inverse."""
_LEVERS = {"Fx": ("Mz", 1, 0.5), "Fy": ("Mz", 0, -0.5)}
"""By turned force: the moment that follows it where the moments were recorded about another point than the plate's
centre, the axis along which that point lies beside it, and how far (m) per ratio of the two: the force counts twice, as
recorded and as turned."""
_ANEW = 0.1
"""Share of the frames that tell anything new: forces of people change at a tenth of the rate."""
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
        centre = next(one.centre for case in cases for one in case.trial.plates if one.name == plate)
        pairs = [pair for case in seen if (pair := on_one_plate(case, plate, centre)) is not None]
        if not pairs:
            return ()
        measured, needed, doubt = (np.concatenate([pair[k] for pair in pairs]) for k in range(3))
        wrong = sign_turned(measured, needed, doubt)
        points = {name: moment_point(measured, needed, name, centre) for name in wrong}
        if not wrong:
            return (
                QualityCheck("signs of the channels", True, f"No channel of {plate} mirrors what the motion needs."),
            )
        prefix = "" if len(cases[0].trial.plates) == 1 else f"{plate}:"
        return tuple(
            QualityCheck(
                "signs of the channels",
                False,
                f"{plate} {name} has the opposite sign of what the motion needs{_beside(name, *point)}.",
                cls.name,
                f"{prefix}{name}",
                point[0],
                "point",
                "m",
                sd=point[1],
            )
            for name, point in points.items()
        )

    @classmethod
    def undone(cls, trial: Trial, found: QualityCheck) -> Trial:
        """Return the trial with the sign turned back, its moments about the point that they were recorded about; as it
        is where the reader has overruled the file.
        """
        name, _, channel = found.target.rpartition(":")
        if channel not in CHANNELS or found.unit != "m":
            return trial
        plates = (_turned(p, channel, found.size) if p.name == name or not name else p for p in trial.plates)
        return replace(trial, plates=tuple(plates))


def _turned(plate: Plate, channel: str, point: float) -> Plate:
    """Return a plate with a channel's sign turned, its moments kept about the ``point`` (m, lab); NaN: its centre."""
    right = GAIN.undone(plate, channel, _TURNED)
    if channel not in _LEVERS or np.isnan(point):
        return right
    moment, axis, share = _LEVERS[channel]
    return CROSSTALK.undone(right, f"{channel}->{moment}", float(point - plate.centre[axis]) / share)


def _beside(channel: str, point: float, sd: float) -> str:
    """Return where the moments were recorded about, to go on a sentence with; "" for the plate's centre."""
    if np.isnan(point):
        return ""
    along = "xyz"[_LEVERS[channel][1]]
    return f", and its moments are about a point at {along} = {point:.3f} ± {sd:.3f} m, not about the plate's centre"


def on_one_plate(case: Case, name: str, about: Array) -> tuple[Array, Array, Array] | None:
    """Return measured and needed wrench (n, 6) of a plate about the point ``about`` (3,) m where it carries the person
    alone, and (n, 6, p) what a standard deviation of each direction of the body's prior adds to the needed one, less
    their means and what follows the needed vertical force (a centre of mass that is a little off does); None without
    two seconds of that. Only as many frames as tell something new.
    """
    plate = next((plate for plate in case.trial.plates if plate.name == name), None)
    if plate is None:
        return None
    total, own, needed = case.trial.wrench.value[:, 2], plate.wrench.value, case.predicted
    alone = (own[:, 2] > ALONE * total) & (own[:, 2] > 0.5 * needed[:, 2]) & np.isfinite(own).all(axis=1)
    if alone.sum() < _SECONDS * case.motion.rate:
        return None
    used = np.flatnonzero(alone)[:: round(1 / _ANEW)]
    doubt = regressor(case.body, case.motion.at(used)) @ prior_factor(widened_prior(case.body.sip))
    rows = np.concatenate([own[used][:, None], needed[used][:, None], doubt.swapaxes(1, 2)], axis=1)
    flat = wrench_about_point(rows, about).reshape(len(used), -1)
    nuisance = np.stack([np.ones(len(used)), needed[used, 2]], axis=1)
    # What a constant and the needed vertical force explain is taken off, from all columns alike.
    rest = (flat - nuisance @ np.linalg.lstsq(nuisance, flat, rcond=None)[0]).reshape(rows.shape)
    return rest[:, 0], rest[:, 1], rest[:, 2:].swapaxes(1, 2)


def sign_turned(measured: Array, needed: Array, doubt: Array) -> tuple[str, ...]:
    """Return the channels of ``measured`` (n, 6) that agree with ``needed`` (n, 6) only once their sign is turned,
    whatever body within its ``doubt`` (n, 6, p) needs it: segments that move against each other leave a force that
    hangs on how the mass is shared between them.
    """
    wrong = [
        bool(needed[:, k].std() > noise)
        and _misfit(-measured[:, k] - needed[:, k], doubt[:, k], noise)
        < MIRRORED * _misfit(measured[:, k] - needed[:, k], doubt[:, k], noise)
        for k, noise in enumerate(MOVING)
    ]
    return tuple(name for name, bad in zip(CHANNELS, wrong, strict=True) if bad)


def _misfit(left: Array, doubt: Array, noise: float) -> float:
    """Return min over u of |left - doubt u|^2 / noise^2 + |u|^2: what no likely body explains of ``left`` (n,)."""
    inner = np.eye(doubt.shape[1]) * noise**2 + doubt.T @ doubt
    across = doubt.T @ left
    # Woodbury: min over u is (l'l - l'D (noise² + D'D)^-1 D'l) / noise².
    return float(left @ left - across @ np.linalg.solve(inner, across)) / noise**2


def moment_point(measured: Array, needed: Array, channel: str, centre: Array) -> tuple[float, float]:
    """Return where (m in the lab, with its standard deviation) the point lies about which the moments of a plate were
    recorded whose force ``channel`` is turned; NaN where that is its ``centre`` (3,) m. Wrenches (n, 6) about that.

    Who moves moments from a point p to the centre c with a force that is turned errs by 2 (p - c) x F. Only what leaves
    at most `MIRRORED` of the moment's squared residual is believed.
    """
    if channel not in _LEVERS:
        return np.nan, np.nan
    moment, axis, share = _LEVERS[channel]
    force = -measured[:, CHANNELS.index(channel)]
    left = (measured - needed)[:, CHANNELS.index(moment)]
    # Least squares of the moment's error on the true force; its slope is twice the lever (`_LEVERS`).
    ratio = float(force @ left / (force @ force))
    rest = left - ratio * force
    if not rest @ rest < MIRRORED * (left @ left):
        return np.nan, np.nan
    # Standard error of a slope: residual variance over the sum of squares.
    sd = float(np.sqrt(rest @ rest / len(rest) / (force @ force)))
    return float(centre[axis]) + share * ratio, abs(share) * sd


EFFECT = AxisError

"""Time is wrong: a declared rate that was not the true one, frames that the cameras lost without saying so."""

import numpy as np
from scipy.fft import dct

from biodance.effects._base.case import Case
from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded
from biodance.effects._base.words import RECORD_AGAIN, About, CauseWords, CheckKind
from biodance.effects.clipping import clipped
from biodance.identification.posterior import prior_factor
from biodance.lab.prepare import LowPass, low_pass
from biodance.motion.dynamics import predict_wrench, regressor
from biodance.records import Array, Motion
from biodance.spatial import skew
from biodance.uncertainty.caution import widened_prior

BAND = 3.0
"""Hz: above, soft tissue decides how large accelerations seem."""
RATIO = 0.12
"""Largest relative error of the rate that is let pass (30 nulls and 16 loads up to 8 kg show 0.004 to 0.010); rates in
use differ by 0.15 and more.
"""
FITS = 0.9
"""Least share of the moving wrench that body and clock together must explain, or nothing is said (nulls, wrong
clocks: 0.97 and more).
"""
COARSE = 20.0
"""Hz: movement below BAND needs no more samples than these."""
_NOISE = np.array([3.0, 3.0, 3.0, 1.5, 1.5, 1.0])
"""N, N·m: what soft tissue leaves in one coefficient."""
_STEP = 0.018
"""s by which the delay may differ between the two halves of a trial."""
_SHARE = 0.05
"""Least share of the force that one delay a trial leaves, which another delay from its middle on must explain (two to
twelve frames lost: 0.10 to 0.37; hands that push now and then, and slow clocks: 0.024 at most).
"""
EXPLAINED = 0.5
"""Least share of the moving force that the motion must explain before anything is said."""
_EDGE = 0.5
"""s at each end of a trial that are not judged."""


class FrameRate(DiscreteEffect):
    """A wrong rate, or frames that were lost on the way."""

    name = "frame_rate"
    separated_by = "A jump on the plate (flight time against height), and a clock in the picture."
    advice = (
        "Compare the declared rates with the cameras' setting; look for dropped frames in the recording "
        "software and record again."
    )
    about = About(
        what=(
            "Time is wrong: a declared rate that was not the true one, frames that the cameras lost without saying so."
        ),
        signature=(
            "At a wrong rate the accelerations, and with them the moving part of all forces, are too large by the "
            "square of the ratio, while weight is right; lost frames make forces late from one instant on."
        ),
        look_alikes=(
            "A load (gravity grows with it, too, so it is fitted beside the clock); gains of all channels (which "
            "touch the weight, too); a delay (from the start on)."
        ),
        settled_by="A jump on the plate: flight time against height, and by a clock in the picture.",
    )
    words = CauseWords("the cameras' frames are not those that the file declares", RECORD_AGAIN, "a wrong frame rate")
    explains = (CheckKind.MARKERS,)
    raw = True

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return whether accelerations have the size that forces need, and whether the delay is the same from start
        to end.
        """
        cut = {trial.name for trial in recorded.session.trials if clipped(trial)}
        whole = [case for case in recorded.cases if case.trial.name not in cut]
        parts = [(case, part) for case in whole if (part := moving_parts(case)) is not None]
        return (*cls._rate([case for case, _ in parts]), *cls._lost([part for _, part in parts]))

    @classmethod
    def _rate(cls, cases: list[Case]) -> tuple[QualityCheck, ...]:
        if not cases:
            return ()
        ratio, explained = clock_beside_body(cases)
        if explained < FITS:
            return ()
        # the cameras' rate is one for all trials: what only some ask for, or only all together, is something else
        if abs(ratio - 1) > RATIO and all(_agrees(clock_beside_body([one]), ratio) for one in cases):
            said = (
                f"Whatever the segments weigh, forces need {1 / ratio**2:.2f} times the motion's accelerations: the "
                f"declared rate is "
                f"{ratio:.3g} times the true one."
            )
            return (QualityCheck("rate of the cameras", False, said, cls.name, "", ratio, "ratio", "1"),)
        if abs(ratio - 1) > RATIO:
            return ()
        return (
            QualityCheck(
                "rate of the cameras", True, f"Accelerations fit the forces: declared over true rate {ratio:.3f}."
            ),
        )

    @classmethod
    def _lost(cls, parts: list[tuple[Array, Array, float]]) -> tuple[QualityCheck, ...]:
        steps = [
            late(m[len(m) // 2 :], n[len(n) // 2 :], rate) - late(m[: len(m) // 2], n[: len(n) // 2], rate)
            for m, n, rate in parts
        ]
        if len(steps) < 2:
            return ()
        step = float(np.median(steps))
        if np.min(np.sign(step) * np.array(steps)) < -_STEP:
            return ()  # lost frames are not found again: where trials contradict each other, something else is wrong
        if abs(step) > _STEP and explained_by_step(parts) > _SHARE:
            said = (
                f"From the middle of the trials on, forces are {1000 * step:.0f} ms later than at their start: "
                f"frames were lost."
            )
            return (QualityCheck("lost frames", False, said, cls.name, "", step, "lost", "s"),)
        return (
            QualityCheck(
                "lost frames",
                True,
                f"The delay is the same at the start and at the end of the trials (within {1000 * _STEP:.0f} ms).",
            ),
        )


def _agrees(alone: tuple[float, float], ratio: float) -> bool:
    """Return whether a trial ``alone`` (`clock_beside_body`) asks for the ``ratio`` of all, or cannot tell."""
    return alone[1] < FITS or abs(alone[0] - ratio) < RATIO


def moving_parts(case: Case) -> tuple[Array, Array, float] | None:
    """Return measured force less weight, the force that the accelerations need (n, 3) N, both below BAND, and the rate;
    the mean force is made to fit (a runner's median is none), so that units do not matter here. None where the motion
    does not explain the force.
    """
    frames, rate = case.motion.time.size, case.motion.rate
    if frames < 2 * _EDGE * rate + 2 * rate or rate < 3 * BAND:
        return None
    # At rest in every posture: what gravity alone needs.
    still = Motion(case.motion.time, case.motion.q, 0 * case.motion.v, 0 * case.motion.a)
    weight = predict_wrench(case.body, still, case.phi).force
    force = case.trial.wrench.force
    if not np.isfinite(force).all() or not force[:, 2].mean() > 0:
        return None
    needed = case.predicted[:, :3] - weight
    measured = force * (case.predicted[:, 2].mean() / force[:, 2].mean()) - weight
    # Mean difference off: zeros of plates and a wrong mass tell nothing of the clock.
    measured = measured - (measured - needed).mean(axis=0)
    smooth = low_pass(np.hstack([measured, needed]), rate, LowPass(order=4, cutoff=BAND))
    inside = slice(int(_EDGE * rate), -int(_EDGE * rate))
    measured, needed = smooth[inside, :3], smooth[inside, 3:]
    alike = float((measured * needed).sum() / np.sqrt((measured**2).sum() * (needed**2).sum() + 1e-12))
    return (measured, needed, rate) if alike**2 > EXPLAINED else None


def clock_beside_body(cases: list[Case]) -> tuple[float, float]:
    """Return declared over true rate, and the share of the moving wrench that it explains together with the body's
    parameters.

    At a wrong rate the inertial part of the wrench grows with the square of the ratio, the part of gravity does not,
    while a load is heavy in both; so the square is fitted beside all parameters (known as well as the table knows them)
    by Gauss-Newton steps.
    """
    body = cases[0].body
    factor, phi, square = prior_factor(widened_prior(body.sip)), body.sip.phi, 1.0
    measured, heavy, driven = (np.concatenate(parts) for parts in zip(*map(_slow_parts, cases), strict=True))
    away = np.zeros(factor.shape[1])
    for _ in range(8):
        here = phi + factor @ away
        # Columns: parameters in prior standard deviations, then the square of the clock's ratio.
        slopes = np.column_stack([(heavy + square * driven) @ factor, driven @ here])
        left = measured - (heavy + square * driven) @ here
        # Unit-normal prior of the parameters, none of the clock.
        inner = slopes.T @ slopes + np.diag([*np.ones(away.size), 0.0])
        step = np.linalg.solve(inner, slopes.T @ left - np.append(away, 0.0))
        # The square stays positive, at least a tenth of what it was.
        away, square = away + step[:-1], max(square + step[-1], 0.1 * square)
    here = phi + factor @ away
    moving = measured - heavy @ here
    return float(square**-0.5), float(1 - np.sum((moving - square * driven @ here) ** 2) / np.sum(moving**2))


def _slow_parts(case: Case) -> tuple[Array, Array, Array]:
    """Return slow coefficients of the wrench (n,), and of the regressors of weight and acceleration (n, 10N)."""
    skip, edge = max(1, int(case.motion.rate / COARSE)), int(_EDGE * case.motion.rate)
    take = slice(edge, -edge, skip)
    motion = case.motion
    some = motion.at(take)
    weight, whole = regressor(case.body, Motion(some.time, some.q, 0 * some.v, 0 * some.a)), regressor(case.body, some)
    force = case.trial.wrench.value[take]
    force = force * (np.mean(whole[:, 2] @ case.phi) / np.mean(force[:, 2]))
    shift, count = np.eye(6), int(2 * BAND * some.time.size / some.rate)
    # M about the standing point: M - c x F.
    shift[3:, :3] = -skew(np.array([*np.median(some.q[:, :2], axis=0), 0.0]))

    def coefficients(values: Array) -> Array:
        return np.asarray(dct(shift @ values, axis=0, norm="ortho")[:count] / _NOISE[:, None]).reshape(
            -1, values.shape[2]
        )

    return coefficients(force[:, :, None])[:, 0], coefficients(weight), coefficients(whole - weight)


def late(measured: Array, needed: Array, rate: float) -> float:
    """Return by how many seconds the measured force (n, 3) is late against the needed one, to first order of a
    least-squares fit.
    """
    speed = np.gradient(needed, 1 / rate, axis=0)
    # measured(t) = needed(t - d) is about needed - d needed'.
    return float(-((measured - needed) * speed).sum() / max((speed**2).sum(), 1e-12))


def explained_by_step(parts: list[tuple[Array, Array, float]]) -> float:
    """Return the share of the force that one delay of each trial leaves, which another delay from the middle of the
    trial on explains: lost frames are a step of the clock, and what pushes leaves its own force.
    """
    one = two = 0.0
    for measured, needed, rate in parts:
        half = len(measured) // 2
        one += _left_by_delay(measured, needed, rate)
        two += sum(_left_by_delay(measured[some], needed[some], rate) for some in (slice(half), slice(half, None)))
    return 1.0 - two / max(one, 1e-12)


def _left_by_delay(measured: Array, needed: Array, rate: float) -> float:
    """Return the sum of squares that the needed force (n, 3) leaves of the measured one once it is delayed (`late`)."""
    speed = np.gradient(needed, 1 / rate, axis=0)
    return float(np.sum((measured - needed + late(measured, needed, rate) * speed) ** 2))


EFFECT = FrameRate

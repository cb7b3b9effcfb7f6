"""Time is wrong: a declared rate that was not the true one, frames that the cameras lost without saying so.

Signature: at a wrong rate the accelerations, and with them the moving part of all forces, are too large by the square of the ratio, while
weight is right; lost frames make forces late from one instant on.
Look-alikes: gains of all channels (which touch the weight, too); a delay (from the start on). Separated by a jump on the plate: flight time
against height, and by a clock in the picture.
"""

import numpy as np

from biodance.effects.case import Case
from biodance.effects.clipping import clipped
from biodance.effects.gate import DiscreteEffect, Gate, Recorded
from biodance.lab.filters import LowPass, low_pass
from biodance.motion.regressor import predict_wrench
from biodance.records import Array, Motion

BAND = 3.0
"""Hz: above, soft tissue decides how large accelerations seem."""
RATIO = 0.12
"""Largest relative error of the rate that movement itself explains (nulls: up to 0.062); rates in use differ by 0.2 and more."""
STEP = 0.018
"""s by which the delay may differ between the two halves of a trial."""
EXPLAINED = 0.5
"""Least share of the moving force that the motion must explain before anything is said."""
STRONG = 0.2
"""Least share of the moving force that an axis must have to be judged."""
EDGE = 0.5
"""s at each end of a trial that are not judged."""


class FrameRate(DiscreteEffect):
    """A wrong rate, or frames that were lost on the way."""

    name = "frame_rate"
    separated_by = "A jump on the plate (flight time against height), and a clock in the picture."
    advice = "Compare the declared rates with the cameras' setting; look for dropped frames in the recording software and record again."

    @classmethod
    def look(cls, recorded: Recorded) -> tuple[Gate, ...]:
        """Return whether accelerations have the size that forces need, and whether the delay is the same from start to end."""
        cut = {trial.name for trial in recorded.session.trials if clipped(trial)}
        whole = [case for case in recorded.cases if case.trial.name not in cut]
        parts = [part for case in whole if (part := moving_parts(case)) is not None]
        return (*cls._rate(parts), *cls._lost(parts))

    @classmethod
    def _rate(cls, parts: list[tuple[Array, Array, float]]) -> tuple[Gate, ...]:
        found = [ratio for measured, needed, _ in parts if (ratio := rate_ratio(measured, needed)) is not None]
        if not found:
            return ()
        ratio = float(np.median(found))
        if abs(ratio - 1) > RATIO:
            said = f"Forces need {1 / ratio**2:.2f} times the motion's accelerations: the declared rate is {ratio:.3g} times the true one."
            return (Gate("rate of the cameras", False, said, cls.name, "", ratio, "ratio", "1"),)
        return (Gate("rate of the cameras", True, f"Accelerations fit the forces: declared over true rate {ratio:.3f}."),)

    @classmethod
    def _lost(cls, parts: list[tuple[Array, Array, float]]) -> tuple[Gate, ...]:
        steps = [late(m[len(m) // 2 :], n[len(n) // 2 :], rate) - late(m[: len(m) // 2], n[: len(n) // 2], rate) for m, n, rate in parts]
        if len(steps) < 2:
            return ()
        step = float(np.median(steps))
        if abs(step) > STEP:
            said = f"From the middle of the trials on, forces are {1000 * step:.0f} ms later than at their start: frames were lost."
            return (Gate("lost frames", False, said, cls.name, "", step, "lost", "s"),)
        return (
            Gate("lost frames", True, f"The delay is the same at the start and at the end of the trials (within {1000 * STEP:.0f} ms)."),
        )


def moving_parts(case: Case) -> tuple[Array, Array, float] | None:
    """Return measured force less weight, the force that the accelerations need (n, 3) N, both below BAND, and the rate; the weight is made
    to fit, so that units do not matter here. None where the motion does not explain the force.
    """
    frames, rate = case.motion.time.size, case.motion.rate
    if frames < 2 * EDGE * rate + 2 * rate or rate < 3 * BAND:
        return None
    still = Motion(case.motion.time, case.motion.q, 0 * case.motion.v, 0 * case.motion.a)
    weight = predict_wrench(case.body, still, case.phi).force
    force = case.trial.wrench.force
    if not np.isfinite(force).all() or not np.median(force[:, 2]) > 0:
        return None
    measured = force * (np.median(weight[:, 2]) / np.median(force[:, 2])) - weight
    measured = measured - np.median(measured, axis=0)
    smooth = low_pass(np.hstack([measured, case.predicted[:, :3] - weight]), rate, LowPass(order=4, cutoff=BAND))
    inside = slice(int(EDGE * rate), -int(EDGE * rate))
    measured, needed = smooth[inside, :3], smooth[inside, 3:]
    alike = float((measured * needed).sum() / np.sqrt((measured**2).sum() * (needed**2).sum() + 1e-12))
    return (measured, needed, rate) if alike**2 > EXPLAINED else None


def rate_ratio(measured: Array, needed: Array) -> float | None:
    """Return declared over true rate from the sizes of the two moving forces (n, 3): accelerations grow with its square. The median of the
    axes along which the force moves, so that one bad channel does not count.
    """
    both = (measured * needed).sum(axis=0)
    strong = (both > 0) & ((needed**2).sum(axis=0) > STRONG**2 * (needed**2).sum())
    squares = np.sqrt(((measured**2).sum(axis=0) / (needed**2).sum(axis=0))[strong])
    return float(np.median(squares**-0.5)) if strong.any() else None


def late(measured: Array, needed: Array, rate: float) -> float:
    """Return by how many seconds the measured force (n, 3) is late against the needed one, to first order of a least-squares fit."""
    speed = np.gradient(needed, 1 / rate, axis=0)
    return float(-((measured - needed) * speed).sum() / max((speed**2).sum(), 1e-12))


EFFECT = FrameRate

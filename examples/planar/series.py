"""The paper's numerical example (III.C, Fig. 4), which criterion excites a planar chain of three links best.

Six motions of 2 s follow each other; each is designed on top of all before it; cond(W_b) at 50 Hz judges every
criterion alike. Four via points per joint at equal distances, so 12 variables, as printed. NOT printed, hence chosen
here: joint ranges and masses (see ``planar_chain``), rest at both ends of each motion (sixth-order splines as in III.A:
a cubic through four points has accelerations linear in time and leaves ZZ1, ZZ2, ZZ3 dependent whatever the points),
and where the motions begin and end (see the two functions).
"""

from dataclasses import dataclass

import numpy as np
from comparison import Comparison, compare_criteria
from criteria import criterion
from planar_chain import PLANAR_CHANNELS, PLANAR_GRAVITY
from target import target
from via_points import Excitation, design, within_ranges

from biodance.body.body import Body
from biodance.dance.problem.splines import rest_to_rest
from biodance.identification.base_parameters import BaseParameters, base_parameters, parameter_names
from biodance.motion.dynamics import regressor_of
from biodance.motion.kinematics import segment_motion
from biodance.records import Array, Motion

MOTIONS = 6
DURATION = 2.0
"""s, of one motion."""
VIA = 4
DESIGN_RATE, JUDGE_RATE, RANGE_RATE = 25.0, 50.0, 1000.0
"""Hz: samples that the optimiser sees, on which the result is judged (the paper's), and on which the joint ranges must
hold.
"""
ITERATIONS = 60
MOVABLE = slice(1, -1)


@dataclass(frozen=True, eq=False)
class Series:
    """Motions of one criterion: ``points`` (motions, VIA + 2, joints) rad; ``condition`` (motions,) cond(W_b) after
    each, at 50 Hz.
    """

    criterion: str
    points: Array
    condition: Array


def planar_base(body: Body) -> BaseParameters:
    """Return the base parameters of the planar chain, found numerically: the ten of eq. 13."""
    rng, joints = np.random.default_rng(0), len(body.joints)
    size = (50, joints)
    states = Motion(np.arange(50.0), rng.uniform(-2, 2, size), rng.normal(0, 2, size), rng.normal(0, 4, size))
    W = regressor_of(segment_motion(body, states), gravity=PLANAR_GRAVITY)[:, list(PLANAR_CHANNELS)]
    return base_parameters(W.reshape(-1, W.shape[2]), parameter_names(body))


def planar_problem(body: Body, name: str, *, rate: float = DESIGN_RATE) -> Excitation:
    """Return the design problem of the criterion ``name`` on the planar chain, sampled at ``rate`` Hz."""
    aim = target(body, planar_base(body))
    return Excitation(
        body, rest_to_rest(DURATION, via=VIA, rate=rate), PLANAR_CHANNELS, aim, criterion(name), PLANAR_GRAVITY
    )


def paper_series(body: Body, name: str, *, motions: int = MOTIONS) -> Series:
    """Return motions designed from the paper's start: a line from the lower to the upper limits of all joints, then
    back, and so on.

    On the line all joints move in proportion, so the first W_b is singular (the paper: condition number 5e16).
    """
    lower, upper = body.limits.lower, body.limits.upper
    ends = [(lower, upper) if i % 2 == 0 else (upper, lower) for i in range(motions)]
    return _series(body, name, [[np.linspace(a, b, VIA + 2)] for a, b in ends])


def seeded_series(body: Body, name: str, *, motions: int = MOTIONS, starts: int = 3, seed: int = 0) -> Series:
    """Return motions from mid-range to mid-range, each the best of ``starts`` designs from via points drawn within the
    ranges.
    """
    rng, middle = np.random.default_rng(seed), (body.limits.lower + body.limits.upper) / 2

    def draw() -> Array:
        inner = rng.uniform(body.limits.lower, body.limits.upper, (VIA, len(middle)))
        return np.vstack([middle, inner, middle])

    return _series(body, name, [[draw() for _ in range(starts)] for _ in range(motions)])


def compared(body: Body, *, seed: int = 0) -> Comparison:
    """Return all criteria compared on one motion of the chain from mid-range to mid-range, from one seeded start."""
    middle = (body.limits.lower + body.limits.upper) / 2
    inner = np.random.default_rng(seed).uniform(body.limits.lower, body.limits.upper, (VIA, len(middle)))
    return compare_criteria(
        lambda name: planar_problem(body, name), (np.vstack([middle, inner, middle]),), movable=MOVABLE
    )


def _series(body: Body, name: str, starts: list[list[Array]]) -> Series:
    """Return the best design of each motion, in order; a motion is judged together with all before it."""
    problem, judge = planar_problem(body, name), planar_problem(body, "condition", rate=JUDGE_RATE)
    ranges = planar_problem(body, name, rate=RANGE_RATE)
    history = judged = np.zeros((problem.target.prior_factor.shape[0],) * 2)
    points, condition = [], []
    for tries in starts:
        found = [
            within_ranges(ranges, design(problem, start, history, movable=MOVABLE, iterations=ITERATIONS))
            for start in tries
        ]
        best = min(found, key=lambda p: problem.criterion(problem.extend(history, p), problem.target)[0])
        history, judged = problem.extend(history, best), judge.extend(judged, best)
        points.append(best)
        condition.append(judge.criterion(judged, judge.target)[0])
    return Series(name, np.array(points), np.array(condition))

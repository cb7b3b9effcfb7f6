"""One static posture on given feet: found within all limits, or refused by the name of the limit that forbids it; and
its mirror image, for bodies whose sides are alike. The right foot in front has no image.
"""

import math
from dataclasses import dataclass
from functools import partial
from typing import NoReturn

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import UPRIGHT
from biodance.dance.limits import CheckedMotion, Limit
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.excitation import (
    Blocks,
    effort,
    smooth_condition,
    static_grams,
    total,
    upright_slopes,
    uprights,
)
from biodance.dance.problem.nlp import Evaluation, NonlinearProgramme, Objective, free_coordinates, minimise
from biodance.dance.problem.stance import Stance, stance_words
from biodance.dance.problem.state import State, close_legs
from biodance.errors import BiodanceError
from biodance.records import Array


@dataclass(frozen=True, eq=False)
class Posture:
    """``x`` (n,) coordinates, ``up`` (N, 3) the vertical in the segments; ``violation`` of the reserved limits in their
    scales and the worst ``limit``; ``hard`` how hard it is to take.
    """

    x: Array
    up: Array
    violation: float = np.inf
    limit: str = ""
    hard: float = 0.0


KEPT = 0.01
"""Violation, in scales of the limits, of the reserved margins that is accepted."""
EASE = 5e-4
"""Worth of a joint at its stop against the criterion: postures near mid range are easier to take."""
ATTEMPTS = 8
"""Starts of a posture that is not feasible."""


def initial_guess(chain: Chain, stance: Stance, rng: np.random.Generator) -> Array:
    """Return the coordinates (n,) of a squat of any depth over the support, arms anywhere; seated: all anywhere."""
    low, high, x = chain.body.limits.lower, chain.body.limits.upper, np.zeros(chain.size)
    x[ROOT:] = low + (high - low) * rng.uniform(0.15, 0.85, len(low))
    if stance.seat:
        x[2] = stance.seat
        return x
    reach = min(float(leg.length(np.radians(rng.uniform(15, 110)))) for leg in chain.legs)
    above = UPRIGHT @ np.mean([leg.hip for leg in chain.legs], axis=0)  # zero of a person: the root is in their middle
    x[:3] = [*(stance.centre - [0.02, 0.0]), stance.ankle[0, 2] + 0.97 * reach] - above
    x[3:6] = rng.normal([0.0, 0.0, -0.2], [0.25, 0.25, 0.4])
    return x


_ITERATIONS = 30
MILD = 0.3
"""Share of the neighbours' joint angles that a posture in between keeps: it is a rest."""


def distance_from(target: Array) -> Objective:
    """Return the objective: mean squared distance (rad, m) of the coordinates from ``target`` (n,)."""

    def distance(state: State) -> tuple[float, Array]:
        gap, by = state.x - target, np.zeros((3, *state.x.shape))
        by[0] = 2 * gap / len(target)
        return float(np.mean(gap**2)), by

    return distance


def intermediate_posture(
    chain: Chain, stance: Stance, neighbours: Array, limits: tuple[Limit, ...], *, seed: list[int], mild: float = MILD
) -> Posture:
    """Return a posture on the feet ``stance`` between ``neighbours`` (K, n) coordinates; ``mild`` share of whose angles
    is the aim.

    Raises
    ------
    BiodanceError
        There is none within the limits; the message names the limit.
    """
    rng, tried = np.random.default_rng(seed), list[Array]()
    begin = initial_guess(chain, stance, rng)
    begin[3:] = mild * neighbours[:, 3:].mean(axis=0)
    for _ in range(ATTEMPTS):
        found = solve(chain, stance, begin, distance_from(begin), limits, iterations=_ITERATIONS)
        if found.violation <= KEPT:
            return found
        tried.append(begin)
        begin = initial_guess(chain, stance, rng)
    refuse(chain, stance, tried, limits)


def refuse(chain: Chain, stance: Stance, begin: list[Array], limits: tuple[Limit, ...]) -> NoReturn:
    """Raise the BiodanceError that names the limit without which there would be a posture on these feet."""
    kept = [limit for limit in limits if limit.at_rest]
    for limit in sorted(kept, key=lambda limit: limit.suspicion):
        others = tuple(other for other in kept if other is not limit)
        for x in begin:
            posture = solve(chain, stance, x, shortfall(limit), others, iterations=60)
            if posture.violation <= KEPT:
                what = describe(State(chain, stance, posture.x[None], *np.zeros((2, 1, chain.size))), limit)
                raise BiodanceError(
                    f"No posture {stance_words(stance)} keeps all limits; there would be one without the limit on "
                    f"{what}. Widen that limit, or leave this stance out of the protocol."
                )
    raise BiodanceError(
        f"No posture {stance_words(stance)} keeps all limits, whichever of them is left out. Leave this stance out of "
        f"the protocol."
    )


@dataclass(frozen=True, eq=False)
class Exciting:
    """Objective of one posture beside the Gram matrices of the ``others`` (N, 3, 3), per ``unit`` kg, and its ease."""

    blocks: Blocks
    others: Array
    unit: float
    sharpness: int

    def __call__(self, state: State) -> tuple[float, Array]:
        """Return the criterion and its slopes by x."""
        up = uprights(state)
        measure = partial(smooth_condition, sharpness=self.sharpness)
        value, slope = total(self.blocks.weight, self.others + static_grams(up), self.blocks.first, measure=measure)
        by = np.zeros((3, *state.x.shape))
        by[0] = upright_slopes(state, -2 * np.einsum("nij,tnj->tni", slope, up)) / self.unit
        ends = state.chain.body.limits
        half = np.maximum((ends.upper - ends.lower) / 2, 1e-3)
        off = (state.x[:, ROOT:] - (ends.upper + ends.lower) / 2) / half
        by[0][:, ROOT:] += 2 * EASE * off / half
        value = value / self.unit + EASE * float(np.sum(off**2))
        if not self.blocks.simplicity:
            return value, by
        hard, slopes = effort(state)
        return value + 10 * self.blocks.simplicity * hard, by + 10 * self.blocks.simplicity * slopes


def solve(
    chain: Chain, stance: Stance, begin: Array, objective: Objective, limits: tuple[Limit, ...], *, iterations: int
) -> Posture:
    """Return the posture on the feet ``stance`` that is best for ``objective`` near ``begin`` (n,) and keeps those of
    the ``limits`` that count at rest.
    """
    free = free_coordinates(chain, stance)
    base, basis = np.zeros((3, 1, chain.size)), np.zeros((3, 1, 1))
    base[0, 0] = begin
    base[0, 0, free] = 0.0
    basis[0] = 1.0
    kept = tuple(limit for limit in limits if limit.at_rest)
    reserve = np.array([[limit.hold_reserve(stance) for limit in kept]])
    problem = NonlinearProgramme(chain, stance, base, basis, free, kept, objective, reserve)
    found = minimise(problem.evaluate, begin[free], iterations=iterations)
    state = problem.state(found.y)
    return Posture(state.x[0], uprights(state)[0], *Evaluation(problem, state).worst, hard=effort(state)[0])


def posture_at(chain: Chain, stance: Stance, x: Array) -> Posture:
    """Return the posture with the coordinates x (n,), its planted feet in place, not judged."""
    state = close_legs(chain, stance, x[None], *np.zeros((2, 1, chain.size)))
    return Posture(state.x[0], uprights(state)[0])


def describe(state: State, limit: Limit) -> str:
    """Return in words how much a ``state`` (one sample) breaks a ``limit`` or its reserve, and where: in which joint,
    on which side, between what.
    """
    motion = state.chain.motion(np.zeros(len(state.x)), state.x, state.v, state.a)
    left = limit.check(CheckedMotion(state.chain.body, motion, state.stance))
    column = int(np.argmin(left.value[0]))
    missing, unit = -float(left.value[0, column]), limit.unit
    if unit == "rad":
        missing, unit = math.degrees(missing), "degrees"
    elif unit == "m":
        missing, unit = 100 * missing, "cm"
    what = f"{limit.name} of {left.of[column]}".replace("_", " ")
    if missing < 0:
        return f"{what} ({-missing:.0f} {unit} left, less than its reserve)"
    return f"{what} (short by about {missing:.0f} {unit})"


def shortfall(limit: Limit) -> Objective:
    """Return the objective of a posture that breaks one limit as little as it can: sum of squares of what is missing,
    in the limit's scale.
    """

    def missing(state: State) -> tuple[float, Array]:
        margins, slopes = limit.margins(state), np.zeros((3, *state.x.shape))
        lacks = np.minimum(margins.value / limit.scale, 0.0)
        slopes[0] = 2 * np.einsum("tm,tmn->tn", lacks, margins.slopes[0]) / limit.scale
        return float(np.sum(lacks**2)), slopes

    return missing


ACROSS = {"parallel": "parallel", "single_right": "single_left", "single_left": "single_right", "seated": "seated"}
"""Feet of a posture, and of its image."""
FLIP = np.array([1.0, 1.0, -1.0])
"""Sense of the axes of a segment in the image (z to the right)."""
SIDEWAYS = ("_bending", "_rotation")
"""Ends of the names of middle joints that change their sense; paired ones have the anatomical sense on both sides."""
_SAME = 1e-9
"""m, kg, rad, N·m: differences between the sides that are rounding."""


def counterpart(name: str) -> str:
    """Return the name of the joint or segment on the other side; middle ones are their own."""
    for side, other in (("right_", "left_"), ("left_", "right_")):
        if name.startswith(side):
            return other + name.removeprefix(side)
    return name


def symmetric(body: Body) -> bool:
    """Return whether the body is the same on both sides: joints, limits, masses and boxes."""
    names, limits, segments = [joint.name for joint in body.joints], body.limits, list(body.segments)
    if set(map(counterpart, names)) != set(names) or set(map(counterpart, segments)) != set(segments):
        return False
    across, sense = _joints(names)
    other = [segments.index(counterpart(name)) for name in segments]
    places, axes, turns = (
        np.array([getattr(joint, name) for joint in body.joints]) for name in ("translation", "axis", "rotation")
    )
    bounds = np.array([[limits.lower, limits.upper], [limits.torque_lower, limits.torque_upper]])
    pairs: list[tuple[Array, Array]] = [
        (np.sort(sense * bounds[:, :, across], axis=1), bounds),
        (FLIP * places[across], places),
        (-FLIP * axes[across], sense[:, None] * axes),  # of a robot's rolls and yaws, both sides may turn the same way
        (FLIP[:, None] * turns[across] * FLIP, turns),
        (body.sip.mass[other], body.sip.mass),
        (FLIP * body.sip.com[other], body.sip.com),
        (np.sort(FLIP * body.boxes[other], axis=1), body.boxes),
    ]
    return all(np.allclose(image, own, rtol=0.0, atol=_SAME) for image, own in pairs)


def _joints(names: list[str]) -> tuple[list[int], Array]:
    """Return for every joint the index of the one whose angle it has in the image, and the sense (n,) of that angle."""
    middle = [counterpart(name) == name for name in names]
    sense = np.array(
        [-1.0 if alone and name.endswith(SIDEWAYS) else 1.0 for alone, name in zip(middle, names, strict=True)]
    )
    return [names.index(counterpart(name)) for name in names], sense


def image_feet(here: Stance, stances: tuple[Stance, ...]) -> int | None:
    """Return the place of the first of ``stances`` on which images of postures ``here`` stand, if there is one."""
    free = np.isnan(here.hands[::-1])
    alike = (
        k
        for k, there in enumerate(stances)
        if there.name == ACROSS.get(here.name) and np.array_equal(np.isnan(there.hands), free)
    )
    return next(alike, None)


def mirror_posture(chain: Chain, x: Array, here: Stance, there: Stance) -> Array:
    """Return the image (n,), on the feet ``there``, of a posture ``x`` (n,) on the feet ``here``."""
    across, sense = _joints([joint.name for joint in chain.body.joints])
    out = np.concatenate([x[:ROOT] * [1, -1, 1, -1, -1, 1], sense * x[ROOT:][across]])
    gap = there.ankle - here.ankle[::-1] * [1, -1, 1]
    out[:2] += gap[list(there.planted), :2].mean(axis=0) if there.planted else 0.0
    return np.asarray(out)


def mirror_vectors(body: Body, vectors: Array) -> Array:
    """Return the image (N, 3) of one vector for each segment, ``vectors`` (N, 3) in the segments' frames."""
    other = [body.segments.index(counterpart(name)) for name in body.segments]
    return np.asarray(FLIP * vectors[other])

"""Static postures that turn gravity through every segment (paper eq. 14-17): one on given feet, found within all limits
or refused by the name of the limit that forbids it; its mirror image, where the feet have one and both sides are alike;
small problems in turn, then the best of all that were found.

cond has a kink where a segment is isotropic, at which one posture after the other stands still; sweeps therefore use a
smooth condition number of growing sharpness, and after two independent runs postures are exchanged, one for one until
nothing helps and no two alike, for better ones among all that came by and their mirror images.
"""

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain as chained
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.parts import UPRIGHT
from biodance.dance.limits import CheckedMotion, Limit
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.excitation import (
    Blocks,
    criteria,
    effort,
    smooth_condition,
    static_grams,
    total,
    upright_slopes,
    uprights,
)
from biodance.dance.problem.nlp import (
    Evaluation,
    NonlinearProgramme,
    Objective,
    free_coordinates,
    minimise,
    no_objective,
)
from biodance.dance.problem.stance import Stance, stance_words
from biodance.dance.problem.state import State, close_legs
from biodance.errors import BiodanceError
from biodance.records import Array, grouped


@dataclass(frozen=True, eq=False)
class Posture:
    """``x`` (n,) coordinates, ``up`` (N, 3) the vertical in the segments; ``violation`` of the reserved limits in their
    scales; ``hard`` how hard it is to take.
    """

    x: Array
    up: Array
    violation: float = np.inf
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
        found = solve(chain, stance, begin, distance_from(begin), limits, iterations=30)
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
        # G = sum of 1 - u u': d<S, G> = -2 (S u) du.
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
    state = problem.state(minimise(problem, begin[free], iterations=iterations)[0])
    return Posture(state.x[0], uprights(state)[0], Evaluation(problem, state).worst[0], effort(state)[0])


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
    if missing <= 0:
        return f"{what} ({abs(missing):.0f} {unit} left, less than its reserve)"
    return f"{what} (short by about {missing:.0f} {unit})"


def shortfall(limit: Limit) -> Objective:
    """Return the objective of a posture that breaks one limit as little as it can: sum of squares of what is missing,
    in the limit's scale.
    """

    def missing(state: State) -> tuple[float, Array]:
        margins, slopes = limit.margins(state), np.zeros((3, *state.x.shape))
        lacks = np.minimum(margins.value / limit.scale, 0.0)
        # Only what is missing counts: the gradient of a square that begins at zero.
        slopes[0] = 2 * np.einsum("tm,tmn->tn", lacks, margins.slopes[0]) / limit.scale
        return float(np.sum(lacks**2)), slopes

    return missing


ACROSS = {"parallel": "parallel", "single_right": "single_left", "single_left": "single_right", "seated": "seated"}
"""Feet of a posture, and of its image."""
FLIP = np.array([1.0, 1.0, -1.0])
"""Sense of the axes of a segment in the image (z to the right)."""
SIDEWAYS = ("_bending", "_rotation")
"""Ends of the names of middle joints that change their sense; paired ones have the anatomical sense on both sides."""


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
    # Both bounds of a joint whose sense changes change places: sorted again.
    pairs: list[tuple[Array, Array]] = [
        (np.sort(sense * bounds[:, :, across], axis=1), bounds),
        (FLIP * places[across], places),
        # An axis of rotation is a pseudovector: -F a in the mirror.
        (-FLIP * axes[across], sense[:, None] * axes),  # of a robot's rolls and yaws, both sides may turn the same way
        (FLIP[:, None] * turns[across] * FLIP, turns),
        (body.sip.mass[other], body.sip.mass),
        (FLIP * body.sip.com[other], body.sip.com),
        (np.sort(FLIP * body.boxes[other], axis=1), body.boxes),
    ]
    return all(np.allclose(image, own, rtol=0.0, atol=1e-9) for image, own in pairs)


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
    # Mirror in the sagittal plane: left, and the turns about up and forward, change sign.
    out = np.concatenate([x[:ROOT] * [1, -1, 1, -1, -1, 1], sense * x[ROOT:][across]])
    gap = there.ankle - here.ankle[::-1] * [1, -1, 1]
    out[:2] += gap[list(there.planted), :2].mean(axis=0) if there.planted else 0.0
    return np.asarray(out)


def mirror_vectors(body: Body, vectors: Array) -> Array:
    """Return the image (N, 3) of one vector for each segment, ``vectors`` (N, 3) in the segments' frames."""
    other = [body.segments.index(counterpart(name)) for name in body.segments]
    return np.asarray(FLIP * vectors[other])


RUNS = 2
"""Independent searches whose postures are put together."""
SWEEPS = ((4, 20), (4, 10))
"""Sharpness of the smooth condition number and iterations for every posture, of the sweeps of a run."""
FRESH, POLISH = ((8, 20), (8, 20)), ((8, 10), (8, 10), (16, 10), (32, 8))
"""The same for the sweeps after the exchange, first two from fresh starts, then from where the postures are."""

APART = np.radians(10.0)
"""rad: two postures on the same feet differ by this much in one joint at least; less nobody would see."""


def find_postures(
    chain: Chain,
    blocks: Blocks,
    stances: tuple[Stance, ...],
    limits: tuple[Limit, ...],
    *,
    seed: int,
    workers: Executor,
) -> Array:
    """Return the coordinates (P, n) of one posture for each of ``stances`` that keeps the ``limits``, together the most
    exciting for all first moments.

    Raises
    ------
    BiodanceError
        On some feet there is no posture within the limits; the message names the limit.
    """
    search = _Search(chain, blocks, stances, limits, seed)
    kept = search.independent_runs(workers)
    chosen = exchange(blocks, stances, kept)
    for n, (sharpness, iterations) in enumerate((*FRESH, *POLISH)):
        begin = [search.anywhere(k, 100 + n) for k in range(len(stances))] if n < len(FRESH) else [p.x for p in chosen]
        found = list(chosen)
        halves = [range(k, len(stances), 2) for k in range(2)]
        tasks = [workers.submit(search.sweep, chosen, begin, half, sharpness, iterations) for half in halves]
        for half, task in enumerate(tasks):
            found[half::2] = task.result()
        kept = [[new, *rest] if new.violation <= KEPT else rest for new, rest in zip(found, kept, strict=True)]
        kept = search.with_images(kept, [[new] for new in found])
        before = [[old, *(p for p in rest if p is not old)] for old, rest in zip(chosen, kept, strict=True)]
        chosen = min((exchange(blocks, stances, pool) for pool in (kept, before)), key=search.price)
    return np.array([p.x for p in chosen])


@dataclass(frozen=True, eq=False)
class _Search:
    """What all searches share; random numbers depend on ``seed`` and the place of a posture only."""

    chain: Chain
    blocks: Blocks
    stances: tuple[Stance, ...]
    limits: tuple[Limit, ...]
    seed: int

    def anywhere(self, place: int, run: int) -> Array:
        """Return the start (n,) of one posture in one run."""
        return initial_guess(self.chain, self.stances[place], np.random.default_rng([self.seed, run, place]))

    def price(self, chosen: list[Posture]) -> float:
        """Return the criterion and, where simplicity counts, how hard the postures are to take, kg."""
        hard = float(self.blocks.weight.sum() * np.mean([p.hard for p in chosen]))
        return criterion(self.blocks, chosen) + self.blocks.simplicity * hard

    def independent_runs(self, workers: Executor) -> list[list[Posture]]:
        """Return for every place the postures of `RUNS` searches that keep all limits; refuse a place without any."""
        named = {stance.name: k for k, stance in enumerate(self.stances)}
        checked = {name: workers.submit(self.possible, k) for name, k in named.items()}
        possible = {name: task.result() for name, task in checked.items()}
        tasks = [workers.submit(self.run, run) for run in range(RUNS)]
        kept = []
        for stance, *found in zip(self.stances, *(task.result() for task in tasks), strict=True):
            within = [p for p in chained.from_iterable(found) if p.violation <= KEPT]
            kept.append(within or [replace(possible[stance.name])])
        return self.with_images(kept, kept)

    def possible(self, place: int) -> Posture:
        """Return a posture that keeps all limits at this place, or raise the BiodanceError that names a limit."""
        begin, stance = [self.anywhere(place, run) for run in range(ATTEMPTS)], self.stances[place]
        found = (solve(self.chain, stance, x, no_objective, self.limits, iterations=30) for x in begin)
        posture = next((p for p in found if p.violation <= KEPT), None)
        return posture or refuse(self.chain, stance, begin, self.limits)

    def with_images(self, kept: list[list[Posture]], found: list[list[Posture]]) -> list[list[Posture]]:
        """Return the postures ``kept`` of every place and the images of ``found``, of a body whose sides are alike."""
        out, body = [[*some] for some in kept], self.chain.body
        for here, some in zip(self.stances, found if symmetric(body) else [], strict=False):
            goal = image_feet(here, self.stances)
            if goal is not None:
                there = self.stances[goal]
                images = (
                    replace(p, x=mirror_posture(self.chain, p.x, here, there), up=mirror_vectors(body, p.up))
                    for p in some
                )
                out[goal] += [image for image in images if image.violation <= KEPT]
        return out

    def run(self, run: int) -> list[list[Posture]]:
        """Return for every place the postures of one run, one per sweep."""
        now = [posture_at(self.chain, s, self.anywhere(k, run)) for k, s in enumerate(self.stances)]
        order = list(np.random.default_rng([self.seed, run]).permutation(len(now)))
        out: list[list[Posture]] = [[] for _ in now]
        for sharpness, iterations in SWEEPS:
            now = self.sweep(now, [p.x for p in now], order, sharpness, iterations)
            for search, posture in zip(out, now, strict=True):
                search.append(posture)
        return out

    def sweep(
        self, now: list[Posture], begin: list[Array], order: Sequence[int], sharpness: int, iterations: int
    ) -> list[Posture]:
        """Return the postures of the places ``order``, found in turn from ``begin``, the others held, by place."""
        now, unit = list(now), 0.1 * float(self.blocks.weight.sum()) / len(now)
        for p in order:
            others = np.array([one.up for k, one in enumerate(now) if k != p]).reshape(-1, *now[p].up.shape)
            objective = Exciting(self.blocks, static_grams(others), unit, sharpness)
            x, steps = begin[p], iterations
            for attempt in range(ATTEMPTS):
                now[p] = solve(self.chain, self.stances[p], x, objective, self.limits, iterations=steps)
                if now[p].violation <= KEPT:
                    break
                x, steps = self.anywhere(p, 3 + attempt), max(iterations, 20)
        return [now[p] for p in sorted(order)]


@dataclass(frozen=True, eq=False)
class _SameFeet:
    """``postures`` (K) on the same feet, ``grams``, which are ``like`` which, how ``hard`` (kg), those ``taken``."""

    postures: list[Posture]
    grams: Array
    like: NDArray[np.bool_]
    hard: Array
    taken: list[int]

    @classmethod
    def first_of(cls, pool: list[list[Posture]], worth: float) -> "_SameFeet":
        """Return the postures of these places, the first of each place taken unless it is like one taken before."""
        every = list(dict.fromkeys(chained.from_iterable(pool)))
        # 1 - u u' of every posture (K, N, 3, 3): sums over postures are Gram matrices.
        grams = np.eye(3) - np.einsum("pni,pnj->pnij", *[np.array([p.up for p in every])] * 2)
        like, taken = alike(np.array([p.x for p in every])), list[int]()
        for found in pool:
            order = [every.index(found[0]), *range(len(every))]
            taken.append(next((i for i in order if not like[i, taken].any()), order[0]))
        return cls(every, grams, like, worth * np.array([p.hard for p in every]), taken)

    def spare(self, place: int) -> NDArray[np.intp]:
        """Return the indices of the postures that may stand at a place: like none of the others taken."""
        return np.flatnonzero(~self.like[:, self.taken[:place] + self.taken[place + 1 :]].any(axis=1))


def exchange(blocks: Blocks, stances: tuple[Stance, ...], pool: list[list[Posture]]) -> list[Posture]:
    """Return one posture for each place, no two of a stance alike (`APART`) where the pool allows: those that come
    first, exchanged for better ones of the same stance as long as any helps.
    """
    worth = blocks.simplicity * float(blocks.weight.sum()) / len(stances)
    of_feet = grouped(zip((stance.name for stance in stances), pool, strict=True))
    feet = {name: _SameFeet.first_of(found, worth) for name, found in of_feet.items()}
    whole = sum(one.grams[one.taken].sum(axis=0) for one in feet.values())
    effort = sum(one.hard[one.taken].sum() for one in feet.values())
    value = criteria(blocks, whole[None])[0] + effort
    for one, place in _places(list(feet.values())):
        now, spare = one.taken[place], one.spare(place)
        if spare.size:
            trial, efforts = whole - one.grams[now] + one.grams[spare], effort - one.hard[now] + one.hard[spare]
            values = criteria(blocks, trial) + efforts
            if values.min() < value - 1e-6:
                value, best = values.min(), int(values.argmin())
                whole, effort, one.taken[place] = trial[best], efforts[best], int(spare[best])
    picks = {name: iter(one.taken) for name, one in feet.items()}
    return [feet[stance.name].postures[next(picks[stance.name])] for stance in stances]


def alike(x: Array) -> NDArray[np.bool_]:
    """Return (P, P) True where two postures x (P, n) differ by less than `APART` in every coordinate."""
    return np.asarray(np.abs(x[:, None] - x[None]).max(axis=2) < APART)


def _places(feet: list[_SameFeet]) -> Iterator[tuple[_SameFeet, int]]:
    """Yield all places in turn, again and again, until a round has changed nothing."""
    before: list[list[int]] = []
    while before != (now := [list(one.taken) for one in feet]):
        before = now
        for one in feet:
            for place in range(len(one.taken)):
                yield one, place


def criterion(blocks: Blocks, chosen: list[Posture]) -> float:
    """Return the sum of M_i cond(W_bi^S), kg, of postures."""
    return total(blocks.weight, static_grams(np.array([p.up for p in chosen])), blocks.first)[0]

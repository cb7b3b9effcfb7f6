"""The best set of postures among all that were found and their mirror images: exchanged one for one until nothing
helps, no two alike.

Only postures whose image stands on feet of the protocol have one: side by side, on the other leg, seated. The right
foot in front has none.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.dance.postures.posture import Posture
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.excitation import Blocks, static_grams, total
from biodance.dance.problem.stance import Stance
from biodance.records import Array

APART = np.radians(10.0)
"""rad: two postures on the same feet differ by this much in one joint at least; less nobody would see."""


def exchange(blocks: Blocks, stances: tuple[Stance, ...], pool: list[list[Posture]]) -> list[Posture]:
    """Return one posture for each place, no two of a stance alike (`APART`) where the pool allows: those that come
    first, exchanged for better ones of the same stance as long as any helps.
    """
    kinds = [stance.name for stance in stances]
    every: dict[str, list[Posture]] = {kind: [] for kind in kinds}
    for kind, found in zip(kinds, pool, strict=True):
        every[kind] += [posture for posture in found if posture not in every[kind]]
    grams = {
        kind: np.eye(3) - np.einsum("pni,pnj->pnij", *[np.array([p.up for p in found])] * 2)
        for kind, found in every.items()
    }
    like = {kind: alike(np.array([p.x for p in found])) for kind, found in every.items()}
    taken: dict[str, list[int]] = {kind: [] for kind in every}
    for kind, found in zip(kinds, pool, strict=True):
        order = [every[kind].index(found[0]), *range(len(every[kind]))]
        taken[kind].append(next((i for i in order if not like[kind][i, taken[kind]].any()), order[0]))
    worth = blocks.simplicity * float(blocks.weight.sum()) / len(stances)
    hard = {kind: worth * np.array([p.hard for p in found]) for kind, found in every.items()}
    whole = sum(grams[kind][picks].sum(axis=0) for kind, picks in taken.items())
    effort = sum(hard[kind][picks].sum() for kind, picks in taken.items())
    value = _values(blocks, whole[None])[0] + effort
    for kind, place in _places(taken):
        now, rest = taken[kind][place], taken[kind][:place] + taken[kind][place + 1 :]
        spare = np.flatnonzero(~like[kind][:, rest].any(axis=1))
        if spare.size:
            trial, efforts = whole - grams[kind][now] + grams[kind][spare], effort - hard[kind][now] + hard[kind][spare]
            values = _values(blocks, trial) + efforts
            if values.min() < value - 1e-6:
                value, best = values.min(), int(values.argmin())
                whole, effort, taken[kind][place] = trial[best], efforts[best], int(spare[best])
    picks = {kind: iter(chosen) for kind, chosen in taken.items()}
    return [every[kind][next(picks[kind])] for kind in kinds]


def alike(x: Array) -> NDArray[np.bool_]:
    """Return (P, P) True where two postures x (P, n) differ by less than `APART` in every coordinate."""
    return np.asarray(np.abs(x[:, None] - x[None]).max(axis=2) < APART)


def _places(taken: dict[str, list[int]]) -> Iterator[tuple[str, int]]:
    """Yield all places in turn, again and again, until a round has changed nothing."""
    before: dict[str, list[int]] = {}
    while before != taken:
        before = {kind: list(picks) for kind, picks in taken.items()}
        for kind, picks in taken.items():
            for place in range(len(picks)):
                yield kind, place


def _values(blocks: Blocks, grams: Array) -> Array:
    """Return the criterion (K,) kg of K sets of Gram matrices (K, N, 3, 3)."""
    out = np.zeros(len(grams))
    whole = [i for i, pick in enumerate(blocks.first) if len(pick) == 3 and blocks.weight[i] > 0]
    if whole:
        least, most = extremes(grams[:, whole])
        out += np.sqrt(most / np.maximum(least, 1e-12)) @ blocks.weight[whole]
    for i, pick in enumerate(blocks.first):
        if 0 < len(pick) < 3 and blocks.weight[i] > 0:
            value = np.linalg.eigvalsh(grams[:, i][np.ix_(range(len(grams)), pick, pick)])
            out += blocks.weight[i] * np.sqrt(value[:, -1] / np.maximum(value[:, 0], 1e-12))
    return out


def extremes(A: Array) -> tuple[Array, Array]:
    """Return the smallest and the largest eigenvalue of symmetric matrices (..., 3, 3) in closed form
    (doi:10.1145/355578.366316): an exchange asks for a million of them.
    """
    mean = (A[..., 0, 0] + A[..., 1, 1] + A[..., 2, 2]) / 3
    a, b, c = (A[..., i, i] - mean for i in range(3))
    d, e, f = A[..., 0, 1], A[..., 1, 2], A[..., 0, 2]
    radius = np.sqrt((a * a + b * b + c * c + 2 * (d * d + e * e + f * f)) / 6)
    half = (a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)) / 2
    angle = np.arccos(np.clip(half / np.maximum(radius**3, 1e-300), -1.0, 1.0)) / 3
    return mean + 2 * radius * np.cos(angle + 2 * np.pi / 3), mean + 2 * radius * np.cos(angle)


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


def criterion(blocks: Blocks, chosen: list[Posture]) -> float:
    """Return the sum of M_i cond(W_bi^S), kg, of postures."""
    return total(blocks.weight, static_grams(np.array([p.up for p in chosen])), blocks.first)[0]

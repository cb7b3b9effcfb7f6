"""Solve H step = -gradient for all frames at once, where H has the sparsity of the kinematic tree.

Branch by branch from the tips to the root: each branch holds a dense front over the coordinates above it and its own; its joints are
eliminated from the last to the first (L'DL without fill-in, Featherstone 2008, section 6.3), and what is left is added to the front
that carries it (the multifrontal scheme of Duff & Reid 1983, DOI 10.1145/356044.356047). Branches of one shape (both legs) share one
array. The frame is the last axis.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.motion.marker_moments import Fit, Measured, cross_product, curvature, model_moments
from biodance.motion.tree import Branches, Index, Tree
from biodance.records import Array

LENGTH = 0.1
"""m, turns an angle into a typical marker displacement: makes gradients, damping and pivots of different coordinates comparable."""

FLAT = 1e-9
"""A pivot below this fraction of its coordinate's scale counts as zero or negative: the cost is not convex there."""


@dataclass(frozen=True, eq=False)
class Quadratic:
    """The quadratic model at a fit: ``twist``, ``momentum`` (n, 6, B); ``root`` (r, r, B); ``gradient``, ``damping``, ``scale`` (nv, B).

    Held coordinates have a zero twist and gradient and a unit damping, so that their step is zero.
    """

    twist: Array
    momentum: Array
    root: Array
    gradient: Array
    damping: Array
    scale: Array


def lever(tree: Tree) -> Array:
    """Return (nv, 1) m: 1 for the root's translation, LENGTH for every angle."""
    return np.array([1.0] * 3 + [LENGTH] * (3 + tree.joints) if tree.n_root else [LENGTH] * tree.joints)[:, None]


def moved_weight(tree: Tree, at: Fit) -> Array:
    """Return (nv, B): the marker weight that moves with each coordinate."""
    return np.concatenate([np.repeat(at.weight[:1], tree.n_root, axis=0), at.weight[1:]])


@dataclass(frozen=True, eq=False)
class Local:
    """Local coordinates of B frames: ``twist`` (n, 6, B) a step of each joint's coordinate makes; ``gradient`` (nv, B); ``free`` (nv, B)
    False where the coordinate is held.
    """

    twist: Array
    gradient: Array
    free: NDArray[np.bool_]


def quadratic(tree: Tree, measured: Measured, at: Fit, local: Local, *, damping: Array, newton: NDArray[np.bool_]) -> Quadratic:
    """Return the quadratic model of the cost in the ``local`` coordinates.

    ``newton`` (B,): exact second derivatives where True, Gauss-Newton (the model's own sums for the measured ones) elsewhere;
    ``damping`` (B,) >= 0 is added to the diagonal in units of the moved weight times its lever squared.
    """
    seen, cross = at.seen, at.cross
    if not newton.all():
        seen, cross = np.where(newton, seen, at.model), np.where(newton, cross, model_moments(tree, measured, at))
    twist = np.where(local.free[tree.n_root :, None], local.twist, 0.0)
    size = moved_weight(tree, at) * lever(tree) ** 2
    return Quadratic(
        twist=twist,
        momentum=curvature(at, seen, cross, twist),
        root=_root_block(at, seen[0], cross[0])[: tree.n_root, : tree.n_root],
        gradient=np.where(local.free, local.gradient, 0.0),
        damping=np.where(local.free, damping * size, 1.0),
        scale=np.where(local.free, size, 1.0),
    )


def _root_block(at: Fit, seen: Array, cross: Array) -> Array:
    """Return (6, 6, B), lower triangle valid: second derivatives by the root's translation and rotation vector."""
    block = np.zeros((6, 6, at.cost.size))
    block[range(3), range(3)] = at.weight[0]
    block[3:, :3] = [cross_product(axis[:, None], at.model[0]) for axis in np.eye(3)]
    block[3:, 3:] = np.einsum("iib->b", cross) * np.eye(3)[..., None] - 0.5 * (cross + np.swapaxes(cross, 0, 1))
    return block


def solve(tree: Tree, model: Quadratic) -> tuple[Array, NDArray[np.bool_]]:
    """Return the step (nv, B) to the minimum of the quadratic model, and (B,) whether the model has one (all pivots positive)."""
    chains = [_chain(tree, family) for family in tree.branches] + [np.arange(1 + tree.n_root)[:, None]]
    fronts = [_front(tree, model, family, chain) for family, chain in zip(tree.branches, chains[:-1], strict=True)]
    fronts.append(_root_front(model))
    scale = np.concatenate([np.ones_like(model.scale[:1]), model.scale])
    convex = np.ones(scale.shape[1], dtype=bool)
    factors = []
    for index in range(len(fronts) - 1, -1, -1):
        turn = (index - 1) % len(fronts)  # the root's front, which is the last, comes last
        family = tree.branches[turn] if turn < len(tree.branches) else None
        first = 1 if family is None else 1 + tree.n_root + family.above.shape[1]
        factors.append((chains[turn], _eliminate(fronts[turn], first, scale[chains[turn]], convex)))
        for row, (parent, seat) in enumerate(family.parent if family else ()):
            fronts[parent][:, :, seat] += fronts[turn][:first, :first, row]
    return _substitute(factors, scale.shape), convex


def _chain(tree: Tree, family: Branches) -> Index:
    """Return (1 + size, G): rows of a front; 0 is the right side, the others are 1 + coordinate: root, joints above, own joints."""
    joints = np.concatenate([family.above, family.own], axis=1).T + tree.n_root
    root = np.repeat(np.arange(tree.n_root)[:, None], joints.shape[1], axis=1)
    return np.concatenate([np.zeros_like(joints[:1]), 1 + root, 1 + joints])


def _front(tree: Tree, model: Quadratic, family: Branches, chain: Index) -> Array:
    """Return (1 + size, 1 + size, G, B): gradient, second derivatives and damping of a family's own joints in its lower rows."""
    r, size, frames = tree.n_root, len(chain), model.gradient.shape[1]
    first = size - family.own.shape[1]
    front = np.zeros((size, size, len(family.own), frames))
    momentum = model.momentum[family.own.T]
    front[first:, 0] = model.gradient[chain[first:] - 1]
    front[first:, 1 : 1 + r] = np.moveaxis(momentum[:, :, :r], 2, 1)
    front[first:, 1 + r :] = np.einsum("ogcb,igcb->oigb", momentum, model.twist[chain[1 + r :] - 1 - r])
    front[range(first, size), range(first, size)] += model.damping[chain[first:] - 1]
    return front


def _root_front(model: Quadratic) -> Array:
    """Return (1 + r, 1 + r, 1, B) of the root's coordinates."""
    r, frames = len(model.root), model.gradient.shape[1]
    front = np.zeros((1 + r, 1 + r, 1, frames))
    front[1:, 0, 0], front[1:, 1:, 0] = model.gradient[:r], model.root
    front[range(1, 1 + r), range(1, 1 + r), 0] += model.damping[:r]
    return front


def _eliminate(front: Array, first: int, scale: Array, convex: NDArray[np.bool_]) -> list[Array]:
    """Eliminate the rows of ``front`` from the last down to ``first``; return multipliers (k, G, B); clear ``convex`` at bad pivots."""
    rows = []
    for k in range(len(front) - 1, first - 1, -1):
        pivot = front[k, k]
        good = pivot > FLAT * scale[k]
        if not good.all():
            convex &= good.all(axis=0)
            pivot = np.where(good, pivot, np.maximum(np.abs(pivot), np.maximum(scale[k], FLAT)))
        rows.append(front[k, :k] / pivot)
        if k > first:
            front[first:k, :k] -= rows[-1][first:, None] * front[k, :k]
    if rows:
        above = np.stack([row[:first] for row in reversed(rows)])
        front[:first, :first] -= np.einsum("kigb,kjgb->ijgb", above, front[first:, :first])
    return rows


def _substitute(factors: list[tuple[Index, list[Array]]], shape: tuple[int, ...]) -> Array:
    """Return the step from the multipliers of every front, the root's front being the last."""
    step = np.zeros(shape)
    step[0] = 1.0  # the right side's column: gradient / pivot is the first multiplier
    for chain, rows in reversed(factors):
        local = step[chain]
        first = len(chain) - len(rows)
        for k, factor in zip(range(first, len(chain)), reversed(rows), strict=True):
            local[k] = -np.einsum("kgb,kgb->gb", factor, local[:k])
        step[chain[first:]] = local[first:]
    return step[1:]

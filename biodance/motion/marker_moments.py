"""The marker cost of all frames at once, through moments instead of markers.

The cost of a frame is 1/2 sum_k w_k |p_k(q) - m_k|². For every joint, all that its gradient and its exact second derivatives need
are four sums over the markers that move with it, with p and m taken from the root's origin (docs/derivations.md, "Marker fit"):

    w = sum w_k,   S = sum w_k p_k,   a = sum w_k m_k,   M = sum w_k p_k m_k'

The sums of a segment follow from constants of its markers and its pose, those of a subtree by addition (the composite-rigid-body
idea), so the work does not grow with the number of markers. With m = p they are those of the model alone, and the same formula then
gives the Gauss-Newton matrix. The frame is the last axis of every array.
"""

from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from biodance.motion.quaternion import matrix
from biodance.motion.tree import Tree
from biodance.records import Array

Batch = TypeVar("Batch")


@dataclass(frozen=True, eq=False)
class Measured:
    """What the markers of B frames say per segment (N): ``weight`` (N, B) sum w; ``model`` (N, 3, B) sum w l, l in the segment frame;
    ``spread`` (N, 3, 3, B) sum w l l'; ``seen`` (N, 3, B) sum w m; ``cross`` (N, 3, 3, B) sum w m l'; ``square`` (B,) sum w m'm.
    """

    weight: Array
    model: Array
    spread: Array
    seen: Array
    cross: Array
    square: Array


@dataclass(frozen=True, eq=False)
class Fit:
    """The cost at one posture per frame: ``cost`` (B,) m²; ``twist`` (n, 6, B) linear, angular of every joint at the root's origin,
    ``third`` (G, 6, B) of every ball joint's third axis at zero second angle; sums below every slot: ``wrench`` (n + 1, 6, B) of the
    residuals, ``weight`` (n + 1, B), ``model`` S and ``seen`` a (n + 1, 3, B), ``cross`` M (n + 1, 3, 3, B); ``rotation`` (N, 3, 3, B)
    and ``place`` (N, 3, B) of the segments from the root's origin.
    """

    cost: Array
    twist: Array
    third: Array
    wrench: Array
    weight: Array
    model: Array
    seen: Array
    cross: Array
    rotation: Array
    place: Array


def take(batch: Batch, frames: NDArray[np.intp] | slice) -> Batch:
    """Return the batch of some of its frames."""
    return type(batch)(*(getattr(batch, f.name)[..., frames] for f in fields(batch)))  # type: ignore[arg-type]


def merge(chosen: NDArray[np.bool_], new: Fit, old: Fit) -> Fit:
    """Return ``new`` where ``chosen`` (B,), else ``old``."""
    return new if chosen.all() else Fit(*(np.where(chosen, getattr(new, f.name), getattr(old, f.name)) for f in fields(Fit)))


def design(segment: list[int] | NDArray[np.intp], local: Array, count: int) -> Array:
    """Return (13, count, K): what each marker at ``local`` (K, 3) m in ``segment`` (K) adds to 1, l and l l' of its segment."""
    terms = np.concatenate([np.ones((1, len(local))), local.T, np.einsum("ki,kj->ijk", local, local).reshape(9, -1)])
    return terms[:, None] * (np.array(segment)[None, :] == np.arange(count)[:, None])


def measure(sums: Array, weight: Array, xyz: Array) -> Measured:
    """Return the sums per segment from the ``design`` (13, N, K), marker weights (K, B) and markers ``xyz`` (K, 3, B) m, all finite."""
    count, (markers, frames) = sums.shape[1], weight.shape
    model = np.moveaxis((sums.reshape(-1, markers) @ weight).reshape(13, count, frames), 0, 1)
    weighted = weight[:, None] * xyz
    seen = (sums[:4].reshape(-1, markers) @ weighted.reshape(markers, -1)).reshape(4, count, 3, frames)
    return Measured(
        weight=np.ascontiguousarray(model[:, 0]),
        model=np.ascontiguousarray(model[:, 1:4]),
        spread=model[:, 4:].reshape(count, 3, 3, frames),
        seen=seen[0],
        cross=np.ascontiguousarray(np.moveaxis(seen[1:], 0, 2)),
        square=np.einsum("kib,kib->b", weighted, xyz),
    )


def cross_product(a: Array, b: Array) -> Array:
    """Return a x b for arrays (..., 3, B)."""
    (ax, ay, az), (bx, by, bz) = np.moveaxis(a, -2, 0), np.moveaxis(b, -2, 0)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-2)


def pose(tree: Tree, q: Array) -> tuple[Array, Array]:
    """Return rotation (n + 1, 3, 3, B) and place (n + 1, 3, B) m from the root's origin of every slot."""
    n, frames = tree.joints, q.shape[1]
    rotation, place = np.empty((n + 1, 3, 3, frames)), np.empty((n + 1, 3, frames))
    rotation[0] = matrix(q[3:7]) if tree.n_root else np.eye(3)[..., None]
    place[0] = 0.0
    angle = q[len(q) - n :]
    terms = np.stack([np.ones_like(angle), np.sin(angle), 1 - np.cos(angle)], axis=1)
    local = (tree.turn @ terms).reshape(n, 3, 3, frames)
    for slots, parents in tree.levels:
        carrier = rotation[parents]
        rotation[slots] = np.einsum("nikb,nkjb->nijb", carrier, local[slots - 1])
        place[slots] = place[parents] + np.einsum("nikb,nk->nib", carrier, tree.translation[slots - 1])
    return rotation, place


def fit(tree: Tree, measured: Measured, q: Array) -> Fit:
    """Return cost, gradient and sums at the postures ``q`` (nq, B)."""
    rotation, place = pose(tree, q)
    root = q[:3] if tree.n_root else np.zeros((3, q.shape[1]))
    twist = _twist(rotation[1:], place[1:], tree.axis)
    ball = tree.balls.first + 1
    third = _twist(rotation[ball], place[ball], tree.axis[ball + 1])
    turn, at = rotation[tree.carrier], place[tree.carrier]
    weight = measured.weight
    arm = np.einsum("nikb,nkb->nib", turn, measured.model)
    model = weight[:, None] * at + arm
    seen = measured.seen - weight[:, None] * root
    cross = np.einsum("nikb,njkb->nijb", turn, measured.cross)
    cross += at[:, :, None] * seen[:, None] - arm[:, :, None] * root[None, None]
    parts = np.concatenate([weight[:, None], model, seen, cross.reshape(len(at), 9, -1)], axis=1)
    sums = (tree.below @ parts.reshape(len(at), -1)).reshape(-1, 16, q.shape[1])
    weight_sum, model_sum, seen_sum = sums[:, 0], sums[:, 1:4], sums[:, 4:7]
    cross_sum = sums[:, 7:].reshape(-1, 3, 3, q.shape[1])
    inertia = np.einsum("niib->b", measured.spread) + np.einsum("nib,nib->b", at, model + arm)
    square = measured.square - np.einsum("ib,ib->b", root, 2 * seen_sum[0] + weight_sum[0] * root)
    cost = 0.5 * (inertia + square) - np.einsum("iib->b", cross_sum[0])
    wrench = np.concatenate([model_sum - seen_sum, _skew_part(cross_sum)], axis=1)
    return Fit(cost, twist, third, wrench, weight_sum, model_sum, seen_sum, cross_sum, turn, at)


def _twist(rotation: Array, place: Array, axis: Array) -> Array:
    """Return (n, 6, B) linear, angular at the root's origin of unit turns about ``axis`` (n, 3) of the joint frames."""
    turned = np.einsum("nikb,nk->nib", rotation, axis)
    return np.concatenate([cross_product(place, turned), turned], axis=1)


def _skew_part(cross: Array) -> Array:
    """Return sum w p x (p - m) (n, 3, B), which is the skew part of M."""
    return np.stack([cross[:, 2, 1] - cross[:, 1, 2], cross[:, 0, 2] - cross[:, 2, 0], cross[:, 1, 0] - cross[:, 0, 1]], axis=1)


def gradient(tree: Tree, twist: Array, wrench: Array) -> Array:
    """Return (nv, B) for joints that move along ``twist`` (n, 6, B); the root's coordinates are translation and rotation vector (lab)."""
    joints = np.einsum("nib,nib->nb", twist, wrench[1:])
    return np.concatenate([wrench[0], joints]) if tree.n_root else joints


def model_moments(tree: Tree, measured: Measured, at: Fit) -> Array:
    """Return sum w p p' (n + 1, 3, 3, B) below every slot, from the root's origin: what ``cross`` would be without residuals."""
    turn, place = at.rotation, at.place
    inner = measured.model[:, :, None] * place[:, None] + np.einsum("nikb,njkb->nijb", measured.spread, turn)
    arm = np.einsum("nikb,nkb->nib", turn, measured.model)
    own = np.einsum("nikb,nkjb->nijb", turn, inner) + place[:, :, None] * (measured.weight[:, None] * place + arm)[:, None]
    return (tree.below @ own.reshape(len(own), -1)).reshape(-1, 3, 3, own.shape[-1])


def curvature(at: Fit, seen: Array, cross: Array, twist: Array) -> Array:
    """Return (n, 6, B): the momentum of every joint's ``twist`` (n, 6, B), whose product with the twist of a joint above is the Hessian.

    ``seen`` and ``cross`` as in ``at`` for Newton, or the model's own sums for Gauss-Newton.
    """
    linear, axis = twist[:, :3], twist[:, 3:]
    force = at.weight[1:, None] * linear + cross_product(axis, at.model[1:])
    trace = np.einsum("niib->nb", cross[1:])
    moment = cross_product(seen[1:], linear) + trace[:, None] * axis - np.einsum("nijb,njb->nib", cross[1:], axis)
    return np.concatenate([force, moment], axis=1)

"""The markers of a whole trial as batches, and the descent of any number of its frames from given postures.

Frames go through ``newton.minimise`` in chunks that fit the processor's cache; the few that need many steps are pooled for further rounds.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.motion.chart import Chart, chart_of
from biodance.motion.marker_moments import Measured, design, measure, pose
from biodance.motion.newton import Minimum, minimise
from biodance.motion.tree import Index, Tree, tree_of
from biodance.records import Array

CHUNK = 384
"""Frames per batch."""

ROUNDS = (3, 5, 20, 200)
"""Most Newton steps of a frame in each round."""


@dataclass(frozen=True, eq=False)
class MarkerProblem:
    """A body's tree and markers against T frames of measured ones: ``segment`` (K), ``local`` (K, 3) m, ``xyz`` (T, K, 3) m (anything
    finite where hidden), ``weight`` (T, K) >= 0, zero where hidden; ``sums`` the design of ``marker_moments``; ``tolerance`` m.
    """

    tree: Tree
    chart: Chart
    segment: Index
    local: Array
    sums: Array
    xyz: Array
    weight: Array
    tolerance: float

    def measured(self, frames: Index) -> tuple[Measured, Array]:
        """Return the sums of some frames about an origin of their own, (3, B) m, near their markers (the lab's for a fixed root)."""
        weight, xyz = self.weight[frames].T.copy(), self.xyz[frames].transpose(1, 2, 0).copy()
        origin = np.einsum("kb,kib->ib", weight, xyz) / weight.sum(axis=0) if self.tree.n_root else np.zeros((3, len(frames)))
        return measure(self.sums, weight, xyz - origin), origin


def marker_problem(body: Body, columns: list[int], xyz: Array, *, tolerance: float) -> MarkerProblem:
    """Return the problem of the body's markers ``columns`` (K) against ``xyz`` (T, K, 3) m, NaN = hidden."""
    segment = np.array([body.markers.segment[c] for c in columns], dtype=np.intp)
    local = body.markers.position[columns]
    seen = np.logical_not(np.isnan(xyz).any(axis=2))
    return MarkerProblem(
        tree=tree_of(body),
        chart=chart_of(body),
        segment=segment,
        local=local,
        sums=design(segment, local, len(body.segments)),
        xyz=np.where(seen[:, :, None], xyz, 0.0),
        weight=seen * body.markers.weight[columns],
        tolerance=tolerance,
    )


def descend(problem: MarkerProblem, frames: Index, start: Array) -> Minimum:
    """Return the minima (F frames) of ``frames`` (F,) reached from the postures ``start`` (nq, F)."""
    count, r = len(frames), problem.tree.n_root
    out = Minimum(start.copy(), np.zeros(count), np.full(count, np.inf), np.zeros(count, dtype=np.intp))
    angles = out.q[len(start) - problem.tree.joints :]
    np.clip(angles, problem.tree.lower, problem.tree.upper, out=angles)
    todo = np.arange(count)
    for steps in ROUNDS:
        for chunk in np.array_split(todo, -(-len(todo) // CHUNK)):
            measured, origin = problem.measured(frames[chunk])
            q = out.q[:, chunk]
            q[: min(r, 3)] -= origin[: min(r, 3)]
            found = minimise(problem.tree, measured, q, tolerance=problem.tolerance, steps=steps)
            found.q[: min(r, 3)] += origin[: min(r, 3)]
            out.q[:, chunk], out.cost[chunk], out.slope[chunk] = found.q, found.cost, found.slope
            out.steps[chunk] += found.steps
        todo = todo[out.slope[todo] > problem.tolerance]
        if not todo.size:
            break
    return out


def points(problem: MarkerProblem, q: Array) -> Array:
    """Return the model's markers (K, 3, B) m at the postures ``q`` (nq, B)."""
    rotation, place = pose(problem.tree, q)
    slot = problem.tree.carrier[problem.segment]
    out = place[slot] + np.einsum("kijb,kj->kib", rotation[slot], problem.local)
    return out + q[:3] if problem.tree.n_root else out


def distances(problem: MarkerProblem, q: Array) -> Array:
    """Return the distance (T, K) m between every marker and the model at the postures ``q`` (nq, T)."""
    out = np.empty(problem.weight.shape)
    for start in range(0, len(out), CHUNK):
        part = slice(start, start + CHUNK)
        apart = points(problem, q[:, part]) - problem.xyz[part].transpose(1, 2, 0)
        out[part] = np.sqrt(np.einsum("kib,kib->bk", apart, apart))
    return out


def better(one: Minimum, other: Minimum) -> Minimum:
    """Return frame by frame the minimum of lower cost."""
    first = one.cost <= other.cost
    pick: NDArray[np.bool_] = first
    return Minimum(
        np.where(pick, one.q, other.q),
        np.where(pick, one.cost, other.cost),
        np.where(pick, one.slope, other.slope),
        one.steps + other.steps,
    )

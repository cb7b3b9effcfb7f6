"""The markers of a whole trial, and the descent of any number of its frames from given postures."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from biodance.body.body import Body
from biodance.motion.ik.chart import Chart, chart_of
from biodance.motion.ik.compiled import newton
from biodance.motion.ik.compiled.chain import MarkerChain, chain_of
from biodance.records import Array, Index, assign

_STEPS = 200
"""Most Newton steps of a frame."""


@dataclass(frozen=True, eq=False)
class MarkerProblem:
    """A body against T frames of measured markers: ``segment`` (K) that carries each, ``xyz`` (T, K, 3) m (anything
    finite where hidden), ``weight`` (T, K) >= 0, zero where hidden; ``tolerance`` m, largest slope of a solved frame.
    """

    body: Body
    chain: MarkerChain
    chart: Chart
    segment: list[int]
    xyz: Array
    weight: Array
    tolerance: float

    def __post_init__(self) -> None:
        """Keep ``xyz`` as a view that nothing writes to: one type for the compiled code, whatever was given."""
        view = self.xyz.view()
        view.flags.writeable = False
        assign(self, xyz=view)


class Minimum(NamedTuple):
    """What was reached: ``q`` (B, nq); ``cost`` (B,) m²; ``slope`` (B,) m, largest projected gradient; ``steps``
    (B,) steps tried.
    """

    q: Array
    cost: Array
    slope: Array
    steps: Index

    def part(self, frames: Index) -> "Minimum":
        """Return a copy of some frames."""
        return Minimum(self.q[frames], self.cost[frames], self.slope[frames], self.steps[frames])

    def put(self, frames: Index, part: "Minimum") -> None:
        """Replace some frames."""
        for mine, other in zip(self, part, strict=True):
            mine[frames] = other


def marker_problem(body: Body, columns: list[int], xyz: Array, *, tolerance: float) -> MarkerProblem:
    """Return the problem of the body's markers ``columns`` (K) against ``xyz`` (T, K, 3) m, NaN = hidden."""
    segment = [body.markers.segment[c] for c in columns]
    seen = np.isfinite(xyz.sum(axis=2))
    return MarkerProblem(
        body=body,
        chain=chain_of(body, segment, body.markers.position[columns]),
        chart=chart_of(body),
        segment=segment,
        xyz=np.ascontiguousarray(xyz) if seen.all() else np.where(seen[:, :, None], xyz, 0.0),
        weight=seen * body.markers.weight[columns],
        tolerance=tolerance,
    )


def minimise_markers(problem: MarkerProblem, frames: Index, start: Array, *, steps: int = _STEPS) -> Minimum:
    """Return the minima (F frames) of ``frames`` (F,) reached from the postures ``start`` (F, nq) in at most
    ``steps`` steps.
    """
    count, joints = len(frames), len(problem.chain.lower)
    q = np.array(start, order="C")
    angles = q[:, q.shape[1] - joints :]
    np.clip(angles, problem.chain.lower, problem.chain.upper, out=angles)
    found = Minimum(q, np.zeros(count), np.full(count, np.inf), np.zeros(count, dtype=np.intp))
    newton.minimise_frames(problem.chain, problem.xyz, problem.weight, frames, found, problem.tolerance, steps)
    return found


def marker_distances(problem: MarkerProblem, q: Array) -> Array:
    """Return the distance (T, K) m between every marker and the model at the postures ``q`` (T, nq)."""
    out = np.empty(problem.weight.shape)
    newton.fill_distances(problem.chain, problem.xyz, q, out)
    return out


_EQUAL = 1e-9
"""Share by which the costs of one posture may differ: what the tolerance of the descent leaves."""


def better(one: Minimum, other: Minimum) -> Minimum:
    """Return frame by frame the minimum of lower cost; of equal ones, ``one``."""
    first = one.cost <= other.cost * (1 + _EQUAL)
    return Minimum(
        np.where(first[:, None], one.q, other.q),
        np.where(first, one.cost, other.cost),
        np.where(first, one.slope, other.slope),
        one.steps + other.steps,
    )

"""The posture of a body frame by frame, while the markers still come: each frame descends from the one before."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.errors import TrialRefused
from biodance.motion.ik.determination import determination
from biodance.motion.ik.marker_problem import MarkerProblem, Minimum, marker_distances, marker_problem, minimise_markers
from biodance.motion.ik.search import MORE_SHARES, SHARES, from_markers
from biodance.motion.kinematics import poses
from biodance.records import Array

_TOLERANCE = 1e-7
"""m, largest slope of a solved frame, as in `solve_ik`."""
_PATIENCE = 100
"""Frames between two searches from the markers alone, where the fit has become bad."""
_BAD = 0.05
"""m: RMS distance beyond which the descent from the last frame is distrusted."""
_ONE = np.arange(1)


class Follower:
    """Follows one body. ``names`` (K) of its markers; ``q`` (nq,) the last posture, NaN before the first one."""

    def __init__(self, body: Body, labels: Sequence[str]) -> None:
        self.body = body
        self.names = tuple(name for name in body.markers.names if name in labels)
        self._columns = [body.markers.names.index(name) for name in self.names]
        self._empty = marker_problem(body, self._columns, np.zeros((1, len(self.names), 3)), tolerance=_TOLERANCE)
        self._weight = np.asarray(body.markers.weight)[self._columns]
        self._determined: dict[bytes, bool] = {}
        self._searched = -_PATIENCE
        self._frame = 0
        self.q = np.full(body.nq, np.nan)

    def follow(self, xyz: Array) -> tuple[Array, Array, bool]:
        """Return posture (nq,), distances (K,) m (NaN = hidden) and whether the markers fix the posture, from the
        markers ``xyz`` (K, 3) m of the next frame, NaN = hidden; where they do not, the last posture stays.

        Raises
        ------
        TrialRefused
            The very first frame does not fix the posture, so that there is nothing to stay with.
        """
        problem, seen = self._problem(xyz)
        self._frame += 1
        determined = self._fixes(seen)
        if not determined:
            if np.isnan(self.q).any():
                raise TrialRefused(
                    f"The first frame shows {int(seen.sum())} of {seen.size} markers, too few to find the posture. "
                    f"Begin the stream with all markers in view."
                )
        else:
            self.q = self._descend(problem).q[0]
        return self.q, np.where(seen, marker_distances(problem, self.q[None])[0], np.nan), determined

    def warm_up(self) -> None:
        """Load what the first frame would wait for, by following the body in its neutral posture."""
        at = poses(self.body, self.body.neutral).points(self._empty.segment, self._empty.chain.local)
        if self._fixes(np.ones(len(self.names), dtype=bool)):
            self.follow(at[0])
        self.q = np.full(self.body.nq, np.nan)

    def exchange(self, xyz: Array, suspects: Sequence[str], start: Array) -> tuple[str, str, float] | None:
        """Return the pair among ``suspects`` whose exchange brings the markers ``xyz`` (K, 3) m nearest to the body,
        descending from ``start`` (nq,), and the share of squared distance that is left; None with fewer than two.
        """
        plain = minimise_markers(self._problem(xyz)[0], _ONE, start[None]).cost[0]
        best: tuple[str, str, float] | None = None
        for one, other in combinations(suspects, 2):
            i, k = self.names.index(one), self.names.index(other)
            turned = np.array(xyz)
            turned[[i, k]] = turned[[k, i]]
            left = float(minimise_markers(self._problem(turned)[0], _ONE, start[None]).cost[0] / plain)
            best = (one, other, left) if best is None or left < best[2] else best
        return best

    def _problem(self, xyz: Array) -> tuple[MarkerProblem, NDArray[np.bool_]]:
        seen = np.asarray(np.isfinite(xyz).all(axis=1))
        at = np.ascontiguousarray(np.where(seen[:, None], xyz, 0.0))[None]
        return replace(self._empty, xyz=at, weight=(seen * self._weight)[None]), seen

    def _fixes(self, seen: NDArray[np.bool_]) -> bool:
        key = seen.tobytes()
        if key not in self._determined:
            self._determined[key] = bool(determination(self.body, self._columns, seen[None]).determined[0])
        return self._determined[key]

    def _descend(self, problem: MarkerProblem) -> Minimum:
        """Return the minimum from the last posture, or from the markers alone where that is bad or missing."""
        anew = partial(from_markers, problem, _ONE, (*SHARES, *MORE_SHARES))
        if np.isnan(self.q).any():
            return anew()
        found = minimise_markers(problem, _ONE, self.q[None])
        rms = np.sqrt(2 * found.cost[0] / problem.weight.sum())
        if rms > _BAD and self._frame - self._searched > _PATIENCE:
            self._searched = self._frame
            other = anew()
            return other if other.cost[0] < 0.8 * found.cost[0] else found
        return found

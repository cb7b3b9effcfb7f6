"""Skin over bone, markers that sag, flesh: errors of soft tissue, segment by segment."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from biodance.body.body import Body
from biodance.body.human.skeleton import kind_of
from biodance.motion.ik.compiled.tree import FOUR, add_products
from biodance.motion.kinematics import neighbours
from biodance.records import Array, Index
from biodance.spatial import cross
from biodance.uncertainty.response import ErrorSource, Response, in_segments, mean_squares


class _WithAngles(ErrorSource):
    """Errors in proportion to the angles beside a segment: every slope times every angle."""

    @abstractmethod
    def _slopes(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        """Yield for every segment functionals (F, 9, P) per radian, and the angles that they go with."""

    def functional(self, trial: Response) -> Array:
        """Return the functionals, times the angles."""
        # Slope (F, 9, P) times angle (F, n) as (F, 9, P, n), the angles last.
        parts = [value[..., None] * trial.angles[:, None, None, near] for value, near in self._slopes(trial)]
        return np.concatenate([part.reshape(*part.shape[:2], -1) for part in parts], axis=2)

    def transpose(self, trial: Response, back: Array) -> Array:
        """Return the same sums as of any error, the angles last: there are many, and few slopes."""
        found, size = [], back.shape[2]
        work, back = np.empty((FOUR, size)), np.ascontiguousarray(back)
        for value, near in self._slopes(trial):
            sums = np.zeros((value.shape[2], near.size, size))
            add_products(np.ascontiguousarray(value), trial.angles.take(near, axis=1), back, work, sums)
            found.append(sums.reshape(-1, size))
        return np.concatenate(found)


@dataclass(frozen=True, eq=False)
class Slide(_WithAngles):
    """Skin over bone: a pattern of a segment's markers in proportion to the angle of a joint beside it (m/rad).

    ``patterns`` per segment (m, 3, P) displacements of its m markers, segment axes: the markers of a segment as a
    whole, or each alone.
    """

    patterns: tuple[Array, ...]

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Every pattern of a segment, times every angle beside it."""
        count = zip(self.body.segments, self.patterns, _near(self.body), strict=True)
        return tuple(
            f"slide {kind_of(name)}" for name, pattern, near in count for _ in range(pattern.shape[2] * near.size)
        )

    def residual(self, trial: Response) -> Array:
        """Return the residuals of the patterns, times the angles."""
        left, cuts = self._left(trial)
        local, angles = in_segments(trial, left), trial.angles
        mean = (local.reshape(len(left), -1).T @ angles / len(left)).reshape(*local.shape[1:], angles.shape[1])
        parts = (mean[:, :, cut][..., near] for cut, (*_, near) in zip(cuts, self._parts, strict=True))
        return np.concatenate([part.reshape(*part.shape[:2], -1) for part in parts], axis=2)

    def squares(self, trial: Response) -> Array:
        """Return the squared residuals of every pattern, times the squared angles."""
        count = len(self.body.markers.names) * len(trial.place)
        left, cuts = self._left(trial)
        square = np.einsum("frp,frp->fp", left, left)
        parts = zip(cuts, self._parts, strict=True)
        # |left|² of a pattern times angle² summed over frames, over M F: mean squared distance.
        return np.concatenate(
            [(square[:, cut].T @ trial.angles[:, near] ** 2 / count).ravel() for cut, (*_, near) in parts]
        )

    def _slopes(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        for s, on, rows, near in self._parts:
            if self._alone[s]:
                answer = trial.answer[:, :, rows].reshape(len(trial.answer), -1, 3)
                # Each marker alone has the axes of its segment as patterns: no (3m, 3m) displacements -R are formed.
                yield -(answer @ trial.pose.rotation[:, s]).reshape(len(answer), 9, -1), near
            else:
                yield trial.of_markers(self._moved(trial, s, on), rows), near

    @cached_property
    def _alone(self) -> tuple[bool, ...]:
        """Whether every marker of a segment slides by itself: its patterns then are the axes of the segment."""
        flat = (one.reshape(3 * len(one), -1 if one.size else 0) for one in self.patterns)
        return tuple(np.array_equal(one, np.eye(one.shape[1])) for one in flat)

    def _left(self, trial: Response) -> tuple[Array, list[slice]]:
        """Return what all patterns leave of the markers (F, 3M, K) m per radian, and where those of a segment are."""
        moves = [(self._moved(trial, s, on), rows) for s, on, rows, _ in self._parts]
        ends = np.cumsum([0, *(moved.shape[2] for moved, _ in moves)])
        return trial.left(*moves), [slice(a, b) for a, b in pairwise(ends)]

    def _moved(self, trial: Response, s: int, on: Index) -> Array:
        """Return the displacements (F, 3m, P) of the model's markers against those measured, lab."""
        local = np.swapaxes(self.patterns[s], 1, 2)[None]
        # The skin carries the measured marker by +p: the model's lies -p from it.
        moved = -np.swapaxes(local @ np.swapaxes(trial.pose.rotation[:, s, None], -1, -2), -1, -2)
        return np.asarray(moved).reshape(len(moved), 3 * on.size, -1)

    @cached_property
    def _parts(self) -> tuple[tuple[int, Index, Index, Index], ...]:
        """Segments that wear markers: index, markers, their rows among 3M, angles beside it."""
        worn, found = np.array(self.body.markers.segment), []
        for s, near in enumerate(_near(self.body)):
            on = np.flatnonzero(worn == s)
            if on.size:
                found.append((s, on, (3 * on[:, None] + np.arange(3)).ravel(), near))
        return tuple(found)


@dataclass(frozen=True, eq=False)
class Sag(ErrorSource):
    """Markers on flesh that yields to its own weight and acceleration, segment by segment (s²: m per m/s²)."""

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Every segment that wears markers."""
        return tuple(f"sag {kind_of(self.body.segments[s])}" for s in self._worn)

    def functional(self, trial: Response) -> Array:
        """Return the functionals of the markers that are left behind by the acceleration of their middle."""
        return np.concatenate([trial.of_markers(*self._moved(trial, s)) for s in self._worn], axis=2)

    def residual(self, trial: Response) -> Array:
        """Return the residuals of the markers left behind."""
        return np.asarray(in_segments(trial, self._left(trial)).mean(axis=0))

    def squares(self, trial: Response) -> Array:
        """Return the squared residuals of the markers left behind."""
        return mean_squares(self._left(trial))

    def _left(self, trial: Response) -> Array:
        """Return what is left of the markers (F, 3M, K) m."""
        return trial.left(*(self._moved(trial, s) for s in self._worn))

    @property
    def _worn(self) -> tuple[int, ...]:
        return tuple(sorted(set(self.body.markers.segment)))

    def _moved(self, trial: Response, s: int) -> tuple[Array, Index]:
        """Return the acceleration (F, R, 1) less gravity, lab, of the middle of a segment's markers, for each of their
        rows (R,) among 3M.
        """
        on = np.flatnonzero(np.array(self.body.markers.segment) == s)
        move = trial.segments
        # Middle of the markers: its acceleration is that of the origin + dw x r + w x (w x r).
        arm = move.rotation[:, s] @ self.body.markers.position[on].mean(axis=0)
        w = move.angular_velocity[:, s]
        acceleration = move.acceleration[:, s] + cross(move.angular_acceleration[:, s], arm) + cross(w, cross(w, arm))
        # a - g: at rest +9.81 upwards, so the measured marker hangs below the model's by s times that.
        left_behind = np.tile(acceleration - self.body.gravity, (1, on.size))[:, :, None]
        return left_behind, (3 * on[:, None] + np.arange(3)).ravel()


@dataclass(frozen=True, eq=False)
class Flesh(_WithAngles):
    """Matter that moves against its segment in proportion to an angle beside it, along the three axes of the segment
    (m/rad).
    """

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Three axes of every segment, times every angle beside it."""
        pairs = zip(self.body.segments, _near(self.body), strict=True)
        return tuple(f"flesh {kind_of(name)}" for name, near in pairs for _ in range(3 * near.size))

    def residual(self, trial: Response) -> Array:
        """Return zeros: no marker sees a displaced centre of mass."""
        return np.zeros((len(self.body.markers.names), 3, len(self.groups)))

    def _slopes(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        for s, near in enumerate(self._beside):
            # Functionals of a displacement (lab) times R: per metre along the segment's axes.
            yield trial.place[:, s] @ trial.pose.rotation[:, s], near

    @cached_property
    def _beside(self) -> tuple[Index, ...]:
        """For every segment the angles beside it."""
        return _near(self.body)

    def squares(self, trial: Response) -> Array:
        """Return zeros: no marker sees it."""
        return np.zeros(len(self.groups))


def _near(body: Body) -> tuple[Index, ...]:
    """Return for every segment the angles beside it."""
    return tuple(np.flatnonzero(column) for column in neighbours(body).T)

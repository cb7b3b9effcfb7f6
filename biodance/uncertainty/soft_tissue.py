"""Skin over bone, markers that sag, flesh: errors of soft tissue, segment by segment."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from biodance.body.body import Body
from biodance.body.human.skeleton import kind_of
from biodance.records import Array, Index
from biodance.spatial import cross
from biodance.uncertainty.response import Pull, Response
from biodance.uncertainty.source import Effects, ErrorSource, mean_local, mean_squares, neighbours


@dataclass(frozen=True, eq=False)
class Slide(ErrorSource):
    """Skin over bone: a pattern of a segment's markers in proportion to the angle of a joint beside it (m/rad).

    ``patterns`` per segment (m, 3, P) displacements of its m markers, segment axes: the markers of a segment as a
    whole, or each alone.
    """

    patterns: tuple[Array, ...]

    @property
    def groups(self) -> tuple[str, ...]:
        """Every pattern of a segment, times every angle beside it."""
        count = zip(self.body.segments, self.patterns, _near(self.body), strict=True)
        return tuple(
            f"slide {kind_of(name)}" for name, pattern, near in count for _ in range(pattern.shape[2] * near.size)
        )

    def forward(self, trial: Response) -> Effects:
        """Return functional and residual of the patterns, times the angles."""
        values, left = [], []
        for s, on, rows, near in self._parts:
            value, residual = trial.of_markers(self._moved(trial, s, on), rows)
            values.append(_times(value, trial.angles[:, near]))
            left.append(mean_local(trial, residual, trial.angles[:, near]))
        return np.concatenate(values, axis=2), np.concatenate(left, axis=2)

    def transpose(self, trial: Response, pull: Pull) -> Array:
        """Return the weights on the markers along the patterns, summed over time with the angles."""
        found, size = [], pull.marker.shape[3]
        for s, on, _, near in self._parts:
            local = np.swapaxes(trial.pose.rotation[:, s, None], -1, -2) @ pull.marker[:, on]
            along = self.patterns[s].reshape(3 * on.size, -1).T @ local.reshape(len(local), 3 * on.size, size)
            found.append(-_with_angles(along, trial.angles[:, near]))
        return np.concatenate(found)

    def squares(self, trial: Response) -> Array:
        """Return the squared residuals of every pattern, times the squared angles."""
        found = []
        for s, on, rows, near in self._parts:
            _, residual = trial.of_markers(self._moved(trial, s, on), rows)
            found.append(3 * np.mean(residual**2, axis=1).T @ trial.angles[:, near] ** 2 / len(residual))
        return np.concatenate([part.ravel() for part in found])

    def _moved(self, trial: Response, s: int, on: Index) -> Array:
        """Return the displacements (F, 3m, P) of the model's markers against those measured, lab."""
        local = np.swapaxes(self.patterns[s], 1, 2)[None]
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

    @property
    def groups(self) -> tuple[str, ...]:
        """Every segment that wears markers."""
        return tuple(f"sag {kind_of(self.body.segments[s])}" for s in self._worn)

    def forward(self, trial: Response) -> Effects:
        """Return functional and residual of the markers that are left behind by the acceleration of their middle."""
        value, left = self._followed(trial)
        return value, mean_local(trial, left, np.ones((len(left), 1)))

    def squares(self, trial: Response) -> Array:
        """Return the squared residuals of the markers left behind."""
        return mean_squares(self._followed(trial)[1])

    def _followed(self, trial: Response) -> tuple[Array, Array]:
        """Return functionals (F, 18, K) and residuals (F, 3M, K) of the markers left behind."""
        parts = []
        for s in self._worn:
            on, moved = self._moved(trial, s)
            rows = (3 * on[:, None] + np.arange(3)).ravel()
            parts.append(trial.of_markers(np.tile(moved, (1, on.size))[:, :, None], rows))
        return np.concatenate([value for value, _ in parts], axis=2), np.concatenate(
            [left for _, left in parts], axis=2
        )

    def transpose(self, trial: Response, pull: Pull) -> Array:
        """Return the weights on a segment's markers along the acceleration, summed over time."""
        parts = [self._moved(trial, s) for s in self._worn]
        return np.array([np.einsum("fi,fip->p", moved, pull.marker[:, on].sum(axis=1)) for on, moved in parts])

    @property
    def _worn(self) -> tuple[int, ...]:
        return tuple(sorted(set(self.body.markers.segment)))

    def _moved(self, trial: Response, s: int) -> tuple[Index, Array]:
        """Return the markers of a segment and the acceleration (F, 3) of their middle less gravity, lab."""
        on = np.flatnonzero(np.array(self.body.markers.segment) == s)
        move = trial.segments
        arm = move.rotation[:, s] @ self.body.markers.position[on].mean(axis=0)
        w = move.angular_velocity[:, s]
        acceleration = move.acceleration[:, s] + cross(move.angular_acceleration[:, s], arm) + cross(w, cross(w, arm))
        return on, acceleration - self.body.gravity


@dataclass(frozen=True, eq=False)
class Flesh(ErrorSource):
    """Matter that moves against its segment in proportion to an angle beside it, along the three axes of the segment
    (m/rad).
    """

    @property
    def groups(self) -> tuple[str, ...]:
        """Three axes of every segment, times every angle beside it."""
        pairs = zip(self.body.segments, _near(self.body), strict=True)
        return tuple(f"flesh {kind_of(name)}" for name, near in pairs for _ in range(3 * near.size))

    def forward(self, trial: Response) -> Effects:
        """Return the functional of a displaced centre of mass, times the angles; no marker sees it."""
        pairs = enumerate(_near(self.body))
        values = [_times(trial.place[:, s] @ trial.pose.rotation[:, s], trial.angles[:, near]) for s, near in pairs]
        return np.concatenate(values, axis=2), np.zeros((len(self.body.markers.names), 3, len(self.groups)))

    def transpose(self, trial: Response, pull: Pull) -> Array:
        """Return the weights on the centres of mass in segment axes, summed over time with the angles."""
        local = np.swapaxes(trial.pose.rotation, -1, -2) @ pull.place
        return np.concatenate(
            [_with_angles(local[:, s], trial.angles[:, near]) for s, near in enumerate(_near(self.body))]
        )

    def squares(self, trial: Response) -> Array:
        """Return zeros: no marker sees it."""
        return np.zeros(len(self.groups))


def _near(body: Body) -> tuple[Index, ...]:
    """Return for every segment the angles beside it."""
    return tuple(np.flatnonzero(column) for column in neighbours(body).T)


def _times(value: Array, angles: Array) -> Array:
    """Return (F, 18, P * n): functionals (F, 18, P) times angles (F, n)."""
    return np.asarray(value[..., None] * angles[:, None, None]).reshape(*value.shape[:2], -1)


def _with_angles(weight: Array, angles: Array) -> Array:
    """Return (P * n, p): sum over time of ``weight`` (F, P, p) times angles (F, n)."""
    summed = (angles.T @ weight.reshape(len(weight), -1)).reshape(angles.shape[1], *weight.shape[1:])
    return np.swapaxes(summed, 0, 1).reshape(-1, weight.shape[2])

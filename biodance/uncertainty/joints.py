"""Joint centres that lie elsewhere and hinges whose axis is tilted."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from biodance.body.body import Body
from biodance.body.human.skeleton import kind_of
from biodance.motion.kinematics import Poses, below, chains, poses
from biodance.records import Array, Index
from biodance.spatial import skew
from biodance.uncertainty.response import ErrorSource, Response, in_segments, mean_squares


@dataclass(frozen=True, eq=False)
class _Carried(ErrorSource):
    """Errors of joints that displace what hangs on them: segments, and their markers with them."""

    @abstractmethod
    def _own(self, trial: Response) -> Iterator[Array]:
        """Yield joint by joint the functionals (F, 9, P) of the segments that hang on it."""

    @abstractmethod
    def _moved(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        """Yield joint by joint how the model's markers that hang on it move, (F, R, P) m, and their rows among 3M."""

    def functional(self, trial: Response) -> Array:
        """Return the functionals of the segments, and of the coordinates that follow their markers."""
        parts = zip(self._own(trial), self._moved(trial), strict=True)
        found = [own + trial.of_markers(moved, rows) for own, (moved, rows) in parts]
        return np.concatenate(found or [np.empty((len(trial.place), 9, 0))], axis=2)

    def residual(self, trial: Response) -> Array:
        """Return the residuals of the markers that are carried along."""
        return np.asarray(in_segments(trial, trial.left(*self._moved(trial))).mean(axis=0))

    def squares(self, trial: Response) -> Array:
        """Return the squared residuals of the markers that are carried along."""
        return mean_squares(trial.left(*self._moved(trial)))


@dataclass(frozen=True, eq=False)
class Centre(_Carried):
    """A joint centre that lies elsewhere, along the axes of its parent (m).

    All that hangs on the joint is carried by R_parent - R_child C, with C = child_R_parent of the neutral posture,
    where the static trial has calibrated it away.
    """

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Three axes of every anatomical joint."""
        return tuple(f"joint_centre {kind_of(name)}" for name in self.joints)

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Every anatomical joint three times."""
        return tuple(joint_of(self.body, chain) for chain in chains(self.body) for _ in range(3))

    def _own(self, trial: Response) -> Iterator[Array]:
        for (on, _), drift in self._drifts(trial):
            # All that hangs is carried by one displacement: its functionals may be summed before.
            yield trial.place[:, on].sum(axis=1) @ drift

    def _moved(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        for (_, rows), drift in self._drifts(trial):
            # Every marker moves by the same (3, 3): repeated for the three rows of each.
            yield np.tile(drift, (1, rows.size // 3, 1)), rows

    def _drifts(self, trial: Response) -> Iterator[tuple[tuple[Index, Index], Array]]:
        """Yield for every anatomical joint what hangs on it and (F, 3, 3) m of its drift, lab, per metre along the
        parent's axes.
        """
        for chain, hanging, neutral in self._still:
            child = self.body.joints[chain[-1]].segment
            yield hanging, _above(self.body, trial.pose, chain[0]) - trial.pose.rotation[:, child] @ neutral

    @cached_property
    def _still(self) -> tuple[tuple[tuple[int, ...], tuple[Index, Index], Array], ...]:
        """Axes of every anatomical joint, what hangs on it, and child_R_parent (3, 3) of the neutral posture."""
        rest, found = poses(self.body, self.body.neutral), []
        for chain in chains(self.body):
            child = self.body.joints[chain[-1]].segment
            # child_R_parent = R_child' R_parent.
            neutral = rest.rotation[0, child].T @ _above(self.body, rest, chain[0])[0]
            found.append((chain, _hanging(self.body, chain[0]), neutral))
        return tuple(found)


@dataclass(frozen=True, eq=False)
class Tilt(_Carried):
    """The axis of a hinge that is tilted against the bone's own, about two directions square to it (rad)."""

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Two directions of every hinge."""
        return tuple(f"tilt {kind_of(name)}" for name in self.joints)

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Every hinge twice."""
        return tuple(joint_of(self.body, (joint,)) for joint, _, _ in self._hinges for _ in range(2))

    def _own(self, trial: Response) -> Iterator[Array]:
        for joint, (on, _), turn in self._turns(trial):
            # A turn r about the joint's centre displaces a CoM by r x arm = -[arm]x r, and turns its segment by r.
            arm = skew(trial.com[:, on] - trial.pose.joint_position[:, joint, None])
            yield (trial.turn[:, on] - trial.place[:, on] @ arm).sum(axis=1) @ turn

    def _moved(self, trial: Response) -> Iterator[tuple[Array, Index]]:
        for joint, (_, rows), turn in self._turns(trial):
            arm = trial.markers[:, rows[::3] // 3] - trial.pose.joint_position[:, joint, None]
            yield -(skew(arm) @ turn[:, None]).reshape(len(arm), rows.size, 2), rows

    def _turns(self, trial: Response) -> Iterator[tuple[int, tuple[Index, Index], Array]]:
        """Yield for every hinge its joint, what hangs on it, and (F, 3, 2) rad of its turn, lab, per radian of tilt."""
        for joint, hanging, across in self._hinges:
            # A hinge's axis off by e turns what hangs on it by angle * e (first order in the angle).
            yield joint, hanging, trial.angles[:, joint, None, None] * (trial.pose.joint_rotation[:, joint] @ across)

    @cached_property
    def _hinges(self) -> tuple[tuple[int, tuple[Index, Index], Array], ...]:
        """Every hinge: its joint, what hangs on it, and two unit vectors (3, 2) square to its axis."""
        alone = [chain[0] for chain in chains(self.body) if len(chain) == 1]
        return tuple((j, _hanging(self.body, j), np.array(_across(self.body.joints[j].axis)).T) for j in alone)


def _hanging(body: Body, joint: int) -> tuple[Index, Index]:
    """Return the segments that hang on a joint, and the rows of their markers among 3M."""
    hangs = below(body)[joint] > 0
    markers = np.flatnonzero(hangs[list(body.markers.segment)])
    # Rows of marker k among 3M: 3k, 3k + 1, 3k + 2.
    return np.flatnonzero(hangs), (3 * markers[:, None] + np.arange(3)).ravel()


def joint_of(body: Body, chain: tuple[int, ...]) -> str:
    """Return the anatomical joint of a chain of axes: ``right_hip`` of ``right_hip_flexion``."""
    return body.joints[chain[0]].name.rsplit("_", 1)[0]


def _above(body: Body, at: Poses, joint: int) -> Array:
    """Return the turn (F, 3, 3) of the frame in which a joint lies."""
    parent = body.joints[joint].parent
    return at.root_rotation if parent < 0 else at.joint_rotation[:, parent]


def _across(axis: Array) -> list[Array]:
    """Return two unit vectors square to ``axis``."""
    # The unit vector farthest from the axis: the cross product is never near zero.
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    return [first, np.cross(axis, first)]

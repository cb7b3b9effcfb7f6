"""Joint centres that lie elsewhere and hinges whose axis is tilted."""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.body.human.skeleton import kind_of
from biodance.motion.kinematics import Poses, below, chains, poses
from biodance.records import Array, Index
from biodance.spatial import skew
from biodance.uncertainty.response import ErrorSource, Response, centres_of_mass, mean_local, mean_squares


@dataclass(frozen=True, eq=False)
class Centre(ErrorSource):
    """A joint centre that lies elsewhere, along the axes of its parent (m).

    All that hangs on the joint is carried by R_parent - R_child C, with C = child_R_parent of the neutral posture,
    where the static trial has calibrated it away.
    """

    @property
    def groups(self) -> tuple[str, ...]:
        """Three axes of every anatomical joint."""
        return tuple(f"joint_centre {kind_of(name)}" for name in self.joints)

    @property
    def joints(self) -> tuple[str, ...]:
        """Every anatomical joint three times."""
        return tuple(joint_of(self.body, chain) for chain in chains(self.body) for _ in range(3))

    def functional(self, trial: Response) -> Array:
        """Return the functionals of what hangs on displaced centres, and of its markers that are carried along."""
        value = trial.of_markers(self._moved(trial))
        for k, (on, drift) in enumerate(self._drifts(trial)):
            value[:, :, 3 * k : 3 * k + 3] += trial.place[:, on].sum(axis=1) @ drift
        return value

    def residual(self, trial: Response) -> Array:
        """Return the residuals of the markers that are carried along."""
        left = trial.left(self._moved(trial))
        return mean_local(trial, left, np.ones((len(left), 1)))

    def squares(self, trial: Response) -> Array:
        """Return the squared residuals of the markers that are carried along."""
        return mean_squares(trial.left(self._moved(trial)))

    def _moved(self, trial: Response) -> Array:
        """Return the displacements (F, 3M, K) m of the markers that are carried along."""
        worn = np.array(self.body.markers.segment)
        moved = np.zeros((len(trial.J), worn.size, 3, len(self.groups)))
        for k, (on, drift) in enumerate(self._drifts(trial)):
            moved[:, np.isin(worn, on), :, 3 * k : 3 * k + 3] = drift[:, None]
        return moved.reshape(len(moved), 3 * worn.size, -1)

    def _drifts(self, trial: Response) -> list[tuple[Index, Array]]:
        """Return for every anatomical joint the segments on it and (F, 3, 3) m of their drift, lab, per metre along
        the parent's axes.
        """
        rest, hangs, found = poses(self.body, self.body.neutral), below(self.body), []
        for chain in chains(self.body):
            turn, still = (_above(self.body, at, chain[0]) for at in (trial.pose, rest))
            child = self.body.joints[chain[-1]].segment
            drift = turn - trial.pose.rotation[:, child] @ (rest.rotation[0, child].T @ still[0])
            found.append((np.flatnonzero(hangs[chain[0]]), drift))
        return found


@dataclass(frozen=True, eq=False)
class Tilt(ErrorSource):
    """The axis of a hinge that is tilted against the bone's own, about two directions square to it (rad)."""

    @property
    def groups(self) -> tuple[str, ...]:
        """Two directions of every hinge."""
        return tuple(f"tilt {kind_of(name)}" for name in self.joints)

    @property
    def joints(self) -> tuple[str, ...]:
        """Every hinge twice."""
        return tuple(joint_of(self.body, chain) for chain in chains(self.body) if len(chain) == 1 for _ in range(2))

    def functional(self, trial: Response) -> Array:
        """Return the functionals of what hangs on a hinge, turned and displaced by the angle times the tilt."""
        value, com = trial.of_markers(self._moved(trial)), centres_of_mass(self.body, trial.pose)
        for k, (joint, on, rho) in enumerate(self._turns(trial)):
            origin = trial.pose.joint_position[:, joint]
            for s in on:
                arm = skew(com[:, s] - origin)
                value[:, :, 2 * k : 2 * k + 2] += trial.turn[:, s] @ rho - trial.place[:, s] @ (arm @ rho)
        return value

    def residual(self, trial: Response) -> Array:
        """Return the residuals of the markers that are turned along."""
        left = trial.left(self._moved(trial))
        return mean_local(trial, left, np.ones((len(left), 1)))

    def squares(self, trial: Response) -> Array:
        """Return the squared residuals of the markers that are turned along."""
        return mean_squares(trial.left(self._moved(trial)))

    def _moved(self, trial: Response) -> Array:
        """Return the displacements (F, 3M, K) m of the markers that are turned along."""
        worn = np.array(self.body.markers.segment)
        marker = trial.pose.points(list(worn), self.body.markers.position)
        moved = np.zeros((len(marker), worn.size, 3, len(self.groups)))
        for k, (joint, on, rho) in enumerate(self._turns(trial)):
            carried, origin = np.flatnonzero(np.isin(worn, on)), trial.pose.joint_position[:, joint, None]
            moved[:, carried, :, 2 * k : 2 * k + 2] = -skew(marker[:, carried] - origin) @ rho[:, None]
        return moved.reshape(len(marker), 3 * worn.size, -1)

    def _turns(self, trial: Response) -> list[tuple[int, Index, Array]]:
        """Return for every hinge its joint, the segments on it, and (F, 3, 2) rad of their turn, lab, per radian of
        tilt.
        """
        hangs, found = below(self.body), []
        for (joint,) in (chain for chain in chains(self.body) if len(chain) == 1):
            across = np.array(_across(self.body.joints[joint].axis)).T
            rho = trial.angles[:, joint, None, None] * (trial.pose.joint_rotation[:, joint] @ across)
            found.append((joint, np.flatnonzero(hangs[joint]), rho))
        return found


def joint_of(body: Body, chain: tuple[int, ...]) -> str:
    """Return the anatomical joint of a chain of axes: ``right_hip`` of ``right_hip_flexion``."""
    return body.joints[chain[0]].name.rsplit("_", 1)[0]


def _above(body: Body, at: Poses, joint: int) -> Array:
    """Return the turn (F, 3, 3) of the frame in which a joint lies."""
    parent = body.joints[joint].parent
    return at.root_rotation if parent < 0 else at.joint_rotation[:, parent]


def _across(axis: Array) -> list[Array]:
    """Return two unit vectors square to ``axis``."""
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    return [first, np.cross(axis, first)]

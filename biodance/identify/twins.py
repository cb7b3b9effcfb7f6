"""Twins of a subject: the same motion and masses, but skin that slides, joints that sit elsewhere, hinges that are tilted, flesh that
shifts.

A person is not the model. The tracked coordinates err coherently with the motion, the parameters absorb much of it, and the wrench
residual hides it. Every twin draws such errors once for a whole session; they pass through the inverse kinematics to first order - model
markers moved by dx are answered by dq = -(J'DJ)^-1 J'D dx, D marker weights - and change the wrench (docs/derivations.md, section 8).
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body, JointError
from biodance.body.inertia import TENSOR
from biodance.motion.kinematics import Poses, poses
from biodance.motion.marker_jacobian import below as below
from biodance.motion.marker_jacobian import chains as chains
from biodance.motion.marker_jacobian import jacobian as jacobian
from biodance.motion.marker_jacobian import skew as skew
from biodance.records import Array, Motion

SLIDE = 0.006
"""m/rad per axis: skin and flesh over bone per angle of a neighbouring joint; the session's own marker residuals rescale it."""
JOINT_CENTRE = {"hip": 0.012, "knee": 0.008, "ankle": 0.008, "trunk": 0.040, "shoulder": 0.012, "elbow": 0.020}
"""m per axis. Regressions miss hip and shoulder by 5 to 25 mm (Harrington 2007, Mantovani 2016); the level at which a one-piece trunk bends
differs by 5 to 8 cm between tables; the elbow of a nearly straight arm is found through a plane that is hardly defined."""
HINGE_TILT = {"knee": 0.07, "elbow": 0.35}
"""rad: tilt of a hinge's axis against the bone's own, for the same reason."""
OTHER_CENTRE, OTHER_TILT = 0.010, 0.05
"""m, rad: joints of other bodies."""


@dataclass(frozen=True, eq=False)
class Twins:
    """The errors of K twins: ``slide`` (n, M, 3, K) m/rad per joint and marker, ``flesh`` (n, N, 3, K) m/rad per joint and segment,
    ``centre`` (n, 3, K) m of the first axis of every joint, in its parent's frame, ``tilt`` (n, 3, K) of the axes of hinges.
    """

    slide: Array
    flesh: Array
    centre: Array
    tilt: Array


def neighbours(body: Body) -> Array:
    """Return (n, N) 1 where an anatomical joint (all its axes) is at an end of a segment."""
    table = np.zeros((len(body.joints), len(body.segments)))
    for chain in chains(body):
        child, above = body.joints[chain[-1]].segment, body.joints[chain[0]].parent
        table[np.ix_(chain, (child, 0 if above < 0 else body.joints[above].segment))] = 1.0
    return table


def joint_error(body: Body, chain: tuple[int, ...]) -> JointError:
    """Return how far the anatomical joint of a chain of axes may be from the person's: as the movement tells, else as landmarks do."""
    name = body.joints[chain[0]].name.rsplit("_", 1)[0]
    kind = name.removeprefix("right_").removeprefix("left_")
    by_landmarks = JointError(name, JOINT_CENTRE.get(kind, OTHER_CENTRE), HINGE_TILT.get(kind, OTHER_TILT))
    return next((error for error in body.joint_errors if error.joint == name), by_landmarks)


def draw_twins(body: Body, count: int, rng: np.random.Generator) -> Twins:
    """Draw the errors of ``count`` twins of ``body``."""
    beside, segment = neighbours(body), list(body.markers.segment)
    n = len(body.joints)
    centre, tilt = np.zeros((n, 3, count)), np.zeros((n, 3, count))
    for chain in chains(body):
        error = joint_error(body, chain)
        centre[chain[0]] = error.centre * rng.normal(size=(3, count))
        if len(chain) == 1:
            axis = body.joints[chain[0]].axis
            across = np.eye(3) - np.outer(axis, axis)
            tilt[chain[0]] = error.axis * across @ rng.normal(size=(3, count))
    slide = SLIDE * beside[:, segment, None, None] * rng.normal(size=(n, len(segment), 3, count))
    flesh = SLIDE * beside[:, :, None, None] * rng.normal(size=(n, len(body.segments), 3, count))
    return Twins(slide, flesh, centre, tilt)


@dataclass(frozen=True, eq=False)
class Disturbance:
    """Errors of K twins over T frames at unchanged coordinates, lab frame: ``markers`` (T, M, 3, K) m, model less measured; ``places``
    (T, N, 3, K) m of the segments' centres of mass; ``turns`` (T, N, 3, K) rad of the segments.
    """

    markers: Array
    places: Array
    turns: Array


def disturbance(body: Body, motion: Motion, pose: Poses, twins: Twins) -> Disturbance:
    """Return what the twins' errors do before the coordinates answer; a joint centre is recalibrated away in the neutral posture."""
    angles = motion.q[:, body.nq - len(body.joints) :]
    segment, hangs = list(body.markers.segment), below(body)
    com = pose.points(list(range(len(body.segments))), body.sip.com)
    marker = pose.points(segment, body.markers.position)
    drift = _drift(body, pose, twins, hangs)
    places = drift + pose.rotation @ _pulled(angles, twins.flesh)
    markers = drift[:, segment] - pose.rotation[:, segment] @ _pulled(angles, twins.slide)
    turns = np.zeros_like(places)
    for j in np.flatnonzero(np.any(twins.tilt, axis=(1, 2))):
        on, carried = np.flatnonzero(hangs[j]), np.flatnonzero(hangs[j][segment])
        rho = (angles[:, j, None, None] * (pose.joint_rotation[:, j] @ twins.tilt[j]))[:, None]
        origin = pose.joint_position[:, j, None]
        turns[:, on] += rho
        places[:, on] -= skew(com[:, on] - origin) @ rho
        markers[:, carried] -= skew(marker[:, carried] - origin) @ rho
    return Disturbance(markers, places, turns)


def _pulled(angles: Array, pull: Array) -> Array:
    """Return (T, S, 3, K): the sum over joints of angle times ``pull`` (n, S, 3, K)."""
    return np.asarray((angles @ pull.reshape(len(pull), -1)).reshape(len(angles), *pull.shape[1:]))


def _drift(body: Body, pose: Poses, twins: Twins, hangs: Array) -> Array:
    """Return (T, N, 3, K) m: how displaced joint centres carry the segments, less what the neutral posture calibrates away."""
    rest = poses(body, body.neutral)
    first = [chain[0] for chain in chains(body)]
    count = twins.centre.shape[2]

    def carried(at: Poses) -> Array:
        moved = np.stack([_parent_turn(at, body.joints[j].parent) @ twins.centre[j] for j in first], axis=1)
        return np.asarray((hangs[first].T @ moved.reshape(len(moved), len(first), -1)).reshape(len(moved), -1, 3, count))

    return np.asarray(carried(pose) - pose.rotation @ (np.swapaxes(rest.rotation, -1, -2) @ carried(rest)))


def _parent_turn(pose: Poses, parent: int) -> Array:
    return pose.root_rotation if parent < 0 else pose.joint_rotation[:, parent]


def central_inertia(body: Body) -> Array:
    """Return the inertia tensors (N, 3, 3) about the centres of mass."""
    table, com = body.sip.phi.reshape(-1, 10), body.sip.com
    tensor = np.empty((len(table), 3, 3))
    for column, (i, j) in enumerate(TENSOR, start=4):
        tensor[:, i, j] = tensor[:, j, i] = table[:, column]
    square = np.sum(com**2, axis=1)[:, None, None] * np.eye(3) - com[:, :, None] * com[:, None]
    return np.asarray(tensor - table[:, 0, None, None] * square)

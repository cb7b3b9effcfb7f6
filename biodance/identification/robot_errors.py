"""What a robot's laboratory may be off by, as changes of the wrench that the drawing needs: encoder zeros, joints that
give or have play under load, where on the plate the robot stood.

A joint that gives lies, beyond its encoder, by torque over stiffness away from it; one with play by half of the play to
the side to which its load pushes. Both torques are the drawing's. The robot is put on its foot anew with every change.
"""

from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.body.pinocchio_model import load_pinocchio
from biodance.lab.filters import LowPass, low_pass
from biodance.motion.dynamics import distribute, joint_torques
from biodance.motion.grounded import Grounded, ground_again
from biodance.motion.kinematics import poses
from biodance.motion.regressor import predict_wrench
from biodance.records import SIDES, Array, Motion, Wrench
from biodance.spatial import cross, quaternion_matrix

ZERO = 0.005
"""rad: standard deviation of an encoder's zero about the drawing's (judgement: 0.3 degrees, set by hand at stops)."""
GIVE = 0.01
"""rad by which a joint that gives does so at its RMS torque, and half of the play of one that has some: the unit."""
_TURNS = 0.2
"""Of the RMS torque of a joint: load at which its play is taken up (smooth, as friction holds it near zero load)."""
PLACE, YAW = 0.02, 0.035
"""m and rad: how well the place on the plate follows from the drawing's centre of pressure, before the data."""
_NEAR = 0.02
"""Of the height of the root: soles so near the lower one bear too."""
_QUIET = 1.5
"""Hz: accelerations below it are the robot's, above it the encoders' noise and vibrations, which would be taken for
causes.
"""
_SLOW = 0.3
"""Cut-off over the thinned rate: changes are smooth."""
THINNED = 4
"""Every so many frames are enough to see what an encoder's zero does."""


def some_frames(motion: Motion, pick: "slice | np.ndarray") -> Motion:
    """Return the chosen frames of a motion."""
    return Motion(motion.time[pick], motion.q[pick], motion.v[pick], motion.a[pick])


def zero_changes(body: Body, one: Grounded, angle: Array) -> Array:
    """Return the change (T / `THINNED`, 6, n) of the needed wrench by `ZERO` rad at every joint's encoder, of a motion
    with joint ``angle`` (T, n) rad.
    """
    return angle_changes(
        body, one, angle, np.broadcast_to(ZERO * np.eye(angle.shape[1]), (*angle.shape, angle.shape[1]))
    )


def leg_joints(body: Body) -> tuple[int, ...]:
    """Return the joints between the root and either foot."""
    found = set[int]()
    for side in SIDES:
        joint = body.segment_joint[body.feet[side].segment]
        while joint >= 0:
            found.add(joint)
            joint = body.joints[joint].parent
    return tuple(sorted(found))


def load_angles(body: Body, one: Grounded, measured: Array) -> tuple[Array, Array, Array]:
    """Return by how much (T, n) rad each joint lies beyond its encoder where it gives by 1 rad per N·m, and where it
    has play of 1 rad to either side; and the RMS torques (n,) N·m, with the ``measured`` wrench (T, 6) of the
    ground, NaN where unknown. Zero for joints that are not of the legs.
    """
    joints = list(leg_joints(body))
    torque = np.zeros((len(measured), len(body.joints)))
    torque[:, joints] = _torques(body, one, measured)[:, joints]
    size = np.sqrt(np.mean(torque**2, axis=0))
    return -torque, -np.tanh(torque / np.maximum(_TURNS * size, 1e-9)), size


def angle_changes(body: Body, one: Grounded, angle: Array, shapes: Array) -> Array:
    """Return the change (T / `THINNED`, 6, k) of the needed wrench by changes ``shapes`` (T, n, k) rad of the joint
    ``angle`` (T, n) rad.
    """
    few, time = angle[::THINNED], one.motion.time
    slow = LowPass(cutoff=_SLOW / float(time[THINNED] - time[0]))
    before = _needed(body, ground_again(body, one, few, every=THINNED, settings=slow).motion)
    out = np.empty((*before.shape, shapes.shape[2]))
    for k in range(shapes.shape[2]):
        after = ground_again(body, one, few + shapes[::THINNED, :, k], every=THINNED, settings=slow)
        out[:, :, k] = _needed(body, after.motion) - before
    return out


def slow_wrench(body: Body, one: Grounded, angle: Array) -> Array:
    """Return the wrench (T, 6) that a motion needs, without what is faster than `_QUIET`: faults of a plate are made
    from it, since neither the encoders' noise nor forces that no motion explains are in it.
    """
    return _needed(body, ground_again(body, one, angle, settings=LowPass(cutoff=_QUIET)).motion)


def _needed(body: Body, motion: Motion) -> Array:
    """Return the wrench (T, 6) that a motion needs, about the origin; one vector at a time, ten times faster than by
    the regressor.
    """
    pin = load_pinocchio()
    model, rows = body.model, np.empty((motion.time.size, 6))
    data = model.createData()
    for row, q, v, a in zip(rows, motion.q, motion.v, motion.a, strict=True):
        row[:] = pin.rnea(model, data, q, v, a)[:6]
    turn = quaternion_matrix(motion.q[:, 3:7])
    force, moment = (np.einsum("tij,tj->ti", turn, part) for part in (rows[:, :3], rows[:, 3:]))
    return np.concatenate([force, moment + cross(motion.q[:, :3], force)], axis=1)


def place_changes(wrench: Array, one: Grounded) -> Array:
    """Return the changes (T, 6, 3) of a wrench by one standard deviation of the place along x, y and of the turn."""
    force, moment = wrench[:, :3], wrench[:, 3:]
    out = np.zeros((len(wrench), 6, 3))
    for k in range(2):
        out[:, 3:, k] = cross(PLACE * np.eye(3)[k], force)
    up = YAW * np.eye(3)[2]
    out[:, :3, 2], out[:, 3:, 2] = cross(up, force), cross(up, moment)
    return out / 10 if one.base is not None and one.base.position is not None else out


def _torques(body: Body, one: Grounded, measured: Array) -> Array:
    """Return the torques (T, n) N·m under the measured wrench, from the feet upwards; a foot whose sole is near the
    ground bears its share. Accelerations are left out: they would bring in the encoders' noise.
    """
    pose = poses(body, one.motion.q)
    soles = []
    for side in SIDES:
        foot = body.feet[side]
        middle = foot.outline.mean(axis=0)
        soles.append(pose.rotation[:, foot.segment] @ middle + pose.position[:, foot.segment])
    height = np.stack([sole[:, 2] for sole in soles], axis=1)
    down = height < height.min(axis=1, keepdims=True) + _NEAR * np.median(one.motion.q[:, 2])
    down[np.arange(len(down)), one.foot] = True
    still = replace(one.motion, v=np.zeros_like(one.motion.v), a=np.zeros_like(one.motion.a))
    needed = predict_wrench(body, still).value
    measured = np.where(np.isfinite(measured), measured, needed)
    wrench = Wrench(still.time, low_pass(measured, still.rate, LowPass(cutoff=_QUIET)))
    parts = distribute(wrench, soles[0], soles[1], down)
    names = [body.segments[body.feet[side].segment] for side in SIDES]
    return joint_torques(body, still, dict(zip(names, parts, strict=True))).torque

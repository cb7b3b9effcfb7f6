"""What a robot's laboratory may be off by, as changes of the wrench that the drawing needs: encoder zeros, joints that
give or have play under load, where on the plate the robot stood.

A joint that gives lies, beyond its encoder, by torque over stiffness away from it; one with play by half of the play to
the side to which its load pushes. Both torques are the drawing's. The robot is put on its foot anew with every change.
"""

from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.lab.filters import LowPass
from biodance.motion.dynamics import distribute, joint_torques
from biodance.motion.grounded import Grounded, ground
from biodance.motion.kinematics import poses
from biodance.motion.regressor import predict_wrench
from biodance.records import SIDES, Array, Motion, Wrench
from biodance.spatial import cross

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
_SLOW = 0.3
"""Cut-off over the thinned rate: changes are smooth."""
THINNED = 4
"""Every so many frames are enough to see what an encoder's zero does."""


def thinned(motion: Motion, pick: "slice | np.ndarray") -> Motion:
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
    time, few = one.motion.time[::THINNED], angle[::THINNED]
    slow = LowPass(cutoff=_SLOW / float(time[1] - time[0]))
    base = one.base[::THINNED] if one.base else None
    before = predict_wrench(body, ground(body, time, few, settings=slow, lean=one.lean, base=base).motion).value
    out = np.empty((*before.shape, shapes.shape[2]))
    for k in range(shapes.shape[2]):
        after = ground(body, time, few + shapes[::THINNED, :, k], settings=slow, lean=one.lean, base=base).motion
        out[:, :, k] = predict_wrench(body, after).value - before
    return out


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
    wrench = Wrench(still.time, np.where(np.isfinite(measured), measured, needed))
    parts = distribute(wrench, *soles, down)
    names = [body.segments[body.feet[side].segment] for side in SIDES]
    return joint_torques(body, still, dict(zip(names, parts, strict=True))).torque

"""The pelvis as its own markers show it: the tracked one is pulled by a trunk that the body takes for stiff."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from biodance.body.body import Body
from biodance.lab.prepare import low_pass, motion_filter
from biodance.motion.kinematics import chains, poses
from biodance.records import Motion, Trial
from biodance.spatial import rigid_fit, zxy_angles

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


def with_own_pelvis(trial: Trial, body: Body, motion: Motion) -> Motion:
    """Return the motion with the pelvis turned as its own markers show it in the ``trial``, thighs and trunk turned in
    the lab as before: angles of pelvis, hips and trunk change, nothing else.

    The rotation is the rigid fit of the pelvis' markers from where the static trial has them (least squares),
    low-passed as the joint coordinates; while one of them is not seen the difference to the tracked pelvis goes
    straight from before to after. As it is with fewer than three markers on the pelvis, or a trial that is shorter
    than the low-pass needs. ``v``, ``a`` and the residuals stay those of the tracked body.
    """
    turned = _own_rotation(trial, body, motion)
    if turned is None:
        return motion
    q, pose, pelvis = motion.q.copy(), poses(body, motion.q), turned.as_matrix()
    q[:, 3:7] = turned.as_quat()
    for chain in chains(body):
        if body.joints[chain[0]].parent < 0:
            # Pelvis, fixed placement, angles, child: F' P' C is the product of the rotations about z, x and y.
            fixed = body.joints[chain[0]].rotation.T
            relative = fixed @ np.swapaxes(pelvis, -1, -2) @ pose.joint_rotation[:, chain[-1]]
            sign = [sum(body.joints[axis].axis) for axis in chain]  # signed axes: +1 or -1 along one coordinate each
            columns = [body.nq - len(body.joints) + axis for axis in chain]
            q[:, columns] = np.stack(zxy_angles(relative), axis=1) * sign
    return replace(motion, q=q)


def _own_rotation(trial: Trial, body: Body, motion: Motion) -> "Rotation | None":
    """Return how the pelvis is turned in the lab by its own markers; None where they do not tell it."""
    from scipy.spatial.transform import Rotation

    markers, filtering = trial.markers, motion_filter(trial.settings)
    if markers is None or markers.time.size != motion.time.size:
        return None
    own = [k for k, on in enumerate(body.markers.segment) if on == 0 and body.markers.names[k] in markers.names]
    seen = markers.xyz[:, [markers.names.index(body.markers.names[k]) for k in own]]
    known = np.isfinite(seen).all(axis=(1, 2))
    if len(own) < 3 or not known.any() or motion.time.size < filtering.shortest(markers.rate):
        return None
    tracked = Rotation.from_quat(motion.q[:, 3:7])
    shown = Rotation.from_matrix(rigid_fit(body.markers.position[own], seen[known])[0])
    apart = (tracked[known].inv() * shown).as_rotvec()
    whole = np.stack([np.interp(motion.time, motion.time[known], column) for column in apart.T], axis=1)
    return tracked * Rotation.from_rotvec(low_pass(whole, markers.rate, filtering))

"""A motion in the coordinates of the OpenSim model that biodance writes."""

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.export.osim import ROOT_ROTATIONS, ROOT_TRANSLATIONS
from biodance.body.parts import UPRIGHT
from biodance.lab.opensim.mot import TimeTable
from biodance.records import Motion


def opensim_coordinates(body: Body, motion: Motion) -> TimeTable:
    """Return the coordinates of ``motion`` (T frames) by name: rad and m, root in OpenSim's ground (y up), joints as
    in ``body``.
    """
    names = [joint.name for joint in body.joints]
    angles = motion.q[:, body.nq - len(names) :]
    if not body.n_root:
        return TimeTable(body.name, tuple(names), motion.time, angles)
    turned = UPRIGHT.T @ Rotation.from_quat(motion.q[:, 3:7]).as_matrix()
    turns = np.unwrap(Rotation.from_matrix(turned).as_euler("ZXY"), axis=0)
    root = [f"{body.segments[0]}_{word}" for word in (*ROOT_ROTATIONS, *ROOT_TRANSLATIONS)]
    return TimeTable(body.name, (*root, *names), motion.time, np.hstack([turns, motion.q[:, :3] @ UPRIGHT, angles]))

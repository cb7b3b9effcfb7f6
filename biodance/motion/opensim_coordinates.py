"""A motion as the coordinates of the .osim that ``body.export`` writes: the table of its .mot file."""

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.body.body import UPRIGHT, Body
from biodance.body.export.osim import ROOT_ROTATIONS, ROOT_TRANSLATIONS
from biodance.lab.mot import Table
from biodance.records import Motion


def opensim_coordinates(body: Body, motion: Motion) -> Table:
    """Return the coordinates of ``motion`` (T frames) by name: rad and m, root in OpenSim's ground (y up), joints as in ``body``."""
    names = [joint.name for joint in body.joints]
    angles = motion.q[:, body.nq - len(names) :]
    if not body.n_root:
        return Table(body.name, tuple(names), motion.time, angles)
    turned = UPRIGHT.T @ Rotation.from_quat(motion.q[:, 3:7]).as_matrix()
    turns = np.unwrap(Rotation.from_matrix(turned).as_euler("ZXY"), axis=0)
    root = [f"{body.segments[0]}_{word}" for word in (*ROOT_ROTATIONS, *ROOT_TRANSLATIONS)]
    return Table(body.name, (*root, *names), motion.time, np.hstack([turns, motion.q[:, :3] @ UPRIGHT, angles]))

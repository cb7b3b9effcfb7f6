"""A trial on one plate whose force and point of application are given in closed form."""

from pathlib import Path

import numpy as np

from biodance.records import Markers, Plate, Source, Trial, Wrench

TIME = np.arange(0.0, 2.0, 0.001)
CORNERS = np.array([[0.7, 0.5, 0.0], [0.1, 0.5, 0.0], [0.1, -0.1, 0.0], [0.7, -0.1, 0.0]])
CENTRE = CORNERS.mean(axis=0)
SWING = np.sin(2 * np.pi * 0.7 * TIME)
FORCE = np.stack([30 * SWING, -20 * SWING, 650 + 60 * SWING], axis=1)
POINT = CENTRE + np.stack([0.1 + 0.04 * SWING, -0.05 + 0.02 * SWING, 0 * SWING], axis=1)


def trial(force=FORCE, point=POINT, corners=CORNERS) -> Trial:
    """Return a trial in which ``force`` (T, 3) N acts at ``point`` (T, 3) m."""
    wrench = Wrench(TIME, np.hstack([force, np.cross(point, force)]))
    feet = Markers(("LHEE",), TIME[::10], np.tile([0.4, 0.2, 0.05], (TIME[::10].size, 1, 1)))
    source = Source(Path("t.c3d"), "", "C3D", 100.0, 1000.0)
    return Trial("t", "fit", feet, (Plate("plate1", 2, corners, wrench),), source)

"""A force plate is turned against what the laboratory's file says.

Signature: forces and moments turned about one axis: for yaw, Fx follows -Fy and Mx follows -My; for pitch and roll, Fx
or Fy follows Fz. Look-alikes: pitch and roll look like cross-talk from Fz and like a tilted laboratory; yaw has none.
Separated by lunges, arm swings and the plate's corners measured with markers.
"""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter, axis_vector, plate_axis_targets
from biodance.records import Array
from biodance.spatial import axis_rotation, wrench_about_origin


class PlateRotation(Effect):
    """An ``angle`` (rad) about a lab axis through the plate's centre by which the recorded wrench is turned; target
    ``plate1:z`` for yaw.
    """

    name = "plate_rotation"
    by_load = True
    prior = 0.02
    parameters = (
        Parameter(
            "angle", "rad", 0.02, "about 0.2 deg in a CalTester example report; 1 deg and more when corners are typed"
        ),
    )
    separated_by = "Lunges and arm swings in two directions; a pole pressed at a slant."
    advice = "Measure the plate's corners with markers and enter them again."

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return every axis of every plate."""
        return plate_axis_targets(case)

    def transform(self, case: Case, theta: Array) -> Case:
        """Return the case whose plate wrench is turned by ``theta``: exact for any angle."""
        plate = self.plate_of(case)
        turn = axis_rotation(axis_vector(self.target), np.atleast_1d(theta))[0]
        local = case.predicted_on(plate)
        turned = np.concatenate([local[:, :3] @ turn.T, local[:, 3:] @ turn.T], axis=1)
        return case.with_added(plate, wrench_about_origin(turned - local, plate.centre))


EFFECT = PlateRotation

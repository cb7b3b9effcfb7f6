"""A force plate is turned against what the laboratory's file says."""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Parameter
from biodance.effects._base.installed_plate import InstalledPlate
from biodance.effects._base.words import MEASURE_CORNERS, About, CauseWords, CheckKind
from biodance.lab.plates.faults import ROTATION
from biodance.records import Array


class PlateRotation(InstalledPlate):
    """An ``angle`` (rad) about a lab axis through the plate's centre by which the recorded wrench is turned; target
    ``plate1:z`` for yaw.
    """

    name = "plate_rotation"
    fault = ROTATION
    by_load = True
    prior = 0.02
    parameters = (
        Parameter(
            "angle",
            "rad",
            0.02,
            "about 0.2 deg in a CalTester example report; 1 deg and more when corners are typed",
            # rad that matters: laboratories that check have 2 to 5 mm and 0.2 degrees (Collins
            # 2009, doi:10.1016/j.gaitpost.2008.10.060).
            least=0.005,
            usual=0.03,
            alike=0.01,
        ),
    )
    separated_by = "Lunges and arm swings in two directions; a pole pressed at a slant."
    advice = "Measure the plate's corners with markers and enter them again."
    about = About(
        what="A force plate is turned against what the laboratory's file says.",
        signature=(
            "Forces and moments turned about one axis: for yaw, Fx follows -Fy and Mx follows -My; for pitch and "
            "roll, Fx or Fy follows Fz."
        ),
        look_alikes="Pitch and roll look like cross-talk from Fz and like a tilted laboratory; yaw has none.",
        settled_by="Lunges, arm swings and the plate's corners measured with markers.",
    )
    words = CauseWords("{plate} is turned {size}{between} about {axis}", MEASURE_CORNERS, "a turned plate")
    explains = (CheckKind.PRESSURE, CheckKind.FORCES)

    def transform(self, case: Case, theta: Array) -> Case:
        """Return the case whose plate wrench is turned by ``theta``: exact for any angle."""
        turned = self.fault.mixing(self.place, float(np.ravel(theta)[0])) - np.eye(6)
        return case.with_added(self.plate_of(case), self._added(case, turned))


EFFECT = PlateRotation

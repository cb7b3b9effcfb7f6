"""Newton: the force of all plates against m (g + a) of the trunk: when it comes, and what it weighs.

The markers of pelvis and trunk go nearly as the centre of mass does. What they say of clock and weight needs no foot
whole on a plate, no step and no posture; a chair that carries along lowers the correlation, and then nothing is said.
"""

import math

import numpy as np

from biodance.effects.body_mass import BodyMass
from biodance.effects.plate_gain import PlateGain
from biodance.effects.plate_offset import PlateOffset
from biodance.effects.time_delay import TimeDelay
from biodance.motion.newton import LagAndMass, slopes_of
from biodance.observations import Observation, Observer, SeenTrial
from biodance.observations._causes import Sensitivity
from biodance.observations.stride_force import StrideForce
from biodance.records import Array

_LABORATORY = 0.003
"""s: sd of what this lag differs by from that of the whole body's forces in one laboratory and movement: root mean
square 2.5 ms in seven real sessions. The clocks of laboratories differ by twice as much (`time_delay`)."""
_TRIAL = 0.002
"""s: sd of one trial beside what the trial tells of itself: 18 walks of one laboratory scatter by 2.5 ms."""
_PERSON = 0.005
"""Share of the mass: sd of one person's weight between two movements (belt at two speeds 0.35 %, standing and
walking)."""


class Newton(Observer):
    """Lag (s) of the total vertical force behind the trunk, and the mass (kg) that it weighs."""

    name = "newton"
    responds_to = (TimeDelay.name, BodyMass.name, PlateGain.name, PlateOffset.name)
    needs = "Movement up and down with both feet on the plates (walking, squats); markers of pelvis or trunk, and feet."
    source = "Newton's second law; 13 public laboratories"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return one lag and one mass of a trial whose force goes with the trunk. Where somebody stands still, or whole
        steps weigh, the mass adds nothing: others weigh by the same force.
        """
        told, trial = seen.newton, seen.trial.name
        if told is None:
            return ()
        slopes, found = _slopes(seen, told), []
        if math.isfinite(told.lag):
            sd, norms = math.hypot(told.lag_sd, _TRIAL), {"laboratory newton lag": _LABORATORY}
            responds = Sensitivity(slopes[0], delay=1.0)
            found.append(
                Observation(
                    self.name, "all plates, lag", trial, told.lag, sd, 0.0, "s", norms=norms, sensitivity=responds
                )
            )
        if math.isfinite(told.mass) and seen.mass > 0:
            norms = {"person declared mass": seen.mass_doubt, "person weighs by newton": _PERSON * seen.mass}
            counts = not seen.still and not any(one.unit == "kg" for one in StrideForce().observe(seen))
            found.append(
                Observation(
                    self.name, "all plates, mass", trial, told.mass, told.mass_sd, seen.mass, "kg", norms=norms,
                    counts=counts, sensitivity=Sensitivity(slopes[1], mass=1.0),
                )
            )  # fmt: skip
        return tuple(found)


def _slopes(seen: SeenTrial, told: LagAndMass) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return by plate the derivatives (6, 7) of the lag and of the mass with respect to B."""
    assert seen.trunk is not None
    lags, masses = {}, {}
    for plate in seen.trial.plates:
        # Only the vertical force, row 2 of B, enters.
        lags[plate.name], masses[plate.name] = np.zeros((2, 6, 7))
        changes = np.column_stack([plate.wrench.value, np.ones(plate.wrench.time.size)])
        lags[plate.name][2], masses[plate.name][2] = slopes_of(
            seen.trunk, told, seen.total, changes, gravity=seen.trial.settings.gravity
        )
    return lags, masses


OBSERVER = Newton

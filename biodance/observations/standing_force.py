"""What the plates weigh and push while somebody stands still: the mass, and no horizontal force at all."""

import numpy as np

from biodance.body.tables.error_sizes import error_size
from biodance.effects.body_mass import BodyMass
from biodance.effects.lab_tilt import LabTilt
from biodance.effects.plate_crosstalk import PlateCrosstalk
from biodance.effects.plate_gain import PlateGain
from biodance.effects.plate_offset import PlateOffset
from biodance.effects.plate_rotation import PlateRotation
from biodance.observations import Observation, Observer, SeenTrial
from biodance.observations._causes import Sensitivity, of_mean
from biodance.observations._recording import ONSET
from biodance.records import Array, Plate

_ON_PLATES = (0.75, 1.35)
"""Share of the declared mass between which somebody stands on the plates with both feet and in the right unit."""
_MASS, _SWAY = 0.002, 0.0015
"""sd as a share of the weight: of the mass, of the mean horizontal force (sway)."""
_SHORTEST = 0.4
"""s of standing."""


class StandingForce(Observer):
    """Mass (kg) by the mean vertical force in quiet standing, and the mean horizontal forces (N), in which no zero can
    be told from a plate that is not level.
    """

    name = "standing_force"
    responds_to = (BodyMass.name, PlateGain.name, PlateOffset.name)
    needs = "Standing still with both feet wholly on the plates."
    source = "Newton: who stands still is not accelerated; 9 static trials of 3 public laboratories"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return one mass and two horizontal forces of a trial in which somebody stands still."""
        plates = [p for p in seen.trial.plates if p.wrench.time.size and p.wrench.force[:, 2].mean() > ONSET]
        if not plates or not seen.still or not seen.whole or not seen.mass > 0:
            return ()
        total, weight = seen.total, seen.mass * seen.trial.settings.gravity
        force = mean_force(total.force)
        if total.time.size < _SHORTEST * total.rate or not _ON_PLATES[0] < force[2] / weight < _ON_PLATES[1]:
            return ()
        where = plates[0].name if len(plates) == 1 else ""
        mass = force[2] / seen.trial.settings.gravity
        norms, trial = {"person declared mass": seen.mass_doubt}, seen.trial.name
        g = seen.trial.settings.gravity
        # dm = dFz / g.
        weighs = Sensitivity({p.name: of_mean(_known(p), 2) / g for p in seen.trial.plates}, mass=1.0)
        found = [
            Observation(
                self.name, "mass", trial, mass, _MASS * seen.mass, seen.mass, "kg", where, norms, sensitivity=weighs
            )
        ]
        # The mean over T seconds scatters with 1 / sqrt(T), as independent seconds do.
        sd = _SWAY * weight / max(1.0, (total.time[-1] - total.time[0])) ** 0.5
        for axis, channel in enumerate(("Fx", "Fy")):
            value, own = float(force[axis]), {f"plate level along {'xy'[axis]}": _level(axis) * weight}
            pushes = Sensitivity({p.name: of_mean(_known(p), axis) for p in seen.trial.plates})
            found.append(
                Observation(
                    self.name, f"mean {channel}", trial, value, max(sd, 0.5), 0.0, "N", where, own, sensitivity=pushes
                )
            )
        return tuple(found)


def _level(axis: int) -> float:
    """Return the share of the weight (one sd) that leaning and cross-talk put into a horizontal channel everywhere."""
    about, channel = "yx"[axis], ("Fx", "Fy")[axis]
    lean = error_size(LabTilt.name, about), error_size(PlateRotation.name, about)
    return float(np.linalg.norm([*lean, error_size(PlateCrosstalk.name, f"Fz->{channel}")]))


def _known(plate: Plate) -> Array:
    """Return the wrench (n, 6) of a plate at the samples that are known."""
    return plate.wrench.value[np.isfinite(plate.wrench.value).all(axis=1)]


def mean_force(force: Array) -> Array:
    """Return the mean (3,) N of forces (S, 3) N, NaN samples left out."""
    mean = force.mean(axis=0)
    return np.asarray(mean if np.isfinite(mean).all() else np.nanmean(force, axis=0))


OBSERVER = StandingForce

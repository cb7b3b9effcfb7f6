"""Whether the centre of pressure lies inside the foot that stands there, all of stance."""

import numpy as np

from biodance.effects.axis_error import AxisError
from biodance.effects.plate_position import PlatePosition
from biodance.motion.soles import distance_to_hull
from biodance.observations import FootStep, Observation, Observer, SeenTrial
from biodance.observations._causes import Sensitivity, by_plate, pressure_gradient
from biodance.records import Array

_STEADY = (0.1, 0.9)
"""Shares of stance between which the pressure must lie under the foot."""
_OWN = 0.004
"""m: the outline is drawn from two markers."""
_NEAR = 1e-5
"""m: step by which the direction away from a sole is found."""


class FootOutline(Observer):
    """Median distance (m) of the centre of pressure outside the sole that stands there; 0 inside."""

    name = "foot_outline"
    responds_to = (PlatePosition.name, AxisError.name)
    needs = "A step with one whole foot on one plate; heel and toe markers."
    source = "Pressure cannot act where nothing touches; soles by Winter 2009 and ANSUR II 2012."

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return one observation of each step; it is shown only: the place in the foot counts already."""
        found = [self._of_step(seen, step) for step in seen.steps]
        return tuple(one for one in found if one is not None)

    def _of_step(self, seen: SeenTrial, step: FootStep) -> Observation | None:
        part = seen.stance(step)
        if part is None:
            return None
        count, plate = part.stop - part.start, seen.plate(step.plate)
        first, last = (part.start + share * count for share in _STEADY)
        span = np.unique(np.linspace(first, last, 25).astype(int))
        sole = seen.foot(step.side).outline(plate.wrench.time[span])
        plates = seen.under(step, span)
        wrench = sum(plates.values(), np.zeros((span.size, 6)))
        cop = seen.pressure(step, wrench)
        known = np.isfinite(sole).all(axis=(1, 2)) & np.isfinite(cop).all(axis=1)
        if known.sum() < 5:
            return None
        distance = distance_to_hull(cop[known], sole[known])
        # The one or two samples in the middle are the median; an odd number counts its own twice, hence the half.
        median = np.argsort(distance)[[(distance.size - 1) // 2, distance.size // 2]]
        at = np.flatnonzero(known)[median]
        gradient = pressure_gradient(wrench[at], _away(cop[at], sole[at]), plate.height) / 2
        responds = Sensitivity(by_plate(gradient, {name: one[at] for name, one in plates.items()}), linear=False)
        return Observation(
            self.name, step.name, seen.trial.name, float(np.median(distance)), _OWN, 0.0, "m", step.plate, counts=False,
            sensitivity=responds,
        )  # fmt: skip


def _away(point: Array, sole: Array) -> Array:
    """Return the direction (n, 2) in which the distance of points (n, 2) m from soles (n, P, 2) m grows; 0 inside."""
    # Central differences along x and y.
    sides = [distance_to_hull(point + size * axis, sole) for axis in np.eye(2) for size in (-_NEAR, _NEAR)]
    slope = np.stack([sides[1] - sides[0], sides[3] - sides[2]], axis=1) / (2 * _NEAR)
    return np.asarray(np.where(distance_to_hull(point, sole)[:, None] > 0, slope, 0.0))


OBSERVER = FootOutline

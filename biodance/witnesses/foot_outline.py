"""Whether the centre of pressure lies inside the foot that stands there, all of stance."""

import numpy as np

from biodance.effects.axis_error import AxisError
from biodance.effects.plate_position import PlatePosition
from biodance.motion.contact.over import distance_to_hull
from biodance.witnesses import FootStep, Observation, SeenTrial, Witness
from biodance.witnesses._stance import by_step

_STEADY = (0.1, 0.9)
"""Shares of stance between which the pressure must lie under the foot."""
_OWN = 0.004
"""m: the outline is drawn from two markers."""


class FootOutline(Witness):
    """Median distance (m) of the centre of pressure outside the sole that stands there; 0 inside."""

    name = "foot_outline"
    sees = (PlatePosition.name, AxisError.name)
    needs = "A step with one whole foot on one plate; heel and toe markers."
    source = "Pressure cannot act where nothing touches; soles by Winter 2009 and ANSUR II 2012."

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return one observation of each step; it is shown only: the place in the foot counts already."""
        found = [self._of_step(seen, step) for step in seen.steps]
        return tuple(one for one in found if one is not None)

    @by_step
    def _of_step(self, seen: SeenTrial, step: FootStep) -> Observation | None:
        part = seen.stance(step)
        if part is None:
            return None
        count, plate = part.stop - part.start, seen.plate(step.plate)
        first, last = (part.start + share * count for share in _STEADY)
        span = np.unique(np.linspace(first, last, 25).astype(int))
        sole = seen.foot(step.side).outline(plate.wrench.time[span])
        cop = seen.pressure(step, span)
        known = np.isfinite(sole).all(axis=(1, 2)) & np.isfinite(cop).all(axis=1)
        if known.sum() < 5:
            return None
        value = float(np.median(distance_to_hull(cop[known], sole[known])))
        return Observation(self.name, step.name, seen.trial.name, value, _OWN, 0.0, "m", step.plate, counts=False)


WITNESS = FootOutline

"""Plate against plate: the load goes over from one plate to the next in double support, and the sum stays smooth.

Each plate weighs the same person while one foot stands alone on it: the two masses differ by the difference of the
plates' gains, whatever the person weighs.
"""

from biodance.effects.plate_gain import PlateGain
from biodance.observations import Observation, Observer, SeenTrial
from biodance.observations.stride_force import StrideForce

_OWN = 0.02
"""Share of the mass: sd of one difference."""


class DoubleSupport(Observer):
    """Mass (kg) by one plate less that by the next one, each under one foot alone, in two steps with double support
    between.
    """

    name = "double_support"
    responds_to = (PlateGain.name,)
    needs = "Two steps one after the other on two plates; pelvis markers."
    source = "20 pairs of steps of 9 persons of public laboratories"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return one observation of each pair; it is shown only: each foot alone counts already."""
        alone = {
            one.what.removesuffix(", alone"): one for one in StrideForce().observe(seen) if one.what.endswith("alone")
        }
        found = []
        for first, last in zip(seen.steps, seen.steps[1:], strict=False):
            before, after = alone.get(first.name), alone.get(last.name)
            if first.plate == last.plate or before is None or after is None:
                continue
            what = f"{first.plate} less {last.plate} from {first.middle:.2f} s"
            value, sd = before.value - after.value, _OWN * seen.mass
            found.append(
                Observation(
                    self.name, what, seen.trial.name, value, sd, 0.0, "kg", counts=False,
                    sensitivity=before.sensitivity - after.sensitivity,
                )
            )  # fmt: skip
        return tuple(found)


OBSERVER = DoubleSupport

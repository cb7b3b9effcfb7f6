"""Left against right: the pressure's path in one foot mirrors the other's, wherever the laboratory puts its markers."""

from biodance.effects.plate_position import PlatePosition
from biodance.observations import Observation, Observer, SeenTrial
from biodance.observations._stance import step_course

_OWN = 0.009
"""m: right less left foot of one visit."""


class Sides(Observer):
    """Centre of pressure outwards in the right foot less that in the left one, m, in each pair of steps."""

    name = "sides"
    responds_to = (PlatePosition.name,)
    needs = "A step of each foot, each alone on a plate; heel and toe markers."
    source = "6.7 mm between visits of adults, 18 pairs of steps of 9 persons of public laboratories"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return one observation of each pair of neighbours; it is shown only: both feet count already."""
        found = []
        for first, last in zip(seen.steps, seen.steps[1:], strict=False):
            sides = {step.side: step_course(seen, step) for step in (first, last)}
            right, left = sides.get("right"), sides.get("left")
            if right is None or left is None:
                continue
            (one, responds), (other, too) = (side.place(1, 0.1, 0.6) for side in (right, left))
            what = f"right less left foot, {first.plate} and {last.plate} from {first.middle:.2f} s"
            found.append(
                Observation(
                    self.name, what, seen.trial.name, one - other, _OWN, 0.0, "m", counts=False,
                    sensitivity=responds - too,
                )
            )  # fmt: skip
        return tuple(found)


OBSERVER = Sides

"""What a plate reads while nobody is on it: the zero that was taken off, and what is left before and after the step.

An empty plate is the only recording whose wrench is known exactly. What it reads was taken off by the reader; it is
told all the same, because a trial in which the plate is never empty keeps it.
"""

import numpy as np

from biodance.effects.plate_drift import PlateDrift
from biodance.effects.plate_offset import PlateOffset
from biodance.observations import Observation, Observer, SeenTrial
from biodance.observations._causes import Sensitivity, of_mean, was_zeroed
from biodance.observations._recording import ONSET
from biodance.records import CHANNELS, Plate

_SETTLES = 0.15
"""s after the step in which a plate still rings."""
_SHORTEST = 0.2
"""s of an empty plate that say its level."""
_OWN = 0.3
"""N: how exactly the level of an empty plate is known: noise, and neighbours that tremble."""


class EmptyPlate(Observer):
    """Force (N) that the empty plate read and that was taken off, and its change from before to after the steps."""

    name = "empty_plate"
    responds_to = (PlateOffset.name, PlateDrift.name)
    needs = "A trial that begins or ends with nobody on the plate."
    source = "An empty plate reads zero; 35 empty plates of 8 public laboratories were zeroed to 0-6 N (horizontal)."

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return three zeros of every plate that has one, and three changes of every plate seen before and after."""
        plates = [plate for plate in seen.trial.plates if plate.wrench.time.size > 1]
        return tuple(one for plate in plates for one in (*self._zero(seen, plate), *self._change(seen, plate)))

    def _zero(self, seen: SeenTrial, plate: Plate) -> list[Observation]:
        if not was_zeroed(plate):
            return []
        return [
            Observation(
                self.name, f"{plate.name} {name}, taken off", seen.trial.name, float(size), _OWN, 0.0, "N", plate.name,
                sensitivity=Sensitivity(zero={plate.name: np.eye(3)[k]}),
            )
            for k, (name, size) in enumerate(zip(CHANNELS[:3], plate.zero, strict=True))
        ]  # fmt: skip

    def _change(self, seen: SeenTrial, plate: Plate) -> list[Observation]:
        wrench = plate.wrench
        loaded = np.flatnonzero(np.abs(wrench.force[:, 2]) > ONSET)
        margin, least = round(_SETTLES * wrench.rate), max(1, round(_SHORTEST * wrench.rate))
        if not loaded.size:
            return []
        before, after = slice(0, max(0, loaded[0] - margin)), slice(loaded[-1] + margin, wrench.time.size)
        if before.stop < least or after.stop - after.start < least:
            return []
        value = wrench.force[after].mean(axis=0) - wrench.force[before].mean(axis=0)
        moved = [of_mean(wrench.value[after], k) - of_mean(wrench.value[before], k) for k in range(3)]
        return [
            Observation(
                self.name, f"{plate.name} {name}, after less before", seen.trial.name, float(size), 1.0, 0.0, "N",
                plate.name, counts=False, sensitivity=Sensitivity({plate.name: moves}),
            )
            for name, size, moves in zip(CHANNELS[:3], value, moved, strict=True)
        ]  # fmt: skip


OBSERVER = EmptyPlate

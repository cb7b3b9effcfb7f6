"""A cause in an installed plate whose formula is that of `lab.plates.faults`: what it adds to the predicted wrench."""

from abc import ABC
from typing import ClassVar

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Care, Effect
from biodance.lab.plates.faults import PlateFault
from biodance.records import Array
from biodance.spatial import wrench_about_origin


class InstalledPlate(Effect, ABC):
    """A plate that reads ``fault.mixing`` times what is there; the author writes the ``fault``."""

    care = Care.PLATES
    fault: ClassVar[PlateFault]

    @property
    def place(self) -> str:
        """Where on the plate it is: channel, pair or axis."""
        return self.target.rpartition(":")[2]

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return every place of every plate; without the plate's name where there is one plate with channels."""
        plates, axes = case.trial.plates, "x" in cls.fault.places
        prefixes = [""] if len(plates) == 1 and not axes else [f"{plate.name}:" for plate in plates]
        return tuple(f"{prefix}{place}" for prefix in prefixes for place in cls.fault.places)

    def columns(self, case: Case) -> Array:
        """Return what a small fault adds to the predicted wrench on its plate, per unit, moved to the lab origin."""
        return self._added(case, self.fault.slope(self.place))[:, :, None]

    def _added(self, case: Case, mixing: Array) -> Array:
        """Return (T, 6) about the lab origin: ``mixing`` (6, 6) times what is predicted on the plate."""
        plate = self.plate_of(case)
        return np.asarray(wrench_about_origin(case.predicted_on(plate) @ mixing.T, plate.centre))

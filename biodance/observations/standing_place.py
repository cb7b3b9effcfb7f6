"""The centre of pressure under the body in quiet standing.

Who stands still has the centre of mass over the centre of pressure. Without a body the middle between the front and
the back of the pelvis stands for it: from side to side within some millimetres, ahead within a centimetre or two.
"""

import numpy as np

from biodance.effects.plate_crosstalk import PlateCrosstalk
from biodance.effects.plate_position import PlatePosition
from biodance.observations import Observation, Observer, SeenTrial
from biodance.observations._causes import Sensitivity, by_plate, pressure_gradient
from biodance.observations.standing_force import mean_force

_ASIDE, _AHEAD = (0.0, 0.006, 0.003), (0.02, 0.015, 0.030)
"""m: expected place, sd of one person, sd of one laboratory (shoes, posture asked for, where the pelvis markers sit):
pressure to the left of the pelvis's middle; ahead of it."""
_OWN = 0.003
"""m: sway in a short trial."""
_REACH = 0.30
"""m: no pressure lies farther from the pelvis of who stands still. One that does is of plates that are not where the
file says at all (exchanged, for example): of these no shift is told, along one axis as little as along the other.
"""


class StandingPlace(Observer):
    """Centre of pressure to the left of the middle of the pelvis, and ahead of it, in quiet standing, m."""

    name = "standing_place"
    responds_to = (PlatePosition.name, PlateCrosstalk.name)
    needs = "Standing still with both feet wholly on the plates; pelvis and foot markers."
    source = (
        "8 static trials of 2 public laboratories, 4 of a simulated one; Winter 1995, doi:10.1016/0966-6362(96)82849-9"
    )

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return two observations of a trial in which somebody stands still on the plates."""
        trial = seen.trial
        plates = [plate for plate in trial.plates if plate.wrench.time.size]
        if not plates or not seen.still or not seen.whole or seen.pelvis is None or not seen.feet:
            return ()
        force = mean_force(seen.total.force)[2]
        # Both feet point this way on average, each in the median over the trial.
        ahead = np.mean([np.nanmedian(foot.front - foot.heel, axis=0)[:2] for foot in seen.feet], axis=0)
        length = float(np.linalg.norm(ahead))
        if not force > 0.75 * seen.mass * trial.settings.gravity or not length > 0.05:
            return ()
        ahead = ahead / length
        height = float(np.mean([plate.height for plate in plates]))
        pressure = seen.total.cop(height=height)[:, :2]
        known = np.isfinite(pressure).all(axis=1)
        # What stands still is over its centre of pressure on average.
        away = np.nanmean(pressure, axis=0) - np.nanmean(seen.pelvis[:, :2], axis=0)
        if not np.linalg.norm(away) <= _REACH:
            return ()
        loaded = [plate.name for plate in plates if plate.wrench.force[:, 2].mean() > 0.05 * force]
        where = loaded[0] if len(loaded) == 1 else ""
        axes = {"to the left": (np.array([-ahead[1], ahead[0]]), _ASIDE), "ahead": (ahead, _AHEAD)}
        total, each = seen.total.value[known], {plate.name: plate.wrench.value[known] for plate in plates}
        rows = {
            what: pressure_gradient(total, np.tile(axis, (len(total), 1)), height) / len(total)
            for what, (axis, _) in axes.items()
        }
        return tuple(
            Observation(
                self.name, f"pressure {what} of the pelvis", trial.name, float(away @ axis), _OWN, expected, "m", where,
                {f"person stands {what}": person, f"laboratory stands {what}": laboratory},
                sensitivity=Sensitivity(by_plate(rows[what], each), linear=False),
            )
            for what, (axis, (expected, person, laboratory)) in axes.items()
        )  # fmt: skip


OBSERVER = StandingPlace

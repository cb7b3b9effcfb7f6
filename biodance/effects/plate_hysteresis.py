"""A force plate does not forget: after loading it reads less than after unloading to the same load."""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import ChannelEffect, Parameter
from biodance.effects._base.words import ACCEPT, About, CauseWords
from biodance.records import Array
from biodance.spatial import wrench_about_point

REVERSAL = np.array([5.0, 5.0, 20.0, 5.0, 5.0, 2.0])
"""N, N·m by which a channel must turn back until the loop is crossed (to 63 %)."""
_WIDEST = 0.02
"""Share of the largest load of its channel that a loop can be wide: four times the worst of makers' sheets."""
_LEAST = {"N": 1.0, "N·m": 0.3}
"""N, N·m that matter: what is left in one band and alarms nobody (`consequence.LEAST_FORCE`)."""


class PlateHysteresis(ChannelEffect):
    """A loop of half ``width`` (N or N·m) in channel ``target`` about the plate's centre: read low on the way up,
    high on the way down.
    """

    name = "plate_hysteresis"
    by_load = True
    parameters = (
        Parameter(
            "width", "N or N·m", 3.0, "0.2-0.5 % of full scale in makers' sheets of strain-gauge plates", least=_LEAST
        ),
    )
    separated_by = "Weights put on and taken off one after the other, or slow squats with holds on the way down and up."
    advice = "Load and unload the plate with dead weights; look for a loose top plate, cable or screw."
    about = About(
        what=(
            "A force plate does not forget: after loading it reads less than after unloading to the same load "
            "(friction, glue, a loose top plate)."
        ),
        signature=(
            "A step of the residual in one channel wherever that channel turns round, of the same size for small and "
            "large turns."
        ),
        look_alikes="A delay (whose residual follows the speed of change), drift, a gain.",
        settled_by="Loading and unloading in steps with the person standing still between them.",
    )
    words = CauseWords(
        "{it} comes back late after a load, by {size}{between}", f"Have the plate repaired{ACCEPT}", "a slow plate"
    )

    def in_channel(self, case: Case) -> Array:
        """Return minus the memory of the channel."""
        return -memory(self._load(case), REVERSAL[self.channel])

    def possible_in(self, case: Case, theta: Array) -> bool:
        """Return whether the loop turns the way of friction and is no wider than such a load makes it."""
        return bool(0 < theta[0] <= _WIDEST * np.abs(self._load(case)).max())

    def _load(self, case: Case) -> Array:
        """Return what the channel (T,) read about the plate's centre: no prediction has one plate's part of it."""
        plate = self.plate_of(case)
        return wrench_about_point(plate.wrench.value, plate.centre)[:, self.channel]


def memory(load: Array, reversal: float) -> Array:
    """Return the state (T,) from -1 (unloading) to 1 (loading) of a friction element: ds/dload = (+-1 - s) / reversal
    (Dahl 1968).

    It starts in the middle of the loop; exact for a load (T,) that is monotonic between samples.
    """
    step = np.diff(load)
    # Relaxation towards +-1 over the distance that the load moves: exact where it is monotonic.
    way, stay = np.sign(step), np.exp(-np.abs(step) / reversal)
    state = np.zeros(load.size)
    for k in range(step.size):
        state[k + 1] = way[k] + (state[k] - way[k]) * stay[k]
    return state


EFFECT = PlateHysteresis

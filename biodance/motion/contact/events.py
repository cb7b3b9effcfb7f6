"""When a foot comes down on the plates and when it leaves them."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from biodance.motion.contact.contact import Contact
from biodance.records import SIDES, Wrench, runs

_THRESHOLD = 20.0
"""N of vertical force from which a foot counts as down (Zeni et al. 2008, doi:10.1016/j.gaitpost.2007.07.007, use
the same).
"""
_SHORTEST = 0.05
"""s: a shorter contact, or a shorter time without, is noise."""


@dataclass(frozen=True)
class FootEvent:
    """``time`` s on the clock of the trial; ``side`` "right" or "left"; ``down`` True where the foot comes down,
    False where it leaves; ``source`` "force" where a plate saw it, "markers" where the movement of the feet tells it.
    """

    time: float
    side: str
    down: bool
    source: Literal["force", "markers"] = "force"


def foot_events(feet: tuple[Wrench, Wrench], contact: Contact) -> tuple[FootEvent, ...]:
    """Return when each foot came down on a plate or left it, in the order of time.

    ``feet`` the wrenches on the right and the left foot. An event is where the vertical force passes `THRESHOLD`,
    between two frames in which the plates tell what the ground does to this foot and the other one is not over the same
    plate: a force that two feet share tells nothing of one.
    """
    found = []
    for foot, wrench in enumerate(feet):
        shared = (contact.on_plate[:, foot] & contact.on_plate[:, 1 - foot]).any(axis=1)
        sure, force = contact.told[:, foot] & ~shared, wrench.force[:, 2]
        shortest = _SHORTEST * wrench.rate
        loaded = _without_short(np.nan_to_num(force) > _THRESHOLD, shortest)
        for i in np.flatnonzero(loaded[1:] != loaded[:-1]) if loaded.size > 1 else ():
            if not (sure[i] and sure[i + 1]):
                continue
            share = (_THRESHOLD - force[i]) / (force[i + 1] - force[i])
            time = wrench.time[i] + np.clip(share, 0, 1) * (wrench.time[i + 1] - wrench.time[i])
            found.append(FootEvent(float(time), SIDES[foot], bool(loaded[i + 1])))
    return tuple(sorted(found, key=lambda event: event.time))


def _without_short(
    loaded: "np.ndarray[tuple[int], np.dtype[np.bool_]]", shortest: float
) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    """Return ``loaded`` (T,) without gaps and without contacts shorter than ``shortest`` frames; the ends of the
    trial stay.
    """
    kept = loaded.copy()
    for value in (False, True):
        for start, stop in runs(kept == value):
            if stop - start < shortest and start > 0 and stop < len(kept):
                kept[start:stop] = not value
    return kept

"""Why seconds of a trial are not judged: one reason for every gate that takes frames out."""

from collections.abc import Mapping
from enum import StrEnum

import numpy as np

from biodance.records.arrays import Mask


class LeftOut(StrEnum):
    """A reason for which frames are not compared with a body, in the order in which the gates are asked: a frame counts
    at the first that takes it out.
    """

    CARRIED_ELSEWHERE = "carried_elsewhere"
    """A chair, a rail or a hand carries a part of the person."""
    NO_LOAD = "no_load"
    """No plate is loaded, and nobody flies."""
    FORCE_UNKNOWN = "force_unknown"
    """A plate's force is not known."""
    FOOT_UNSEEN = "foot_unseen"
    """A foot was not seen."""
    FOOT_BESIDE = "foot_beside"
    """A foot may touch the ground beside the plates, or stand partly beside one."""
    NO_FOOT_ON_PLATE = "no_foot_on_plate"
    """A plate is loaded though no foot is over it."""
    SILENT_PLATE = "silent_plate"
    """A foot rests on a plate that reads nothing."""
    POSTURE_OPEN = "posture_open"
    """The markers do not fix the posture."""
    FORCES_DIFFER = "forces_differ"
    """Plates and motion differ by more than a wrong body or soft tissue can make of this movement."""
    SHORT_RUN = "short_run"
    """What is left without a break is too short to tell of slow errors."""


def seconds_left_out(reasons: Mapping[LeftOut, Mask], rate: float) -> dict[LeftOut, float]:
    """Return how many seconds each of the ``reasons`` (T,) takes out at ``rate`` Hz, in the order of `LeftOut`: a frame
    counts once, at the first; without reasons that take out nothing.
    """
    found: dict[LeftOut, float] = {}
    before: Mask | None = None
    for reason in (one for one in LeftOut if one in reasons):
        here = reasons[reason]
        new = here if before is None else here & np.logical_not(before)
        before = here if before is None else here | before
        if new.any():
            found[reason] = float(new.sum() / rate)
    return found

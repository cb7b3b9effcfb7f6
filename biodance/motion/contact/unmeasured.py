"""Why frames are not fully measured: each reason with the frames for which it holds."""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from biodance.motion.contact.footing import Footing
from biodance.motion.contact.support import carried_elsewhere, flight
from biodance.records import SIDES, LeftOut, Mask, Trial, runs

_EXPLAINED = 0.5
"""Share of its frames from which on feet beside the plates are all that the plates lack."""


class Unmeasured(NamedTuple):
    """The ``frames`` (T,) that are not fully measured for one ``reason``, which ``text`` says of one foot or plate."""

    reason: LeftOut
    text: str
    frames: Mask


def unmeasured_frames(
    trial: Trial, place: Footing, touching: Mask, rests: Mask, load: Mask, *, weight: float
) -> tuple[Unmeasured, ...]:
    """Return every reason why frames of a prepared trial are not fully measured.

    ``place`` the feet on plates; ``touching`` and ``rests`` (T, 2) of the feet; ``load`` (T, P) True where a plate is
    loaded; ``weight`` N of the body, NaN = unknown.
    """
    unloaded = ~load.any(axis=1) & ~flight(trial, touching, load)
    unknown: Mask = np.logical_not(np.isfinite(trial.wrench.value).all(axis=1))
    feet = tuple(one for foot in range(len(SIDES)) for one in _of_foot(place, touching, foot))
    elsewhere = carried_elsewhere(trial, weight=weight)
    beside = np.any([one.frames for one in feet], axis=0)
    for start, stop in runs(elsewhere):
        elsewhere[start:stop] &= beside[start:stop].mean() < _EXPLAINED
    lacks = "the plates carry too little for this movement: a chair or a hand carries the rest"
    return (
        Unmeasured(LeftOut.NO_LOAD, "no plate is loaded", unloaded & ~elsewhere),
        Unmeasured(LeftOut.FORCE_UNKNOWN, "a plate's force is unknown", unknown),
        *feet,
        *(one for index in range(len(trial.plates)) for one in _of_plate(trial, place, rests, load, index)),
        Unmeasured(LeftOut.CARRIED_ELSEWHERE, lacks, elsewhere),
    )


def _of_foot(place: Footing, touching: Mask, foot: int) -> tuple[Unmeasured, ...]:
    hidden, share, side = place.unseen[:, foot], place.share[:, foot], SIDES[foot]
    apart = touching[:, foot] & ~place.covered[:, foot] & ~hidden
    beside, partly = (
        f"the {side} foot may touch the ground beside the plates",
        f"the {side} foot may stand partly on a plate, partly beside it",
    )
    return (
        Unmeasured(LeftOut.FOOT_UNSEEN, f"the {side} foot was not seen", hidden),
        Unmeasured(LeftOut.FOOT_BESIDE, beside, apart & (share == 0)),
        Unmeasured(LeftOut.FOOT_BESIDE, partly, apart & (share > 0)),
    )


def _of_plate(trial: Trial, place: Footing, rests: Mask, load: Mask, index: int) -> tuple[Unmeasured, ...]:
    name, on, loaded = trial.plates[index].name, place.on_plate[:, :, index], load[:, index]
    alone = on & (place.on_plate.sum(axis=2) == 1) & rests & ~loaded[:, None]
    return (
        Unmeasured(LeftOut.NO_FOOT_ON_PLATE, f"{name} is loaded but no foot is over it", loaded & ~on.any(axis=1)),
        *(
            Unmeasured(LeftOut.SILENT_PLATE, f"the {side} foot rests on {name}, which reads nothing", alone[:, foot])
            for foot, side in enumerate(SIDES)
        ),
    )


def by_reason(found: Sequence[Unmeasured]) -> dict[LeftOut, Mask]:
    """Return the frames (T,) of every reason that holds somewhere."""
    masks: dict[LeftOut, Mask] = {}
    for one in found:
        if one.frames.any():
            masks[one.reason] = masks.get(one.reason, False) | one.frames
    return masks


def unmeasured_notes(measured: Mask, found: Sequence[Unmeasured]) -> tuple[str, ...]:
    """Return how many frames are ``measured`` (T,), and how many are not for every reason ``found``, in words."""
    counts = Counter({one.text: int(one.frames.sum()) for one in found if one.frames.any()})
    first = f"{int(measured.sum())} of {measured.size} frames are fully measured by the plates."
    return (first, *(f"Left out, {count} of {measured.size}: {text}." for text, count in counts.most_common()))

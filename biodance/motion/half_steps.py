"""Steps partly beside a plate whose place the file does not tell: the plate lacks what the floor beside it carries.

Where plates lie is not in force files of OpenSim. A foot is then taken to stand on the plate whose centre of pressure
is under it, and what reaches beyond the edge cannot be seen. But by Newton the ground carries weight (1 + a / g), with
a the acceleration of pelvis and trunk: while the same feet are down, plates that lack more of it than in the other
stances of the session do not measure all that the ground does.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from biodance.lab.markers.upright import is_still
from biodance.motion.contact import Contact, flight, share_lacking
from biodance.records import SIDES, LeftOut, LeftOutSpan, Mask, Trial, runs

_LONG = 0.15  # s, at least, for which the same feet are down before the mean of what is lacking is asked for
_MORE = 0.06
"""Share of the weight, beyond what the best stance of the session lacks, from which on a foot is partly beside. 53
whole steps of 15 people on plates of known place lack 0.018 +- 0.015 while one foot stands alone; ten whose foot
reaches beyond the edge 0.05 to 0.71.
"""
_LOADED = 0.05  # share of the weight from which on a plate carries somebody


class FeetDown(NamedTuple):
    """Frames ``start`` to ``stop`` in which the same ``feet`` (2,) are down, all on ``plates`` whose place the file
    does not tell; ``lacks`` which share of the weight these lack meanwhile, on average.
    """

    start: int
    stop: int
    feet: Mask
    plates: tuple[str, ...]
    lacks: float


def stances(trial: Trial, contact: Contact, *, weight: float) -> tuple[FeetDown, ...]:
    """Return the stances of a prepared trial on plates of unknown place; ``weight`` N of the body, NaN = unknown: none.
    Those of both feet only of who stands still: else they are passages between steps, or a movement on both, which
    tells a wrong plate by what each of them carries.

    None of who flies: the parabola that tells the acceleration is longer than a step of running; none where a chair or
    a rail carries at times.
    """
    unplaced, total = np.array([not plate.placed for plate in trial.plates]), trial.wrench.force[:, 2]
    if not unplaced.any() or not weight > 0 or total.size < 2:
        return ()
    loaded = np.asarray(total > _LOADED * weight)
    if flight(trial, contact.touching, loaded[:, None]).any() or LeftOut.CARRIED_ELSEWHERE in contact.left_out:
        return ()
    lacks, step = share_lacking(trial, weight=weight), float(np.median(np.diff(contact.time)))
    # Which feet are down, as one number: a stance ends where it changes.
    changes = np.flatnonzero(np.diff(contact.touching @ np.array([1, 2]), prepend=-1, append=-1))
    found = []
    for start, stop in pairwise(changes):
        feet, on = contact.touching[start], contact.on_plate[start:stop] & unplaced
        if feet.any() and on.any(axis=2)[:, feet].all() and stop - start >= _LONG / step:
            plates = tuple(plate.name for plate, under in zip(trial.plates, on.any(axis=(0, 1)), strict=True) if under)
            found.append(FeetDown(int(start), int(stop), feet, plates, float(lacks[start:stop].mean())))
    return tuple(found) if is_still(trial) else tuple(one for one in found if not one.feet.all())


def half_steps(every: Sequence[tuple[FeetDown, ...]]) -> tuple[tuple[FeetDown, ...], ...]:
    """Return, trial by trial, the stances of a session in which a foot is partly beside its plate: they lack more than
    the one that lacks least, so that a wrong weight, which all lack alike, accuses none, and more than other steps on
    the same plate.
    """
    least = max(0.0, min((one.lacks for some in every for one in some), default=0.0))
    # Plates that carried some step whole: one that lacks in all its steps reads too little.
    whole = {one.plates for some in every for one in some if not one.feet.all() and one.lacks <= least + _MORE}
    return tuple(
        tuple(one for one in some if one.lacks > least + _MORE and (one.feet.all() or one.plates in whole))
        for some in every
    )


def without(contact: Contact, some: tuple[FeetDown, ...]) -> Contact:
    """Return the contact without feet that are partly beside their plates in ``some`` stances: nothing tells which part
    of their force is measured for as long as they are down.
    """
    off = np.zeros_like(contact.touching)
    for foot in range(len(SIDES)):
        here = [one for one in some if one.feet[foot]]
        for start, stop in runs(contact.touching[:, foot]):
            off[start:stop, foot] = any(start < one.stop and one.start < stop for one in here)
    spans = tuple(
        LeftOutSpan(float(contact.time[start]), float(contact.time[stop - 1]), side)
        for foot, side in enumerate(SIDES)
        for start, stop in runs(off[:, foot])
    )
    frames = off.any(axis=1)
    measured = contact.measured & ~frames
    said = (
        f"{int(measured.sum())} of {measured.size} frames are fully measured by the plates.",
        f"Left out, {int(frames.sum())} of {frames.size}: a foot may stand partly beside a plate of unknown place.",
    )
    beside = contact.left_out.get(LeftOut.FOOT_BESIDE, np.zeros_like(frames))
    return replace(
        contact, measured=measured, told=contact.told & ~off, half=spans, notes=(*said, *contact.notes[1:]),
        left_out={**contact.left_out, LeftOut.FOOT_BESIDE: beside | frames},
    )  # fmt: skip


def told_of(some: tuple[FeetDown, ...]) -> str:
    """Return in words which feet may stand partly beside their plates, and what makes it likely."""
    feet = np.any([one.feet for one in some], axis=0)
    whose = "both feet" if feet.all() else f"the {SIDES[int(np.argmax(feet))]} foot"
    return (
        f"{whose} may stand partly beside plates whose place is not in the file: these lack up to "
        f"{100 * max(one.lacks for one in some):.0f} % of the weight"
    )

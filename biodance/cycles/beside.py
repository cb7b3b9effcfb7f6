"""Angles and events beside those that another program wrote into the same file."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.cycles.curves import CycleCurve, over_cycle
from biodance.cycles.cut import Cycle, delay_of_nearest
from biodance.lab.c3d.subject import FileOutputs
from biodance.records import Array, FootEvent, Motion

_PLUG_IN_GAIT: Mapping[str, tuple[str, int]] = {
    "pelvis_tilt": ("PelvisAngles", 0),
    "pelvis_obliquity": ("PelvisAngles", 1),
    "pelvis_rotation": ("PelvisAngles", 2),
    "hip_flexion": ("HipAngles", 0),
    "hip_adduction": ("HipAngles", 1),
    "hip_rotation": ("HipAngles", 2),
    "knee_flexion": ("KneeAngles", 0),
    "ankle_dorsiflexion": ("AnkleAngles", 0),
    "foot_progression": ("FootProgressAngles", 2),
}
"""Our angle -> the label (with L or R before it) and component of plug-in gait's, where both have the same positive
sense. Its knee has two more angles, which ours has not; the turn of its foot is that of a line, not of a body.
"""
EMG = "_emg"
"""Ending of a quantity that is the activity of a muscle."""
_AGAINST_LAB = ("PelvisAngles", "FootProgressAngles")
"""What plug-in gait tells against the laboratory's axes."""
_OBLIQUE = 6.0  # deg
_NEAR_EVENT = 0.15  # s within which an event of ours and one of the file are the same
_FEWEST = 20  # Frames without which nothing is compared


@dataclass(frozen=True)
class AngleComparison:
    """One joint angle beside that of the file: ``offset`` deg the mean of ours less the file's, ``sd`` deg of the
    difference about it, ``correlation`` (NaN where one does not move), over ``frames``.
    """

    joint: str
    label: str
    offset: float
    sd: float
    correlation: float
    frames: int


@dataclass(frozen=True)
class EventComparison:
    """Our strikes (``down``) or leavings beside the file's: ``late`` s, the mean of ours less the file's, ``sd`` s over
    ``count`` events; ``missed`` events of the file without one of ours.
    """

    down: bool
    late: float
    sd: float
    count: int
    missed: int


def emg_curves(cycle: Cycle, outputs: FileOutputs) -> Iterator[CycleCurve]:
    """Yield the envelopes of a cycle's own leg, of both in a squat, a rise or a jump, as ``soleus_emg``."""
    for one in outputs.emg:
        inside = one.time[0] <= cycle.start and cycle.end <= one.time[-1]
        if inside and cycle.side in (one.side, "both"):
            yield over_cycle(cycle, f"{one.muscle}{EMG}", one.side, one.unit, one.time, one.value)


def compare_angles(body: Body, motion: Motion, outputs: FileOutputs) -> tuple[AngleComparison, ...]:
    """Return every angle that both have, over the frames in which both are known."""
    comparisons = []
    for j, joint in enumerate(body.joints):
        side, _, name = joint.name.partition("_")
        label, axis = _PLUG_IN_GAIT.get(name, ("", 0))
        label = f"{side[:1].upper()}{label}"
        theirs = outputs.angles.get(label)
        if name not in _PLUG_IN_GAIT or theirs is None or len(theirs) != motion.time.size:
            continue
        known = motion.determined & np.isfinite(theirs).all(axis=1)
        ours, other = motion.angles[known, j], theirs[known, axis]
        if ours.size < _FEWEST:
            continue
        moves = np.ptp(ours) > 1.0 and np.ptp(other) > 1.0
        # The correlation of an angle that does not move is noise.
        correlation = float(np.corrcoef(ours, other)[0, 1]) if moves else float("nan")
        apart, label = ours - other, f"{label} {'xyz'[axis]}"
        mean, sd = float(apart.mean()), float(apart.std())
        comparisons.append(AngleComparison(joint.name, label, mean, sd, correlation, ours.size))
    return tuple(comparisons)


def compare_events(events: tuple[FootEvent, ...], outputs: FileOutputs) -> tuple[EventComparison, ...]:
    """Return how our events lie beside those that the file holds; () where it holds none."""
    comparisons = []
    for down in (True, False):
        delays = [delay_of_nearest(events, one) for one in outputs.events if one.down is down]
        late = [delay for delay in delays if abs(delay) < _NEAR_EVENT]
        if delays:
            mean, sd = (float(np.mean(late)), float(np.std(late))) if late else (np.nan, np.nan)
            comparisons.append(EventComparison(down, mean, sd, len(late), len(delays) - len(late)))
    return tuple(comparisons)


def file_curves(cycle: Cycle, outputs: FileOutputs, time: Array, ours: Sequence[CycleCurve]) -> Iterator[CycleCurve]:
    """Yield plug-in gait's own angles over a gait cycle, under our names, at the frames' ``time`` (T,) s.

    Its pelvis and the turn of its foot are told against one axis of the laboratory, ours against the way that the
    person goes. Where the pelvis of ``ours``, the curves of the same cycle, is turned otherwise by more than
    `_OBLIQUE` on average, they are no curves of the same thing and are left out.
    """
    if cycle.kind != "gait":
        return
    found = []
    for quantity, (label, axis) in _PLUG_IN_GAIT.items():
        theirs = outputs.angles.get(f"{cycle.side[:1].upper()}{label}")
        if theirs is not None and len(theirs) == time.size:
            # Wrapped to [-180, 180).
            found.append(over_cycle(cycle, quantity, cycle.side, "deg", time, (theirs[:, axis] + 180) % 360 - 180))
    # Mean over the cycle of theirs less ours.
    turned = [[one.value for one in some if one.quantity == "pelvis_rotation"] for some in (ours, found)]
    oblique = not all(turned) or not abs(np.nanmean(turned[1][0] - turned[0][0])) < _OBLIQUE
    yield from (one for one in found if not (oblique and _PLUG_IN_GAIT[one.quantity][0] in _AGAINST_LAB))

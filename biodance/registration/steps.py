"""Steps on plates: one whole foot alone on one plate, from first to last contact, with the pressure in the foot's own
frame.
"""

from dataclasses import dataclass

import numpy as np

from biodance.lab.markers.sets import landmark, read_marker_set
from biodance.motion.contact.contact import Contact
from biodance.motion.contact.footing import inside
from biodance.motion.contact.soles import Soles
from biodance.records import SIDES, Array, Motion, Trial, Wrench, runs
from biodance.registration.pose import Forces, FramePose
from biodance.witnesses import ONSET, FootPath
from biodance.witnesses.force_onset import heel_strike

_SHORTEST, _LONGEST = 0.3, 1.6
"""s: a walking step."""
_OVERHANG = 0.02
"""m by which a sole may reach beyond the edge of its plate."""
_FORTH = 0.45
"""Where the pressure of a foot that lands on its heel begins, in lengths from heel to toe marker, at most."""


@dataclass(frozen=True, eq=False)
class PlateStep:
    """One step on plate number ``plate`` with the foot of ``side``: ``phase`` (n,) 0 at the first contact to 1 at the
    last; centre of pressure ``place`` (n, 3) m in the room; the foot's ``forwards`` and ``outwards`` (n, 3) unit
    vectors; the pressure ``ahead`` of the heel marker and ``beside`` (n,) m, outwards positive, of its line to the toe
    marker; ``length`` m between the two; ``onset`` s after the heel's strike (NaN = not seen).
    """

    plate: int
    side: str
    phase: Array
    place: Array
    forwards: Array
    outwards: Array
    ahead: Array
    beside: Array
    length: float
    onset: float

    @property
    def heel_first(self) -> bool:
        """Whether the foot lands on its heel."""
        return bool(np.mean(self.ahead[(self.phase > 0.04) & (self.phase < 0.1)]) < _FORTH * self.length)


def plate_steps(
    trial: Trial, motion: Motion, contact: Contact, soles: Soles, forces: Forces, pose: FramePose
) -> tuple[PlateStep, ...]:
    """Return the steps of a trial that is placed by ``pose``; none without heel and toe markers."""
    if trial.markers is None or not trial.marker_set:
        return ()
    known = read_marker_set(trial.marker_set)
    found = []
    for number, plate in enumerate(forces.plates):
        recorded = plate.wrench
        for start, stop in runs(recorded.force[:, 2] > ONSET):
            time = recorded.time[start:stop] - pose.delay
            ends = start == 0 or stop == len(recorded.time)
            if ends or not _SHORTEST <= time[-1] - time[0] <= _LONGEST or not _covered(motion, time):
                continue
            foot = _foot(trial, contact, soles, number, time)
            if foot is None:
                continue
            marks = [landmark(trial.markers, known, f"{SIDES[foot]}_{name}") for name in ("heel", "toe")]
            if marks[0] is not None and marks[1] is not None:
                part = Wrench(time, pose.wrench(recorded.value[start:stop]))
                one = _step(number, foot, part, trial.plates[number].height, trial.markers.time, marks[0], marks[1])
                found += [one] if one is not None else []
    return tuple(found)


def _covered(motion: Motion, time: Array) -> bool:
    return bool(time[0] - 0.1 > motion.time[0] and time[-1] < motion.time[-1])


def _foot(trial: Trial, contact: Contact, soles: Soles, number: int, time: Array) -> int | None:
    """Return the foot (0 right, 1 left) that stands on a plate alone and whole in the middle of a step; None
    otherwise.
    """
    length = time[-1] - time[0]
    middle = (contact.time > time[0] + 0.25 * length) & (contact.time < time[0] + 0.75 * length)
    over = contact.on_plate[middle, :, number].mean(axis=0)
    alone = [foot for foot in (0, 1) if over[foot] > 0.8 and over[1 - foot] < 0.2]
    if not middle.any() or not alone:
        return None
    whole = np.nanmedian(inside(trial.plates[number], soles.outline[middle, alone[0]]), axis=0)
    return alone[0] if whole.min() > -_OVERHANG else None


def _step(
    number: int, foot: int, part: Wrench, height: float, frames: Array, heel: Array, toe: Array
) -> PlateStep | None:
    """Return one step sample by sample; None where a marker of the foot is not seen."""
    time, place = part.time, part.cop(height=height, threshold=ONSET)
    near = (frames > time[0] - 0.2) & (frames < time[-1] + 0.1)
    if not (np.isfinite(heel[near]).all() and np.isfinite(toe[near]).all()):
        return None
    path = FootPath(SIDES[foot], frames, heel, toe)
    ahead, beside, apart = path.in_foot(time, place[:, :2])
    behind, front = path.at(time)
    forwards = (front - behind) * np.array([1.0, 1.0, 0.0]) / apart[:, None]
    left = np.stack([-forwards[:, 1], forwards[:, 0], np.zeros(len(forwards))], axis=1)
    outwards = -left if SIDES[foot] == "right" else left
    phase = (time - time[0]) / (time[-1] - time[0])
    onset = time[0] - heel_strike(path, float(time.mean()), time[0])
    known = np.isfinite(ahead)
    phase, place, forwards, outwards, ahead, beside = (
        x[known] for x in (phase, place, forwards, outwards, ahead, beside)
    )
    length = float(np.median(apart))
    return PlateStep(number, SIDES[foot], phase, place, forwards, outwards, ahead, beside, length, onset)

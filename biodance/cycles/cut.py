"""A trial cut into what repeats: gait cycles of each foot, squats, rises from a chair."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.motion.contact.events import FootEvent
from biodance.motion.contact.soles import Soles
from biodance.motion.kinematics import centre_of_mass, poses
from biodance.records import SIDES, Array, Motion, runs

CycleKind = Literal["gait", "squat", "sit_to_stand"]
PERCENT = np.linspace(0.0, 100.0, 101)
"""% of a cycle at which its curves are given."""
_SHORTEST_STRIDE, _LONGEST_STRIDE = 0.4, 2.5
"""s of a gait cycle."""
_DEEP = 0.15
"""Of the leg's length by which the pelvis goes down in a squat, at least."""
_UP = 0.1
"""Of a repetition's depth within which the pelvis counts as up."""
_SEATED = 0.03
"""m that the centre of mass lies behind the heels of somebody who sits: standing so, one falls."""
_MOVES = 0.05
"""m/s of the centre of mass from which a rise has begun."""
_SLIDES = 0.1
"""m that a foot may travel in a squat or a rise."""


@dataclass(frozen=True)
class Cycle:
    """One repetition in ``trial``: ``kind``; ``side`` of the foot whose gait cycle it is, "both" for squats and rises;
    ``start``, ``end`` s on the clock of the trial; ``off`` s when the foot leaves the ground (gait), when the seat is
    left (rise) or when the pelvis is lowest (squat); NaN = not known.
    """

    trial: str
    kind: CycleKind
    side: str
    start: float
    end: float
    off: float

    @property
    def duration(self) -> float:
        """Its length, s."""
        return self.end - self.start

    @property
    def off_percent(self) -> float:
        """``off`` in % of the cycle: of a gait cycle the stance."""
        return 100 * (self.off - self.start) / self.duration

    def times(self) -> Array:
        """Return the times (101,) s of `PERCENT`."""
        return self.start + PERCENT / 100 * self.duration


def gait_cycles(trial: str, events: tuple[FootEvent, ...]) -> tuple[Cycle, ...]:
    """Return the cycles from each strike to the next of the same foot, with the other foot's strike between them."""
    found = []
    for side in SIDES:
        strikes = [e.time for e in events if e.down and e.side == side]
        others = [e.time for e in events if e.down and e.side != side]
        for start, end in pairwise(strikes):
            if not _SHORTEST_STRIDE < end - start < _LONGEST_STRIDE or not any(start < one < end for one in others):
                continue
            off = [e.time for e in events if not e.down and e.side == side and start < e.time < end]
            found.append(Cycle(trial, "gait", side, start, end, off[0] if len(off) == 1 else float("nan")))
    return tuple(sorted(found, key=lambda cycle: cycle.start))


def repetitions(trial: str, body: Body, motion: Motion, soles: Soles) -> tuple[Cycle, ...]:
    """Return the squats and the rises from a chair of a trial in which the feet stay where they are.

    A squat begins and ends standing and goes down by `_DEEP` of the leg's length at least. Whoever has the centre of
    mass `_SEATED` behind the heels sits on something: a rise begins with the centre of mass moving and ends standing.
    """
    height = poses(body, motion.q).position[:, 0, 2]
    leg, top = _leg_length(body), float(np.percentile(height, 98))
    centre = centre_of_mass(body, motion)
    seated = _seated(body, motion, soles, centre)
    found = []
    for first, stop in runs(height < top - _DEEP * leg):
        depth = top - float(height[first:stop].min())
        begin, end = _reach(height, top - _UP * depth, first, -1), _reach(height, top - _UP * depth, stop - 1, 1)
        if end is None or not motion.determined[first : end + 1].all() or _slide(soles, first, end) > _SLIDES:
            continue
        time = motion.time
        if seated[first:stop].any():
            leaves = first + int(np.flatnonzero(seated[first:stop])[-1])
            begin = _still_before(centre, motion, leaves)
            found.append(
                Cycle(trial, "sit_to_stand", "both", float(time[begin]), float(time[end]), float(time[leaves]))
            )
        elif begin is not None:
            lowest = first + int(np.argmin(height[first:stop]))
            found.append(Cycle(trial, "squat", "both", float(time[begin]), float(time[end]), float(time[lowest])))
    return tuple(one for one in found if not any(_overlap(one, other) for other in found if other is not one))


def _overlap(one: Cycle, other: Cycle) -> bool:
    """Return whether two repetitions share time: then the person went down several times without standing between."""
    return one.start < other.end and other.start < one.end


def _leg_length(body: Body) -> float:
    ends = ("knee_flexion", "ankle_dorsiflexion")
    return float(sum(np.linalg.norm(one.translation) for one in body.joints if one.name.endswith(ends))) / 2


def _seated(body: Body, motion: Motion, soles: Soles, centre: Array) -> NDArray[np.bool_]:
    """Return (T,) True where the centre of mass (T, 3) m lies behind both heels, as the feet point."""
    from biodance.cycles.events import heel_and_toe

    heel, toe = (place[..., :2] for place in heel_and_toe(body, soles.outline))
    ahead = (toe - heel).mean(axis=1)
    ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    behind = np.einsum("tfk,tk->tf", heel - centre[:, None, :2], ahead).min(axis=1)
    return np.asarray(behind > _SEATED)


def _reach(height: Array, level: float, start: int, step: int) -> int | None:
    """Return the first frame from ``start`` on, in steps of ``step``, at which the pelvis is above a level; None where
    the trial ends before.
    """
    at = start
    while 0 <= at < height.size:
        if height[at] >= level:
            return at
        at += step
    return None


def _still_before(centre: Array, motion: Motion, leaves: int) -> int:
    """Return the last frame before ``leaves`` at which the centre of mass was at rest; the first of the trial without
    one.
    """
    speed = np.linalg.norm(np.gradient(centre, motion.time, axis=0), axis=1)
    rest = np.flatnonzero(speed[: leaves + 1] < _MOVES)
    return int(rest[-1]) if rest.size else 0


def _slide(soles: Soles, first: int, last: int) -> float:
    """Return the farthest that a sole's centre goes between two frames, m."""
    path = soles.centre[first : last + 1, :, :2]
    return float(np.linalg.norm(path - path[:1], axis=-1).max())

"""Means over a part of the stance of one step: the centre of pressure in the foot's own frame, the plate's force."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, wraps
from typing import TypeVar

import numpy as np

from biodance.records import Array, Markers, Plate
from biodance.witnesses._feet import FootPath, path_at
from biodance.witnesses._recording import FootStep, SeenTrial

_Seen = TypeVar("_Seen")
_Witness = TypeVar("_Witness")

_SEEN = 0.8
"""Share of a phase in which foot and pressure must be known."""
_WALKS = 0.4
"""s: a foot that is down for less runs (running 0.2 to 0.3 s, walking 0.5 to 0.8 s; Novacheck 1998,
doi:10.1016/S0966-6362(97)00038-6), and what is expected of a step is of walking.
"""
_SWING, _SWUNG = 0.3, 0.1
"""s beside a contact in which a marker of a foot that steps goes so many m: 0.16 to 1.08 m in the steps of 13 public
sessions. A foot that is lifted for balance goes 0.03 m, and neither its heel nor its toe has an instant.
"""


@dataclass(frozen=True, eq=False)
class StepCourse:
    """One step sample by sample: ``phase`` (n,) 0 at the first contact to 1 at the last; ``time`` (n,) s; ``force``
    (n, 3) N under it; ``ahead`` of the heel marker and ``outwards`` of the line to the toe marker (n,) m: the
    centre of pressure in the foot; ``length`` m between the markers.
    """

    phase: Array
    time: Array
    force: Array
    ahead: Array
    outwards: Array
    length: float

    def mean(self, values: Array, start: float, stop: float) -> float:
        """Return the mean of ``values`` (n,) over a part of the stance; NaN where too little of it is known."""
        here = values[np.searchsorted(self.phase, start) : np.searchsorted(self.phase, stop, side="right")]
        known = np.isfinite(here)
        return float(here[known].mean()) if here.size and known.mean() >= _SEEN else float("nan")


def is_recorded(seen: SeenTrial, step: FootStep) -> bool:
    """Return whether a foot comes and goes within the recording, so that the shares of its stance are known."""
    part = seen.stance(step)
    return part is not None and part.start > 0 and part.stop < seen.plate(step.plate).wrench.time.size


def walks(seen: SeenTrial, step: FootStep) -> bool:
    """Return whether a foot is down for as long as in walking."""
    part, time = seen.stance(step), seen.plate(step.plate).wrench.time
    return part is not None and bool(time[part.stop - 1] - time[part.start] >= _WALKS)


def _swings(foot: FootPath, path: Array, middle: float, near: float, *, before: bool = False) -> bool:
    """Return whether a marker's ``path`` (T, 3) m swings off within 0.3 s after ``near`` s (``before``: comes so),
    against the ground or belt on which the foot stands at ``middle`` s.
    """
    time = near + np.linspace(0.0, -_SWING if before else _SWING, 7)
    belt = foot.drift(np.linspace(middle - 0.1, middle + 0.1, 5))[:2]
    place = path_at(foot.time, path, time)[:, :2] - belt * (time - near)[:, None]
    return bool(np.nan_to_num(np.linalg.norm(place - place[0], axis=1)).max() >= _SWUNG)


def steps(seen: SeenTrial, step: FootStep) -> bool:
    """Return whether the foot swings onto its plate or off it: one that stays in its place stands: where the
    pressure lies in it is a matter of balance, and its markers show no instant.
    """
    part, foot = seen.stance(step), seen.foot(step.side)
    if part is None:
        return False
    time = seen.plate(step.plate).wrench.time[part]
    came = _swings(foot, foot.heel, step.middle, float(time[0]), before=True)
    return came or _swings(foot, foot.toe, step.middle, float(time[-1]))


@lru_cache(maxsize=128)
def step_course(seen: SeenTrial, step: FootStep, *, running: bool = False) -> StepCourse | None:
    """Return one step sample by sample; None where its plate's force does not show it, the foot does not
    step, or it runs (with ``running``: walks). Of the last steps it is kept: several witnesses ask for it.
    """
    part = seen.stance(step)
    if part is None or not is_recorded(seen, step) or walks(seen, step) is running or not steps(seen, step):
        return None
    wrench = seen.under(step)
    time, force, cop = wrench.time[part], wrench.force[part], seen.pressure(step, part)
    phase = (time - time[0]) / (time[-1] - time[0])
    if step.beside:
        cop[~seen.swings(step, time)] = np.nan  # the plates beside hold the other foot, too
    ahead, outwards, apart = seen.foot(step.side).in_foot(time, cop)
    known = apart[np.isfinite(apart)]
    length = float(np.median(known)) if known.size else float("nan")
    return StepCourse(phase, time, force, ahead, outwards, length)


_KEPT = 64
"""Steps of which a witness keeps what it saw."""


@dataclass(frozen=True)
class _Look:
    """A look of a ``kind`` of witness at one step, and all that it hangs on: other plates than those under the foot,
    and the person's mass, change nothing.
    """

    kind: type
    step: FootStep
    feet: tuple[FootPath, ...]
    markers: Markers | None
    plates: tuple[Plate, ...]
    seen: SeenTrial = field(compare=False)


def by_step(look: Callable[[_Witness, SeenTrial, FootStep], _Seen]) -> Callable[[_Witness, SeenTrial, FootStep], _Seen]:
    """Keep what a witness sees of a step: it is asked about one recording after another in which other plates are
    altered (`traces`).
    """

    @lru_cache(maxsize=_KEPT)
    def known(asked: _Look) -> _Seen:
        return look(asked.kind(), asked.seen, asked.step)

    @wraps(look)
    def of_step(witness: _Witness, seen: SeenTrial, step: FootStep) -> _Seen:
        plates = tuple(plate for plate in seen.trial.plates if plate.name in (step.plate, *step.beside))
        return known(_Look(type(witness), step, seen.feet, seen.trial.markers, plates, seen))

    return of_step

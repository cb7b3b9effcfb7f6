"""Means over a part of the stance of one step: the centre of pressure in the foot's own frame, the plate's force; and
how far the markers of the feet may lie beside where the laboratory says: unknown, and common to both feet.

A toe marker on the first ray instead of the second puts the pressure outwards on BOTH feet; a right foot on one plate
and a left foot on another then look like two plates shifted in opposite directions. Only what the feet do not share
speaks of plates. The farther ahead the pressure lies, the more the toe marker's place matters: at the heel not at all.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from biodance.observations._causes import Sensitivity, by_plate, of_mean, pressure_gradient
from biodance.observations._feet import FootPath, InFoot, Track, track_of
from biodance.observations._recording import ONSET, FootStep, SeenTrial
from biodance.records import Array, Wrench

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
    """One step sample by sample: ``phase`` (n,) 0 at the first contact to 1 at the last; ``time`` (n,) s; ``plates``
    by name the wrench (n, 6) about the lab origin that carries the foot; ``wrench`` (n, 6) their sum; ``foot`` the
    pressure in the foot; ``height`` m of the plate; ``length`` m between the markers.
    """

    phase: Array
    time: Array
    plates: Mapping[str, Array]
    wrench: Array
    foot: InFoot
    height: float
    length: float

    @property
    def force(self) -> Array:
        """Force (n, 3) N under the foot."""
        return self.wrench[:, :3]

    def part(self, start: float, stop: float) -> slice:
        """Return the samples of a part of the stance."""
        return slice(int(np.searchsorted(self.phase, start)), int(np.searchsorted(self.phase, stop, side="right")))

    def place(self, axis: int, start: float, stop: float) -> tuple[float, Sensitivity]:
        """Return where the pressure is in the foot on average over a part of the stance, m ahead of the heel marker
        (``axis`` 0) or outwards (1), and how that responds (the stance is held); NaN where too little of it is known.
        """
        part = self.part(start, stop)
        known = np.isfinite(self.foot.place[part, axis])
        if not known.size or known.mean() < _SEEN:
            return float("nan"), Sensitivity()
        at = np.arange(part.start, part.stop)[known]
        # Mean over the known samples.
        gradient = pressure_gradient(self.wrench[at], self.foot.axes[at, axis], self.height) / at.size
        plates = by_plate(gradient, {name: wrench[at] for name, wrench in self.plates.items()})
        # Late forces: the same pressure meets the foot of a later instant.
        delay = float(np.nan_to_num(self.foot.moves[at, axis]).mean())
        return float(self.foot.place[at, axis].mean()), Sensitivity(plates, delay=delay)


def is_recorded(seen: SeenTrial, step: FootStep) -> bool:
    """Return whether a foot comes and goes within the recording, so that the shares of its stance are known."""
    part = seen.stance(step)
    return part is not None and part.start > 0 and part.stop < seen.plate(step.plate).wrench.time.size


def walks(seen: SeenTrial, step: FootStep) -> bool:
    """Return whether a foot is down for as long as in walking."""
    part, time = seen.stance(step), seen.plate(step.plate).wrench.time
    return part is not None and bool(time[part.stop - 1] - time[part.start] >= _WALKS)


def _swings(foot: FootPath, marker: Track, middle: float, near: float, *, before: bool = False) -> bool:
    """Return whether a ``marker`` swings off within 0.3 s after ``near`` s (``before``: comes so), against the belt."""
    time = near + np.linspace(0.0, -_SWING if before else _SWING, 7)
    belt = foot.drift(np.linspace(middle - 0.1, middle + 0.1, 5))[:2]
    # Relative to the belt, which would carry a standing foot along, too.
    place = marker.at(time)[:, :2] - belt * (time - near)[:, None]
    return bool(np.nan_to_num(np.linalg.norm(place - place[0], axis=1)).max() >= _SWUNG)


def steps(seen: SeenTrial, step: FootStep) -> bool:
    """Return whether the foot swings onto its plate or off it: one that stays in its place stands: where the
    pressure lies in it is a matter of balance, and its markers show no instant.
    """
    if ("steps", step) not in seen.kept:
        seen.kept["steps", step] = _steps(seen, step)
    return bool(seen.kept["steps", step])


def _steps(seen: SeenTrial, step: FootStep) -> bool:
    part, foot = seen.stance(step), seen.foot(step.side)
    if part is None:
        return False
    first, last = seen.plate(step.plate).wrench.time[[part.start, part.stop - 1]]
    came = _swings(foot, foot.tracks[0], step.middle, float(first), before=True)
    return came or _swings(foot, track_of(foot.time, foot.toe), step.middle, float(last))


def crossing(wrench: Wrench, sample: int) -> tuple[float, Array]:
    """Return the time s at which the vertical force crosses 20 N between a sample and the one before it, on a straight
    line, and its derivative (6, 7) with respect to B.
    """
    (start, stop), pair = wrench.time[sample - 1 : sample + 1], wrench.value[sample - 1 : sample + 1]
    rise, lasts = pair[1, 2] - pair[0, 2], stop - start
    if not np.isfinite(pair).all():
        return float(stop), np.zeros((6, 7))
    share = float((ONSET - pair[0, 2]) / rise)
    # Implicit function: F(t) = 20 N gives dt = -dF / F', with dF between the samples in the same shares.
    return float(start + share * lasts), -lasts / rise * of_mean(pair, 2, np.array([1 - share, share]))


def step_course(seen: SeenTrial, step: FootStep, *, running: bool = False) -> StepCourse | None:
    """Return one step sample by sample; None where its plate's force does not show it, the foot does not
    step, or it runs (with ``running``: walks).
    """
    if not is_recorded(seen, step) or walks(seen, step) is running or not steps(seen, step):
        return None
    if ("course", step) not in seen.kept:
        part = seen.stance(step)
        assert part is not None
        plate = seen.plate(step.plate)
        time, plates = plate.wrench.time[part], seen.under(step, part)
        wrench = sum(plates.values(), np.zeros((time.size, 6)))
        pressure = seen.pressure(step, wrench)
        phase = (time - time[0]) / (time[-1] - time[0])
        if step.beside:
            pressure[~seen.swings(step, time)] = np.nan  # the plates beside hold the other foot, too
        foot = seen.foot(step.side).in_foot(time, pressure)
        known = foot.length[np.isfinite(foot.length)]
        length = float(np.median(known)) if known.size else float("nan")
        seen.kept["course", step] = StepCourse(phase, time, plates, wrench, foot, plate.height, length)
    found: StepCourse = seen.kept["course", step]
    return found


LANDMARK = "toe landmark"
"""What the names of the errors hold that both feet share because of where their markers sit."""
_ACROSS = {False: 0.025, True: 0.010}
"""m: sd of the toe end of the foot's line across the foot; True: by markers on the edges of the forefoot. In ten
laboratories the pressure lay 12 mm (sd 12) outwards in the middle of stance, where 0.7 of it is seen (0 to 4 mm with
the marker on the second ray, 17 to 41 mm on the first); by the edges 5 mm in seven laboratories.
"""
_ALONG = 0.012
"""m: sd of the heel end along the foot: 11 mm early in stance in twelve laboratories (heel pads, shoes, wands)."""
_OWN = {"across": 0.008, "along": 0.004}
"""m: the same of one foot beside the other: half the difference of the feet 5.6 mm (ten laboratories) in the middle of
stance, of which the pressure's own path takes a part (`foot_across`)."""
LEVERS = {"early": 0.35, "middle": 0.7, "late": 1.0, "running": 0.7}
"""Share of the toe end's place across the foot that is seen in a phase: how far ahead the pressure lies."""


def landmark_across(foot: FootPath, phase: str) -> dict[str, float]:
    """Return m by name: errors of the pressure's place across a ``foot`` in a phase of stance due to its markers."""
    lever, by = LEVERS[phase], " by edges" if foot.by_edges else ""
    return {
        f"laboratory {LANDMARK}{by}, across": lever * _ACROSS[foot.by_edges],
        f"person {foot.side} toe, across": lever * _OWN["across"],
    }


def landmark_along(foot: FootPath) -> dict[str, float]:
    """Return m by name: errors of the pressure's place along a ``foot`` due to its heel marker, in all phases."""
    return {f"laboratory {LANDMARK}, along": _ALONG, f"person {foot.side} heel, along": _OWN["along"]}


def shift_per_sd(norm: str) -> float:
    """Return how many m of the toe end (across) or heel end (along) one standard deviation of a shared error is."""
    return _ALONG if norm.endswith("along") else _ACROSS[" by edges" in norm]

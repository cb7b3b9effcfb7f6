"""Rehearse a designed dance in MuJoCo (`playback`), first posture to last.

Does the body stay up on its feet alone, and does the pressure stay within the soles?
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from biodance.dance.dance import Dance
from biodance.dance.playback import RADIUS, Playback, play
from biodance.dance.problem.stance import phase_at
from biodance.errors import BiodanceError
from biodance.records import Array

_RATE = 100.0
"""Hz at which plan and playback are compared."""
UNSURE = 0.2
"""s around the instant at which a foot leaves the ground, or comes back, in which it may still, or already, bear: it
rises by 10 h (t/T)³ at first, so that what sinks by 1 mm bears 0.2 s longer where h = 0.1 m in T = 2 s."""


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """``playback`` of the ``dance`` (its holds shortened), ``inside`` (T,) m how far the centre of pressure of the
    simulated floor is inside the whole base of support of the feet that are planned to be down, or may be still or
    already (`UNSURE`); negative: outside.
    """

    dance: Dance
    playback: Playback
    inside: Array

    @property
    def broken(self) -> tuple[str, ...]:
        """What the plan did not foresee, in phrases: a fall, a hand on the floor, pressure outside the soles."""
        p = self.playback
        told = [] if p.stays_up else [f"falls at {p.fell:.1f} s of {self.dance.duration:.1f} s"]
        told += [f"the {part.replace('_', ' ')} comes to the floor at {at:.1f} s" for part, at in p.touched.items()]
        if (least := float(np.nanmin(self.inside))) < -RADIUS:
            when = p.time[int(np.nanargmin(self.inside))]
            told.append(f"the pressure is {-1000 * least:.0f} mm outside the soles at {when:.1f} s")
        return tuple(told)

    def table(self) -> str:
        """Return what became of the dance in a few lines of Markdown."""
        p, fate = self.playback, "; ".join(self.broken) or "stays up to the end, on its feet alone"
        angle, gap = np.degrees(p.angle_error), 1e3 * p.zmp_error[np.isfinite(p.zmp_error)]
        inside = 1e3 * self.inside[np.isfinite(self.inside)]
        angle_rms, gap_rms = (np.sqrt(np.mean(error**2)) for error in (angle, gap))
        most, least = np.quantile(gap, 0.99), np.quantile(inside, 0.01)
        rows = (
            ("fate", fate),
            ("joint angles, RMS and worst gap to the plan", f"{angle_rms:.2f} and {np.abs(angle).max():.1f} deg"),
            ("tilt of the pelvis, worst gap", f"{np.degrees(p.tilt_error.max()):.1f} deg"),
            ("place of the pelvis, worst gap", f"{1e3 * p.root_error.max():.0f} mm"),
            ("centre of pressure, RMS and 99 % gap", f"{gap_rms:.1f} and {most:.0f} mm"),
            ("centre of pressure inside the soles, 1 % and least", f"{least:.0f} and {inside.min():.0f} mm"),
        )
        return "\n".join(["| what | found |", "|---|---|", *(f"| {what} | {found} |" for what, found in rows)])


def rehearse(dance: Dance, *, hold: float = 0.5, friction: float = 0.5) -> Rehearsal:
    """Return what becomes of a dance whose postures are held for ``hold`` s only, when nothing but its joints is
    driven.

    Raises
    ------
    MissingLibrary
        MuJoCo is not installed.
    BiodanceError
        It is danced on a stool, which is not simulated.
    """
    if any(stance.seat for stance in dance.stances):
        raise BiodanceError(f"Dance {dance.protocol}: is danced on a stool, which is not simulated. Play another one.")
    short = replace(dance, hold=np.minimum(dance.hold, hold))
    motion = short.motion(_RATE)
    played = play(dance.body, motion, friction=friction, down=bearing(short, motion.time))
    return Rehearsal(short, played, _inside(short, played))


def bearing(dance: Dance, time: Array) -> NDArray[np.bool_]:
    """Return (T, 2) True where the right, the left foot is planned to be down at instants ``time`` s."""
    planted = np.array([[side in phase.stance.planted for side in (0, 1)] for phase in dance.phases])
    return planted[phase_at(dance.phases, time)]


def _inside(dance: Dance, played: Playback) -> Array:
    point, out = played.wrench.cop()[:, :2], np.full(len(played.time), -np.inf)
    for late in (0.0, -UNSURE, UNSURE):
        owner = phase_at(dance.phases, np.clip(played.time + late, 0.0, dance.duration))
        for k in np.unique(owner):
            normals, offsets = dance.phases[k].stance.whole.reduced(1.0)
            own = owner == k
            out[own] = np.maximum(out[own], (point[own] @ normals.T + offsets).min(axis=1))
    return out

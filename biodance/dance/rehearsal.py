"""Rehearse a designed dance in MuJoCo, first posture to last, feet in contact: what stays up, where the zero-moment point goes."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from biodance.dance.dance import Dance
from biodance.dance.playback import Playback, play
from biodance.records import Array

RATE = 100.0
"""Hz at which plan and playback are compared."""


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """``playback`` of the ``dance`` (its holds shortened), ``inside`` (T,) m how far the centre of pressure of the simulated floor is
    inside the whole base of support of the feet that are planned to be down (negative: outside).
    """

    dance: Dance
    playback: Playback
    inside: Array

    def table(self) -> str:
        """Return what became of the dance in a few lines of Markdown."""
        p, end = self.playback, self.dance.duration
        fate = "stays up to the end" if p.stays_up else f"falls at {p.fell:.1f} s of {end:.1f} s"
        angle, gap = np.degrees(p.angle_error), 1e3 * p.zmp_error[np.isfinite(p.zmp_error)]
        inside = 1e3 * self.inside[np.isfinite(self.inside)]
        rows = (
            ("fate", fate),
            ("joint angles, RMS and worst gap to the plan", f"{np.sqrt(np.mean(angle**2)):.2f} and {np.abs(angle).max():.1f} deg"),
            ("tilt of the pelvis, worst gap", f"{np.degrees(p.tilt_error.max()):.1f} deg"),
            ("place of the pelvis, worst gap", f"{1e3 * p.root_error.max():.0f} mm"),
            ("centre of pressure, RMS and 99 % gap", f"{np.sqrt(np.mean(gap**2)):.1f} and {np.quantile(gap, 0.99):.0f} mm"),
            ("centre of pressure inside the soles, 1 % and least", f"{np.quantile(inside, 0.01):.0f} and {inside.min():.0f} mm"),
        )
        return "\n".join(["| what | found |", "|---|---|", *(f"| {what} | {found} |" for what, found in rows)])


def rehearse(dance: Dance, *, hold: float = 0.5, friction: float = 0.5) -> Rehearsal:
    """Return what becomes of a dance whose postures are held for ``hold`` s only, when nothing but its joints is driven.

    Raises
    ------
    MissingLibrary
        MuJoCo is not installed.
    """
    short = replace(dance, hold=np.minimum(dance.hold, hold))
    motion = short.motion(RATE)
    played = play(dance.body, motion, friction=friction, down=bearing(short, motion.time))
    return Rehearsal(short, played, _inside(short, played))


def bearing(dance: Dance, time: Array) -> NDArray[np.bool_]:
    """Return (T, 2) True where the right, the left foot is planned to be down at instants ``time`` s."""
    planted = np.array([[side in phase.stance.planted for side in (0, 1)] for phase in dance.phases])
    return planted[_owner(dance, time)]


def _owner(dance: Dance, time: Array) -> NDArray[np.intp]:
    starts = np.array([phase.start for phase in dance.phases])
    return np.clip(np.searchsorted(starts, time + 1e-9, side="right") - 1, 0, None)


def _inside(dance: Dance, played: Playback) -> Array:
    point, owner = played.wrench.cop()[:, :2], _owner(dance, played.time)
    out = np.empty(len(point))
    for k in np.unique(owner):
        normals, offsets = replace(dance.phases[k].stance, over=None).reduced(1.0)
        out[owner == k] = (point[owner == k] @ normals.T + offsets).min(axis=1)
    return out

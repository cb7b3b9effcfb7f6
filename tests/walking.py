"""A made walk over two plates, whose truth is known by construction: a mass point bobs over two feet.

Lab x is ahead, y to the left. The pelvis moves as the mass point, so the plates' sum is m (g + a). Each foot's centre
of pressure rolls from 0.22 to 0.95 foot lengths ahead of the heel marker, ``outwards`` of the line to the toe marker.
No formula here is one of biodance's.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from biodance.records import Markers, Plate, Session, Source, Subject, Trial, Wrench

MASS, G, FOOT = 60.0, 9.80665, 0.18
STRIKES = {"right": 0.8, "left": 1.4}
STANCE = 0.72
PLATES = {"plate1": (0.5, 0.0), "plate2": (1.1, 0.0)}
CARRIES = {"right": "plate1", "left": "plate2"}
RATE, ANALOG = 100.0, 1000.0


@dataclass(frozen=True)
class Wrong:
    """What is wrong with the plates: ``late`` s; ``moved`` m (2,) of plate1 in the file; ``gain`` of Fz of plate1;
    ``signs`` (6,) of the channels of plate1 about its centre; ``zero`` N (3,) that every plate's reader took off.
    """

    late: float = 0.0
    moved: tuple[float, float] = (0.0, 0.0)
    gain: float = 0.0
    signs: tuple[float, ...] = (1, 1, 1, 1, 1, 1)
    zero: tuple[float, float, float] = (0.0, 0.0, 0.0)


def place(side: str) -> np.ndarray:
    """Return where the heel marker of a foot stands, (2,) m."""
    x, y = PLATES[CARRIES[side]]
    return np.array([x - 0.1, y + (0.05 if side == "left" else -0.05)])


def body(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return place (T, 3) m and acceleration (T, 3) m/s² of the mass point: two periods a stride."""
    w = 2 * np.pi / 0.6
    t = time - 0.8 - STANCE / 2
    position = np.stack([0.9 * t + 0.45 - 0.012 * np.sin(w * t), 0 * t, 0.9 + 0.015 * np.cos(w * t)], axis=1)
    acceleration = np.stack([0.012 * w**2 * np.sin(w * t), 0 * t, -0.015 * w**2 * np.cos(w * t)], axis=1)
    return position, acceleration


def foot(side: str, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return heel and toe marker (T, 3) m: heel down at the strike, toe down 0.1 s later, both away at the end."""
    strike, end = STRIKES[side], STRIKES[side] + STANCE
    x, y = place(side)
    before, rise = np.minimum(time - strike, 0.0), np.clip(time - end + 0.15, 0, 0.15)
    high = np.minimum(-0.5 * before, 0.05)
    away = pulled(time - end)
    heel = np.stack([x + 2.0 * before + away, np.full(time.size, y), 0.04 + high + 0.3 * rise], axis=1)
    down = np.clip(strike + 0.1 - time, 0.0, 0.1)
    toe = np.stack([x + FOOT + 2.0 * before + away, heel[:, 1], 0.04 + 0.5 * down], axis=1)
    return heel, toe


def pulled(time: np.ndarray) -> np.ndarray:
    """Return the way (T,) m of a point that is pulled ahead for 0.05 s, most after 0.025 s, and goes on at 1.5 m/s."""
    span, peak = 0.05, 60.0
    t = np.clip(time, 0, span)
    pull = peak * (t**2 / 4 + span**2 / (8 * np.pi**2) * (np.cos(2 * np.pi * t / span) - 1))
    return pull + peak * span / 2 * np.maximum(time - span, 0.0)


def walk(wrong: Wrong | None = None, *, outwards: float = 0.0, name: str = "walk") -> Trial:
    """Return the walk as a reader hands it over, with what is ``wrong``."""
    wrong = wrong or Wrong()
    frames, time = np.arange(0, 2.8, 1 / RATE), np.arange(0, 2.8, 1 / ANALOG)
    late = time - wrong.late
    total = MASS * (body(late)[1] + [0, 0, G])
    share = {side: np.clip(np.minimum(late - t, t + STANCE - late) / 0.12, 0, 1) for side, t in STRIKES.items()}
    both = np.maximum(sum(share.values()), 1.0)
    plates = []
    for side, plate in CARRIES.items():
        force = (share[side] / both)[:, None] * total
        phase = np.clip((late - STRIKES[side]) / STANCE, 0, 1)
        outer = outwards * (1 if side == "left" else -1)
        cop = np.stack(
            [place(side)[0] + FOOT * (0.22 + 0.73 * phase), np.full(time.size, place(side)[1] + outer)], axis=1
        )
        plates.append(_plate(plate, time, force, cop, wrong))
    paths = {
        "SACR": body(frames)[0] - [0.1, 0, 0],
        "LASI": body(frames)[0] + [0.1, 0.1, 0],
        "RASI": body(frames)[0] + [0.1, -0.1, 0],
    }
    for side in STRIKES:
        paths[f"{side[0].upper()}HEE"], paths[f"{side[0].upper()}TOE"] = foot(side, frames)
    markers = Markers(tuple(paths), frames, np.stack(list(paths.values()), axis=1))
    return Trial(name, "fit", markers, tuple(plates), Source(Path("walk.c3d"), "", "made", RATE, ANALOG))


def _plate(name: str, time: np.ndarray, force: np.ndarray, cop: np.ndarray, wrong: Wrong) -> Plate:
    """Return one plate, 0.5 m x 0.5 m, whose force acts at ``cop`` on the floor, with what is wrong."""
    centre = np.array([*PLATES[name], 0.0])
    arm = np.column_stack([cop, np.zeros(len(cop))]) - centre
    local = np.concatenate([force, np.cross(arm, force)], axis=1)
    own = name == "plate1"
    if own:
        local = local * np.array(wrong.signs)
        local[:, 2] *= 1 + wrong.gain
    middle = centre + (np.array([*wrong.moved, 0.0]) if own else 0.0)
    value = np.concatenate([local[:, :3], local[:, 3:] + np.cross(middle, local[:, :3])], axis=1)
    corners = middle + np.array([[0.29, 0.25, 0], [0.29, -0.25, 0], [-0.29, -0.25, 0], [-0.29, 0.25, 0]])
    said = ("Zero: the plate is unloaded in samples 1-500; their mean was subtracted.",)
    return Plate(name, 2, corners, Wrench(time, value), said, np.array(wrong.zero))


def standing(wrong: Wrong | None = None, *, push: float = 0.0, weight: float = MASS) -> Trial:
    """Return quiet standing on plate1 with both feet, the pelvis over the pressure; ``push`` N along x."""
    frames, time = np.arange(0, 2.0, 1 / RATE), np.arange(0, 2.0, 1 / ANALOG)
    x, y = PLATES["plate1"]
    fixed = {"LHEE": (x - 0.1, y + 0.1, 0.04), "RHEE": (x - 0.1, y - 0.1, 0.04), "LTOE": (x + 0.08, y + 0.1, 0.04),
             "RTOE": (x + 0.08, y - 0.1, 0.04), "LASI": (x + 0.1, y + 0.1, 0.9), "RASI": (x + 0.1, y - 0.1, 0.9),
             "SACR": (x - 0.1, y, 0.9)}  # fmt: skip
    xyz = np.tile(np.array(list(fixed.values())), (frames.size, 1, 1))
    force = np.tile([push, 0.0, weight * G], (time.size, 1))
    plate = _plate("plate1", time, force, np.tile([x, y], (time.size, 1)), wrong or Wrong())
    unseen = Plate("plate1", 2, plate.corners, plate.wrench, ("Zero: nothing was subtracted.",))
    return Trial(
        "static", "static", Markers(tuple(fixed), frames, xyz), (unseen,), Source(Path("s.c3d"), "", "made", RATE)
    )


def session(*trials: Trial, mass: float = MASS) -> Session:
    """Return a session of made trials."""
    return Session(Subject(mass=mass, stature=1.7, sex="F"), trials, Path("made"))

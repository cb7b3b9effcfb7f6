"""Tables of markers and forces written by hand, in the spellings of different laboratories, from a squat whose wrench
is known.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from two_plates import CENTRES, session

SQUAT = session()["squat_1"]
FORCES = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def places(stamps: np.ndarray) -> np.ndarray:
    """Return where the markers truly are at some times, (T, K, 3) m."""
    assert SQUAT.markers is not None
    return CubicSpline(SQUAT.markers.time, SQUAT.markers.xyz)(stamps)


def wrenches(stamps: np.ndarray) -> list[np.ndarray]:
    """Return what the ground truly does on the subject by plate, (T, 6) each about the lab's origin."""
    fine = SQUAT.plates[0].wrench.time
    smooth = [np.array([np.convolve(c, np.ones(31) / 31, "same") for c in p.wrench.value.T]).T for p in SQUAT.plates]
    return [np.stack([np.interp(stamps, fine, column) for column in value.T], axis=1) for value in smooth]


def about(value: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return a wrench (T, 6) about another point."""
    return np.hstack([value[:, :3], value[:, 3:] - np.cross(point, value[:, :3])])


def jittering(count: int, rate: float, seed: int = 4) -> np.ndarray:
    """Return times whose steps vary from a third of the usual one to twice."""
    steps = np.random.default_rng(seed).choice([0.35, 0.8, 1.0, 1.0, 1.2, 1.9], size=count) / rate
    return 0.1 + np.cumsum(steps)


@dataclass(frozen=True)
class Style:
    """How a laboratory writes: separator, decimal sign, labels of time and coordinates, units as factors on m, s, N."""

    separator: str = ","
    decimal: str = "."
    time: str = "time"
    marker: Callable[[str, str], str] = lambda name, axis: f"{name}{axis}"
    quoted: Callable[[int, str], str] = lambda column, cell: cell
    metres: float = 1000.0
    seconds: float = 1.0
    digits: int = 6


def write_table(
    path: Path, stamps: np.ndarray, forces: dict[str, np.ndarray], style: Style, xyz: np.ndarray | None = None
) -> Path:
    """Write markers and ``forces`` (column label -> (T,)) of the squat at ``stamps``; return the path."""
    assert SQUAT.markers is not None
    xyz = places(stamps) if xyz is None else xyz
    columns = {style.time: stamps * style.seconds}
    columns |= {
        style.marker(name, axis): style.metres * xyz[:, i, k]
        for i, name in enumerate(SQUAT.markers.names)
        for k, axis in enumerate("xyz")
    }
    columns |= forces
    head = style.separator.join(style.quoted(k, label) for k, label in enumerate(columns))
    rows = (
        style.separator.join(f"{v:.{style.digits}f}".replace(".", style.decimal) for v in row)
        for row in np.stack(list(columns.values()), axis=1)
    )
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


def of_both(stamps: np.ndarray, label: Callable[[str, int], str], *, own: bool) -> dict[str, np.ndarray]:
    """Return the columns of both plates, about the lab's origin or each about its ``own`` centre."""
    found = {}
    for number, (value, centre) in enumerate(zip(wrenches(stamps), CENTRES.values(), strict=True), start=1):
        one = about(value, centre) if own else value
        found |= {label(name, number): one[:, k] for k, name in enumerate(FORCES)}
    return found

"""What an installed plate can add to a wrench: 49 elementary errors of one standard deviation each, about where the
person stands.
"""

from dataclasses import dataclass

import numpy as np

from biodance.records import CHANNELS, Array
from biodance.spatial import skew
from biodance.uncertainty.noise import Noise
from biodance.uncertainty.tolerances import shipped

PLATE_SOURCES = 49


@dataclass(frozen=True, eq=False)
class Plates:
    """What m plates do to a wrench about their middle: ``mixing`` (m, 6, 6), ``offset`` (m, 6) N, N·m, ``delay`` (m,)
    s.
    """

    mixing: Array
    offset: Array
    delay: Array


def plate_sources() -> Plates:
    """Return plates with one fault of one standard deviation each: 36 gains and cross-talks, 3 turns, 3 shifts, 6
    offsets, a delay.
    """
    mixing, offset, delay = np.zeros((PLATE_SOURCES, 6, 6)), np.zeros((PLATE_SOURCES, 6)), np.zeros(PLATE_SOURCES)
    rows, columns = np.divmod(np.arange(36), 6)
    mixing[np.arange(36), rows, columns] = [
        _share(CHANNELS[c], CHANNELS[r]) for r, c in zip(rows, columns, strict=True)
    ]
    turn, shift = (
        skew(np.diag([around_zero(f"{name} {axis}") for axis in "xyz"]))
        for name in ("plate_rotation", "plate_position")
    )
    mixing[36:39, :3, :3] = mixing[36:39, 3:, 3:] = turn
    mixing[39:42, 3:, :3] = shift
    offset[42:48] = np.diag([around_zero(f"plate_offset {channel}", "offset") for channel in CHANNELS])
    delay[48] = around_zero("time_delay", "delay")
    return Plates(mixing, offset, delay)


def around_zero(key: str, parameter: str = "") -> float:
    """Return the root mean square of what ``key`` of the shipped tolerances can be, its mean in sessions without
    fault included.
    """
    known = shipped()
    return float(np.hypot(known.size(key), known.mean(f"{key} {parameter}")))


def plate_errors(wrench: Array, rate: float, noise: Noise, plates: Plates) -> Array:
    """Return the errors (T, 6, m) about the lab origin of plates that measure ``wrench`` (T, 6), at ``rate`` Hz,
    described about the point of ``noise``.
    """
    near = wrench @ noise.shift.T
    late = np.gradient(near, 1.0 / rate, axis=0)[..., None] * plates.delay
    return np.asarray(
        np.linalg.inv(noise.shift)
        @ (np.tensordot(near, plates.mixing, axes=(1, 2)).swapaxes(1, 2) + plates.offset.T - late)
    )


def _share(source: str, target: str) -> float:
    """Return how much of one channel shows in another, or errs in itself."""
    return around_zero(f"plate_gain {source}" if source == target else f"plate_crosstalk {source}->{target}")

"""What an installed plate can add to a wrench: 49 elementary errors of one standard deviation each, about where the
person stands.
"""

from dataclasses import dataclass

import numpy as np

from biodance.lab.plates.faults import CROSSTALK, DELAY, GAIN, OFFSET, POSITION, ROTATION, PlateFault
from biodance.records import CHANNELS, Array
from biodance.uncertainty.bands import Noise
from biodance.uncertainty.tolerances import shipped

SOURCES: tuple[tuple[PlateFault, str], ...] = (
    *((GAIN, to) if at == to else (CROSSTALK, f"{at}->{to}") for to in CHANNELS for at in CHANNELS),
    *((fault, axis) for fault in (ROTATION, POSITION) for axis in "xyz"),
    *((OFFSET, channel) for channel in CHANNELS),
    (DELAY, ""),
)
"""Fault and place of each elementary error."""
PLATE_SOURCES = len(SOURCES)


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
    sizes = source_sizes()
    mixing = np.stack([size * fault.slope(place) for (fault, place), size in zip(SOURCES, sizes, strict=True)])
    offset = np.stack([size * fault.zero(place) for (fault, place), size in zip(SOURCES, sizes, strict=True)])
    return Plates(mixing, offset, np.where([fault is DELAY for fault, _ in SOURCES], sizes, 0.0))


def source_sizes() -> Array:
    """Return (m,) one standard deviation of each of `SOURCES`, in the unit of its fault."""
    means = {OFFSET, DELAY}  # whose mean in sessions without fault is known
    return np.array(
        [
            around_zero(f"{fault.name} {place}".strip(), fault.parameter if fault in means else "")
            for fault, place in SOURCES
        ]
    )


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
    # Wrench about the noise's point; (T, 6) rows, hence the transpose.
    near = wrench @ noise.shift.T
    # A clock late by d measures w(t - d), to first order w - d dw/dt.
    late = np.gradient(near, 1.0 / rate, axis=0)[..., None] * plates.delay
    return np.asarray(
        np.linalg.inv(noise.shift)
        # sum_j mixing[m, i, j] near[t, j] as (T, m, i), then (T, i, m).
        @ (np.tensordot(near, plates.mixing, axes=(1, 2)).swapaxes(1, 2) + plates.offset.T - late)
    )

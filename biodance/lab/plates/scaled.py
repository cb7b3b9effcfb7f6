"""Floating-point channels that are in their units already, while ANALOG:SCALE still says how integers were scaled."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from biodance.lab.c3d.raw import RawC3d
from biodance.lab.plates.signals import PlateReading
from biodance.settings import STANDARD_GRAVITY

_OFF = 0.5
"""Share of the weight (or its inverse) from which on the scale is doubted; a foot beside the plates costs less."""
_WHOLE = 0.15
"""Share by which what the plates carry without the scale may differ from the weight: shoes, clothes, movement."""
_LOADED = 0.3  # share of the largest total force from which on somebody stands on the plates


def scale_in_doubt(raw: RawC3d, readings: Sequence[PlateReading], mass: float | None) -> bool:
    """Return whether the scale was perhaps applied twice: floating-point numbers with a scale, and not the weight of
    ``mass`` kg on the plates.
    """
    used = [column for reading in readings for column in reading.plate.channels]
    if raw.layout is None or not raw.layout.floating or not used or not mass or not mass > 0:
        return False
    gain = raw.layout.gain[used]
    return bool(np.isfinite(gain).all() and (gain != 1).any() and not _OFF < weight_share(readings, mass) < 1 / _OFF)


def unscaled(raw: RawC3d) -> RawC3d:
    """Return the file with its analog numbers as stored, without OFFSET, SCALE and GEN_SCALE."""
    assert raw.layout is not None
    gain = np.where(np.isfinite(raw.layout.gain) & (raw.layout.gain != 0), raw.layout.gain, 1.0)
    return replace(raw, analog=raw.analog / gain + raw.layout.offset)


def already_scaled(scaled: Sequence[PlateReading], plain: Sequence[PlateReading], mass: float) -> str:
    """Return why the numbers are believed as stored (``plain``) and not times the scale; "" where they are not.

    The evidence is the weight: as stored, the plates carry all of it.
    """
    share, whole = weight_share(scaled, mass), weight_share(plain, mass)
    if len(plain) < len(scaled) or abs(whole - 1) > _WHOLE:
        return ""
    return (
        f"Read with ANALOG:SCALE the plates carry {share:.1g} of the weight ({mass:.4g} kg), without it all of it "
        f"({whole:.2f}): the floating-point data are already scaled, and SCALE was not applied. Write 1 into "
        f"ANALOG:SCALE, or export the file again."
    )


def weight_share(readings: Sequence[PlateReading], mass: float) -> float:
    """Return the median of the total vertical force while somebody is on the plates over the weight of ``mass`` kg."""
    total = np.sum([np.abs(reading.sensor[:, 2]) for reading in readings], axis=0)
    loaded = total >= _LOADED * total.max()
    return float(np.median(total[loaded]) / (mass * STANDARD_GRAVITY))

"""Read the numbers of a C3D file whose layout is known."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.lab.c3d_layout import Layout
from biodance.lab.c3d_parameters import MIPS, doubles, floats

Numbers = tuple[NDArray[Any], NDArray[Any]]
"""Points (T, K, 3) in file units with NaN = not seen, analog (T * samples, C) in units."""


def read_numbers(content: bytes, layout: Layout) -> Numbers:
    """Return the points and analog values of the data section.

    A frame holds x, y, z and a word of residual and cameras for each point, then the analog samples, channel fastest; all 32-bit floats
    or all 16-bit integers. A point was not seen if its residual is negative, a coordinate is no finite number, or all three are zero.
    Source: C3D user guide, "3D point data" and "analog data".
    """
    words = layout.frames * (4 * layout.points + layout.channels * layout.samples)
    size = 4 if layout.floating else 2
    section = memoryview(content)[layout.start : layout.start + size * words]
    if layout.floating:
        rows = analog_rows = floats(section, layout.processor).reshape(layout.frames, -1)
    else:
        order = ">" if layout.processor == MIPS else "<"
        rows = np.frombuffer(section, dtype=order + "i2").reshape(layout.frames, -1)
        analog_rows = rows.view(order + "u2") if layout.unsigned else rows
    quads = rows[:, : 4 * layout.points].reshape(layout.frames, layout.points, 4)
    points = doubles(quads[..., :3])
    if not layout.floating:
        points *= layout.scale
    seen = (quads[..., 3] >= 0) & np.isfinite(points).all(axis=2) & (points != 0).any(axis=2)
    points[~seen] = np.nan
    rest = doubles(analog_rows[:, 4 * layout.points :])
    with np.errstate(invalid="ignore", over="ignore"):
        analog = rest.reshape(layout.frames * layout.samples, layout.channels) if layout.channels else np.empty((0, 0))
        analog -= layout.offset
        analog *= layout.gain
    return points, analog

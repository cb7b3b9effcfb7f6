"""Channels of the laboratory, named in the plate's own axes."""

import numpy as np
import pytest

from biodance.diagnosis.plate_axes import in_plate_axes
from biodance.records import Plate, Wrench


def turned(degrees: float) -> Plate:
    """Return a plate whose x axis lies ``degrees`` anticlockwise from lab x, z up."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    corners = np.array([[0.2, 0.3, 0], [-0.2, 0.3, 0], [-0.2, -0.3, 0], [0.2, -0.3, 0]])
    return Plate(
        "plate1", 2, corners @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), Wrench(np.arange(2.0), np.zeros((2, 6)))
    )


@pytest.mark.parametrize(
    ("degrees", "target", "own"),
    [
        (0, "Fx", ""), (10, "My", ""), (90, "Fx", "-Fy"), (90, "My", "Mx"), (180, "plate1:Fy", "-Fy"),
        (90, "Fz->My", "Fz into Mx"), (45, "Fx", "Fx and -Fy"), (90, "plate2:Fx", ""), (90, "left_thigh", ""),
    ],
)  # fmt: skip
def test_a_channel_has_its_plate_s_own_name(degrees: float, target: str, own: str) -> None:
    said = in_plate_axes(target, (turned(degrees),))
    assert said == (f"In the axes of plate1 itself: {own}." if own else "")

"""Faults: one a session, at a size that is clear."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""The one kind of array that is used here."""


@dataclass(frozen=True)
class Fault:
    """What is wrong in a session.

    Attributes
    ----------
    kind : str
        One of FAULTS, or "none".
    target : str
        Plate ("plate1"), landmark ("right_knee_lateral"), segment ("left_forearm") or "".
    axis : str
        Axis of the target: of the plate ("x", "y"), of the world for the tilt; "" where there is none.
    size : float
        In `unit`.
    unit : str
    """

    kind: str = "none"
    target: str = ""
    axis: str = ""
    size: float = 0.0
    unit: str = ""


FAULTS = (
    "plate_place", "plate_yaw", "plate_gain", "plate_offset", "force_delay", "knee_misplaced", "knee_moved",
    "labels_exchanged", "load_forearm", "load_thigh", "load_trunk", "wrong_mass", "force_filter", "rail", "lab_tilt",
)  # fmt: skip


def draw_fault(rng: np.random.Generator, kind: str) -> Fault:
    """Draw target, sign and size of a fault.

    Raises
    ------
    ValueError
        For a kind that is not in FAULTS.
    """
    if kind == "none":
        return Fault()
    plate, side = f"plate{rng.integers(1, 3)}", str(rng.choice(["right", "left"]))
    sign, axis = float(rng.choice([-1, 1])), str(rng.choice(["x", "y"]))
    draws = {
        "plate_place": (plate, axis, sign * rng.uniform(0.015, 0.020), "m"),
        "plate_yaw": (plate, "z", sign * np.radians(4.0), "rad"),
        "plate_gain": (plate, "z", sign * 0.05, "1"),
        "plate_offset": (plate, axis, sign * 10.0, "N"),
        "force_delay": ("", "", rng.uniform(0.020, 0.030), "s"),
        "knee_misplaced": (f"{side}_knee_lateral", "x", sign * 0.025, "m"),
        "knee_moved": (f"{side}_knee_lateral", "x", sign * 0.025, "m"),
        "labels_exchanged": (f"{side}_wrist", "", 1.0, "1"),
        "load_forearm": (f"{side}_forearm", "", rng.uniform(1.5, 2.4), "kg"),
        "load_thigh": (f"{side}_thigh", "", rng.uniform(1.5, 2.4), "kg"),
        "load_trunk": ("thorax", "", rng.uniform(1.5, 2.4), "kg"),
        "wrong_mass": ("", "", sign * 4.0, "kg"),
        "force_filter": ("", "", 4.0, "Hz"),
        "rail": (f"{side}_hand", "z", rng.uniform(25.0, 40.0), "N"),
        "lab_tilt": ("", axis, sign * np.radians(1.5), "rad"),
    }
    if kind not in draws:
        raise ValueError(f"There is no fault {kind!r}; there are: none, {', '.join(FAULTS)}.")
    return Fault(kind, *draws[kind])

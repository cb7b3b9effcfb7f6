"""What force plates record of a performance: true wrench, true place of the plate, gain, cross-talk, offset, noise,
delay, steps of the converter.

The model is an AMTI BP400600: z down, origin under the surface, the ground's reaction on the subject in plate axes as
Vicon writes TYPE 2, or volts with the calibration matrix of a real unit as TYPE 4.
"""

from dataclasses import dataclass

import numpy as np

from biodance.lab.c3d.write import PlateRecording
from biodance.records import Array
from biodance.virtual_lab.movement.performance import Performance
from biodance.virtual_lab.person.skeleton import small_rotation
from biodance.virtual_lab.tolerances import LabTolerances

HALF_SIZE = np.array([0.2, 0.3])
"""m, half sides along plate x and y."""
HALF_BELT = np.array([0.25, 0.85])
"""m, the same of one belt of an instrumented split-belt treadmill."""
ORIGIN = np.array([0.0004, -0.0006, -0.0380])
"""m, from the sensor's origin to the centre of the surface, plate axes (z down, hence negative)."""
NEWTON, _INCH = 4.4482216152605, 0.0254
CALIBRATION = (
    np.diag([NEWTON] * 3 + [NEWTON * _INCH] * 3)
    @ np.array(
        [
            [0.6521, 0.0045, -0.0002, -0.0057, -0.0019, 0.0020],
            [-0.0015, 0.6525, -0.0117, -0.0082, -0.0034, -0.0077],
            [0.0010, -0.0052, 2.5676, -0.0012, 0.0012, 0.0006],
            [-0.0168, 0.0309, -0.0594, 12.8865, -0.0469, -0.0248],
            [0.0314, 0.0101, -0.0595, 0.0163, 10.1565, -0.0069],
            [0.0327, 0.1287, -0.0279, 0.0057, 0.0677, 5.4770],
        ]
    )
    * 50.0
)
"""(6, 6) N/V, N·m/V: the sheet of a real AMTI unit (lb, lb·in per microvolt and volt), gain 2000, 10 V excitation."""
FULL_SCALE = 10.0 * np.diag(CALIBRATION)
"""(6,) N, N·m at 10 V: 1450, 1450, 5710, 728, 574, 309."""


@dataclass(frozen=True, eq=False)
class TruePlate:
    """One plate as it truly is: ``corners`` (4, 3) m as surveyed; ``turn`` (3, 3), ``centre`` (3,) m its true pose in
    the lab frame; ``mixing`` (6, 6) gains and cross-talk; ``offset`` (6,) N, N·m; ``side`` whose foot it carries,
    "both" for a single plate, "none" for an empty one.
    """

    corners: Array
    turn: Array
    centre: Array
    mixing: Array
    offset: Array
    side: str = "both"


def lay_plate(
    centre: Array,
    heading: float,
    side: str,
    tolerances: LabTolerances,
    rng: np.random.Generator,
    *,
    moment_zero: float = 0.0,
    half: Array = HALF_SIZE,
) -> TruePlate:
    """Return a plate whose long side lies along ``heading`` (rad from lab x), surveyed at ``centre`` (3,) m and truly a
    little elsewhere; ``moment_zero`` N·m, standard deviation of its moments' zeros beyond that of its forces; ``half``
    (2,) m, half its sides across and along.
    """
    t, relative = tolerances, FULL_SCALE / FULL_SCALE[2]
    forward, leftward = (
        np.array([np.cos(heading), np.sin(heading), 0.0]),
        np.array([-np.sin(heading), np.cos(heading), 0.0]),
    )
    turn = np.stack([leftward, forward, np.array([0.0, 0.0, -1.0])], axis=1)
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    corners = centre + (signs * half) @ turn[:, :2].T
    mixing = t.plate_crosstalk * rng.normal(size=(6, 6)) * np.outer(FULL_SCALE, 1 / FULL_SCALE)
    np.fill_diagonal(mixing, 1.0 + t.plate_gain * rng.normal(size=6))
    true_turn = turn @ small_rotation(t.plate_rotation * rng.normal(size=3))
    place, zero = centre + t.plate_position * rng.normal(size=3), t.plate_offset * relative * rng.normal(size=6)
    if moment_zero:
        zero[3:] += moment_zero * rng.normal(size=3)
    return TruePlate(corners, true_turn, place, mixing, zero, side)


def contact_wrench(performance: Performance, time: Array, side: str) -> Array:
    """Return the true wrench (T, 6) about the lab origin under one foot, under "both" or "none"."""
    if side == "none":
        return np.zeros((time.size, 6))
    return performance.wrench(time).value if side == "both" else performance.foot_wrench(time, side)


def sense_plate(
    performance: Performance,
    plate: TruePlate,
    time: Array,
    tilt: Array,
    tolerances: LabTolerances,
    rng: np.random.Generator,
) -> Array:
    """Return what the plate's six channels say (S, 6) N, N·m at ``time`` (S,) s: reaction on the subject, plate axes,
    about the plate's origin.

    ``tilt`` (3, 3) turns true-vertical axes into the laboratory's.
    """
    value = contact_wrench(performance, time - tolerances.plate_delay, plate.side)
    force, moment = value[:, :3] @ tilt.T, value[:, 3:] @ tilt.T
    at_centre = moment - np.cross(plate.centre, force)
    force, moment = force @ plate.turn, at_centre @ plate.turn
    true = np.concatenate([force, moment + np.cross(ORIGIN, force)], axis=1)
    noise = tolerances.plate_noise * FULL_SCALE / FULL_SCALE[2] * rng.normal(size=true.shape)
    return true @ plate.mixing.T + plate.offset + noise


def digitise(channels: Array, plate: TruePlate, *, kind: int, bits: int) -> PlateRecording:
    """Return channels (S, 6) N, N·m as the converter stores them: ``bits`` over ±10 V, ``kind`` TYPE 2 or, in volts,
    TYPE 4.
    """
    calibration = CALIBRATION if kind == 4 else np.diag(FULL_SCALE / 10.0)
    step = 20.0 / 2**bits
    volts = np.clip(np.round(channels @ np.linalg.inv(calibration).T / step) * step, -10.0, 10.0)
    if kind == 4:
        return PlateRecording(4, plate.corners, ORIGIN, volts, calibration=calibration)
    return PlateRecording(2, plate.corners, ORIGIN, volts @ calibration.T)

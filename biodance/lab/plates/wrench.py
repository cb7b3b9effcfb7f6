"""From the channels of a force plate to a wrench, one formula per C3D TYPE; all in plate axes, signs as the file has
them.

Sources: C3D user guide, FORCE_PLATFORM (TYPE 1-4, ORIGIN, CAL_MATRIX); Visual3D documentation, force platform types
5-7; Kistler 9287 manual (moments of an eight-channel plate; correction polynomial of the centre of pressure).
"""

import numpy as np

from biodance.lab.plates.parameters import PlateParameters
from biodance.records import Array
from biodance.settings import COP_FORCE
from biodance.spatial import wrench_about_origin, wrench_about_point, zero_moment_point

EIGHT_CHANNELS, TWELVE_CHANNELS = (3, 7), (6,)
FOUR_SENSORS = EIGHT_CHANNELS + TWELVE_CHANNELS
_FARTHEST = 1.5  # m: a centre of pressure farther away has no meaning


def calibrated(plate: PlateParameters, channels: Array) -> Array:
    """Return the channels (S, C) times the plate's calibration matrix, or unchanged where the type has none."""
    return channels if plate.calibration is None else channels @ plate.calibration.T


def sensor_wrench(plate: PlateParameters, signals: Array, origin: Array) -> Array:
    """Return force and moment (S, 6) N, N·m about the sensor origin from calibrated signals in SI; ``origin`` (3,) m is
    ORIGIN.

    TYPE 1 gives forces, a point on the surface and a free moment; its moment is returned about the surface point above
    the sensor origin (a point farther than 1.5 m away, as an empty plate gives it, counts as 0). TYPE 3 and 7 (four
    vertical sensors, two pairs each in x and y) and TYPE 6 (three components at four corners) use the sensor distances
    a, b in ORIGIN: sensors 1 to 4 lie at (a, b), (-a, b), (-a, -b), (a, -b). TYPE 2, 4 and 5 measure the wrench itself.
    """
    if plate.type in FOUR_SENSORS:
        a, b = np.abs(origin[:2])
        x, y, z = _sums(signals) if plate.type in EIGHT_CHANNELS else _corner_sums(signals)
        moment = [
            b * (z[0] + z[1] - z[2] - z[3]),
            a * (-z[0] + z[1] + z[2] - z[3]),
            b * (x[1] - x[0]) + a * (y[0] - y[1]),
        ]
        return np.stack([x[0] + x[1], y[0] + y[1], z[0] + z[1] + z[2] + z[3], *moment], axis=1)
    if plate.type == 1:
        force = signals[:, :3]
        far = np.abs(signals[:, 3:5]).max(axis=1, keepdims=True) > _FARTHEST
        point = np.where(far, 0.0, signals[:, 3:5])
        free = np.column_stack([np.zeros((len(point), 2)), signals[:, 5]])
        return wrench_about_origin(np.hstack([force, free]), _in_surface(point))
    return signals


def surface_vector(plate: PlateParameters, origin: Array) -> Array:
    """Return the vector (3,) m from the point of reference of ``sensor_wrench`` to the centre of the surface, as
    ORIGIN (3,) m has it.
    """
    x, y, z = origin
    if plate.type == 1:
        return np.array([x, y, 0.0])
    return np.array([0.0, 0.0, z]) if plate.type in FOUR_SENSORS else np.array([x, y, z])


def centre_of_pressure(wrench: Array) -> Array:
    """Return the centre of pressure (S, 2) m on the surface from a wrench about its centre; NaN below 20 N."""
    return zero_moment_point(wrench, threshold=COP_FORCE)[:, :2]


def polynomial_corrected(wrench: Array, polynomial: Array) -> Array:
    """Return the wrench about the surface centre with Kistler's correction of the centre of pressure; force and free
    moment stay.

    ``polynomial`` (2, 6), first row x: dx = (P1 y^4 + P2 y^2 + P3) x^3 + (P4 y^4 + P5 y^2 + P6) x with x, y in mm; dy
    likewise with x and y exchanged; the correction is subtracted (Kistler 9287C manual, 8.4.3).
    """
    point = 1000 * centre_of_pressure(wrench)
    point[np.abs(point) > 1000 * _FARTHEST] = np.nan
    wrong = np.empty_like(point)
    for i, p in enumerate(polynomial):
        own, other = point[:, i], point[:, 1 - i] ** 2
        wrong[:, i] = (p[0] * other**2 + p[1] * other + p[2]) * own**3 + (p[3] * other**2 + p[4] * other + p[5]) * own
    return wrench_about_point(wrench, _in_surface(np.nan_to_num(wrong / 1000)))


def wrench_in_lab(wrench: Array, axes: Array, sign: int, centre: Array) -> Array:
    """Return a plate's wrench (S, 6) about its ``centre`` (3,) m as the wrench about the lab origin.

    ``axes`` (3, 3) lab_R_plate; mirrored ones (determinant -1) turn moments the other way round than forces.
    """
    force = sign * wrench[:, :3] @ axes.T
    moment = sign * np.linalg.det(axes) * wrench[:, 3:] @ axes.T
    return wrench_about_origin(np.hstack([force, moment]), centre)


def _in_surface(point: Array) -> Array:
    """Return points (S, 2) m of the surface as points (S, 3) m in plate axes."""
    return np.column_stack([point, np.zeros(len(point))])


def _sums(c: Array) -> tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...]]:
    """Return (x12, x34), (y14, y23), (z1 z2 z3 z4) of an eight-channel plate."""
    return (c[:, 0], c[:, 1]), (c[:, 2], c[:, 3]), tuple(c[:, 4:8].T)


def _corner_sums(c: Array) -> tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...]]:
    """Return the same sums of a twelve-channel plate (x, y, z of corner 1, then 2, 3, 4)."""
    x, y, z = c[:, 0::3].T, c[:, 1::3].T, c[:, 2::3].T
    return (x[0] + x[1], x[2] + x[3]), (y[0] + y[3], y[1] + y[2]), tuple(z)

"""From the channels of a force plate to a wrench, one formula per C3D TYPE, in plate axes, signs as the file has them;
and what a file does not say: on which side of the surface the sensor lies, and whether load or reaction was recorded.

Sources: C3D user guide, FORCE_PLATFORM (TYPE 1-4, ORIGIN, CAL_MATRIX); Visual3D documentation, force platform types
5-7; Kistler 9287 manual (moments of an eight-channel plate; correction polynomial of the centre of pressure).
"""

import numpy as np
from numpy.typing import NDArray

from biodance.lab.plates.parameters import PlateParameters
from biodance.lab.plates.zero import block_means
from biodance.records import Array, longest_run
from biodance.settings import COP_FORCE, TOUCH_FORCE
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
        x12, x34, y14, y23, z1, z2, z3, z4 = _eight_sums(plate, signals)
        about_x, about_y = b * (z1 + z2 - z3 - z4), a * (-z1 + z2 + z3 - z4)
        about_z = b * (x34 - x12) + a * (y14 - y23)
        return np.stack([x12 + x34, y14 + y23, z1 + z2 + z3 + z4, about_x, about_y, about_z], axis=1)
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


def _eight_sums(plate: PlateParameters, signals: Array) -> tuple[Array, ...]:
    """Return x12, x34, y14, y23, z1, z2, z3, z4: the channels of an eight-channel plate, or the sums of those of a
    twelve-channel one (x, y, z of corner 1, then 2, 3, 4).
    """
    if plate.type in EIGHT_CHANNELS:
        return tuple(signals[:, :8].T)
    x, y, z = signals.T.reshape(4, 3, -1).swapaxes(0, 1)
    return (x[0] + x[1], x[2] + x[3], y[0] + y[3], y[1] + y[2], *z)


DEEPEST = 0.3  # m, no sensor lies farther below the surface
_CONTACT = 0.1  # s
_SWAY_BAND = (0.5, 5.0)  # Hz
_SWAY_TIME = 2.5  # s of standing that the sway test needs
_SWAY_STEADY = 0.05  # share of the weight by which the vertical force may vary
_SWAY_CORRELATION = 0.4
_SWAY_SLOPE = (0.25, 3.0)
"""1/m, shear over weight per metre of centre of pressure; about 1 / height of the centre of mass."""


def sensor_below(vector: Array, axes: Array) -> tuple[Array, str]:
    """Return the vector sensor -> surface centre (plate axes, m) with the z that puts the sensor below the surface, and
    the sentence.

    ``axes`` is lab_R_plate (3, 3). Only z is turned: older AMTI sheets and some software write it with the other sign,
    x and y alike (C3D user guide, ORIGIN of TYPE 2). For a plate whose z points down the legal z is negative.
    """
    x, y, z = vector
    if abs(z) < 1e-6:
        beside = f"; x, y ({1000 * x:.4g}, {1000 * y:.4g} mm) are used as written" if max(abs(x), abs(y)) > 1e-6 else ""
        return vector, f"ORIGIN z is 0: the moments are about the surface{beside}."
    if z * axes[2, 2] > 0:
        return vector, f"ORIGIN puts the sensor {1000 * abs(z):.4g} mm below the surface, as it must be."
    said = f"ORIGIN z of {1000 * z:.4g} mm would put the sensor above the surface: its sign was turned"
    unsure = 2000 * float(np.hypot(x, y))
    if unsure >= 0.05:
        said += f" (if x, y were meant the other way round too, the centre of pressure moves by {unsure:.2g} mm)"
    return np.array([x, y, -z]), f"{said}."


def loaded_samples(wrench: Array, rate: float) -> NDArray[np.bool_]:
    """Return (S,) True where the plate carries at least 30 N and 5 % of its peak along its own z, in the mean over 0.1
    s and at the sample.

    So a plate that only trembles under a neighbour's step does not count as loaded.
    """
    means, size = block_means(wrench[:, 2], rate, length=_CONTACT)
    threshold = max(TOUCH_FORCE, 0.05 * float(np.abs(means).max()))
    lasting = np.repeat(np.abs(means) >= threshold, size)
    lasting = np.append(lasting, np.full(len(wrench) - lasting.size, lasting[-1]))
    return lasting & (np.abs(wrench[:, 2]) >= threshold)


def gravity_sign(wrench: Array, axes: Array, rate: float) -> int:
    """Return +1 if the recorded wrench pushes up on average while loaded (it acts on the subject), -1 if down, 0 if
    never loaded.
    """
    loaded = loaded_samples(wrench, rate)
    return int(np.sign((wrench[loaded, :3] @ axes[2]).sum())) if loaded.any() else 0


def sway_sign(wrench: Array, rate: float) -> int:
    """Return +1 if a standing person's shear shows that the reaction was recorded, -1 for the load, 0 if it cannot be
    told.

    A person who stands is an inverted pendulum: the ground's shear on the person is opposite to the quick part of the
    centre of pressure, F = -(m g / h) (CoP - CoM), whatever the sign of the vertical channel. Needs 2.5 s of standing
    on this one plate (vertical within 5 %), and both axes must agree in sign, correlate by at least 0.4 and have a
    slope between 0.25 and 3 per metre.
    """
    part = _standing(wrench[:, 2], rate)
    if part is None:
        return 0
    point = centre_of_pressure(wrench[part])
    signs = []
    for axis in (0, 1):
        shear, cop = _band(wrench[part, axis], rate), _band(point[:, axis], rate)
        power = float(cop @ cop)
        if power <= 0 or not shear.any():
            return 0
        correlation = float(shear @ cop / np.sqrt(power * float(shear @ shear)))
        slope = abs(float(shear @ cop)) / power / abs(float(wrench[part, 2].mean()))
        if abs(correlation) < _SWAY_CORRELATION or not _SWAY_SLOPE[0] <= slope <= _SWAY_SLOPE[1]:
            return 0
        signs.append(-np.sign(correlation))
    return int(signs[0]) if signs[0] == signs[1] else 0


def _standing(vertical: Array, rate: float) -> slice | None:
    """Return the longest run of half-seconds with a vertical force near the trial's median; None below 2.5 s."""
    size = round(0.5 * rate)
    middle = float(np.median(vertical))
    if size < 4 or abs(middle) < 5 * TOUCH_FORCE:
        return None
    blocks = vertical[: vertical.size // size * size].reshape(-1, size)
    most = _SWAY_STEADY * abs(middle)
    steady = (np.abs(blocks.mean(axis=1) - middle) <= most) & (blocks.std(axis=1) <= most)
    start, stop = longest_run(steady)
    return slice(start * size, stop * size) if (stop - start) * size >= _SWAY_TIME * rate else None


def _band(values: Array, rate: float) -> Array:
    """Return the part of a signal between 0.5 and 5 Hz, without its straight line and faded in and out."""
    along = np.linspace(-1, 1, values.size)
    values = values - values.mean() - along * (along @ values) / (along @ along)
    spectrum = np.fft.rfft(values * np.hanning(values.size))
    frequency = np.fft.rfftfreq(values.size, 1 / rate)
    spectrum[(frequency < _SWAY_BAND[0]) | (frequency > _SWAY_BAND[1])] = 0
    return np.fft.irfft(spectrum, values.size)

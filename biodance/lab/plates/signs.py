"""Directions that a C3D file does not say: on which side of the surface the sensor lies, and whether load or
reaction was recorded.
"""

import numpy as np
from numpy.typing import NDArray

from biodance.lab.plates.wrench import centre_of_pressure
from biodance.lab.plates.zero import block_means
from biodance.records import Array, runs
from biodance.settings import TOUCH_FORCE

DEEPEST = 0.3  # m, no sensor lies farther below the surface
CONTACT = 0.1  # s
SWAY_BAND = (0.5, 5.0)  # Hz
SWAY_TIME = 2.5  # s of standing that the sway test needs
SWAY_STEADY = 0.05  # share of the weight by which the vertical force may vary
SWAY_CORRELATION = 0.4
SWAY_SLOPE = (
    0.25,
    3.0,
)  # 1/m, shear over weight per metre of centre of pressure; about 1 / height of the centre of mass


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
    unsure = 2000 * float(np.hypot(x, y))
    doubt = (
        f" (if x, y were meant the other way round too, the centre of pressure moves by {unsure:.2g} mm)"
        if unsure >= 0.05
        else ""
    )
    return np.array(
        [x, y, -z]
    ), f"ORIGIN z of {1000 * z:.4g} mm would put the sensor above the surface: its sign was turned{doubt}."


def loaded_samples(wrench: Array, rate: float) -> NDArray[np.bool_]:
    """Return (S,) True where the plate carries at least 30 N and 5 % of its peak along its own z, in the mean over 0.1
    s and at the sample.

    So a plate that only trembles under a neighbour's step does not count as loaded.
    """
    means, size = block_means(wrench[:, 2], rate, length=CONTACT)
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
        if abs(correlation) < SWAY_CORRELATION or not SWAY_SLOPE[0] <= slope <= SWAY_SLOPE[1]:
            return 0
        signs.append(-np.sign(correlation))
    return int(signs[0]) if signs[0] == signs[1] else 0


def _standing(vertical: Array, rate: float) -> slice | None:
    """Return the longest run of whole half-seconds in which the vertical force stays near the trial's median; None
    below 2.5 s.
    """
    size = round(0.5 * rate)
    middle = float(np.median(vertical))
    if size < 4 or abs(middle) < 5 * TOUCH_FORCE:
        return None
    blocks = vertical[: vertical.size // size * size].reshape(-1, size)
    steady = (np.abs(blocks.mean(axis=1) - middle) <= SWAY_STEADY * abs(middle)) & (
        blocks.std(axis=1) <= SWAY_STEADY * abs(middle)
    )
    start, stop = max(runs(steady), key=lambda run: run[1] - run[0], default=(0, 0))
    return slice(start * size, stop * size) if (stop - start) * size >= SWAY_TIME * rate else None


def _band(values: Array, rate: float) -> Array:
    """Return the part of a signal between 0.5 and 5 Hz, without its straight line and faded in and out."""
    along = np.linspace(-1, 1, values.size)
    values = values - values.mean() - along * (along @ values) / (along @ along)
    spectrum = np.fft.rfft(values * np.hanning(values.size))
    frequency = np.fft.rfftfreq(values.size, 1 / rate)
    spectrum[(frequency < SWAY_BAND[0]) | (frequency > SWAY_BAND[1])] = 0
    return np.fft.irfft(spectrum, values.size)

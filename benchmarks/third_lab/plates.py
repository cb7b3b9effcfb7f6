"""Force plates of two makes, with what is a little wrong with every plate."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from benchmarks.third_lab.faults import Array, Fault

Pair = tuple["Plate", "Plate"]
DOWN = np.diag([1.0, -1.0, -1.0])  # axes of a plate that is not turned: x as the world's, z down


@dataclass(frozen=True)
class Plate:
    """A plate as it is; what the file says of it is `centre`, `turn` and ORIGIN.

    Attributes
    ----------
    make : {"amti", "kistler"}
    centre : array, shape (3,)
        Middle of the surface as surveyed, m, in the world.
    turn : array, shape (3, 3)
        Axes of the plate as surveyed, plate to world; z down.
    size : tuple of float
        Along its x and y, m.
    deep : array, shape (3,)
        AMTI: from the sensor's origin to the middle of the surface, plate axes, m. Kistler: half distances of the
        sensors (a, b) and -depth of their plane.
    shift : array, shape (3,)
        True place less surveyed place, m, world.
    yaw : float
        True yaw less surveyed yaw, rad, about the world's z.
    response : array, shape (6, 6)
        What is read for what acts: gains and cross-talk.
    offset : array, shape (6,)
        N and N·m, left after zeroing.
    noise : float
        N a sample (moments: a quarter of it in N·m).
    delay : float
        Seconds by which forces come late.
    lowpass : float
        Hz of a filter in the recorder; 0 for none.
    """

    make: str
    centre: Array
    turn: Array
    size: tuple[float, float]
    deep: Array
    shift: Array
    yaw: float
    response: Array
    offset: Array
    noise: float
    delay: float
    lowpass: float = 0.0


def draw_plates(rng: np.random.Generator, make: str) -> Pair:
    """Two plates of one make in a row along the walkway, with the tolerances of a laboratory that is looked after.

    Place 1.5 mm, level 1 mm, yaw 0.25 degrees, gains 0.6 %, cross-talk 0.3 %, offset 0.7 N, noise 0.15 to 0.9 N, delay
    0 to 3 ms.
    """
    size, deep = (
        ((0.508, 0.464), [0.0006, -0.0009, -0.0412]) if make == "amti" else ((0.600, 0.400), [0.21, 0.12, -0.054])
    )
    noise, delay, half_turn = rng.uniform(0.15, 0.9), rng.uniform(0, 0.003), bool(rng.integers(2))
    plates = []
    for sign in (-1, 1):
        turn = (Rotation.from_euler("z", np.pi if half_turn and sign > 0 else 0.0).as_matrix()) @ DOWN
        response = np.eye(6) * (1 + rng.normal(0, 0.006, 6)) + rng.normal(0, 0.003, (6, 6)) * (1 - np.eye(6)) * _SCALES
        centre = np.array([sign * (size[0] / 2 + 0.003), 0.0, 0.0])
        shift = rng.normal(0, [0.0015, 0.0015, 0.001])
        offset = rng.normal(0, 1, 6) * [0.7, 0.7, 1.0, 0.25, 0.25, 0.1]
        plates.append(Plate(make, centre, turn, size, np.array(deep), shift, rng.normal(0, np.radians(0.25)), response,
                            offset, noise, delay))  # fmt: skip
    return plates[0], plates[1]


_SCALES = np.block(
    [[np.ones((3, 3)), np.full((3, 3), 4.0)], [np.full((3, 3), 0.1), np.ones((3, 3))]]
)  # N per N·m and back


def spoil_plates(plates: Pair, fault: Fault) -> Pair:
    """Put a fault of the plates into them; other faults leave them as they are."""
    out = []
    for number, plate in enumerate(plates, 1):
        if fault.kind == "force_delay":
            plate = replace(plate, delay=plate.delay + fault.size)
        if fault.kind == "force_filter":
            plate = replace(plate, lowpass=fault.size)
        if fault.target == f"plate{number}":
            unit = plate.turn[:, "xyz".index(fault.axis)]
            if fault.kind == "plate_place":
                plate = replace(plate, shift=plate.shift + fault.size * unit)
            if fault.kind == "plate_yaw":
                plate = replace(plate, yaw=plate.yaw + fault.size)
            if fault.kind == "plate_gain":
                plate = replace(plate, response=np.diag([1, 1, 1 + fault.size, 1, 1, 1]) @ plate.response)
            if fault.kind == "plate_offset":
                plate = replace(plate, offset=plate.offset + fault.size * np.eye(6)["xyz".index(fault.axis)])
        out.append(plate)
    return out[0], out[1]


def measure(rng: np.random.Generator, plate: Plate, forces: Array, moments: Array, rate: float) -> Array:
    """Read the plate's six outputs.

    Parameters
    ----------
    forces, moments : array, shape (n, 3)
        Ground reaction on the body, N and N·m about the origin of the world.
    rate : float
        Samples a second.

    Returns
    -------
    wrench : array, shape (n, 6)
        N and N·m, about the surveyed origin's true place, in the plate's true axes. AMTI: origin of the sensor;
        Kistler: middle of the sensors' plane.
    """
    turn = Rotation.from_euler("z", plate.yaw).as_matrix() @ plate.turn
    # from the origin of the outputs to the middle of the surface, plate axes
    lever = plate.deep if plate.make == "amti" else np.array([0.0, 0.0, plate.deep[2]])
    origin = plate.centre + plate.shift - turn @ lever
    wrench = np.hstack([forces @ turn, (moments - np.cross(origin, forces)) @ turn])
    if plate.delay:
        n = np.arange(len(wrench))
        wrench = np.stack([np.interp(n - plate.delay * rate, n, column) for column in wrench.T], axis=1)
    wrench = wrench @ plate.response.T + plate.offset
    wrench = wrench + rng.normal(0, plate.noise, wrench.shape) * [1, 1, 1, 0.25, 0.25, 0.25]
    if plate.lowpass:
        wrench = sosfiltfilt(butter(2, plate.lowpass, fs=rate, output="sos"), wrench, axis=0)
    return wrench


def split_kistler(plate: Plate, wrench: Array) -> Array:
    """Eight outputs fx12, fx34, fy14, fy23, fz1 to fz4 for six components, shape (n, 8); moments must be in N·m.

    The inverse of the manufacturer's sums: Mx = b (fz1 + fz2 - fz3 - fz4), My = a (-fz1 + fz2 + fz3 - fz4),
    Mz = b (-fx12 + fx34) + a (fy14 - fy23).
    """
    a, b = plate.deep[:2]
    fx, fy, fz, mx, my, mz = wrench.T
    shear = mz / (2 * (a**2 + b**2))
    sums = [fx / 2 - b * shear, fx / 2 + b * shear, fy / 2 + a * shear, fy / 2 - a * shear]
    corners = [fz / 4 + sx * mx / (4 * b) + sy * my / (4 * a) for sx, sy in ((1, -1), (1, 1), (-1, 1), (-1, -1))]
    return np.stack(sums + corners, axis=1)


def find_corners(plate: Plate) -> Array:
    """Surveyed corners, world, m, shape (3, 4), in the order of C3D: +x+y, -x+y, -x-y, +x-y of the plate."""
    signs = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    return (plate.centre + 0.5 * (signs * [*plate.size, 0]) @ plate.turn.T).T

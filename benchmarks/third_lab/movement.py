"""Movement: planned trunk and arms, legs that keep the feet where they stand, balance by the zero-moment point."""

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg import solve_banded
from scipy.spatial.transform import Rotation

from benchmarks.third_lab.faults import Array
from benchmarks.third_lab.people import Person
from benchmarks.third_lab.skeleton import COLUMNS, GRAVITY, SIDES, WIDTH, find_wrench, pose_segments

KNOTS = 50.0  # 1/s, of the splines that carry the movement
MOST_KNEE = np.radians(135)


@dataclass
class Plan:
    """What a movement wants, at `times`, in the world.

    Attributes
    ----------
    times : array, shape (n,)
        s, evenly spaced.
    angles : dict of str to array, shape (n, 3)
        Flexion, abduction, rotation (y, x, z) of the joints of trunk and arms, rad.
    pelvis : array, shape (n, 6)
        Place (m) over the feet, and yaw, pitch, roll (rad).
    ankles : dict of str to array, shape (n, 3)
        Ankle joints, m.
    feet : dict of str to array, shape (n, 3)
        Yaw, pitch, roll of the feet, rad.
    toes : dict of str to array, shape (n,)
        Extension of the toes, rad.
    share : array, shape (n,)
        Share of the load on the right foot, 0 to 1.
    centres : dict of str to array, shape (n, 2)
        Where under each foot its load is wanted, m.
    """

    times: Array
    angles: dict[str, Array]
    pelvis: Array
    ankles: dict[str, Array]
    feet: dict[str, Array]
    toes: dict[str, Array]
    share: Array
    centres: dict[str, Array]
    sway: Array = field(default_factory=lambda: np.zeros(2))


def ease(times: Array, knots: Array, values: Array) -> Array:
    """Go from value to value with least jerk and stand still in each.

    Parameters
    ----------
    times : array, shape (n,)
        s.
    knots : array, shape (k,)
        s, rising; a value is reached at its knot.
    values : array, shape (k,) or (k, m)

    Returns
    -------
    path : array, shape (n,) or (n, m)
    """
    i = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    s = np.clip((times - knots[i]) / (knots[i + 1] - knots[i]), 0, 1)
    s = s**3 * (10 - 15 * s + 6 * s**2)
    values = np.asarray(values, float)
    s = s.reshape(-1, *[1] * (values.ndim - 1))
    return values[i] + s * (values[i + 1] - values[i])


def realize(person: Person, plan: Plan, rounds: int = 5) -> BSpline:
    """Find the movement: the plan's pelvis, shifted so that the zero-moment point lies where the plan wants it.

    Parameters
    ----------
    person : Person
    plan : Plan
    rounds : int
        Corrections of the pelvis.

    Returns
    -------
    path : BSpline
        q over time, of degree five.
    """
    share = plan.share[:, None]
    wanted = share * plan.centres["right"] + (1 - share) * plan.centres["left"] + plan.sway
    shift = np.zeros_like(wanted)
    for _ in range(rounds):
        path = _solve_legs(person, plan, shift)
        shift = shift + _lead(plan.times, wanted - find_zmp(person, path, plan.times), plan.pelvis[:, 2].mean() * 1.05)
    return _solve_legs(person, plan, shift)


def find_zmp(person: Person, path: BSpline, times: Array) -> Array:
    """Zero-moment point on the floor, shape (n, 2), m."""
    forces, moments = find_wrench(person, path, times)
    return np.stack([-moments[:, 1], moments[:, 0]], axis=1) / forces[:, 2:]


def _lead(times: Array, error: Array, height: float) -> Array:
    """Solve shift - height/g d²shift/dt² = error, m: how an inverted pendulum moves its zero-moment point."""
    k = height / -GRAVITY[2] / (times[1] - times[0]) ** 2
    bands = np.array([np.full(len(times), -k), np.full(len(times), 1 + 2 * k), np.full(len(times), -k)])
    bands[1, [0, -1]], bands[0, 1], bands[2, -2] = 1.0, 0.0, 0.0  # at both ends the person stands still
    return solve_banded((1, 1), bands, error)


def _solve_legs(person: Person, plan: Plan, shift: Array) -> BSpline:
    """Bend hips, knees and ankles so that the feet are where the plan has them; q as a spline."""
    q = np.zeros((len(plan.times), WIDTH))
    for name, angles in plan.angles.items():
        q[:, COLUMNS[name]] = angles
    q[:, :6] = plan.pelvis
    q[:, :2] += shift
    turn = Rotation.from_euler("ZYX", q[:, COLUMNS["pelvis"]]).as_matrix()
    q[:, 2] = _lower(person, plan, q[:, :3], turn)
    for side in SIDES:
        thigh, shank, foot = (f"{side}_{name}" for name in ("thigh", "shank", "foot"))
        hip = q[:, :3] + turn @ person.offsets[thigh]
        sole = Rotation.from_euler("ZYX", plan.feet[side]).as_matrix()
        reach = plan.ankles[side] - hip
        bent, local = _bend_knee(person, side, np.linalg.norm(reach, axis=1))
        hip_turn = _frame(reach, sole[:, :, 1]) @ _frame(local, np.tile([0.0, 1.0, 0.0], (len(local), 1))).swapaxes(
            1, 2
        )
        knee_turn = Rotation.from_euler("YXZ", bent).as_matrix()
        ankle_turn = (hip_turn @ knee_turn).swapaxes(1, 2) @ sole
        q[:, COLUMNS[thigh]] = _angles(turn.swapaxes(1, 2) @ hip_turn)
        q[:, COLUMNS[shank]] = bent
        q[:, COLUMNS[foot]] = _angles(ankle_turn)
        q[:, COLUMNS[f"{side}_toes"].start] = -plan.toes[side]
    return make_interp_spline(plan.times, q, k=5)


def _lower(person: Person, plan: Plan, place: Array, turn: Array) -> Array:
    """Height of the pelvis, m: as planned, or softly less where a leg would not reach the floor, lifted or not."""
    heights = [place[:, 2]]
    for side in SIDES:
        hip = turn @ person.offsets[f"{side}_thigh"]
        longest = 0.996 * -(person.offsets[f"{side}_shank"][2] + person.offsets[f"{side}_foot"][2])
        flat = np.linalg.norm((plan.ankles[side] - place - hip)[:, :2], axis=1)
        heights.append(person.sizes["ankle"] + np.sqrt(np.maximum(longest**2 - flat**2, 0.01)) - hip[:, 2])
    soft = 0.006
    return -soft * np.log(np.exp(-(np.array(heights) - heights[0]) / soft).sum(axis=0)) + heights[0]


def _bend_knee(person: Person, side: str, distance: Array) -> tuple[Array, Array]:
    """Angles of the knee (n, 3) for hip-to-ankle distances (m), and the ankle as seen from the thigh (n, 3).

    The shank turns inwards and abducts a little as the knee bends (screw-home movement: no ideal hinge).
    """
    bend = np.linspace(0.0, MOST_KNEE, 400)
    angles = np.stack([bend, SIDES[side] * 0.03 * np.sin(bend), -SIDES[side] * 0.16 * (1 - np.exp(-2 * bend))], axis=1)
    ankle = person.offsets[f"{side}_shank"] + Rotation.from_euler("YXZ", angles).apply(person.offsets[f"{side}_foot"])
    squared = (ankle**2).sum(axis=1)  # smooth in the bend, unlike the distance itself
    table = make_interp_spline(bend, np.hstack([ankle, angles]), k=5)
    found = np.interp(-(distance**2), -squared, bend)
    for _ in range(3):
        value, slope = table(found)[:, :3], table(found, 1)[:, :3]
        rate = np.minimum(2 * (value * slope).sum(axis=1), -1e-4)
        found = np.clip(found - ((value**2).sum(axis=1) - distance**2) / rate, 0.01, MOST_KNEE)
    value = table(found)
    return value[:, 3:], value[:, :3]


def _frame(along: Array, beside: Array) -> Array:
    """Orthogonal frames (n, 3, 3) whose first axis is `along` and whose second is as near `beside` as can be."""
    first = along / np.linalg.norm(along, axis=1, keepdims=True)
    second = beside - (beside * first).sum(axis=1, keepdims=True) * first
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    return np.stack([first, second, np.cross(first, second)], axis=2)


def _angles(matrices: Array) -> Array:
    """Angles y, x, z of rotation matrices, shape (n, 3), without jumps."""
    return np.unwrap(Rotation.from_matrix(matrices).as_euler("YXZ"), axis=0)


def check_feet(person: Person, path: BSpline, plan: Plan) -> float:
    """Largest distance of an ankle from where the plan has it, m."""
    _, places = pose_segments(person, path(plan.times))
    return max(float(np.abs(places[f"{side}_foot"] - plan.ankles[side]).max()) for side in SIDES)

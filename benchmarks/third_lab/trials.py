"""What is performed: static, quiet standing, six dances, squats. All stand with one foot on each plate."""

import numpy as np

from benchmarks.third_lab.faults import Array
from benchmarks.third_lab.movement import KNOTS, Plan, ease
from benchmarks.third_lab.people import Person
from benchmarks.third_lab.skeleton import NAMES, SIDES

# joint: lowest and highest of flexion, abduction, rotation in degrees (abduction and rotation outwards)
ARMS = {
    "clavicle": ((0, 0), (-4, 16), (-8, 8)),
    "upper_arm": ((-125, 25), (10, 95), (-8, 50)),
    "forearm": ((-120, -8), (0, 0), (-70, 60)),
    "hand": ((-30, 30), (-12, 12), (0, 0)),
}
TRUNK = {
    "lumbar": ((-6, 22), (-9, 9), (-4, 4)),
    "waist": ((-6, 20), (-9, 9), (-8, 8)),
    "thorax": ((-5, 16), (-8, 8), (-14, 14)),
    "neck": ((-10, 18), (-10, 10), (-22, 22)),
    "head": ((-10, 14), (-8, 8), (-22, 22)),
}
DANCES = ("arms", "bend", "twist", "half_squat", "right_knee", "left_knee")
MORE = {
    "arms": {"arms": 1.0, "trunk": 0.25},
    "bend": {"arms": 0.6, "trunk": 1.0},
    "twist": {"arms": 0.8, "trunk": 0.9},
    "half_squat": {"arms": 0.8, "trunk": 0.5},
    "right_knee": {"arms": 0.6, "trunk": 0.35},
    "left_knee": {"arms": 0.6, "trunk": 0.35},
    "squat": {"arms": 0.15, "trunk": 0.2},
    "stand": {},
}


def plan_trial(rng: np.random.Generator, person: Person, kind: str, seconds: float, width: float) -> Plan:
    """Plan one trial of standing on both plates, looking along y of the world.

    Parameters
    ----------
    rng : numpy.random.Generator
    person : Person
    kind : str
        "stand", "squat" or one of DANCES.
    seconds : float
    width : float
        Distance between the ankles, m.

    Returns
    -------
    plan : Plan
    """
    times = np.arange(0, seconds + 0.5 / KNOTS, 1 / KNOTS)
    times = times[: len(times)]
    knots = np.concatenate([[0.0, 0.4], np.cumsum(rng.uniform(0.9, 1.6, 40)) + 0.4])
    knots = np.append(knots[knots < seconds - 1.2], [seconds - 0.3, seconds])
    plan = _stand(rng, person, times, width)
    more = MORE[kind]
    for names, size in ((TRUNK, more.get("trunk", 0.0)), (ARMS, more.get("arms", 0.0))):
        for name, ranges in names.items():
            for side, sign in ({"": 1} if name in TRUNK else SIDES).items():
                angles = size * _targets(rng, ranges, knots, sign if side else 1)
                plan.angles[f"{side}_{name}" if side else name] += ease(times, knots, angles)
    plan.pelvis[:, 3:] += ease(
        times, knots, np.radians(10 * more.get("trunk", 0.0)) * _ends(rng.normal(0, 0.4, (len(knots), 3)))
    )
    if kind in ("squat", "half_squat"):
        _squat(rng, plan, person, 0.36 if kind == "squat" else 0.20)
    if kind in ("right_knee", "left_knee"):
        _lift_knee(rng, plan, person, kind.split("_")[0])
    return plan


def _targets(rng: np.random.Generator, ranges: tuple[tuple[float, float], ...], knots: Array, sign: int) -> Array:
    """Draw angles for each knot, rad, shape (k, 3); zero at the first two and last two knots."""
    low, high = np.radians(np.array(ranges, float)).T
    return _ends(rng.uniform(low, high, (len(knots), 3))) * [1, sign, sign]


def _ends(values: Array) -> Array:
    """Values with nothing at the two first and the two last knots."""
    values = values.copy()
    values[[0, 1, -2, -1]] = 0.0
    return values


def _stand(rng: np.random.Generator, person: Person, times: Array, width: float) -> Plan:
    """Upright on both feet, arms a little away from the body, with the small unrest of a living person."""
    n, ankle = len(times), person.sizes["ankle"]
    angles = {
        name: _unrest(rng, times, 0.003)
        for name in NAMES
        if not name.endswith(("pelvis", "thigh", "shank", "foot", "toes"))
    }
    for side, sign in SIDES.items():
        angles[f"{side}_upper_arm"] += [-0.06, sign * 0.17, 0]
        angles[f"{side}_forearm"] += [-0.2, 0, 0]
    angles["lumbar"] += [-0.06, 0, 0]
    angles["waist"] += [0.03, 0, 0]
    angles["neck"] += [0.08, 0, 0]
    height = ankle - min(person.offsets[f"{s}_shank"][2] + person.offsets[f"{s}_foot"][2] for s in SIDES) - 0.014
    pelvis = np.tile([0.0, 0.0, height, np.pi / 2, 0.04, 0.0], (n, 1))
    pelvis[:, 2:] += _unrest(rng, times, 0.002, 4)
    ankles, feet, centres = {}, {}, {}
    for side, sign in SIDES.items():
        out = sign * rng.uniform(0.06, 0.2)
        place = np.array([-sign * width / 2 + rng.normal(0, 0.005), -0.06 + rng.normal(0, 0.008), ankle])
        ankles[side] = np.tile(place, (n, 1))
        feet[side] = np.tile([np.pi / 2 + out, 0.0, 0.0], (n, 1))
        ahead = 0.22 * person.sizes["foot"]
        centres[side] = np.tile(place[:2] + ahead * np.array([-np.sin(out), np.cos(out)]), (n, 1))
    return Plan(
        times,
        angles,
        pelvis,
        ankles,
        feet,
        {side: np.zeros(n) for side in SIDES},
        0.5 + 3 * _unrest(rng, times, 0.008, 1)[:, 0],
        centres,
        2 * _unrest(rng, times, 0.002, 2),
    )


def _unrest(rng: np.random.Generator, times: Array, size: float, columns: int = 3) -> Array:
    """Smooth random drifts of about 0.15 to 1 Hz; none at the ends. Shape (n, columns)."""
    knots = np.linspace(times[0], times[-1], max(4, int(2.2 * (times[-1] - times[0]))))
    return ease(times, knots, _ends(rng.normal(0, size, (len(knots), columns))))


def _squat(rng: np.random.Generator, plan: Plan, person: Person, depth: float) -> None:
    """Go down by about `depth` of the stature and up again, several times, the trunk leaning ahead."""
    pace = rng.uniform(1.1, 1.5)
    knots = np.arange(0.5, plan.times[-1] - pace, pace)
    down = np.where(np.arange(len(knots)) % 2, rng.uniform(0.7, 1.0, len(knots)), 0.0)
    down[-1] = 0.0
    course = ease(plan.times, knots, down)
    plan.pelvis[:, 2] -= 0.62 * depth * person.height * course
    plan.pelvis[:, 4] += 0.55 * course
    for name, lean in {"lumbar": 0.16, "waist": 0.12, "thorax": 0.08, "neck": -0.12, "head": -0.15}.items():
        plan.angles[name][:, 0] += lean * course
    for side in SIDES:
        plan.angles[f"{side}_upper_arm"][:, 0] -= 1.1 * course


def _lift_knee(rng: np.random.Generator, plan: Plan, person: Person, side: str) -> None:
    """Shift the weight to the other leg, lift the knee, put the foot back where it was, shift back."""
    times, end = plan.times, plan.times[-1]
    other = "left" if side == "right" else "right"
    start, stop = 2.2, end - 2.2
    all_on = 0.0 if side == "right" else 1.0
    plan.share = ease(
        times,
        np.array([0.0, 0.6, start - 0.3, stop + 0.3, end - 0.4, end]),
        np.array([0.5, 0.5, all_on, all_on, 0.5, 0.5]),
    )
    plan.sway = plan.sway * 0.5
    ups = np.linspace(start, stop, 5)
    high = person.height * rng.uniform([0.10, 0.04], [0.19, 0.08])
    course = np.array([[0, 0, 0], [0.10, 0.02, high[0]], [0.02, 0.03, high[1]], [0.12, 0.0, high[0]], [0, 0, 0]])
    yaw = plan.feet[side][0, 0]
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    outward = np.array([1, SIDES[side], 1])
    plan.ankles[side] += ease(times, ups, (course * outward) @ turn.T)
    plan.feet[side][:, 1] += ease(times, ups, np.array([0, 0.45, 0.3, 0.4, 0]))
    plan.pelvis[:, 5] += ease(times, ups, np.array([0, 0.05, 0.03, 0.05, 0])) * -SIDES[other]

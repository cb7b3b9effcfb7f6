"""What the ground must give: mechanics, wobbling, a rail; shared between the feet."""

import numpy as np
from scipy.interpolate import BSpline, CubicSpline

from benchmarks.third_lab.faults import Array, Fault
from benchmarks.third_lab.movement import Plan
from benchmarks.third_lab.people import Person
from benchmarks.third_lab.skeleton import find_wrench, pose_segments
from benchmarks.third_lab.tissue import Tissue, shake
from benchmarks.third_lab.write import Room

FORCE_RATE = 250.0  # 1/s, of the mechanics; nothing in these movements is faster than 14 Hz
RAIL = ("dance_bend", "dance_half_squat", "dance_right_knee")  # trials in which a rail is held


def weigh_trial(
    rng: np.random.Generator,
    person: Person,
    tissue: Tissue,
    path: BSpline,
    plan: Plan,
    room: Room,
    fault: Fault,
    name: str,
) -> list[tuple[Array, Array]]:
    """Weigh a trial: force and moment (about the origin of the world) on plates 1 and 2, at the analog rate.

    Looking along y the left foot stands on plate 1, which lies at negative x.
    """
    times = np.arange(0, plan.times[-1], 1 / FORCE_RATE)
    forces, moments = find_wrench(person, path, times)
    more = shake(person, tissue, path, times)
    forces, moments = forces + more[0], moments + more[1]
    if fault.kind == "rail" and name in RAIL:
        pull, turn = hold_rail(person, path, times, fault)
        forces, moments = forces - pull, moments - turn
    feet = share_ground(rng, person, plan, times, forces, moments)
    samples = np.arange(round(times.size / FORCE_RATE * room.camera_rate) * round(room.analog_rate / room.camera_rate))
    at = samples / room.analog_rate
    return [(CubicSpline(times, feet[s][0])(at), CubicSpline(times, feet[s][1])(at)) for s in ("left", "right")]


def hold_rail(person: Person, path: BSpline, times: Array, fault: Fault) -> tuple[Array, Array]:
    """Let a rail carry a hand, force and moment: comes and goes slowly, mostly upwards."""
    rotations, places = pose_segments(person, path(times))
    hand = places[fault.target] + rotations[fault.target] @ np.array([0, 0, -0.08])
    course = np.clip(1.6 * np.sin(np.pi * np.clip((times - 2) / (times[-1] - 4), 0, 1)), 0, 1)[:, None]
    pull = fault.size * course * [0.0, 0.3, 1.0]
    return pull, np.cross(hand, pull)


def share_ground(
    rng: np.random.Generator, person: Person, plan: Plan, times: Array, forces: Array, moments: Array
) -> dict[str, tuple[Array, Array]]:
    """Share the ground's wrench between the feet; they also push against each other a little.

    Both centres of pressure lie on a line through the common one, as far apart as the feet; so shares, forces and
    moments add up.
    """

    def at(values: Array) -> Array:
        return CubicSpline(plan.times, values)(times)

    share = np.clip(at(plan.share), 0, 1)[:, None]
    zmp = np.stack([-moments[:, 1], moments[:, 0]], axis=1) / forces[:, 2:]
    apart = at(plan.centres["right"] - plan.centres["left"])
    free = moments[:, 2] - (zmp[:, 0] * forces[:, 1] - zmp[:, 1] * forces[:, 0])
    inward = 4 * share * (1 - share) * rng.uniform(0.0, 0.04) * person.mass * 9.81
    direction = np.hstack([apart, np.zeros((len(times), 1))]) / np.linalg.norm(apart, axis=1, keepdims=True)
    feet = {}
    for side, part, where, sign in (
        ("right", share, zmp + (1 - share) * apart, -1),
        ("left", 1 - share, zmp - share * apart, 1),
    ):
        force = part * forces + sign * inward * direction
        point = np.hstack([where, np.zeros((len(times), 1))])
        feet[side] = force, np.cross(point, force) + np.outer(part[:, 0] * free, [0, 0, 1])
    return feet

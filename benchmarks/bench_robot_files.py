"""Robots as they are shipped: read, recorded on one leg by inverse dynamics (pinocchio), identified.

    python benchmarks/bench_robot_files.py FOLDER_OF_ROBOTS OUT [name ...]

FOLDER_OF_ROBOTS: share/example-robot-data/robots of the wheel example-robot-data. The robot stands on its left foot and
moves every joint by sums of two sines for 40 s; its heaviest link is 10 % lighter than drawn. Files as a laboratory
would write them, noise as on HOAP-3 (encoders 0.0005 rad, plate 0.3 N). Times of the processor: made, identified.
"""

import sys
import time as clock
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
from robot_lab import RobotLab, write_robot_trial

from biodance.body.body import Body
from biodance.body.robot.urdf import read_urdf
from biodance.errors import BiodanceError
from biodance.motion.grounded import _soles
from biodance.pipeline.robot import identify_robot
from biodance.records import Array, Sip

TALOS, G1 = ("leg_right_6_link", "leg_left_6_link"), ("right_ankle_roll_link", "left_ankle_roll_link")
ROBOTS: dict[str, tuple[str, tuple[str, str]]] = {
    "talos_reduced": ("talos_data/robots/talos_reduced.urdf", TALOS),
    "talos_full_v2": ("talos_data/robots/talos_full_v2.urdf", TALOS),
    "talos_full_v2_box": ("talos_data/robots/talos_full_v2_box.urdf", TALOS),
    "icub": ("icub_description/robots/icub.urdf", ("r_foot", "l_foot")),
    "icub_reduced": ("icub_description/robots/icub_reduced.urdf", ("r_foot", "l_foot")),
    "g1": ("g1_description/urdf/g1_29dof_rev_1_0.urdf", G1),
    "g1_hands": ("g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf", G1),
    "alexander_legs": ("alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf", ("RIGHT_FOOT", "LEFT_FOOT")),
    "romeo": ("romeo_description/urdf/romeo.urdf", ("r_ankle", "l_ankle")),
    "romeo_small": ("romeo_description/urdf/romeo_small.urdf", ("r_ankle", "l_ankle")),
    "romeo_small, mended": ("romeo_description/urdf/romeo_small.urdf", ("r_ankle", "l_ankle")),
}
RATE, SECONDS, LIGHTER = 200.0, 40.0, 0.9


def stands(body: Body, angle: Array) -> tuple[Array, Array]:
    """Return how far over the plane of the left sole the right one is, and how far from its middle the robot's centre
    of mass is above it, (T,) m each.
    """
    turn, place, height = _soles(body, angle)
    data, away = body.model.createData(), []
    for one, rotation, middle in zip(angle, turn[1], place[1], strict=True):
        com = pin.centerOfMass(body.model, data, np.concatenate([[0.0, 0, 0, 0, 0, 0, 1], one]))
        away.append(np.linalg.norm((rotation.T @ (com - middle))[:2]))
    return height[1], np.array(away)


def one_legged(body: Body, rng: np.random.Generator) -> Array:
    """Return angles (T, n) rad whose right sole stays over the plane of the left one."""
    time, n = np.arange(0, SECONDS, 1 / RATE), len(body.joints)
    low, high = body.limits.lower + 0.02, body.limits.upper - 0.02
    best, chosen = -np.inf, np.zeros(n)
    for k in range(3000):
        spread = 0.4 if k < 300 else 0.1
        centre = np.clip(chosen + rng.normal(0, spread, n), 0.8 * low, 0.8 * high)
        lift, away = stands(body, centre[None])
        if (score := float(min(lift[0], 0.08) - 2 * max(away[0] - 0.02, 0.0))) > best:
            best, chosen = score, centre
    size = np.minimum(0.25, 0.9 * np.minimum(chosen - low, high - chosen)).clip(0)
    rhythm, phase = rng.uniform(0.1, 0.6, (2, n)), rng.uniform(0, 2 * np.pi, (2, n))
    while True:
        waves = sum(w * np.sin(2 * np.pi * rhythm[k] * time[:, None] + phase[k]) for k, w in ((0, 0.6), (1, 0.4)))
        angle = chosen + size * waves
        lift, away = stands(body, angle[::20])
        if lift.min() > 0.01 and away.max() < 0.15:
            return np.asarray(angle)
        size = 0.8 * size


def needed(body: Body, angle: Array) -> Array:
    """Return the wrench (T - 2, 6) of the ground on a robot that stands on its left sole, by pinocchio alone."""
    model, foot = body.model, body.feet["left"]
    data, ankle = model.createData(), body.segment_joint[foot.segment] + 2
    turn, place, _ = _soles(body, angle[:1])
    first = np.concatenate([[0.0, 0, 0, 0, 0, 0, 1], angle[0]])
    pin.forwardKinematics(model, data, first)
    planted = pin.SE3(turn[1, 0], place[1, 0]).inverse() * data.oMi[ankle]
    q = np.empty((len(angle), model.nq))
    for t, one in enumerate(angle):
        pin.forwardKinematics(model, data, np.concatenate([first[:7], one]))
        q[t] = np.concatenate([pin.SE3ToXYZQUAT(planted * data.oMi[ankle].inverse()), one])
    v = np.array([pin.difference(model, a, b) for a, b in zip(q[:-2], q[2:], strict=True)]) * RATE / 2
    a = np.gradient(v, 1 / RATE, axis=0)
    wrenches = []
    for now, rate, change in zip(q[1:-1], v, a, strict=True):
        force = pin.Force(pin.rnea(model, data, now, rate, change)[:6])
        wrenches.append(pin.XYZQUATToSE3(now[:7]).act(force).vector)
    return np.array(wrenches)


def try_robot(name: str, folder: Path, out: Path) -> str:
    """Return the row of one robot."""
    path, feet = ROBOTS[name]
    start, mend = clock.process_time(), name.endswith("mended")
    try:
        body = read_urdf(folder / path, feet=feet, mend=mend)
    except BiodanceError as why:
        return f"| {name} | refused: {str(why).replace(str(folder / path), '').strip(': ')} |"
    phi = np.array(body.sip.phi)
    heavy = int(np.argmax(phi[::10]))
    phi[10 * heavy : 10 * heavy + 10] *= LIGHTER
    real = replace(body, sip=Sip(body.segments, phi, body.sip.covariance))
    angle = one_legged(body, np.random.default_rng(1))
    wrench, time = needed(real, angle), np.arange(1, len(angle) - 1) / RATE
    names = tuple(joint.name for joint in body.joints)
    write_robot_trial(out / name / "run", names, time, angle[1:-1], wrench, lab=RobotLab(), seed=0)
    made = clock.process_time()
    try:
        result = identify_robot(out / name, urdf=folder / path, feet=feet, mend=mend)
    except BiodanceError as why:
        return f"| {name} | read ({len(body.segments)} links, {len(names)} joints); not identified: {why} |"
    done = result.identified.identification
    kept = result.identified.validations[0]
    mass = [float(x) for x in (phi[10 * heavy], body.sip.mass[heavy], done.sip.mass[heavy])]
    sd = float(np.sqrt(done.sip.covariance[10 * heavy, 10 * heavy]))
    named = ", ".join(f"{one.cause.kind} {one.cause.where} {one.value:.3g}" for one in result.causes)
    rms = [" ".join(f"{x:.2f}" for x in one.rms) for one in (kept.table_agreement, kept.identified_agreement)]
    return (
        f"| {name} | {len(body.segments)} links, {len(names)} joints | "
        f"{body.sip.mass.sum():.1f}, {real.sip.mass.sum():.1f}, {done.sip.mass.sum():.2f}"
        f" | {body.segments[heavy]} {mass[1]:.2f}, {mass[0]:.2f}, {mass[2]:.2f} ± {sd:.2f} | "
        f"{rms[0]} | {rms[1]} | {result.verdict} {named} | {made - start:.0f} + {clock.process_time() - made:.0f} s |"
    )


def main(folder: str, out: str, *names: str) -> None:
    """Print one row a robot."""
    sys.stdout.write(
        "| robot | size | kg drawn, true, identified | heaviest link | RMS drawn | RMS identified | causes | time |\n"
    )
    sys.stdout.write("|---" * 8 + "|\n")
    for name in names or tuple(ROBOTS):
        sys.stdout.write(try_robot(name, Path(folder), Path(out)) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])

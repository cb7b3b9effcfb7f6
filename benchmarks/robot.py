"""A virtual HOAP-3 in MuJoCo, recorded as a laboratory would, identified through the front door; truth per link.

    biodance dance --urdf hoap3.urdf --feet right_foot,left_foot --protocol fit.toml --out FIT
    biodance dance --urdf hoap3.urdf --feet right_foot,left_foot --protocol other.toml --seed 5 --out UNSEEN
    python -m benchmarks robot record FIT UNSEEN hoap3.urdf RECORDING [trouble=number ...]
    biodance identify RECORDING --urdf hoap3.urdf --feet right_foot,left_foot --out DONE
    python -m benchmarks robot judge RECORDING DONE

The robot plays its dance by its joints alone, free on a floor with friction, as its person-sized similar model
(Froude), whose times and forces are scaled back. Covers and cables are taken off: the simulated robot is lighter than
the URDF. Troubles (paper IV.C): `pid=3` every joint by PID alone, of so many times the usual stiffness (else spring,
damper and the drawing's torque), `ankle=200` the pitch of the ankles gives behind the encoder (N·m/rad), `stiction=0.1`
N·m in every joint, `friction=0.3` under the feet.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from robot_lab import RobotLab, write_robot_trial

from biodance.body.body import Body
from biodance.body.parts import smallest_eigenvalues
from biodance.body.similarity import SimilarityScale, similar_body, standing_frames
from biodance.body.urdf import read_urdf
from biodance.dance.dance import Dance
from biodance.dance.playback import _STEP, SETTLE, _Driver, _floor_wrench, bearing, floor_model, planned_torques
from biodance.dance.robot import person_sized, shrunk
from biodance.motion.dynamics import predict_wrench
from biodance.records import Array, Sip
from biodance.spatial import point_mass

FEET = ("right_foot", "left_foot")
COVERS = {
    "trunk_head": (0.30, (0.5, 0.5, 0.5)), "pelvis": (0.04, (0.5, 0.5, 0.5)), "right_thigh": (0.07, (0.5, 0.5, 0.3)),
    "left_thigh": (0.07, (0.5, 0.5, 0.3)), "right_shank": (0.05, (0.5, 0.5, 0.7)),
    "left_shank": (0.05, (0.5, 0.5, 0.7)),
}  # fmt: skip
"""kg taken off a link, and where in its box (shares of its sides)."""
INTEGRAL = 0.3
"""s: integral time of the motors, in the likeness."""
EVERY = 8
"""Steps of the simulation between samples."""


def bare(body: Body) -> Body:
    """Return the robot without covers and cables."""
    phi = np.array(body.sip.phi)
    for link, (mass, share) in COVERS.items():
        i = body.segment_index(link)
        low, high = body.boxes[i]
        phi[10 * i : 10 * i + 10] -= point_mass(mass, low + np.array(share) * (high - low), radius=0.03)
    assert smallest_eigenvalues(phi).min() > 0, "covers heavier than the links"
    return replace(body, sip=Sip(body.segments, phi, body.sip.covariance))


class Joints(_Driver):
    """Motors of a robot in its person-sized similar model, with troubles; ``units`` N·m of the likeness per N·m."""

    def __init__(self, body: Body, model: Any, troubles: dict[str, float], units: float) -> None:
        super().__init__(body, model)
        self.past = np.zeros(len(body.joints)) if "pid" in troubles else None
        self.stiffness = self.stiffness * troubles.get("pid", 1.0)
        self.soft = np.full(len(body.joints), np.inf)
        self.soft[ankles(body)] = units * troubles.get("ankle", np.inf)
        self.share = 1 / (1 + self.stiffness / self.soft)
        model.dof_damping[self.v_place] *= self.share * troubles.get("pid", 1.0)
        model.dof_frictionloss[self.v_place] = units * troubles.get("stiction", 0.0)

    def drive(self, data: Any, angle: Array, rate: Array, torque: Array) -> None:
        """Set the motors' torques; behind a joint that gives, motor and spring are in series."""
        if self.past is not None:
            encoder = data.qpos[self.q_place] + data.qfrc_applied[self.v_place] / self.soft
            self.past += _STEP / INTEGRAL * (angle - encoder)
            torque = self.stiffness * self.past
        super().drive(data, angle, rate, torque)
        data.qfrc_applied[self.v_place] *= self.share


def ankles(body: Body) -> list[int]:
    """Return the joints that bend the ankles forwards."""
    return [i for i, joint in enumerate(body.joints) if "ankle_pitch" in joint.name]


def simulate(dance: Dance, truth: Body, hold: float, troubles: dict[str, float]) -> tuple[Array, Array, Array, Array]:
    """Return times (T,) s, joint angles (T, n) behind the motors, torques (T, n) and the floor's wrench (T, 6) of the
    played dance, in the robot's own size.
    """
    import mujoco

    to = person_sized(dance.body)
    plan = replace(dance, hold=np.minimum(dance.hold, hold))
    big = shrunk(plan, similar_body(dance.body, to), SimilarityScale(1 / to.length, 1 / to.mass))
    motion = big.motion(100.0)
    torque = planned_torques(big.body, motion, predict_wrench(big.body, motion), bearing(big, motion.time))
    model = floor_model(similar_body(truth, to), friction=troubles.get("friction", 0.5))
    data, driver = mujoco.MjData(model), Joints(big.body, model, troubles, to.mass * to.length)
    driver.place(data, motion.q[0], motion.v[0])
    for _ in range(round(SETTLE / _STEP)):
        driver.drive(data, motion.q[0, 7:], np.zeros(torque.shape[1]), torque[0])
        mujoco.mj_step(model, data)
    target = np.concatenate([motion.q[:, 7:], motion.v[:, 6:], torque], axis=1)
    rows, n = [], torque.shape[1]
    steps = int(motion.time[-1] / _STEP)
    for k in range(steps):
        at = k * _STEP * 100.0
        i, share = int(at), at - int(at)
        now = (1 - share) * target[i] + share * target[min(i + 1, len(target) - 1)]
        driver.drive(data, now[:n], now[n : 2 * n], now[2 * n :])
        mujoco.mj_step(model, data)
        if k % EVERY == 0:
            applied = data.qfrc_applied[driver.v_place] + data.qfrc_passive[driver.v_place]
            rows.append((k * _STEP, data.qpos[driver.q_place].copy(), applied, _floor_wrench(data)))
            if data.qpos[2] < 0.5 * motion.q[0, 2]:
                print(f"worst joint: {np.abs(now[:n] - data.qpos[driver.q_place]).max():.2f} rad from the plan")
                raise SystemExit(f"fell at {k * _STEP / to.time:.1f} s")
    time, q, applied, wrench = (np.array(column) for column in zip(*rows, strict=True))
    units = to.mass * np.array([1.0] * 3 + [to.length] * 3)
    return time / to.time, q, applied / (to.mass * to.length), wrench / units


def record(fit: str, unseen: str, urdf: str, out: str, *words: str) -> None:
    """Write the recording of both dances, and the truth beside its folder."""
    folder, drawn = Path(out), read_urdf(urdf, feet=FEET)
    troubles = {key: float(value) for key, value in (word.split("=") for word in words)}
    truth = bare(drawn)
    physical = "_".join(f"{key}{value:g}" for key, value in sorted(troubles.items()))
    for k, (name, source) in enumerate((("dance", fit), ("unseen", unseen))):
        dance = Dance.load(Path(source) / "dance.npz")
        cache = Path(source) / f"played_{physical}.npz"
        if not cache.exists():
            played = simulate(dance, replace(dance.body, sip=standing_frames(truth).sip), 1.0, troubles)
            np.savez(cache, *played)
        time, angle, torque, wrench = np.load(cache).values()
        angle[:, ankles(drawn)] += torque[:, ankles(drawn)] / troubles.get("ankle", np.inf)  # as encoders show it
        lab = RobotLab(ahead=0.37 + k, place=(0.03 - 0.05 * k, -0.02), yaw=0.1 - 0.3 * k)
        write_robot_trial(folder / name, tuple(j.name for j in drawn.joints), time, angle, wrench, lab=lab, seed=k)
        print(f"{name}: {time[-1]:.1f} s, stayed up")
    truth_file = folder.with_name(folder.name + ".truth.json")
    truth_file.write_text(json.dumps({"links": truth.segments, "phi": truth.sip.phi.tolist(), "troubles": troubles}))


def judge(recording: str, done: str) -> None:
    """Print identified against drawing and truth."""
    truth = json.loads(Path(recording + ".truth.json").read_text())
    found: dict[str, Any] = json.loads((Path(done) / "results.json").read_text())
    phi = np.reshape(truth["phi"], (-1, 10))
    print("| link | CAD (g) | truth (g) | identified (g) | CoM error CAD, identified (mm) |", "|---|---|---|---|---|")
    errors = []
    for ten, row in zip(phi, found["segments"], strict=True):
        com = ten[1:4] / ten[0]
        off = [1e3 * float(np.linalg.norm(np.array(row[key]) - com)) for key in ("com_prior_m", "com_m")]
        sd = 1e3 * row["mass_sd_kg"]
        g = [1e3 * x for x in (row["mass_prior_kg"], ten[0], row["mass_kg"])]
        errors.append((g[0] - g[1], g[2] - g[1], *off, abs(g[2] - g[1]) < 1.96 * sd))
        print(f"| {row['name']} | {g[0]:.0f} | {g[1]:.0f} | {g[2]:.0f} ± {sd:.0f} | {off[0]:.1f}, {off[1]:.1f} |")
    table = np.array(errors)
    rms = np.sqrt(np.mean(table[:, :4] ** 2, axis=0))
    print(
        f"RMS error: mass {rms[0]:.0f} -> {rms[1]:.0f} g, CoM {rms[2]:.1f} -> {rms[3]:.1f} mm; "
        f"{table[:, 4].sum():.0f} of {len(table)} masses within their 95 % intervals"
    )
    print(*(f"{k}: {v}" for k, v in found["diagnosis"].items()))
    for key in ("fitted", "validation"):
        for trial in found[key]:
            for who in ("table", "identified"):
                print(f"{key} {trial['trial']} {who}: rms {' '.join(f'{x:.2f}' for x in trial[who]['rms'])}")


def main() -> None:
    """Record or judge."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("what", choices=("record", "judge"))
    ask.add_argument("words", nargs="+", help="as above")
    asked = ask.parse_args()
    {"record": record, "judge": judge}[asked.what](*asked.words)

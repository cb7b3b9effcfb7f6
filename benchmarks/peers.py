"""The paper's quadratic programme and biodance on the same synthetic wrench, default settings: error and time.

    python -m benchmarks peers [--subjects 4] [--first SEED]

Every subject: 12 segments whose true parameters differ from the table (masses 15 %, centres and shapes 10 % of the
body's size), a smooth whole-body motion of 60 s, plate noise of 5 N and 2 N·m; once with exact kinematics, once with
joint angles as a gait laboratory has them (2 deg of offset, 3 % of the angle from moving skin). Prints two tables.
"""

import argparse
import time
from dataclasses import dataclass

import numpy as np
from direct_information import information
from scipy.interpolate import CubicSpline

from benchmarks.people import first_seed
from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.body.parts import smallest_eigenvalues
from biodance.identification.identification import identify_body
from biodance.identification.knowledge import segment_quantities
from biodance.identification.paper_programme import paper_programme
from biodance.identification.statistics import Fit
from biodance.motion.dynamics import regressor
from biodance.records import Array, Motion, Subject, Wrench
from biodance.uncertainty.bands import Noise
from biodance.virtual_lab.person import of_parameters, parameters_of_inertia, place_inertia

SUBJECTS = (Subject(52.0, 1.58, "F"), Subject(66.0, 1.71, "F"), Subject(78.0, 1.80, "M"), Subject(97.0, 1.88, "M"))
SECONDS, RATE, NOISE = 60.0, 100.0, (5.0, 2.0)


@dataclass(frozen=True)
class Score:
    """Errors: mass, RMS and largest kg; CoM and inertia, median mm and %; wrench N, N·m; impossible segments."""

    mass: float
    largest: float
    com: float
    inertia: float
    force: float
    moment: float
    impossible: int
    seconds: float


def true_parameters(body: Body, rng: np.random.Generator) -> Array:
    """Return a person of the same mass whose segments are stretched, shifted, heavier or lighter than the table's."""
    bodies = []
    for phi in body.sip.phi.reshape(-1, 10):
        J = of_parameters(phi)
        com = J[:3, 3] / J[3, 3]
        centred = place_inertia(J, np.eye(3), -com)
        size = np.sqrt(np.abs(np.diag(centred)[:3]) / J[3, 3])
        shift = com + 0.1 * size * rng.normal(size=3)
        bodies.append(
            np.exp(0.15 * rng.normal()) * place_inertia(centred, np.eye(3) + 0.1 * rng.normal(size=(3, 3)), shift)
        )
    total = sum(J[3, 3] for J in bodies)
    return np.concatenate([parameters_of_inertia(J * body.sip.mass.sum() / total) for J in bodies])


def dance(body: Body, rng: np.random.Generator) -> Motion:
    """Return a smooth random motion of all joints over most of their range, with the pelvis swaying."""
    time_ = np.arange(0, SECONDS, 1 / RATE)
    knots = np.arange(0, SECONDS + 2, 0.8)
    middle, half = (body.limits.lower + body.limits.upper) / 2, 0.35 * (body.limits.upper - body.limits.lower)
    curve = CubicSpline(knots, rng.uniform(-1, 1, (knots.size, len(body.joints))) * half + 0.5 * middle)
    place = CubicSpline(knots, rng.normal([0.0, 0.0, 0.9], 0.1, (knots.size, 3)))
    q, v, a = np.tile(body.neutral, (time_.size, 1)), np.zeros((time_.size, body.nv)), np.zeros((time_.size, body.nv))
    q[:, :3], q[:, 7:], v[:, 6:], a[:, 6:] = place(time_), curve(time_), curve(time_, 1), curve(time_, 2)
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # root from lab, upright
    v[:, :3], a[:, :3] = place(time_, 1) @ turn.T, place(time_, 2) @ turn.T
    return Motion(time_, q, v, a)


def measured(motion: Motion, rng: np.random.Generator) -> Motion:
    """Return the motion as a laboratory finds it: every joint angle with a constant offset, and a wrong gain."""
    q, v, a = np.array(motion.q), np.array(motion.v), np.array(motion.a)
    gain = 1 + 0.03 * rng.normal(size=v.shape[1] - 6)
    q[:, 7:] = q[:, 7:] * gain + np.radians(2.0) * rng.normal(size=gain.size)
    v[:, 6:], a[:, 6:] = v[:, 6:] * gain, a[:, 6:] * gain
    return Motion(motion.time, q, v, a)


def score(phi: Array, truth: Array, W: Array, seconds: float) -> Score:
    """Judge parameters against the true ones and their wrench against the noise-free one."""
    found, right = (np.array([segment_quantities(row)[0] for row in x.reshape(-1, 10)]) for x in (phi, truth))
    mass = found[:, 0] - right[:, 0]
    com = np.linalg.norm(found[:, 1:4] - right[:, 1:4], axis=1)
    double = np.array([1, 2, 1, 2, 2, 1.0])
    inertia = np.sqrt(((found[:, 4:] - right[:, 4:]) ** 2 @ double) / (right[:, 4:] ** 2 @ double))
    residual = np.sqrt(np.mean((W @ (phi - truth)) ** 2, axis=0))
    return Score(
        float(np.sqrt(np.mean(mass**2))),
        float(np.abs(mass).max()),
        1000 * float(np.median(com)),
        100 * float(np.median(inertia)),
        float(np.sqrt(np.mean(residual[:3] ** 2))),
        float(np.sqrt(np.mean(residual[3:] ** 2))),
        int(np.sum(smallest_eigenvalues(phi) < -1e-8)),
        seconds,
    )


def ours_and_the_papers(body: Body, motion: Motion, wrench: Wrench, truth: Array, W: Array) -> dict[str, Score]:
    """Return the scores of the table, the paper's programme and biodance."""
    start = time.perf_counter()
    result = identify_body(body, (Fit("dance", motion, wrench, np.ones(motion.time.size, dtype=bool)),))
    ours = score(result.sip.phi, truth, W, time.perf_counter() - start)
    start = time.perf_counter()
    paper = paper_programme(information(body, motion, wrench, Noise.of_sd(1.0, 1.0, np.zeros(3))), body)
    papers = score(paper.phi, truth, W, time.perf_counter() - start)
    return {
        "table, nothing identified": score(body.sip.phi, truth, W, 0.0),
        "paper's programme": papers,
        "biodance": ours,
    }


def table(rows: dict[str, list[Score]]) -> str:
    """Return the medians over the subjects as Markdown (largest mass error and impossible segments: the worst)."""
    lines = [
        "| method | mass RMS (kg) | mass, largest (kg) | CoM (mm) | inertia (%) | residual (N) | residual (N·m) | "
        "impossible | time (s) |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for label, scores in rows.items():
        of = {name: np.array([getattr(s, name) for s in scores]) for name in Score.__dataclass_fields__}
        middle = " | ".join(f"{np.median(of[name]):.2f}" for name in ("com", "inertia", "force", "moment"))
        lines.append(
            f"| {label} | {np.median(of['mass']):.2f} | {of['largest'].max():.2f} | {middle} | "
            f"{int(of['impossible'].max())} of 12 | {np.median(of['seconds']):.2f} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Run all methods on all subjects and print the tables."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--subjects", type=int, default=len(SUBJECTS))
    ask.add_argument("--first", type=int, default=first_seed())
    asked = ask.parse_args()
    for title in ("Exact kinematics", "Kinematics of a gait laboratory"):
        rows: dict[str, list[Score]] = {}
        for number, subject in enumerate(SUBJECTS[: asked.subjects]):
            rng, body = np.random.default_rng(asked.first + number), human(subject)
            truth, motion = true_parameters(body, rng), dance(body, rng)
            noise = rng.normal(size=(motion.time.size, 6)) * np.repeat(NOISE, 3)
            W = regressor(body, motion)
            seen = motion if title.startswith("Exact") else measured(motion, rng)
            found = ours_and_the_papers(body, seen, Wrench(motion.time, W @ truth + noise), truth, W)
            for label, value in found.items():
                rows.setdefault(label, []).append(value)
        print(f"\n{title}\n\n{table(rows)}", flush=True)

"""How many base parameters of a robot's dance have a relative standard deviation below 10 %, as the paper counts them:
every sample independent, nothing wrong but noise of a given size per channel.

    python benchmarks/robot_counts.py FOLDER_OF_DANCE ...
    python benchmarks/robot_counts.py RECORDING hoap3.urdf

The first foresees counts of designed dances, the second counts those of a recording whose truth is known
(`bench_robot_recording.py record`), and how many of them are indeed within 10 % of it.
Noises: what our recordings in MuJoCo leave (docs/benchmarks/robot.md), the paper's table II, and shares of both. Sigma
from the noise and (W' W)^-1, relative to the drawing's value (Bonnet et al. 2016, IV.D).
"""

import json
import sys
from pathlib import Path

import numpy as np
from bench_robot_recording import FEET

from biodance.dance.dance import Dance
from biodance.identification.base_parameters import estimate_base, structural_base
from biodance.identification.information import Information, fold
from biodance.motion.regressor import regressor
from biodance.pipeline.robot import identify_robot
from biodance.records import Array, Motion

NOISES = {
    "paper's table II": np.array([1.1, 0.5, 0.9, 0.2, 0.7, 0.4]),
    "ours in MuJoCo": np.array([0.40, 0.35, 0.12, 0.14, 0.17, 0.035]),
}
SHARES, RATES, STEP = (1.0, 0.5, 0.2), (100.0, 500.0, 1000.0), 500


def counts(dance: Dance, noise: Array) -> dict[tuple[float, float], int]:
    """Return how many base parameters are known within 10 %, by share of the noise and rate (Hz)."""
    body, motion, rate = dance.body, dance.motion(25.0), 25.0
    triangle = np.empty((0, 10 * len(body.segments) + 1))
    for first in range(0, motion.time.size, STEP):
        pick = slice(first, first + STEP)
        W = regressor(body, Motion(motion.time[pick], motion.q[pick], motion.v[pick], motion.a[pick]))
        rows = np.concatenate([W, (W @ body.sip.phi)[:, :, None]], axis=2) / noise[:, None]
        triangle = fold(np.concatenate([triangle, rows.reshape(-1, rows.shape[2])]))
    found = estimate_base(Information(triangle, 6 * motion.time.size), structural_base(body))
    return {(s, r): int((found.relative_sd * s * np.sqrt(rate / r) <= 10).sum()) for s in SHARES for r in RATES}


def judge(recording: str, urdf: str) -> None:
    """Print what the paper's rule counts of a recording, at some rates, and what is so within 10 %."""
    result = identify_robot(recording, urdf=urdf, feet=FEET)
    truth = json.loads(Path(recording + ".truth.json").read_text())["phi"]
    known, done = result.alone, result.identified.identification
    right = np.abs(known.value / (known.base.regroup @ truth) - 1) <= 0.1
    for r in RATES:
        counted = known.relative_sd * np.sqrt(RATES[0] / r) <= 10
        words = f"{counted.sum()} of {known.base.count} counted, {(counted & right).sum()} of them within 10 % of truth"
        sys.stdout.write(f"{Path(recording).name}, {r:g} Hz, no prior: {words}\n")
    sd = np.sqrt(np.diag(done.sip.covariance))
    phi, before = np.array(truth), np.sqrt(np.diag(result.body.sip.covariance))
    for name, value, spread in (("drawing", result.body.sip.phi, before), ("identified", done.sip.phi, sd)):
        counted, near = spread <= 0.1 * np.abs(value), np.abs(value - phi) <= 0.1 * np.abs(phi)
        words = f"{counted.sum()} of {phi.size} inertial parameters with sd below 10 %, {(counted & near).sum()} right"
        sys.stdout.write(f"{Path(recording).name}, {name}, all errors, with the drawing as prior: {words}\n")
    own = f"{len(done.base.well_known)} base parameters with all errors, no prior"
    sys.stdout.write(f"{Path(recording).name}: {own}; verdict {result.verdict}\n")


def main(*folders: str) -> None:
    """Print one row a dance, noise and rate."""
    sys.stdout.write(
        "| dance | noise | Hz | " + " | ".join(f"x {s:g}" for s in SHARES) + " |\n|---|---|---|---|---|---|\n"
    )
    for folder in folders:
        dance = Dance.load(Path(folder) / "dance.npz")
        for name, noise in NOISES.items():
            found = counts(dance, noise)
            for r in RATES:
                row = " | ".join(str(found[s, r]) for s in SHARES)
                words = f"{int(dance.counted.sum())} postures, {dance.duration:.0f} s"
                sys.stdout.write(f"| {words} | {name} | {r:g} | {row} |\n")
                sys.stdout.flush()


if __name__ == "__main__":
    (judge if sys.argv[-1].endswith(".urdf") else main)(*sys.argv[1:])

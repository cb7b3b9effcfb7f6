"""What a robot's dance tells of it: parameters from simulated wrenches, beside the paper's numbers for HOAP-3; and
whether it stays up.

    biodance dance --urdf hoap3.urdf --feet right_foot,left_foot --out FOLDER
    biodance dance --urdf hoap3.urdf --feet right_foot,left_foot --protocol OTHER --seed 5 --out UNSEEN
    OMP_NUM_THREADS=1 python benchmarks/bench_robot.py FOLDER UNSEEN [number of robots]

Robots differ from the maker's data as the data's standard deviations say (masses 15 %, centres 10 mm, inertias 30 %).
Joint angles are exact, as encoders and links are; the wrench has one independent error in every quarter of a second, of
the size that Bonnet et al. 2016 left unexplained (table II). UNSEEN is another dance, for validation.
"""

import sys
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.body.inertia import rigid_inertia, smallest_eigenvalues
from biodance.body.robot.similarity import SimilarityScale, similar_body
from biodance.dance.dance import Dance
from biodance.dance.rehearsal import rehearse
from biodance.dance.robot import _RATE, ERROR, person_sized, robot_rows, shrunk
from biodance.identification.base_parameters import estimate_base, structural_base
from biodance.identification.information import Information, fold
from biodance.identification.paper_programme import paper_programme
from biodance.identification.physical import physical_fit
from biodance.identification.posterior import find_posterior
from biodance.motion.regressor import regressor
from biodance.records import CHANNELS, Array

PAPER = {"CAD": (1.9, 0.6, 3.5, 0.7, 0.8, 0.4), "identified": (1.1, 0.5, 0.9, 0.2, 0.7, 0.4)}
"""N, N·m: table II of the paper, unseen movement of the real robot."""


FAST = 100.0
"""Hz: samples that count as independent where errors are taken as white, as the paper does."""


def robot(body: Body, rng: np.random.Generator) -> Array:
    """Return the parameters (10N,) of a robot as the maker's data allow it, every segment a body that can exist with
    its CoM in its box.
    """
    out = np.array(body.sip.phi)
    for i, (low, high) in enumerate(body.com_boxes):
        ten = slice(10 * i, 10 * i + 10)
        spread = np.linalg.cholesky(body.sip.covariance[ten, ten])
        while True:
            phi = body.sip.phi[ten] + spread @ rng.normal(size=10)
            inside = phi[0] > 0 and np.all(phi[1:4] > low * phi[0]) and np.all(phi[1:4] < high * phi[0])
            if inside and smallest_eigenvalues(phi)[0] > 0:
                break
        out[ten] = phi
    return out


def quantities(phi: Array) -> tuple[Array, Array, Array]:
    """Return masses (N,) kg, centres (N, 3) m and moments of inertia (N, 3) kg·m² about them."""
    lumps = [rigid_inertia(ten) for ten in phi.reshape(-1, 10)]
    return (
        np.array([one.mass for one in lumps]),
        np.array([one.com for one in lumps]),
        np.array([np.diag(one.inertia) for one in lumps]),
    )


def errors(phi: Array, truth: Array) -> list[float]:
    """Return the root mean square errors of mass g, of CoM mm, of inertia % of the true trace."""
    (mass, com, inertia), (m, c, i) = quantities(phi), quantities(truth)
    share = (inertia - i) / (i.sum(axis=1, keepdims=True) / 3)
    return [
        float(np.sqrt(np.mean(square)))
        for square in ((1e3 * (mass - m)) ** 2, (1e3 * (com - c)) ** 2, (100 * share) ** 2)
    ]


def left(body: Body, W: Array, phi: Array, truth: Array) -> Array:
    """Return the root mean square (6,) N, N·m of what ``phi`` leaves of the true wrench of a movement with the
    regressor W.
    """
    return np.sqrt(np.mean((W @ (phi - truth)) ** 2, axis=0))


def judge(dance: Dance, unseen: Dance, seed: int) -> dict[str, Array]:
    """Return the numbers of one robot."""
    body, rng, motion = dance.body, np.random.default_rng(seed), dance.motion(_RATE)
    truth, W, V = robot(body, rng), regressor(body, motion), regressor(body, unseen.motion(_RATE))
    wrench = W @ truth + ERROR * rng.normal(size=(len(W), 6))
    data = Information(fold(robot_rows(body, motion, wrench)), 6 * len(W))
    base = estimate_base(data, structural_base(body))
    z = (base.value - base.base.regroup @ truth) / base.sd
    posterior = find_posterior(data, body.sip)
    ours = physical_fit(posterior, body).sip.phi
    plain = np.concatenate([W, wrench[:, :, None]], axis=2).reshape(-1, W.shape[2] + 1)
    paper = paper_programme(Information(fold(plain), 6 * len(W)), body).phi
    covered = np.abs(posterior.mean - truth) <= 1.96 * np.sqrt(np.diag(posterior.covariance))
    counts = (base.base.count, base.rank, len(base.well_known), (base.relative_sd * np.sqrt(_RATE / FAST) <= 10).sum())
    out = {"base": np.array([*counts, base.condition, np.sqrt(np.mean(z**2))])}
    out["covered"] = np.array([100 * covered.mean()])
    for name, phi in (("CAD", body.sip.phi), ("paper", paper), ("ours", ours)):
        out[f"{name} errors"] = np.array(errors(phi, truth))
        out[f"{name} left"] = left(body, V, phi, truth)
    return out


def main(folder: str, other: str, count: str = "10") -> None:
    """Print the tables."""
    dance, unseen = (Dance.load(Path(one) / "dance.npz") for one in (folder, other))
    found = [judge(dance, unseen, seed) for seed in range(int(count))]
    mean = {key: np.sqrt(np.mean([one[key] ** 2 for one in found], axis=0)) for key in found[0]}
    n, rank, known, fast, condition, z = np.mean([one["base"] for one in found], axis=0)
    tell(f"{dance.counted.sum()} postures, {len(dance.move)} moves, {dance.duration:.0f} s; {count} robots")
    tell(
        f"base parameters: {n:.0f}, rank {rank:.0f}, cond {condition:.0f}, {known:.1f} with a relative sd of 10 % or "
        f"less;"
    )
    tell(f"were every sample at {FAST:g} Hz independent: {fast:.1f} (the paper: 42)")
    tell(
        f"error over its sd, RMS: {z:.2f}; parameters within their 95 % intervals: "
        f"{np.mean([one['covered'] for one in found]):.1f} %"
    )
    tell("| | mass, g | CoM, mm | inertia, % |", "|---|---|---|---|")
    for name in ("CAD", "paper", "ours"):
        tell(f"| {name} | " + " | ".join(f"{value:.1f}" for value in mean[f"{name} errors"]) + " |")
    tell(f"| unseen movement, RMS | {' | '.join(CHANNELS)} |", "|---" * 7 + "|")
    for name in ("CAD", "paper", "ours"):
        tell(f"| {name} | " + " | ".join(f"{value:.2f}" for value in mean[f"{name} left"]) + " |")
    for name, row in PAPER.items():
        tell(f"| the paper's robot, {name} | " + " | ".join(f"{value:.1f}" for value in row) + " |")
    to = person_sized(dance.body)
    big = shrunk(dance, similar_body(dance.body, to), SimilarityScale(1 / to.length, 1 / to.mass))
    tell("rehearsed in MuJoCo as the robot's person-sized likeness:", rehearse(big).table())


def tell(*lines: str) -> None:
    """Print lines at once."""
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])

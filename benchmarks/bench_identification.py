"""What identification achieves on virtual subjects, with all that goes wrong in a laboratory; prints a
page, or writes it where there is none yet.

    python benchmarks/bench_identification.py [--subjects 20] [--tuned] [--out build/identification.md]

Sections: accuracy beside the table and the paper's programme, coverage, squats that were not fitted, joint torques,
prior scale, quiet standing, added mass, time (of the processor). Constants were tuned on the catalogue of ``--tuned``;
the page is about the fresh one.
"""

import argparse
import hashlib
import pickle
import time
from pathlib import Path

import numpy as np
from gathered_visits import Gathered, gather
from identification_loads import loaded_arm, loads_table
from identification_tables import (
    SCALES,
    Load,
    Row,
    accuracy_lines,
    coverage_lines,
    load_lines,
    pair_lines,
    scale_lines,
    squat_lines,
    standing_lines,
    torque_lines,
)
from virtual_visits import CACHE, FRESH, TUNED, TrackedVisit, subjects

import biodance
from biodance.body.inertia import smallest_eigenvalues
from biodance.identification.added_mass import LoadSearch, added_mass
from biodance.identification.identification import Identification, identify_body
from biodance.identification.knowledge import SIGMAS, segment_quantities
from biodance.identification.mismatch import evidence_of_scale
from biodance.identification.paper_programme import paper_programme
from biodance.identification.physical import physical_fit
from biodance.identification.posterior import find_posterior
from biodance.identification.statistics import Fit, layout_for, standing_point, statistics
from biodance.identification.torques import torque_bands, torque_regressor
from biodance.lab.plain_text import write_new
from biodance.motion.regressor import predict_wrench
from biodance.records import Array, Motion, Sip, Subject, Wrench

FULL = 10
"""Subjects on whom every load is put on every segment; the arm's load is put on all."""
STILL = 4
"""Subjects who also stand quietly."""


def errors(phi: Array, true: Array) -> Array:
    """Return (12, 3): mass error kg, CoM error mm, inertia error (Frobenius norm about the CoM over the true one's)
    of every segment.
    """
    out = []
    for a, b in zip(phi.reshape(-1, 10), true.reshape(-1, 10), strict=True):
        x, y = segment_quantities(a)[0], segment_quantities(b)[0]
        weight = np.array([1, 2, 1, 2, 2, 1])
        size = np.sqrt(np.sum(weight * y[4:] ** 2))
        out.append(
            [
                abs(x[0] - y[0]),
                1e3 * np.linalg.norm(x[1:4] - y[1:4]),
                100 * np.sqrt(np.sum(weight * (x[4:] - y[4:]) ** 2)) / size,
            ]
        )
    return np.array(out)


def covered(sip: Sip, true: Array) -> Array:
    """Return (120,) True where the 95 % interval holds the truth."""
    return np.abs(true - sip.phi) <= SIGMAS * np.sqrt(np.diag(sip.covariance))


def rms(body, fits: tuple[Fit, ...], about: Array, phi: Array) -> Array:
    """Return (6,) RMS of the wrench residual about ``about`` over the used frames of all trials."""
    parts = []
    for fit in fits:
        d = fit.wrench.value - predict_wrench(body, fit.motion, phi).value
        parts.append(np.concatenate([d[:, :3], d[:, 3:] - np.cross(about, d[:, :3])], axis=1)[fit.use])
    return np.sqrt(np.mean(np.concatenate(parts) ** 2, axis=0))


def own_truth(one: TrackedVisit) -> Array:
    """Return the truth about the true joint centres, in the model's axes (the pelvis in the model's frame)."""
    from virtual_visits import _orthogonal

    from biodance.virtual_lab.person.flesh import of_parameters, parameters_of_inertia, place_inertia

    return np.concatenate(
        [
            parameters_of_inertia(
                place_inertia(of_parameters(phi), _orthogonal(f[:, :3]), f[:, 3] if k == 0 else np.zeros(3))
            )
            for k, (phi, f) in enumerate(zip(one.true_own.reshape(-1, 10), one.frames, strict=True))
        ]
    )


def examine(subject: Subject, seed: int) -> tuple[Row, Identification, Gathered]:
    """Return the accuracy of one subject's dance."""
    got = gather(subject, "dance", seed)
    one, found = got.visit, got.identified()
    paper = paper_programme(got.total.information(got.total.layout), one.body)
    estimates = {"table": one.body.sip.phi, "identified": found.sip.phi, "paper": paper.phi}
    about = standing_point(one.fits)
    squat = {
        name: rms(one.body, one.validations, about, phi) for name, phi in (*estimates.items(), ("floor", one.true))
    }
    before = found.posterior.prior
    held = []
    for scale in SCALES:
        posterior = find_posterior(found.data, Sip(before.segments, before.phi, scale**2 * before.covariance))
        held.append(rms(one.body, one.validations, about, physical_fit(posterior, one.body).sip.phi))
    row = Row(
        error={name: errors(phi, one.true) for name, phi in estimates.items()},
        squat=squat,
        cover=covered(found.sip, one.true),
        cover_own=covered(found.sip, own_truth(one)),
        known=np.array([k.verdict != "cannot be known" for k in found.known]),
        unphysical={name: int(np.sum(smallest_eigenvalues(phi) < -1e-12)) for name, phi in estimates.items()},
        status=(found.status, paper.status),
        evidence=evidence_of_scale(found.data, before, SCALES),
        held_out=np.array(held),
        from_data=float(found.posterior.information.mean()),
        **torques(one, found),
    )
    return row, found, got


def torques(one: TrackedVisit, found: Identification) -> dict:
    """Return how far the joint torques in the kept trials are from those of the true parameters, and how often the
    bands hold them.
    """
    error: dict[str, list] = {"table": [], "identified": []}
    inside = []
    for fit in one.validations:
        bands = torque_bands(found, fit.motion, {}, trial=fit.name, use=fit.use)
        true = torque_regressor(one.body, fit.motion) @ one.true
        inside.append((np.abs(bands.torque - true) <= bands.half_width)[fit.use])
        error["table"].append((bands.table - true)[fit.use])
        error["identified"].append((bands.torque - true)[fit.use])
    return {
        "torque": {name: np.sqrt(np.mean(np.concatenate(parts) ** 2, axis=0)) for name, parts in error.items()},
        "torque_cover": np.concatenate(inside).mean(axis=0),
        "joints": tuple(joint.name for joint in one.body.joints),
    }


def timing(found: Identification, one: TrackedVisit) -> dict[str, float]:
    """Return seconds for 42,000 frames (7 minutes at 100 Hz) from motion and wrench to the R factor, and for the
    programme after it.
    """
    fit = one.fits[0]
    repeat = int(np.ceil(42000 / fit.motion.time.size))
    many = [np.tile(x, (repeat, 1))[:42000] for x in (fit.motion.q, fit.motion.v, fit.motion.a, fit.wrench.value)]
    clock = np.arange(42000) / 100.0
    long = Fit("long", Motion(clock, *many[:3]), Wrench(clock, many[3]), np.ones(42000, dtype=bool))
    layout = found.noise
    start = time.process_time()
    data = statistics(one.body, long, layout_for(layout.about)).information(layout)
    until_r = time.process_time() - start
    physical_fit(found.posterior, one.body)
    start = time.process_time()
    physical_fit(found.posterior, one.body)
    programme = time.process_time() - start
    start = time.process_time()
    identify_body(one.body, one.fits)
    return {
        "42,000 frames to R": until_r,
        "convex programme": programme,
        "identify, 8 trials": time.process_time() - start,
        "frames": data.frames,
    }


def pairs(
    subject: Subject, seed: int, reference: Identification, *, full: bool
) -> tuple[list[LoadSearch], Load, list[Load]]:
    """Return what unloaded pairs of three sessions find, both ways round, and what is found of loads in the second
    session.
    """
    later = [gather(subject, "dance", seed, session=session) for session in (1, 2)]
    found = [reference, *(one.identified() for one in later)]
    nulls = [added_mass(b, reference=a) for a in found for b in found if a is not b]
    return nulls, loaded_arm(reference, later[0]), loads_table(reference, later[0]) if full else []


def subject_of(index: int, catalogue: tuple[int, int], *, tell) -> tuple[Row, list[LoadSearch], Load, list[Load]]:
    """Return all about one subject, from the cache while the code of identification/ is unchanged."""
    house = Path(biodance.identification.__file__).parent.parent
    code = b"".join(
        path.read_bytes() for room in ("identification", "uncertainty") for path in sorted((house / room).glob("*.py"))
    )
    path = CACHE / f"subject-{hashlib.sha256(f'{catalogue}-{index}'.encode() + code).hexdigest()[:20]}.pickle"
    if not path.is_file():
        person, seed = subjects(index + 1, catalogue)[index], catalogue[1] + index
        row, found, _ = examine(person, seed)
        made = (row, *pairs(person, seed, found, full=index < FULL))
        with open(path, "wb") as stream:
            pickle.dump(made, stream)
    with open(path, "rb") as stream:
        row, nulls, arm, loads = pickle.load(stream)
    p = [f"{n.p_no_load:.3f}" for n in nulls]
    tell(
        f"subject {index + 1}: coverage {100 * row.cover.mean():.0f} %, p without load {' '.join(p)}, with "
        f"{arm[2].p_no_load:.0e}"
    )
    return row, nulls, arm, loads


def run(count: int, catalogue: tuple[int, int], tell) -> list[str]:
    """Return the page as lines."""
    people = subjects(count, catalogue)
    found = [subject_of(i, catalogue, tell=tell) for i in range(count)]
    rows = [row for row, _, _, _ in found]
    nulls = [null for _, some, _, _ in found for null in some]
    loads = [load for _, _, _, some in found for load in some]
    still = [gather(person, "standing", catalogue[1] + i).identified() for i, person in enumerate(people[:STILL])]
    first = gather(people[0], "dance", catalogue[1])
    clock = timing(first.identified(), first.visit)
    sections = {
        "Parameters": accuracy_lines(rows),
        "Coverage of the 95 % intervals": coverage_lines(rows),
        "Squats that were not fitted": squat_lines(rows),
        "Joint torques in the squats": torque_lines(rows),
        "The prior's weight": scale_lines(rows),
        "Quiet standing alone": standing_lines(still),
        "Added mass, two sessions": pair_lines(nulls, [arm for _, _, arm, _ in found]),
        f"Loads on every segment ({min(FULL, count)} subjects)": load_lines(loads),
        "Time": [f"- {name}: {1e3 * value:.0f} ms" for name, value in clock.items() if name != "frames"],
    }
    head = [
        "# Identification on virtual subjects",
        "",
        f"{count} subjects (both sexes, 45-110 kg, 1.50-1.95 m), protocol dance, realistic tolerances, through the "
        f"front door: simulate, "
        "read, prepare, scale, place joints by movement, track, contact, identify. Made by "
        "`benchmarks/bench_identification.py`.",
        "The subjects are not those on whom constants were chosen (`--tuned`). Every subject has three sessions on "
        "three days (markers, "
        "skin, plates and performance anew); a load's own wrench, of its true motion, is added to the second day's "
        "plates.",
    ]
    return [*head, *(line for title, lines in sections.items() for line in ("", f"## {title}", *lines))]


def main() -> None:
    """Run the benchmark and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--subjects", type=int, default=20)
    parser.add_argument("--tuned", dest="catalogue", action="store_const", const=TUNED, default=FRESH)
    parser.add_argument("--out", type=Path)
    chosen = parser.parse_args()
    start = time.perf_counter()
    lines = run(
        chosen.subjects,
        chosen.catalogue,
        lambda text: print(f"{time.perf_counter() - start:6.0f} s  {text}", flush=True),
    )
    text = "\n".join(lines) + "\n"
    print(write_new(chosen.out, text.encode()) if chosen.out else text)


if __name__ == "__main__":
    main()

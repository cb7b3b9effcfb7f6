"""What identification achieves on virtual subjects, with all that goes wrong in a laboratory; writes docs/identification.md.

    python benchmarks/bench_identification.py [--subjects 20] [--out docs/identification.md]

Sections: accuracy beside the table and the paper's programme, coverage, squats that were not fitted, prior scale, quiet standing, added
mass, time (of the processor).
"""

import argparse
import hashlib
import pickle
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from virtual_visits import CACHE, TrackedVisit, subjects, visit

import biodance.identify
from biodance.body.inertia import smallest_eigenvalues
from biodance.identify.added_mass import AddedMass, added_mass
from biodance.identify.identification import Identification, conclude, identify, standing_point, usable
from biodance.identify.knowledge import SIGMAS, segment_quantities
from biodance.identify.learning import learn
from biodance.identify.mismatch import Mismatch, evidence_of_scale, mismatch
from biodance.identify.noise import Noise, blocks
from biodance.identify.paper_programme import paper_programme
from biodance.identify.physical import physical_fit
from biodance.identify.posterior import posterior
from biodance.identify.statistics import Fit, Statistics, empty, layout_for, statistics
from biodance.lab.filters import LowPass, low_pass
from biodance.motion.kinematics import segment_motion
from biodance.motion.regressor import GRAVITY, predict_wrench, regressor_of
from biodance.records import Array, Motion, Sip, Subject, Wrench
from biodance.virtual_lab.merge import MERGED

SEED = 100
SCALES = np.array([0.25, 0.5, 0.7, 1.0, 1.4, 2.0, 4.0])
FULL = 4
"""Subjects on whom every load is put on every segment."""
LOADS = (0.5, 1.0, 2.4)
ARM = ("left_forearm_hand", 2.4)


@dataclass(frozen=True, eq=False)
class Gathered:
    """A visit with what identification needs of it: statistics, learned noise, disturbances."""

    visit: TrackedVisit
    total: Statistics
    noise: Noise
    found: Mismatch

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted trials."""
        return tuple(fit.name for fit in self.visit.fits)

    def identified(self) -> Identification:
        """Return the identification."""
        return conclude(self.visit.body, self.total, self.names, noise=self.noise, found=self.found)


def gather(subject: Subject, protocol: str, seed: int, *, session: int = 0, load: tuple[str, float] | None = None) -> Gathered:
    """Return the statistics, the noise and the disturbances of a visit, from the cache while their code is unchanged."""
    folder = Path(biodance.identify.__file__).parent
    code = b"".join((folder / f"{name}.py").read_bytes() for name in ("statistics", "noise", "learning", "twins", "mismatch"))
    key = f"{subject}-{protocol}-{seed}-{session}-{load}".encode() + code
    path = CACHE / f"gathered-{hashlib.sha256(key).hexdigest()[:20]}.pickle"
    if path.is_file():
        with open(path, "rb") as stream:
            return pickle.load(stream)
    made = _gathered(visit(subject, protocol, seed=seed, session=session, load=load))
    with open(path, "wb") as stream:
        pickle.dump(made, stream)
    return made


def _gathered(one: TrackedVisit) -> Gathered:
    used, about, _ = usable(one.body, one.fits)
    one = replace(one, fits=used)
    layout = layout_for(about)
    total = empty(10 * len(one.body.segments), layout)
    for fit in one.fits:
        total = total + statistics(one.body, fit, layout)
    noise, _ = learn(total, one.body.sip)
    return Gathered(one, total, noise, mismatch(one.body, one.fits, noise))


def errors(phi: Array, true: Array) -> Array:
    """Return (12, 3): mass error kg, CoM error mm, inertia error (Frobenius norm about the CoM over the true one's) of every segment."""
    out = []
    for a, b in zip(phi.reshape(-1, 10), true.reshape(-1, 10), strict=True):
        x, y = segment_quantities(a)[0], segment_quantities(b)[0]
        weight = np.array([1, 2, 1, 2, 2, 1])
        size = np.sqrt(np.sum(weight * y[4:] ** 2))
        out.append([abs(x[0] - y[0]), 1e3 * np.linalg.norm(x[1:4] - y[1:4]), 100 * np.sqrt(np.sum(weight * (x[4:] - y[4:]) ** 2)) / size])
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

    from biodance.virtual_lab.flesh import of_parameters, parameters, placed

    return np.concatenate(
        [
            parameters(placed(of_parameters(phi), _orthogonal(f[:, :3]), f[:, 3] if k == 0 else np.zeros(3)))
            for k, (phi, f) in enumerate(zip(one.true_own.reshape(-1, 10), one.frames, strict=True))
        ]
    )


@dataclass(frozen=True, eq=False)
class Row:
    """Everything measured on one subject."""

    error: dict[str, Array]
    squat: dict[str, Array]
    cover: Array
    cover_own: Array
    known: Array
    unphysical: dict[str, int]
    status: tuple[str, str]
    evidence: Array
    held_out: Array
    from_data: float


def examine(subject: Subject, seed: int) -> tuple[Row, Identification, Gathered]:
    """Return the accuracy of one subject's dance."""
    got = gather(subject, "dance", seed)
    one, found = got.visit, got.identified()
    paper = paper_programme(got.total.information(got.total.layout), one.body)
    estimates = {"table": one.body.sip.phi, "identified": found.sip.phi, "paper": paper.phi}
    about = standing_point(one.fits)
    squat = {name: rms(one.body, one.validations, about, phi) for name, phi in (*estimates.items(), ("floor", one.true))}
    before = found.belief.prior
    held = []
    for scale in SCALES:
        belief = posterior(found.data, Sip(before.segments, before.phi, scale**2 * before.covariance))
        held.append(rms(one.body, one.validations, about, physical_fit(belief, one.body).sip.phi))
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
        from_data=float(found.belief.information.mean()),
    )
    return row, found, got


def loads_table(reference: Identification, later: Gathered) -> list[tuple[str, float, AddedMass, AddedMass]]:
    """Return, for every segment and load, what is found with the reference and without: the load's own wrench is added to the plates'."""
    one = later.visit
    extra = _with_loads(later)
    out = []
    for s, segment in enumerate(one.body.segments):
        for mass in LOADS:
            total = _combined(extra, later.total, s, mass, len(one.body.segments))
            session = conclude(one.body, total, later.names, noise=later.noise, found=later.found)
            out.append((segment, mass, added_mass(session, reference=reference), added_mass(session)))
    return out


def _with_loads(got: Gathered) -> Statistics:
    """Return the statistics of [W, wrench of 1 kg on each segment, y]."""
    one, layout = got.visit, got.total.layout
    p = 10 * len(one.body.segments) + len(one.body.segments)
    gram, count = np.zeros((len(got.total.count), 6, p + 1, 6, p + 1)), np.zeros_like(got.total.count)
    for fit in one.fits:
        unit = np.stack([_unit_wrench(one, fit, s) for s in range(len(one.body.segments))], axis=2)
        for pick in blocks(fit.use, fit.motion.rate, layout):
            part = Motion(fit.motion.time[pick], fit.motion.q[pick], fit.motion.v[pick], fit.motion.a[pick])
            W = regressor_of(segment_motion(one.body, part))
            X = layout.coefficients(layout.shift @ np.concatenate([W, unit[pick], fit.wrench.value[pick][:, :, None]], axis=2))
            band = layout.bands_of(len(X))
            for b in np.unique(band[band >= 0]):
                flat = X[band == b].reshape(-1, 6 * (p + 1))
                gram[b] += (flat.T @ flat).reshape(6, p + 1, 6, p + 1)
                count[b] += len(flat)
    return Statistics(gram, count, layout)


def _unit_wrench(one: TrackedVisit, fit: Fit, s: int) -> Array:
    """Return the wrench (T, 6) of 1 kg, 6 cm outwards of the true CoM of a segment (trunk, pelvis: 10 cm behind), low-passed too."""
    from scipy.interpolate import make_interp_spline

    turn, origin = one.true_poses[fit.name]
    name = tuple(MERGED)[s]
    away = {"r": (0.0, 0.0, 0.06), "l": (0.0, 0.0, -0.06)}.get(name[0], (-0.10, 0.0, 0.0))
    own = one.true_own.reshape(-1, 10)[s]
    place = origin[:, s] + turn[:, s] @ (own[1:4] / own[0] + away)
    force = make_interp_spline(fit.motion.time, place, k=5).derivative(2)(fit.motion.time) - GRAVITY
    return low_pass(np.concatenate([force, np.cross(place, force)], axis=1), fit.motion.rate, LowPass())


def _combined(extra: Statistics, plain: Statistics, s: int, mass: float, count: int) -> Statistics:
    """Return the statistics with ``mass`` kg on segment ``s``: y + mass times its unit wrench."""
    p = 10 * count
    turn = np.zeros((p + count + 1, p + 1))
    turn[:p, :p] = np.eye(p)
    turn[-1, -1], turn[p + s, -1] = 1.0, mass
    gram = np.einsum("bcidj,ik,jl->bckdl", extra.gram, turn, turn, optimize=True)
    return Statistics(gram, plain.count, plain.layout)


def timing(found: Identification, one: TrackedVisit) -> dict[str, float]:
    """Return seconds for 42,000 frames (7 minutes at 100 Hz) from motion and wrench to the R factor, and for the programme after it."""
    fit = one.fits[0]
    repeat = int(np.ceil(42000 / fit.motion.time.size))
    many = [np.tile(x, (repeat, 1))[:42000] for x in (fit.motion.q, fit.motion.v, fit.motion.a, fit.wrench.value)]
    clock = np.arange(42000) / 100.0
    long = Fit("long", Motion(clock, *many[:3]), Wrench(clock, many[3]), np.ones(42000, dtype=bool))
    layout = found.noise
    start = time.process_time()
    data = statistics(one.body, long, layout_for(layout.about)).information(layout)
    until_r = time.process_time() - start
    physical_fit(found.belief, one.body)
    start = time.process_time()
    physical_fit(found.belief, one.body)
    programme = time.process_time() - start
    start = time.process_time()
    identify(one.body, one.fits)
    return {
        "42,000 frames to R": until_r,
        "convex programme": programme,
        "identify, 8 trials": time.process_time() - start,
        "frames": data.frames,
    }


def accuracy_lines(rows: list[Row]) -> list[str]:
    """Return the tables of parameter errors, coverage and squats."""
    out = ["| | mass, kg | CoM, mm | inertia, % | segments that cannot exist |", "|---|---|---|---|---|"]
    for name in ("table", "identified", "paper"):
        e = np.array([r.error[name] for r in rows])
        bad = np.mean([r.unphysical[name] for r in rows])
        out.append(f"| {name} | {e[..., 0].mean():.3f} | {e[..., 1].mean():.1f} | {np.median(e[..., 2]):.0f} (median) | {bad:.1f} of 12 |")
    ratio = {n: np.array([r.error["paper"].mean(axis=0) / r.error["identified"].mean(axis=0) for r in rows]) for n in ("p",)}["p"]
    gain = np.array([r.error["table"].mean(axis=0) / r.error["identified"].mean(axis=0) for r in rows])
    out += [
        "",
        f"Paper's programme over ours, median of subjects: mass {np.median(ratio[:, 0]):.1f} x, CoM {np.median(ratio[:, 1]):.1f} x, "
        f"inertia {np.median(ratio[:, 2]):.1f} x. Table over ours: mass {np.median(gain[:, 0]):.2f} x, CoM {np.median(gain[:, 1]):.2f} x, "
        f"inertia {np.median(gain[:, 2]):.2f} x.",
    ]
    status = [r.status for r in rows]
    out.append(
        f"Solved: ours {sum(a == 'solved' for a, _ in status)} of {len(rows)}; the paper's programme "
        f"{sum(b == 'solved' for _, b in status)} with its equalities, {sum(b == 'solved without equalities' for _, b in status)} without."
    )
    out += ["", "| segment | mass: table, identified, paper | CoM mm: table, identified, paper |", "|---|---|---|"]
    for s, segment in enumerate(MERGED):
        m = [np.mean([r.error[n][s, 0] for r in rows]) for n in ("table", "identified", "paper")]
        c = [np.mean([r.error[n][s, 1] for r in rows]) for n in ("table", "identified", "paper")]
        out.append(f"| {segment} | {m[0]:.2f} {m[1]:.2f} {m[2]:.2f} | {c[0]:.0f} {c[1]:.0f} {c[2]:.0f} |")
    return out


def coverage_lines(rows: list[Row]) -> list[str]:
    """Return the table of coverage of the 95 % intervals."""
    out = ["| truth | all | masses | first moments | inertias |", "|---|---|---|---|---|"]
    for words, cover in (("in the model's frames", [r.cover for r in rows]), ("about the true joint centres", [r.cover_own for r in rows])):
        c = np.array(cover).reshape(-1, 10)
        out.append(
            f"| {words} | {100 * c.mean():.1f} % "
            f"| {100 * c[:, 0].mean():.1f} % | {100 * c[:, 1:4].mean():.1f} % | {100 * c[:, 4:].mean():.1f} % |"
        )
    out += [
        "",
        f"Share of the table's variance that the data remove, mean over parameters: {100 * np.mean([r.from_data for r in rows]):.0f} %.",
    ]
    return out


def squat_lines(rows: list[Row]) -> list[str]:
    """Return the table of the squats that were not fitted."""
    norm = {
        n: np.array([[np.sqrt(np.mean(r.squat[n][:3] ** 2)), np.sqrt(np.mean(r.squat[n][3:] ** 2))] for r in rows]) for n in rows[0].squat
    }
    out = ["| body | force, N (median) | moment, N·m (median) | Fx Fy Fz Mx My Mz (mean) |", "|---|---|---|---|"]
    for name, v in norm.items():
        channels = " ".join(f"{x:.1f}" for x in np.mean([r.squat[name] for r in rows], axis=0))
        out.append(f"| {name} | {np.median(v[:, 0]):.2f} | {np.median(v[:, 1]):.2f} | {channels} |")
    floor = norm["identified"] / norm["floor"]
    gain = norm["table"] / norm["identified"]
    low, high = np.percentile(gain, [10, 90], axis=0)
    out += [
        "",
        "Identified over floor (true parameters on the same kinematics), median: "
        f"force {np.median(floor[:, 0]):.2f}, moment {np.median(floor[:, 1]):.2f}. "
        f"Table over identified: force {np.median(gain[:, 0]):.2f} (10-90 %: {low[0]:.2f}-{high[0]:.2f}; paper 1.8), "
        f"moment {np.median(gain[:, 1]):.2f} ({low[1]:.2f}-{high[1]:.2f}; paper 2.5).",
    ]
    return out


def scale_lines(rows: list[Row]) -> list[str]:
    """Return the curve of evidence and of hold-out against the prior's scale."""
    evidence = np.sum([r.evidence for r in rows], axis=0)
    held = np.array([r.held_out for r in rows])
    out = ["| prior sd times | log evidence, all subjects | squat force, N | squat moment, N·m |", "|---|---|---|---|"]
    for i, scale in enumerate(SCALES):
        f, m = (np.median(np.sqrt(np.mean(held[:, i, cut] ** 2, axis=1))) for cut in (slice(0, 3), slice(3, 6)))
        out.append(f"| {scale:g} | {evidence[i] - evidence.max():.0f} | {f:.2f} | {m:.2f} |")
    return out


def pair_lines(nulls: list[AddedMass], arms: list[tuple[AddedMass, Array]]) -> list[str]:
    """Return what two sessions find, without and with 2.4 kg on the left forearm."""
    alarms = sum(n.found for n in nulls)
    right = [a.found and a.best.segment == ARM[0] for a, _ in arms]
    size = np.array([abs(a.best.mass - ARM[1]) for (a, _), ok in zip(arms, right, strict=True) if ok])
    inside = [a.best.interval[0] <= ARM[1] <= a.best.interval[1] for (a, _), ok in zip(arms, right, strict=True) if ok]
    place = np.array([1e3 * np.linalg.norm(a.best.place - p) for (a, p), ok in zip(arms, right, strict=True) if ok])
    return [
        f"- Unloaded pairs: {alarms} false alarms in {len(nulls)} (median p of no load {np.median([n.p_no_load for n in nulls]):.3f}).",
        f"- 2.4 kg on the left forearm: right segment in {sum(right)} of {len(arms)}; "
        f"error of the mass: median {np.median(size):.3f} kg, largest "
        f"{size.max():.2f} kg; the 95 % interval covers in {sum(inside)} of {len(inside)}; place: median {np.median(place):.0f} mm off.",
    ]


def load_lines(table: list[tuple[str, float, AddedMass, AddedMass]]) -> list[str]:
    """Return detection, localisation and size per segment and load."""
    out = [
        "| load on | kg | with reference: found, right segment, error kg, interval covers "
        "| one session: found, right segment, in the set |",
        "|---|---|---|---|",
    ]
    for segment in MERGED:
        for mass in LOADS:
            those = [(r, t) for s, m, r, t in table if s == segment and m == mass]
            n = len(those)
            own = [next(x for x in r.suspects if x.segment == segment) for r, _ in those]
            covers = sum(x.interval[0] <= mass <= x.interval[1] for x in own)
            found, hit = sum(r.found for r, _ in those), sum(r.found and r.best.segment == segment for r, _ in those)
            size = np.median([abs(x.mass - mass) for x in own])
            alone, there, among = (
                sum(t.found for _, t in those),
                sum(t.found and t.best.segment == segment for _, t in those),
                sum(segment in t.set for _, t in those),
            )
            out.append(
                f"| {segment} | {mass:g} | {found}/{n}, {hit}/{n}, {size:.2f}, {covers}/{n} | {alone}/{n}, {there}/{n}, {among}/{n} |"
            )
    return out


def standing_lines(found: list[Identification]) -> list[str]:
    """Return what quiet standing alone can know."""
    words = ("known", "partly known", "cannot be known")
    counts = np.array([[sum(k.verdict == w for k in f.known) for w in words] for f in found])
    kept = [k for f in found for k in f.known if k.verdict == "cannot be known"]
    ratio = np.median([k.sd / k.table_sd for k in kept])
    return [
        "Of 120 quantities: "
        f"{', '.join(f'{n:.0f} {w}' for n, w in zip(counts.mean(axis=0), words, strict=True))}; where it cannot know, the "
        f"interval is {ratio:.2f} of the table's (median)."
    ]


def run(count: int, tell) -> list[str]:
    """Return the page as lines."""
    people = subjects(count)
    rows, found = [], []
    for i, person in enumerate(people):
        row, one, _ = examine(person, SEED + i)
        rows.append(row)
        found.append(one)
        tell(f"subject {i + 1} of {count}: coverage {100 * row.cover.mean():.0f} %")
    nulls, arms, table = [], [], []
    for i, person in enumerate(people):
        later = gather(person, "dance", SEED + i, session=1)
        nulls.append(added_mass(later.identified(), reference=found[i]))
        loaded = gather(person, "dance", SEED + i, session=1, load=ARM)
        assert loaded.visit.load is not None
        arms.append((added_mass(loaded.identified(), reference=found[i]), loaded.visit.load[2]))
        if i < FULL:
            table += loads_table(found[i], later)
        tell(f"pair {i + 1} of {count}: p without load {nulls[-1].p_no_load:.3f}, with {arms[-1][0].p_no_load:.1e}")
    still = [gather(person, "standing", SEED + i).identified() for i, person in enumerate(people[:4])]
    clock = timing(found[0], visit(people[0], "dance", seed=SEED))
    sections = {
        "Parameters": accuracy_lines(rows),
        "Coverage of the 95 % intervals": coverage_lines(rows),
        "Squats that were not fitted": squat_lines(rows),
        "The prior's weight": scale_lines(rows),
        "Quiet standing alone": standing_lines(still),
        "Added mass, two sessions": pair_lines(nulls, arms),
        f"Loads on every segment ({min(FULL, count)} subjects)": load_lines(table),
        "Time": [f"- {name}: {1e3 * value:.0f} ms" for name, value in clock.items() if name != "frames"],
    }
    head = [
        "# Identification on virtual subjects",
        "",
        f"{count} subjects (both sexes, 45-110 kg, 1.50-1.95 m), protocol dance, realistic tolerances, through the "
        "front door: simulate, read, prepare, scale, track, contact, identify. Made by `benchmarks/bench_identification.py`.",
    ]
    return [*head, *(line for title, lines in sections.items() for line in ("", f"## {title}", *lines))]


def main() -> None:
    """Run the benchmark and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--subjects", type=int, default=20)
    parser.add_argument("--out", type=Path, default=Path("docs/identification.md"))
    chosen = parser.parse_args()
    start = time.perf_counter()
    lines = run(chosen.subjects, lambda text: print(f"{time.perf_counter() - start:6.0f} s  {text}", flush=True))
    chosen.out.write_text("\n".join([*lines, "", f"Whole run: {(time.perf_counter() - start) / 60:.0f} min."]) + "\n")
    print(f"wrote {chosen.out}")


if __name__ == "__main__":
    main()

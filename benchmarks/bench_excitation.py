"""The designed dance beside its rivals at equal duration: squats and random motion, full against short protocol.

    OMP_NUM_THREADS=1 python benchmarks/bench_excitation.py [subjects, default 5] [rivals, separated by commas; default:
    all]

Every virtual subject (true body, soft tissue, cameras, plate) performs all of them imperfectly - seven degrees off in
every joint, a fifth slower than shown - through the front door: simulate, read, prepare, scale, track, identify. All
are shown the same dances, designed for one person (`SHOWN_TO`). Judged are the paper's criterion on what was really
done and the error of the identified segments. Dances and visits are cached in BIODANCE_CACHE, so that a run can be
continued.
"""

import hashlib
import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from kept_files import kept
from virtual_visits import subjects

from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.metrics import criterion_of
from biodance.dance.postures.ordering import support_sequence
from biodance.dance.postures.posture import KEPT, distance_from, initial_guess, intermediate_posture, solve
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.plan import Plan, read_plan
from biodance.dance.problem.stance import under
from biodance.lab.session.read import read_session
from biodance.motion.kinematics import poses
from biodance.pipeline.dance import dancer
from biodance.pipeline.session import examine, identification_of
from biodance.pipeline.simulate_dance import simulate_dance
from biodance.records import Array, Motion, Subject
from biodance.virtual_lab.movement.protocol import Protocol, TrialPlan, read_protocol
from biodance.virtual_lab.simulate import simulate_session
from biodance.virtual_lab.truth import sip_in_frames

CACHE = Path(os.environ.get("BIODANCE_CACHE", Path(tempfile.gettempdir()) / "biodance_excitation"))
THIRDS = np.array([[0.20987654], [0.79012346]])
SHOWN_TO = Subject(65.0, 1.75, "F")
ORDER = (
    "short",
    "squats as long as short",
    "random as long as short",
    "full",
    "squats as long as full",
    "random as long as full",
)


@dataclass(frozen=True)
class Row:
    """What one subject's session gave: ``duration`` s of the fit trials, criterion ``static`` and ``dynamic`` kg, error
    of ``mass`` kg and ``com`` m (12,) of the identified segments and of the table, relative error of the moments of
    ``inertia`` (12,), ``squats`` N and N·m of the kept trials, table and identified.
    """

    subject: int
    rival: str
    duration: float
    static: float
    dynamic: float
    mass: Array
    com: Array
    inertia: Array
    table_mass: Array
    table_com: Array
    table_inertia: Array
    squats: Array


def cached(name: str, make: Callable[[], object]) -> object:
    """Return what ``make`` gives, from disk if it was made before."""
    return kept(CACHE / f"{hashlib.sha256(name.encode()).hexdigest()[:20]}.pickle", make)


def designed(protocol: str) -> Dance:
    """Return the dance of a protocol that everybody is shown."""

    def make() -> tuple[Dance, float]:
        began = time.perf_counter()
        plan = read_plan(protocol)
        dance, _ = design(dancer(SHOWN_TO, plan), plan, resume=CACHE / "unfinished")
        return dance, time.perf_counter() - began

    dance, seconds = cached(f"dance {SHOWN_TO} {protocol}", make)
    print(
        f"  {protocol}: {dance.counted.sum()} postures, {dance.duration:.0f} s, designed in {seconds:.0f} s", flush=True
    )
    return dance


def random_dance(like: Dance, plan: Plan, subject: Subject = SHOWN_TO) -> Dance:
    """Return a dance of ``subject`` through as many random feasible postures on the same feet, straight ways between
    them.
    """
    body = dancer(subject, plan)
    chain, rng = Chain(body), np.random.default_rng(7)
    count = {name: sum(s.over is None and s.name == name for s in like.stances) for name, _ in plan.blocks}
    stances = support_sequence(
        body, replace(plan, budget=float("inf"), blocks=tuple((name, n) for name, n in count.items() if n))
    )
    x = np.full((len(stances), chain.size), np.nan)
    for k, stance in enumerate(stances):
        while stance.over is None and np.isnan(x[k, 0]):
            begin = initial_guess(chain, stance, rng)
            found = solve(chain, stance, begin, distance_from(begin), plan.limits, iterations=40)
            if found.violation <= KEPT:
                x[k] = found.x
    for k in np.flatnonzero(np.isnan(x[:, 0])):
        near = x[[max(k - 1, 0)]] if k and not np.isnan(x[k - 1, 0]) else x[:1]
        x[k] = intermediate_posture(chain, stances[k], near, plan.limits, seed=[3, int(k)]).x
    hold = np.array([plan.hold_on(s) for s in stances])
    move = np.full(len(x) - 1, (like.duration - hold.sum()) / (len(x) - 1))
    feet = tuple(under(a, b) for a, b in pairwise(stances))
    return Dance("random", body, x, stances, hold, x[:-1, None] + THIRDS * np.diff(x, axis=0)[:, None], move, feet, 7)


def squats(seconds: float) -> Protocol:
    """Return the protocol of squats with ``seconds`` of deep slow squats to fit, in trials of half a minute."""
    plain = read_protocol("squat")
    fit = next(trial for trial in plain.trials if trial.role == "fit")
    step = fit.steps[0]
    count = max(1, round(seconds / 30.0))
    cycles = max(2, round((seconds / count - step.hold - 2 * fit.lead) / step.period) - 1)
    trials = [
        TrialPlan(f"squats_{k}", "fit", fit.stance, (replace(step, cycles=cycles),), fit.lead) for k in range(count)
    ]
    return replace(plain, trials=(*(t for t in plain.trials if t.role != "fit"), *trials))


def examined(number: int, subject: Subject, rival: str, write: Callable[[Path], object]) -> Row:
    """Return what a session that ``write`` puts on disk gives after the front door."""
    import json

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "session"
        write(place)
        result = examine(read_session(place))
        document = json.loads((place / "truth" / "truth.json").read_text())
    found, body = identification_of(result), result.body
    fits = [t for t in result.trials if t.trial.role == "fit" and t.motion is not None]
    static = next(t for t in result.trials if t.trial.role == "static")
    frame = int(np.argmin(np.abs(static.motion.time - document["static_pose"]["time_s"])))
    pose = poses(body, static.motion.q[frame : frame + 1])
    true = sip_in_frames(document, pose.rotation[0], pose.position[0])
    criteria = criterion_of(body, joined([t.motion for t in fits]))
    rms = np.array([[v.table_agreement.rms, v.identified_agreement.rms] for v in found.validations]).mean(axis=0)
    squat = np.array([[np.linalg.norm(row[:3]), np.linalg.norm(row[3:])] for row in rms])
    own, table = errors(found.identification.sip.phi, true.phi), errors(body.sip.phi, true.phi)
    seconds = float(sum(t.motion.time[-1] - t.motion.time[0] for t in fits))
    return Row(number, rival, seconds, *criteria, *own, *table, squat)


def joined(motions: list[Motion]) -> Motion:
    """Return trials after one another, at 50 Hz."""
    step = max(1, round(motions[0].rate / 50.0))
    q, v, a = (np.concatenate([getattr(m, name)[::step] for m in motions]) for name in ("q", "v", "a"))
    return Motion(np.arange(len(q)) * step / motions[0].rate, q, v, a)


def errors(phi: Array, true: Array) -> tuple[Array, Array, Array]:
    """Return the errors of mass kg, CoM m (distance) and the relative error of the inertia tensors about the joint,
    of every segment.
    """
    a, b = phi.reshape(-1, 10), true.reshape(-1, 10)
    com = np.linalg.norm(a[:, 1:4] / a[:, :1] - b[:, 1:4] / b[:, :1], axis=1)
    return a[:, 0] - b[:, 0], com, np.linalg.norm(a[:, 4:] - b[:, 4:], axis=1) / np.linalg.norm(b[:, 4:], axis=1)


def visit(number: int, subject: Subject, rival: str) -> Row:
    """Return the row of one subject and one rival."""
    seed, name = 500 + number, rival.split()[-1]
    dance, began = designed(name), time.perf_counter()

    def write(place: Path) -> object:
        if rival.startswith("squats"):
            return simulate_session(subject, squats(1.2 * dance.duration), place, seed=seed)
        shown = random_dance(dance, read_plan(name)) if rival.startswith("random") else dance
        return simulate_dance(subject, shown, place, seed=seed)

    row = cached(f"row {subject} {rival} {seed}", lambda: examined(number, subject, rival, write))
    mass, before = (np.sqrt(np.mean(e**2)) for e in (row.mass, row.table_mass))
    com = 1000 * np.sqrt(np.mean(row.com**2))
    print(f"{number} {rival}: {row.duration:.0f} s, mass {mass:.3f} kg (table {before:.3f}), CoM {com:.1f} mm", end=" ")
    print(f"({time.perf_counter() - began:.0f} s)", flush=True)
    return row


def table(rows: list[Row]) -> str:
    """Return the means over the subjects as Markdown."""

    def rms(values: list[Array]) -> float:
        return float(np.sqrt(np.mean(np.square(values))))

    lines = [
        "| motion | s | static, kg | dynamic, kg | mass RMS, kg | CoM RMS, mm | inertia, % (median) | squats, N | "
        "squats, N·m |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    some = [row for row in rows if row.rival == "short"]
    force, moment = np.mean([row.squats[0] for row in some], axis=0)
    lines.append(
        f"| table, nothing danced | 0 | | | {rms([r.table_mass for r in some]):.3f} | "
        f"{1000 * rms([r.table_com for r in some]):.1f} "
        f"| {100 * np.median([r.table_inertia for r in some]):.0f} | {force:.1f} | {moment:.1f} |"
    )
    for rival in ORDER:
        mine = [row for row in rows if row.rival == rival]
        if mine:
            force, moment = np.mean([row.squats[1] for row in mine], axis=0)
            seconds, static, dynamic = (
                np.mean([getattr(row, name) for row in mine]) for name in ("duration", "static", "dynamic")
            )
            mass, com, inertia = (
                rms([r.mass for r in mine]),
                1000 * rms([r.com for r in mine]),
                100 * np.median([r.inertia for r in mine]),
            )
            known = f"{mass:.3f} | {com:.1f} | {inertia:.0f} | {force:.1f} | {moment:.1f}"
            lines.append(f"| {rival} | {seconds:.0f} | {static:.0f} | {dynamic:.0f} | {known} |")
    return "\n".join(lines)


def main() -> None:
    """Run the subjects, the short motions first, and print the table after each rival."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    rivals = sys.argv[2].split(",") if len(sys.argv) > 2 else ORDER
    rows: list[Row] = []
    for rival in rivals:
        rows += [visit(number, subject, rival) for number, subject in enumerate(subjects(count))]
        print(table(rows), flush=True)


if __name__ == "__main__":
    main()

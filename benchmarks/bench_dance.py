"""Whole dances for bodies of both sexes and all sizes: whether all limits hold, how exciting, how long it takes, what
stays up.

    OMP_NUM_THREADS=1 python benchmarks/bench_dance.py FOLDER [name of a body ...]

Everything found is kept in FOLDER (dances, margins, times), so that nothing is computed twice: an interrupted run goes
on, a finished body is only told again. Times are wall time and processor time of the two processes together; what was
taken from FOLDER is not in them.
"""

import json
import resource
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.metrics import dance_metrics
from biodance.dance.problem.person import HEALTHY, PersonLimits, fit_to_person
from biodance.dance.problem.plan import Plan, read_plan
from biodance.dance.rehearsal import rehearse
from biodance.dance.verify import verify
from biodance.errors import BiodanceError
from biodance.records import Subject

STIFF = PersonLimits(
    range_shares=(("left_shoulder", 0.5), ("left_elbow", 0.6), ("left_hip", 0.7), ("left_knee", 0.7)),
    reason="left side stiff",
)
CAREFUL = PersonLimits(stand_alone_on=(), reason="no standing on one leg")
BODIES: dict[str, tuple[Subject, PersonLimits]] = {
    "reference": (Subject(65.0, 1.75, "F", 33.0), HEALTHY),
    "small_woman": (Subject(45.0, 1.50, "F", 25.0), HEALTHY),
    "woman": (Subject(60.0, 1.65, "F", 45.0), HEALTHY),
    "heavy_woman": (Subject(95.0, 1.62, "F", 50.0), HEALTHY),
    "tall_woman": (Subject(80.0, 1.85, "F", 28.0), HEALTHY),
    "small_man": (Subject(58.0, 1.60, "M", 30.0), HEALTHY),
    "man": (Subject(75.0, 1.77, "M", 33.0), HEALTHY),
    "heavy_man": (Subject(110.0, 1.80, "M", 40.0), HEALTHY),
    "tall_man": (Subject(90.0, 1.95, "M", 24.0), HEALTHY),
    "old_man": (Subject(72.0, 1.70, "M", 70.0), HEALTHY),
    "stiff_left": (Subject(68.0, 1.72, "M", 55.0), STIFF),
    "careful": (Subject(62.0, 1.60, "F", 65.0), CAREFUL),
}
ROUNDING = ("continuity", "foot_placement", "ground_clearance")
"""Limits that planted and lifting feet keep exactly: what is left of them is rounding."""
PLAYED = ("reference",)
"""Bodies whose dance is played in MuJoCo, which takes half as long as the dance."""


def made(body: Body, plan: Plan, folder: Path, name: str) -> tuple[Dance, dict[str, float]]:
    """Return the dance of a body and what it took, from the folder if it is there."""
    path, times = folder / f"{name}.npz", folder / f"{name}.json"
    if not path.exists():
        before, start = _spent(), time.time()
        dance, _ = design(
            body, plan, seed=1, resume=folder / "parts", tell=lambda *what: print(name, *what, file=sys.stderr)
        )
        dance.save(path)
        times.write_text(json.dumps({"wall_s": time.time() - start, "cpu_s": _spent() - before}), encoding="utf-8")
    return Dance.load(path), json.loads(times.read_text(encoding="utf-8"))


def _spent() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return float(sum(one.ru_utime + one.ru_stime for one in used))


def told(name: str, folder: Path) -> str:
    """Return the row of one body, or the sentence in which its dance is refused."""
    subject, person = BODIES[name]
    body, plan, _ = fit_to_person(human(subject), read_plan("full"), person)
    who = f"| {name}, {subject.sex} {subject.stature:.2f} m {subject.mass:.0f} kg {subject.age:.0f} y"
    try:
        dance, spent = made(body, plan, folder, name)
    except BiodanceError as error:
        return f"{who} | refused: {error} |"
    margins, numbers = verify(body, dance, plan.limits), dance_metrics(dance, plan)
    numbers = dance_metrics(
        dance, replace(plan, weights=tuple((name, 0.0) for name in numbers.hardly))
    )  # feet that never leave the ground
    worst = min((m for m in margins if m.limit not in ROUNDING), key=lambda m: m.worst)
    slow, stops = int(np.sum(dance.move > plan.move + 1e-9)), int(np.sum(dance.hold == 0))
    holds = sum(m.worst >= 0 for m in margins)
    (folder / f"{name}.margins.txt").write_text("\n".join(map(str, margins)) + "\n", encoding="utf-8")
    return (
        f"{who} | {int(dance.counted.sum())} + {len(dance.hold) - int(dance.counted.sum())} | {len(dance.move)} "
        f"({slow}, {stops}) "
        f"| {holds} of {len(margins)} | {worst.limit} {worst.worst:.2g} {worst.unit} | "
        f"{numbers.static / numbers.static_bound:.3f} "
        f"| {numbers.dynamic[-1] / numbers.dynamic_bound:.2f} | {spent['wall_s']:.0f} | {spent['cpu_s']:.0f} |"
    )


def main() -> None:
    """Print the table, and what became of the dances that are played."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    print(
        "| body | postures + between | moves (slower, with a stop) | limits that hold | least margin | static | "
        "dynamic | wall s | CPU s |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    names = sys.argv[2:] or list(BODIES)
    for name in names:
        print(told(name, folder), flush=True)
    for name in (name for name in names if name in PLAYED and (folder / f"{name}.npz").exists()):
        dance = Dance.load(folder / f"{name}.npz")
        print(f"\nPlayed in MuJoCo: {name}\n\n{rehearse(dance).table()}", flush=True)


if __name__ == "__main__":
    main()

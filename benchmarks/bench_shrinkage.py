"""Is the table's weight right, and what limits masses? The prior varied in milliseconds on kept normal equations.

    python benchmarks/bench_shrinkage.py gather foreign 521 532 --into FOLDER   # needs BIODANCE_FOREIGN_LAB
    python benchmarks/bench_shrinkage.py gather third 0 9 --into FOLDER
    python benchmarks/bench_shrinkage.py table foreign third --into FOLDER

A session is made and tracked once; what identification needs of it is kept. Mass and CoM errors are over the table's,
of the posterior before the choice of a possible body. "Without error" is the wrench of the true masses and centres,
with the table's radii of gyration.
"""

import argparse
import json
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bench_people
import bench_third_lab
import numpy as np
from third_lab import make_session

from biodance.body.body import Body
from biodance.body.inertia import RigidInertia, inertial_parameters, rigid_inertia
from biodance.identification.calibration import discounted, undo_dilution
from biodance.identification.information import Information
from biodance.identification.learning import learn_noise
from biodance.identification.loads import with_unknown_load
from biodance.identification.mismatch import mismatch
from biodance.identification.placement import more_probable_table
from biodance.identification.posterior import find_posterior
from biodance.identification.statistics import layout_for, statistics_together, usable
from biodance.identification.unloaded_body import inflate_prior
from biodance.lab.session.read import read_session
from biodance.pipeline.session import examine
from biodance.pipeline.trial_result import trial_fit
from biodance.records import Array, Sip
from biodance.uncertainty.caution import widened


@dataclass(frozen=True, eq=False)
class Kept:
    """What identification needs of a person's session: ``data`` less what disturbs them, the ``table`` with the open
    questions answered; true ``mass`` (12,) kg and ``com`` (12, 3) m in the model's frames.
    """

    body: Body
    data: Information
    table: Sip
    mass: Array
    com: Array


def gather(kind: str, seed: int, folder: Path) -> Kept:
    """Return what is kept of a person's session, made, tracked and whitened now."""
    place = folder / "sessions" / f"P{seed}"
    if kind == "foreign":
        bench_people.session_of(seed, place.parent)
    else:
        make_session(place, seed, "none")
    result = examine(read_session(place))
    true = json.loads(place.with_name(f"P{seed}.truth.json").read_text())
    static = next(one.motion for one in result.trials if one.trial.role == "static")
    assert result.body is not None
    if kind == "foreign":
        mass, com, _ = bench_people.truth(result.body, static, true["segments"])
    else:
        way = bench_third_lab.world_to_read(result, true["static"]["markers_m"])
        mass, com, _ = bench_third_lab.truth(result.body, static, true, *way)
    body, fits = result.body, [trial_fit(one) for one in result.trials if one.trial.role == "fit"]
    used, about, _ = usable(body, tuple(fit for fit in fits if fit is not None))
    total, before = statistics_together(body, used, layout_for(about)), widened(body.sip, body.joint_errors)
    room = with_unknown_load(body, before)
    noise, _ = learn_noise(total, room)
    found = mismatch(body, used, noise)
    got = undo_dilution(body, total, discounted(total, noise, found, room), found, before, open_table=True)
    return Kept(body, got.data, more_probable_table(got.data, before, body)[0], mass, com)


def without_error(one: Kept, surer: float = 1.0) -> Information:
    """Return data that true masses and centres would give, as sure as these, or ``surer``."""
    phi = []
    for row, mass, com in zip(one.table.phi.reshape(-1, 10), one.mass, one.com, strict=True):
        unit = rigid_inertia(row)
        phi.append(inertial_parameters(RigidInertia(mass, com, unit.inertia * mass / unit.mass)))
    R = np.array(one.data.R)
    R[:-1, :-1] *= surer
    R[:-1, -1] = R[:-1, :-1] @ np.concatenate(phi)
    return Information(R, one.data.frames)


Answer = Callable[[Kept], tuple[Information, Sip]]
WAYS: dict[str, Answer] = {
    "as it is": lambda one: (one.data, one.table),
    **{
        f"all standard deviations x {times:g}": lambda one, times=times: (one.data, inflate_prior(one.table, times))
        for times in (0.5, 0.7, 1.4, 2.0)
    },
    "data without error": lambda one: (without_error(one), one.table),
    "... standard deviations a tenth": lambda one: (without_error(one, 10.0), one.table),
}


def line(name: str, people: list[Kept], answer: Answer) -> str:
    """Return one row: errors over the table's, masses held, log evidence."""
    ours, tables, held, evidence = [], [], [], 0.0
    for one in people:
        posterior = find_posterior(*answer(one))
        sip, table = posterior.sip, one.body.sip
        off, was = sip.mass - one.mass, table.mass - one.mass
        ours.append((np.abs(off).mean(), np.linalg.norm(sip.com - one.com, axis=1).mean()))
        tables.append((np.abs(was).mean(), np.linalg.norm(table.com - one.com, axis=1).mean()))
        held.append(np.abs(off) < bench_people.SIGMAS * bench_people.deviations(sip)[:, 0])
        evidence += posterior.log_evidence
    mass, com = np.mean(ours, axis=0) / np.mean(tables, axis=0)
    return f"| {name} | {mass:.3f} | {com:.3f} | {100 * np.mean(held):.1f} | {evidence:.0f} |"


def main() -> None:
    """Gather people, or print the table of those who were gathered."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("what", choices=("gather", "table"))
    ask.add_argument("words", nargs="+", help="gather: foreign or third, first and last seed; table: foreign, third")
    ask.add_argument("--into", type=Path, required=True)
    asked = ask.parse_args()
    (asked.into / "sessions").mkdir(parents=True, exist_ok=True)
    if asked.what == "gather":
        kind, first, last = asked.words
        for seed in range(int(first), int(last) + 1):
            path = asked.into / f"{kind}-{seed:04d}.pickle"
            if not path.is_file():
                path.write_bytes(pickle.dumps(gather(kind, seed, asked.into)))
        return
    for kind in asked.words:
        people = [pickle.loads(path.read_bytes()) for path in sorted(asked.into.glob(f"{kind}-*.pickle"))]
        print(f"| {kind}, {len(people)} | mass | CoM | masses held, % | log evidence |\n|---|---|---|---|---|")
        print("\n".join(line(name, people, answer) for name, answer in WAYS.items()))


if __name__ == "__main__":
    main()

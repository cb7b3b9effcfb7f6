"""The paper's chain from end to end: a dance is designed for a person, an imprecise virtual person performs it, the
session is read and identified, and what the segments weigh is compared with the truth.

    OMP_NUM_THREADS=1 python benchmarks/bench_chain.py FOLDER [--people 10] [--performer normal] [--motions
    squats,short,full] [--borrow] [--lab SEED]

Every person dances the dance that was designed for him or her (mass, stature, sex); `squats` are the fit trials of the
protocol squat, `squats_long` nine times as many. With `--borrow` a person without a dance takes the one in FOLDER that
was designed for the person nearest in stature; with `--lab` the sessions are recorded in the laboratory drawn from that
seed. Everything found is kept in FOLDER (dances, sessions, one JSON a session), so that an interrupted run goes on.
Remove FOLDER/rows when identification changes.
"""

import argparse
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from better_than_table import expected_better, told
from virtual_visits import subjects

from biodance.body.human.skeleton import SEGMENTS
from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.problem.plan import read_plan
from biodance.identification.knowledge import SIGMAS, segment_quantities
from biodance.identification.posterior import Posterior
from biodance.lab.session.read import read_session
from biodance.motion.kinematics import poses
from biodance.pipeline.dance import dancer
from biodance.pipeline.session import examine, identification_of
from biodance.pipeline.simulate_dance import simulate_dance
from biodance.records import Array, Subject
from biodance.virtual_lab.movement.dancing import PERFORMERS
from biodance.virtual_lab.movement.protocol import Protocol, read_protocol
from biodance.virtual_lab.recording.family import draw_laboratory
from biodance.virtual_lab.recording.laboratory import FIRST_VISIT, LabVisit
from biodance.virtual_lab.simulate import simulate_session
from biodance.virtual_lab.truth import sip_in_frames


@dataclass(frozen=True)
class Way:
    """How the people perform, and where: ``performer`` by name, whether they ``borrow`` dances, ``visit`` and its
    ``place``.
    """

    performer: str
    borrow: bool = False
    visit: LabVisit = FIRST_VISIT
    place: str = ""

    @property
    def name(self) -> str:
        """Of the sessions."""
        return f"{self.performer}{self.place}"


FIRST_SEED = 500
"""Person 0 is the virtual person of this seed, as in bench_excitation.py."""


def borrowed(folder: Path, subject: Subject, protocol: str) -> Path:
    """Return the dance in the folder that was designed for the person nearest in stature."""
    people = subjects(10)
    there = {int(path.stem.split("_")[0]): path for path in (folder / "dances").glob(f"*_{protocol}.npz")}
    return there[min(there, key=lambda number: abs(people[number].stature - subject.stature))]


def designed(folder: Path, number: int, subject: Subject, protocol: str, *, borrow: bool = False) -> Dance:
    """Return the dance of a person, from the folder if it is there."""
    path = folder / "dances" / f"{number}_{protocol}.npz"
    if borrow and not path.exists():
        path = borrowed(folder, subject, protocol)
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        plan = read_plan(protocol)
        dance, _ = design(dancer(subject, plan), plan, seed=0, resume=path.with_suffix(".parts"))
        dance.save(path)
    return Dance.load(path)


def many_squats() -> Protocol:
    """Return the protocol squat with its trial to fit nine times: as long as a short dance."""
    plan = read_protocol("squat")
    fits = [replace(trial, name=f"{trial.name}_{n}") for trial in plan.trials if trial.role == "fit" for n in range(9)]
    return replace(plan, trials=(*(trial for trial in plan.trials if trial.role != "fit"), *fits))


def session(folder: Path, number: int, subject: Subject, motion: str, way: Way) -> Path:
    """Return the folder of a session, simulated if it is not there."""
    place = folder / "sessions" / f"{number}_{motion}_{way.name}"
    if not (place / "truth").is_dir():
        seed = FIRST_SEED + number
        if motion == "squats":
            simulate_session(subject, "squat", place, seed=seed, visit=way.visit)
        elif motion == "squats_long":
            simulate_session(subject, many_squats(), place, seed=seed, visit=way.visit)
        else:
            dance = designed(folder, number, subject, motion, borrow=way.borrow)
            simulate_dance(subject, dance, place, seed=seed, performer=PERFORMERS[way.performer], visit=way.visit)
    return place


def row(folder: Path, number: int, subject: Subject, motion: str, way: Way) -> dict[str, Any]:
    """Return what a session gave: true, table's and identified mass (N,) kg and CoM (N, 3) m with standard deviations,
    and the residuals of the kept squats, table and identified, N and N·m (NaN where none can be used).
    """
    kept = folder / "rows" / f"{number}_{motion}_{way.name}.json"
    if not kept.exists():
        place = session(folder, number, subject, motion, way)
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_text(json.dumps(identified(place), default=np.ndarray.tolist))
    return dict(json.loads(kept.read_text()))


def identified(place: Path) -> dict[str, Any]:
    """Return what `row` keeps of the session in ``place``."""
    result = examine(read_session(place))
    document = json.loads((place / "truth" / "truth.json").read_text())
    one, body = identification_of(result), result.body
    assert body is not None
    static = next(t for t in result.trials if t.trial.role == "static")
    assert static.motion is not None
    frame = int(np.argmin(np.abs(static.motion.time - document["static_pose"]["time_s"])))
    pose = poses(body, static.motion.q[frame : frame + 1])
    turn, origin = pose.rotation[0][: len(SEGMENTS)], pose.position[0][: len(SEGMENTS)]
    true = sip_in_frames(document, turn, origin)
    centres = [origin[0], *(segment["position_m"] for segment in document["static_pose"]["segments_12"][1:])]
    own = sip_in_frames(document, turn, np.array(centres))
    known = one.identification.known

    def column(name: str, quantities: tuple[str, ...]) -> Array:
        rows = [[k for k in known if k.segment == s and k.quantity == q] for s in true.segments for q in quantities]
        return np.array([getattr(k[0], name) for k in rows]).reshape(len(true.segments), -1)

    mass, com = ("mass",), ("com x", "com y", "com z")
    pairs = [[v.table_agreement.rms, v.identified_agreement.rms] for v in one.validations] or np.full((1, 2, 6), np.nan)
    rms = np.mean(pairs, axis=0)
    phi = true.phi.reshape(-1, 10)
    table = {"mass": body.sip.mass[:, None], "com": body.sip.com}
    return {
        "segments": true.segments,
        "seconds": sum(float(np.ptp(t.motion.time)) for t in result.trials if t.trial.role == "fit" and t.motion),
        "true": {"mass": phi[:, :1], "com": phi[:, 1:4] / phi[:, :1], "own_com": own.com},
        "table": table,
        **{
            which: {"mass": column(key, mass), "com": column(key, com)}
            for which, key in (("identified", "value"), ("sd", "sd"), ("table_sd", "table_sd"))
        },
        "squats": [[float(np.linalg.norm(r[:3])), float(np.linalg.norm(r[3:]))] for r in rms],
        "sizes": vars(one.identification.sizes),
        "chance": expected_better(one.identification.posterior),
        "pull": pulled(one.identification.posterior, phi),
    }


def pulled(posterior: Posterior, true: Array) -> dict[str, Array]:
    """Return the errors of mass (N,) kg and CoM (N, 3) m that the table leaves in a ``posterior``, linearised about the
    ``true`` parameters (N, 10); the rest of its error is what the data add.
    """
    before = posterior.prior.phi - true.ravel()
    left = posterior.covariance @ np.linalg.pinv(posterior.prior.covariance, rcond=1e-10) @ before
    rows = [segment_quantities(own)[1][:4] @ part for own, part in zip(true, left.reshape(-1, 10), strict=True)]
    return {"mass": np.array(rows)[:, 0], "com": np.array(rows)[:, 1:]}


def errors(found: dict[str, Any], which: str) -> tuple[Array, Array]:
    """Return the errors of mass (N,) kg and of CoM (N,) m, the distance."""
    mass, com = (np.array(found[which][name]) - np.array(found["true"][name]) for name in ("mass", "com"))
    return mass[:, 0], np.linalg.norm(com, axis=1)


def covered(found: dict[str, Any], name: str) -> Array:
    """Return whether the 95 % interval of each value holds the truth; intervals of CoM are about the true joint centres
    (of the pelvis the model's), and so is the truth that they have to hold.
    """
    true = found["true"]["own_com" if name == "com" else name]
    off = np.abs(np.array(found["identified"][name]) - np.array(true))
    return np.ravel(off <= SIGMAS * np.array(found["sd"][name]))


def rms(values: Any) -> float:
    """Return the root mean square of all values."""
    return float(np.sqrt(np.mean(np.square(np.concatenate([np.ravel(v) for v in values])))))


def table(rows: dict[tuple[int, str], dict[str, Any]], motions: list[str]) -> str:
    """Return a line a motion as Markdown, over the people who have all of them."""
    people = sorted(n for n in {n for n, _ in rows} if all((n, m) in rows for m in motions))
    some = {m: [rows[n, m] for n in people] for m in motions}
    lines = [
        f"{len(people)} people",
        "| motion | fitted, s | mass RMS, kg | CoM RMS, mm | better than the table in mass, CoM, both | covered mass, "
        "CoM | squats, N | squats, N·m |",
        "|---|---|---|---|---|---|---|---|",
    ]
    first = some[motions[-1]]
    pairs = [errors(r, "table") for r in first]
    force, moment = np.mean([r["squats"][0] for r in first], axis=0)
    lines.append(
        f"| table | 0 | {rms(p[0] for p in pairs):.3f} | {1000 * rms(p[1] for p in pairs):.1f} | | | {force:.1f} | "
        f"{moment:.1f} |"
    )
    for motion, mine in some.items():
        found = [errors(r, "identified") for r in mine]
        share = [100 * np.mean(np.concatenate([covered(r, name) for r in mine])) for name in ("mass", "com")]
        force, moment = np.mean([r["squats"][1] for r in mine], axis=0)
        lines.append(
            f"| {motion} | {np.mean([r['seconds'] for r in mine]):.0f} | {rms(a[0] for a in found):.3f} | "
            f"{1000 * rms(a[1] for a in found):.1f} | {told(mine)} | {share[0]:.0f} %, {share[1]:.0f} % | "
            f"{force:.1f} | {moment:.1f} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Run person by person and print the table after each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--people", type=int, default=10)
    parser.add_argument("--performer", choices=tuple(PERFORMERS), default="normal")
    parser.add_argument("--motions", default="squats,short,full")
    parser.add_argument("--borrow", action="store_true")
    parser.add_argument("--lab", type=int, help="seed of a drawn laboratory")
    chosen = parser.parse_args()
    visit = FIRST_VISIT if chosen.lab is None else LabVisit(laboratory=draw_laboratory(chosen.lab))
    way = Way(chosen.performer, chosen.borrow, visit, "" if chosen.lab is None else f"_lab{chosen.lab}")
    motions, rows = chosen.motions.split(","), {}
    for number, subject in enumerate(subjects(chosen.people)):
        for motion in motions:
            rows[number, motion] = row(chosen.folder, number, replace(subject, age=33.0), motion, way)
            (mass, com), (before, there) = (errors(rows[number, motion], which) for which in ("identified", "table"))
            print(
                f"{number} {subject.sex} {subject.stature:.2f} m {subject.mass:.0f} kg {motion}: mass "
                f"{rms([mass]):.3f} kg (table {rms([before]):.3f}), CoM {1000 * rms([com]):.1f} mm (table "
                f"{1000 * rms([there]):.1f})",
                flush=True,
            )
        print(table(rows, motions), flush=True)


if __name__ == "__main__":
    main()

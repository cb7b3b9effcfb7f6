"""Learn what is shipped: sizes of what is usual, and the noise of dances that people performed.

    python -m benchmarks learn tolerances [--rounds 10]         # sizes.csv (learned rows) and null_sessions.toml
    python -m benchmarks learn dances FOLDER [--dance short]    # dances.toml

Both are of anthropometry/uncertainty and written anew. Tolerances are learned from thirty sessions without fault of
twenty virtual persons (seeds that no other benchmark uses): only what has a size in the tolerances in use, as what is
not in there is no nuisance. The noise of dances is the root mean square, over the bodies whose dances `dance` left in
FOLDER, of the standard deviations that identification learned, band by band and channel by channel; the sizes are the
medians of those that the evidence chose. What designs of dances expect beforehand rests on it.
"""

import argparse
import csv
import hashlib
import re
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.dance import BODIES
from biodance.dance.dance import Dance
from biodance.diagnosis.candidates import candidates
from biodance.diagnosis.learning import Null, learn_tolerances, null_of
from biodance.diagnosis.problem import problem
from biodance.lab.session.read import read_session
from biodance.library import folder
from biodance.pipeline.front_dance import simulate_dance
from biodance.pipeline.identification import FITTED_ROLES
from biodance.pipeline.judged_trials import windows
from biodance.pipeline.session import examine, identification_of
from biodance.records import Array, Subject
from biodance.uncertainty.tolerances import Tolerances, shipped, to_toml
from biodance.virtual_lab.movement import read_protocol
from biodance.virtual_lab.movement.performance import PERFORMERS
from biodance.virtual_lab.simulate import simulate_session
from biodance.virtual_lab.visit import LabVisit

TABLES = folder("anthropometry") / "uncertainty"
VISITS = [(i, 500 + i, 0) for i in range(20)] + [(i, 500 + i, 1) for i in range(10)]
"""Person of the catalogue, seed, visit."""
_HEAD = '''origin = """\\
{count} virtual people who danced the followable {dance} with realistic tolerances (performer normal), joints placed by
functional calibration; root mean square over them; python -m benchmarks learn dances"""
unit = "N, N m: standard deviation of one coefficient at 25 Hz, per band of uncertainty.bands.BANDS and channel"
'''


def catalogue(count: int = 20) -> tuple[Subject, ...]:
    """Return virtual persons: both sexes, 45 to 110 kg, 1.50 to 1.95 m, body mass index 18 to 34."""
    rng, out = np.random.default_rng(2026), []
    for i in range(count):
        sex = "FM"[i % 2]
        stature = float(rng.uniform(1.50, 1.80) if sex == "F" else rng.uniform(1.62, 1.95))
        mass = float(np.clip(rng.uniform(19.0, 33.0) * stature**2, 45.0, 110.0))
        out.append(Subject(round(mass, 1), round(stature, 3), sex))
    return tuple(out)


def nulls() -> Iterator[Null]:
    """Yield the sessions without fault as `learn_tolerances` wants them."""
    plan, people = read_protocol("diagnosis"), catalogue()
    plan = replace(plan, trials=tuple(trial for trial in plan.trials if trial.role != "validate"))
    for person, seed, visit in VISITS:
        with tempfile.TemporaryDirectory() as place:
            simulate_session(people[person], plan, Path(place) / "s", seed=seed, visit=LabVisit(visit))
            result = examine(read_session(Path(place) / "s"))
        assert result.body is not None
        put, known = problem(result.body, windows(result.trials, FITTED_ROLES)), shipped()
        yield null_of(put, tuple(one for one in candidates(put) if known.knows(one.effect.name)))
        print(f"person {person}, visit {visit}", flush=True)


def write_sizes(found: Tolerances) -> None:
    """Write the learned sizes into their rows of the one table, and its sha256 beside it."""
    table = TABLES / "sizes.csv"
    with open(table, newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    for row in rows:
        if row["learned_on"] == "null_sessions":
            row["sd"] = f"{found.size(' '.join((row['quantity'], row['target'])).removesuffix(' session')):.4g}"
    with open(table, "w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    provenance = table.with_suffix(".toml")
    fresh = hashlib.sha256(table.read_bytes()).hexdigest()
    provenance.write_text(
        re.sub('sha256 = "[0-9a-f]*"', f'sha256 = "{fresh}"', provenance.read_text()), encoding="utf-8"
    )


def tolerances(rounds: int) -> None:
    """Learn the tolerances and write them."""
    sessions = tuple(nulls())
    found = learn_tolerances(sessions, shipped(), rounds=rounds)
    origin = f"{len(sessions)} virtual sessions of 20 persons without fault, realistic tolerances, protocol diagnosis"
    write_sizes(found)
    (TABLES / "null_sessions.toml").write_text(to_toml(replace(found, origin=origin, sizes={})), encoding="utf-8")


def left(place: Path) -> tuple[Array, Array]:
    """Return what identification found in a session: noise (B, 6) N and N m, sizes (2,) of kinematics and noise."""
    found = identification_of(examine(read_session(place))).identification
    noise = np.sqrt(np.array([np.diag(band) for band in found.noise.covariance]))
    print(place.name, found.sizes, noise.round(1).tolist(), flush=True)
    return noise, np.array([found.sizes.kinematics, found.sizes.noise])


def dances(place: Path, dance: str) -> None:
    """Let the bodies of a folder perform their dances, learn what was left, and write it."""
    found = []
    for number, path in enumerate(sorted(place.glob(f"*_{dance}.npz"))):
        with tempfile.TemporaryDirectory() as scratch:
            subject, seed = BODIES[path.stem.removesuffix(f"_{dance}")][0], 500 + number
            session = Path(scratch) / path.stem
            simulate_dance(subject, Dance.load(path), session, seed=seed, performer=PERFORMERS["normal"])
            found.append(left(session))
    noises, sizes = (np.array(some) for some in zip(*found, strict=True))
    rows = np.sqrt(np.mean(np.square(noises), axis=0))
    kinematics, noise = np.median(sizes, axis=0)
    table = ",\n".join(f"  [{', '.join(f'{value:.1f}' for value in row)}]" for row in rows)
    (TABLES / "dances.toml").write_text(
        f"{_HEAD.format(count=len(found), dance=dance)}noise = [\n{table},\n]\n\n[sizes]\n"
        f"kinematics = {kinematics:.2g}\nnoise = {noise:.2g}\n",
        encoding="utf-8",
    )


def main() -> None:
    """Learn and write."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("what", choices=("tolerances", "dances"))
    ask.add_argument("folder", type=Path, nargs="?", help="of dances")
    ask.add_argument("--rounds", type=int, default=10)
    ask.add_argument("--dance", default="short")
    asked = ask.parse_args()
    if asked.what == "dances" and asked.folder is None:
        ask.error("dances need the FOLDER in which `python -m benchmarks dance` kept them.")
    tolerances(asked.rounds) if asked.what == "tolerances" else dances(asked.folder, asked.dance)
    print(f"wrote {TABLES}")

"""Is the followable dance worth it? Beside the free optimum, random movement and squats of equal time, and the table.

    OMP_NUM_THREADS=1 python benchmarks/bench_worth.py FOLDER [--lab own,foreign] [--bodies small_woman,heavy_man]
        [--visits 3] [--ways followable,free,random,squats] [--tell]

FOLDER holds the dances of `bench_followable.py` (`small_woman_short.npz`); the free ones are designed into FOLDER/free
(same feet, no limit on instructions, no price of one), those of ``full`` with that protocol; any other way is a folder
in FOLDER with dances of it. Visit k of a body is another person of its size. ``own``: the virtual laboratory of this
package, performer "normal"; ``foreign``: an independent one (BIODANCE_FOREIGN_LAB), which copies our dances
(`foreign_dance.py`) and whose own random movement and squats are the rivals. Every way is as long, but for ``full``,
which takes its own seven minutes. What is removed counts against one table, the mean of what the sessions of all ways
say (it is scaled by each session). Shares of the free optimum stand with the interval that 95 % of the samples of as
many people drawn anew from these give.
Rows are kept in FOLDER/worth; ``--tell`` only tells what is there.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bench_chain import covered, errors, identified, rms
from bench_dance import BODIES
from bench_excitation import random_dance, squats
from bench_people import deviations, truth
from better_than_table import expected_better, told
from foreign_dance import TRIAL
from numpy.typing import NDArray

from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.problem.plan import read_plan
from biodance.lab.session.read import read_session
from biodance.pipeline.dance import dancer
from biodance.pipeline.session import examine, identification_of
from biodance.pipeline.simulate_dance import simulate_dance
from biodance.records import Array
from biodance.virtual_lab.movement.dancing import PERFORMERS
from biodance.virtual_lab.simulate import simulate_session

SECONDS = {"own": 136.0, "foreign": 140.0}
"""Of every way; the foreign laboratory records trials of 10 s."""
_SEEDS = {"own": 1100, "foreign": 1101}
_TELLING = 0.1
"""Share of the table's error that the free dance must remove for a share of that to say something."""
_DRAWS = 4000
"""Of people, for the interval of a share."""
WAYS = ("followable", "free", "random", "squats")
HEADING = (
    "| laboratory, sessions | way | mass, kg | stated | removed | share of free | CoM, mm | stated | removed "
    "| share of free | 95 % intervals hold mass, CoM | better than the table in mass, CoM, both |\n|" + "---|" * 12
)


def path_of(folder: Path, name: str, way: str) -> Path:
    """Return where the dance of a body is, or will be."""
    return folder / ("" if way == "followable" else way) / f"{name}_short.npz"


def dance_of(folder: Path, name: str, way: str) -> Dance:
    """Return the dance of a body, from the folder if it is there."""
    path = path_of(folder, name, way)
    if not path.exists():
        subject = BODIES[name][0]
        plan = read_plan("full" if way == "full" else "short")
        plan = replace(plan, instructions=np.inf, simplicity=0.0)
        like = Dance.load(folder / f"{name}_short.npz")
        dance = random_dance(like, plan, subject) if way == "random" else design(dancer(subject, plan), plan, seed=0)[0]
        path.parent.mkdir(exist_ok=True)
        dance.save(path)
    return Dance.load(path)


def own(folder: Path, name: str, way: str, seed: int, place: Path) -> dict[str, Any]:
    """Return what a session of our virtual laboratory gave."""
    subject, seconds = BODIES[name][0], SECONDS["own"]
    if way == "squats":
        simulate_session(subject, squats(seconds), place, seed=seed)
    else:
        dance = dance_of(folder, name, way)
        performer = replace(PERFORMERS["normal"], pace=max(seconds / dance.duration, 1.0))
        simulate_dance(subject, dance, place, seed=seed, performer=performer)
    return identified(place)


def foreign(folder: Path, name: str, way: str, seed: int, place: Path) -> dict[str, Any]:
    """Return what a session of the foreign laboratory gave."""
    subject, seconds = BODIES[name][0], SECONDS["foreign"]
    who: dict[str, Any] = {"seed": seed, "sex": subject.sex, "height": subject.stature, "mass": subject.mass}
    who |= {"noise": 0.6, "camera": 0.3, "out": place}
    if way in ("random", "squats"):
        kinds = ["--kinds", "squat"] if way == "squats" else []
        first: list[Any] = [
            Path(os.environ["BIODANCE_FOREIGN_LAB"]) / "foreign_lab.py",
            "--trials",
            int(seconds / TRIAL),
        ]
        first += kinds
    else:
        seconds = max(seconds, TRIAL * np.ceil(dance_of(folder, name, way).duration / TRIAL))
        first = [Path(__file__).with_name("foreign_dance.py"), path_of(folder, name, way), seconds]
    words = [str(text) for key, value in who.items() for text in (f"--{key}", value)]
    subprocess.run([sys.executable, *map(str, first), *words], check=True, stdout=subprocess.DEVNULL)
    result = examine(read_session(place))
    body, found = result.body, identification_of(result).identification
    static = next(one.motion for one in result.trials if one.trial.role == "static")
    assert body is not None
    assert static is not None
    document = json.loads(place.with_name(f"{place.name}.truth.json").read_text())
    mass, com, own_com = truth(body, static, document["segments"])
    sip, sd = found.sip, deviations(found.sip)
    return {
        "true": {"mass": mass[:, None], "com": com, "own_com": own_com},
        "table": {"mass": body.sip.mass[:, None], "com": body.sip.com},
        "identified": {"mass": sip.mass[:, None], "com": sip.com},
        "sd": {"mass": sd[:, :1], "com": sd[:, 1:]},
        "chance": expected_better(found.posterior),
    }


def row(folder: Path, lab: str, name: str, way: str, visit: int, *, tell: bool) -> dict[str, Any] | None:
    """Return what a session gave, from the folder if it is there."""
    kept = folder / "worth" / f"{lab}_{name}_{way}_{visit}.json"
    if not kept.exists():
        if tell:
            return None
        with tempfile.TemporaryDirectory() as scratch:
            write = own if lab == "own" else foreign
            seed = _SEEDS[lab] + 20 * visit + 3 * list(BODIES).index(name)
            found = write(folder, name, way, seed, Path(scratch) / "session")
        kept.parent.mkdir(exist_ok=True)
        kept.write_text(json.dumps(found, default=np.ndarray.tolist), encoding="utf-8")
    return dict(json.loads(kept.read_text(encoding="utf-8")))


def squares(sessions: list[dict[str, dict[str, Any]]]) -> dict[str, Array]:
    """Return mean square errors (sessions, 2) of mass, kg², and CoM, mm², of every way and of "table", the mean of what
    the sessions of all ways say.
    """

    def of(row: dict[str, Any], which: str) -> list[float]:
        mass, com = errors(row, which)
        return [float(np.mean(mass**2)), float(1e6 * np.mean(com**2))]

    found = {way: np.array([of(one[way], "identified") for one in sessions]) for way in sessions[0]}
    return found | {"table": np.mean([[of(row, "table") for row in one.values()] for one in sessions], axis=1)}


def shares(found: dict[str, Array], way: str, picked: NDArray[np.int_]) -> Array:
    """Return which share (2,) of the error that the free dance removes ``way`` removes, in the sessions ``picked``."""
    off, table, free = (np.sqrt(found[name][picked].mean(axis=0)) for name in (way, "table", "free"))
    return np.asarray((table - off) / (table - free))


def shares_by_chance(found: dict[str, Array], way: str) -> Array:
    """Return the 95 % interval (2, 2) of `shares`, lower and upper: people drawn anew, each with all of their ways."""
    random, number = np.random.default_rng(0), len(found[way])
    drawn = [shares(found, way, random.integers(0, number, number)) for _ in range(_DRAWS)]
    return np.asarray(np.percentile(drawn, (2.5, 97.5), axis=0))


def stated(sessions: list[dict[str, dict[str, Any]]], way: str) -> tuple[float, float]:
    """Return the root mean square of the stated deviations of mass, kg, and CoM (the distance), mm."""
    mass, com = (np.array([one[way]["sd"][name] for one in sessions]) for name in ("mass", "com"))
    return rms([mass]), 1000 * rms([np.linalg.norm(com, axis=-1)])


def lines(lab: str, sessions: list[dict[str, dict[str, Any]]]) -> list[str]:
    """Return the table over ``sessions``, each with the row of every way: root mean squares over all segments."""
    found, everybody = squares(sessions), np.arange(len(sessions))
    off = {way: np.sqrt(square.mean(axis=0)) for way, square in found.items()}
    table = off["table"]
    out = [f"| {lab}, {len(sessions)} | table | {table[0]:.3f} | | | | {table[1]:.1f} | | | | | |"]
    for way in sessions[0]:
        cells, says = [], stated(sessions, way)
        for k, digits in enumerate((3, 1)):
            removed, share = table[k] - off[way][k], "–"
            if "free" in off and table[k] - off["free"][k] > _TELLING * table[k]:
                low, high = 100 * shares_by_chance(found, way)[:, k]
                share = f"{100 * shares(found, way, everybody)[k]:.0f} % ({low:.0f} to {high:.0f})"
            cells += [f"{off[way][k]:.{digits}f}", f"{says[k]:.{digits}f}", f"{removed:.{digits}f}", share]
        held = (100 * np.mean([covered(one[way], what) for one in sessions]) for what in ("mass", "com"))
        words = ", ".join(f"{share:.0f} %" for share in held)
        out.append(f"| | {way} | {' | '.join(cells)} | {words} | {told([one[way] for one in sessions])} |")
    return out


def main() -> None:
    """Run session by session and print the tables over those that all ways have."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--lab", default="own,foreign")
    parser.add_argument("--bodies", default="small_woman,heavy_man,reference")
    parser.add_argument("--visits", type=int, default=3)
    parser.add_argument("--ways", default=",".join(WAYS))
    parser.add_argument("--tell", action="store_true")
    chosen = parser.parse_args()
    print(HEADING)
    for lab in chosen.lab.split(","):
        sessions: list[dict[str, dict[str, Any]]] = []
        for visit in range(chosen.visits):
            for name in chosen.bodies.split(","):
                rows = {w: row(chosen.folder, lab, name, w, visit, tell=chosen.tell) for w in chosen.ways.split(",")}
                if all(rows.values()):
                    sessions.append({way: one for way, one in rows.items() if one})
        if sessions:
            print("\n".join(lines(lab, sessions)), flush=True)


if __name__ == "__main__":
    main()

"""The whole chain: is the dance designed for a person worth it, beside the free optimum, random movement, squats of
equal time and the table.

    OMP_NUM_THREADS=1 python -m benchmarks chain FOLDER [--lab own foreign] [--bodies small_woman heavy_man]
        [--visits 3] [--first SEED] [--ways followable free squats full random] [--tell]

FOLDER holds the dances that `dance` designed (`small_woman_short.npz`); the free ones are designed into FOLDER/free
(same feet, no limit on instructions, no price of one), those of ``full`` with that protocol; any other way is a folder
in FOLDER with dances of it. Visit k of a body is another person of its size. ``own``: the virtual laboratory of this
package, performer "normal"; ``foreign``: an independent one (BIODANCE_FOREIGN_LAB), which copies our dances
(`foreign_dance.py`) and whose own squats and random movement (``random``: there only) are the rivals. Every way is as
long, but for ``full``, which takes its own seven minutes. What is removed counts against one table, the mean of what
the sessions of all ways say (it is scaled by each session). Shares of the free optimum stand with the interval that
95 % of the samples of as many people drawn anew from these give. Rows are kept in FOLDER/worth; ``--tell`` only tells
what is there.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.dance import BODIES
from benchmarks.foreign_dance import TRIAL
from benchmarks.people import Row, better_than_table, covered, errors, first_seed, identified, kept, run_foreign
from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.problem.plan import read_plan
from biodance.pipeline.dance import dancer
from biodance.pipeline.front_dance import simulate_dance
from biodance.records import Array
from biodance.virtual_lab.movement import Protocol, TrialPlan, read_protocol
from biodance.virtual_lab.movement.performance import PERFORMERS
from biodance.virtual_lab.simulate import simulate_session

SECONDS = {"own": 136.0, "foreign": 140.0}
"""Of every way; the foreign laboratory records trials of 10 s."""
_TELLING = 0.1
"""Share of the table's error that the free dance must remove for a share of that to say something."""
_DRAWS = 4000
"""Of people, for the interval of a share."""
WAYS = ("followable", "free", "squats")
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
        if way not in ("free", "full"):
            raise SystemExit(f"There is no {path}. Design it first: python -m benchmarks dance {folder}")
        plan = replace(read_plan("full" if way == "full" else "short"), instructions=np.inf, simplicity=0.0)
        dance, _ = design(dancer(BODIES[name][0], plan), plan, seed=0)
        path.parent.mkdir(exist_ok=True)
        dance.save(path)
    return Dance.load(path)


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


def own(folder: Path, name: str, way: str, seed: int, place: Path) -> None:
    """Write a session of our virtual laboratory."""
    subject, seconds = BODIES[name][0], SECONDS["own"]
    if way == "squats":
        simulate_session(subject, squats(seconds), place, seed=seed)
        return
    dance = dance_of(folder, name, way)
    performer = replace(PERFORMERS["normal"], pace=max(seconds / dance.duration, 1.0))
    simulate_dance(subject, dance, place, seed=seed, performer=performer)


def foreign(folder: Path, name: str, way: str, seed: int, place: Path) -> None:
    """Write a session of the foreign laboratory."""
    who, seconds = BODIES[name][0], SECONDS["foreign"]
    if way in ("random", "squats"):
        kinds = ("--kinds", "squat") if way == "squats" else ()
        run_foreign(seed, place, "--trials", int(seconds / TRIAL), *kinds, who=who)
        return
    seconds = max(seconds, TRIAL * np.ceil(dance_of(folder, name, way).duration / TRIAL))
    script = Path(__file__).with_name("foreign_dance.py")
    run_foreign(seed, place, path_of(folder, name, way), seconds, script=script, who=who)


def row(folder: Path, lab: str, name: str, way: str, seed: int, *, tell: bool) -> Row | None:
    """Return what a session gave, from the folder if it is there."""
    path = folder / "worth" / f"{lab}_{name}_{way}_{seed}.json"

    def made() -> Row:
        with tempfile.TemporaryDirectory() as scratch:
            place = Path(scratch) / "session"
            (own if lab == "own" else foreign)(folder, name, way, seed, place)
            return identified(lab, place)

    return None if tell and not path.exists() else kept(path, made)


def squares(sessions: list[dict[str, Row]]) -> dict[str, Array]:
    """Return mean square errors (sessions, 2) of mass, kg², and CoM, mm², of every way and of "table", the mean of what
    the sessions of all ways say.
    """

    def of(row: Row, which: str) -> list[float]:
        mass, com = (errors(row, which, what) for what in ("mass", "com"))
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


def stated(sessions: list[dict[str, Row]], way: str) -> tuple[float, float]:
    """Return the root mean square of the stated deviations of mass, kg, and CoM (the distance), mm."""
    sd = np.array([one[way]["sd"] for one in sessions])
    mass, com = np.mean(sd[:, :, 0] ** 2), np.mean(np.sum(sd[:, :, 1:] ** 2, axis=-1))
    return float(np.sqrt(mass)), float(1000 * np.sqrt(com))


def lines(lab: str, sessions: list[dict[str, Row]]) -> list[str]:
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
        held = 100 * np.mean([covered(one[way]) for one in sessions], axis=0)
        words = ", ".join(f"{share:.0f} %" for share in held)
        out.append(f"| | {way} | {' | '.join(cells)} | {words} | {better_than_table([one[way] for one in sessions])} |")
    return out


def main() -> None:
    """Run session by session and print the tables over those that all ways have."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path)
    ask.add_argument("--lab", nargs="+", choices=tuple(SECONDS), default=tuple(SECONDS))
    ask.add_argument("--bodies", nargs="+", default=("small_woman", "heavy_man", "reference"))
    ask.add_argument("--visits", type=int, default=3)
    ask.add_argument("--first", type=int, default=first_seed(), help="seed of the first visit of the first body")
    ask.add_argument("--ways", nargs="+", default=WAYS)
    ask.add_argument("--tell", action="store_true")
    asked = ask.parse_args()
    print(HEADING)
    for lab in asked.lab:
        sessions: list[dict[str, Row]] = []
        for visit in range(asked.visits):
            for name in asked.bodies:
                seed = asked.first + 20 * visit + list(BODIES).index(name)
                rows = {way: row(asked.folder, lab, name, way, seed, tell=asked.tell) for way in asked.ways}
                if all(rows.values()):
                    sessions.append({way: one for way, one in rows.items() if one})
        if sessions:
            print("\n".join(lines(lab, sessions)), flush=True)

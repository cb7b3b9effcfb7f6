"""How soon a plate that changed is found in an archive of visits, and how often one that did not is blamed.

    python -m benchmarks plates [--archives 40] [--clean 200] [--first SEED] [--recorded]

Archives are drawn by chance: what every trial says of every plate, with a truth that is known. Only records and the way
from steps to places are taken from the room that judges. Sizes are those measured on real walks: errors of steps have
heavy tails (Student, 5 degrees of freedom) and one step in twenty is plainly wrong; a person's feet have habits of
their own, mirrored from left to right; the declared mass of a visit is wrong; plates are zeroed a little otherwise
every day. ``--recorded`` takes the seven children of ``biomechzoo`` (BIODANCE_DATA) as visits of one laboratory
instead, with a fault written into the files of the later ones.
"""

import argparse
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path

import numpy as np

from benchmarks.people import first_seed
from benchmarks.walks import copied
from biodance.diagnosis.archive.judge import ArchiveJudgement, judge_archive
from biodance.diagnosis.archive.quantities import PlateEvidence, PlateVisit
from biodance.diagnosis.archive.walking import StepRow, placed
from biodance.pipeline.learn import judge_plates

PLATES = ("plate1", "plate2")
ACROSS, ALONG, ONSET, WEIGHED, EMPTY = 0.0027, 0.0044, 0.005, 0.001, 0.1
"""m, m, s, 1, N: one step or trial (places: 23 steps of seven children, two of the same foot in one visit)."""
FOOT, STRIDE, DECLARED, ZEROED = 0.0035, 0.004, 0.003, 0.5
"""m, m, 1, N: a foot across, a person along, a declared mass, a day's zero."""


@dataclass(frozen=True)
class Step:
    """From visit ``at`` (0 ...) on, ``quantity`` of ``plate`` is ``size`` larger; ``plate`` "" none."""

    plate: str = ""
    quantity: str = ""
    size: float = 0.0
    at: int = 0

    def of(self, plate: str, quantity: str, visit: int) -> float:
        """Return what it adds."""
        return self.size if (plate, quantity) == (self.plate, self.quantity) and visit >= self.at else 0.0


def draw(seed: int, *, visits: int = 16, step: Step | None = None) -> tuple[PlateEvidence, ...]:
    """Return an archive of ``visits`` of people who walk (y is across) along x over two plates."""
    chance = np.random.default_rng(seed)
    day, people = date(2025, 1, 7), 0
    habits: dict[int, np.ndarray] = {}
    found: list[PlateEvidence] = []
    for v in range(visits):
        day += timedelta(days=int(chance.integers(1, 9)))
        known = bool(people) and chance.random() < 0.25
        person = int(chance.integers(people)) if known else people
        people += not known
        if person not in habits:
            habits[person] = np.array([*chance.normal(0, FOOT, 2), chance.normal(0, STRIDE)])
        visit = PlateVisit(f"V{v:02d}", f"P{person}", day.isoformat())
        found += _visit(chance, visit, v, habits[person], step or Step())
    return tuple(found)


def _visit(
    chance: np.random.Generator, visit: PlateVisit, v: int, habit: np.ndarray, step: Step
) -> Iterator[PlateEvidence]:
    declared = chance.normal(0, DECLARED)
    zero = chance.normal(0, ZEROED, (len(PLATES), 3))
    rows: list[StepRow] = []
    for t in range(int(chance.integers(6, 13))):
        first = int(chance.integers(2))
        for p, plate in enumerate(PLATES):
            for axis in range(3):
                name = f"offset_{'xyz'[axis]}"
                value = zero[p, axis] + chance.normal(0, EMPTY) + step.of(plate, name, v)
                yield PlateEvidence(name, {plate: 1.0}, value, 0.3, visit, f"walk{t}", taken_off=True)
            if chance.random() < 0.85:
                tail = chance.standard_t(5, 3) / np.sqrt(5 / 3) * (4.0 if chance.random() < 0.05 else 1.0)
                shift = np.array([step.of(plate, f"place_{axis}", v) for axis in "xy"])
                rows += _foot(plate, 1 if t % 2 else -1, (first + p) % 2, habit, shift, tail[:2])
                late = ONSET * tail[2] + step.of(plate, "delay", v)
                yield PlateEvidence("delay", {plate: 1.0}, late, ONSET, visit, f"walk{t}")
    yield from placed(rows, visit, "all steps")
    mass = chance.normal(declared, WEIGHED) + step.of("plate1", "gain", v)
    yield PlateEvidence("gain", {"plate1": 1.0}, mass, WEIGHED, visit, "static")


def _foot(plate: str, way: int, foot: int, habit: np.ndarray, shift: np.ndarray, error: np.ndarray) -> list[StepRow]:
    """Return what one step says, walking along x (``way`` 1) or back: right foot (1) outwards is -y, left (0) is +y."""
    outwards = np.array([0.0, -way if foot else way])
    ahead = np.array([float(way), 0.0])
    side = "right" if foot else "left"
    across = float(outwards @ shift + habit[foot] + ACROSS * error[0])
    along = float(ahead @ shift + habit[2] + ALONG * error[1])
    return [
        StepRow(plate, outwards, across, ACROSS, {f"person {side}": FOOT}),
        StepRow(plate, ahead, along, ALONG, {"person along": STRIDE}),
    ]


AT = 8
"""The first visit after the step."""
AFTER = (1, 2, 3, 5, 8)
"""Visits after the step at which the archive is judged."""
STEPS = (
    Step("plate2", "place_y", 0.005, AT), Step("plate2", "place_x", 0.005, AT), Step("plate1", "place_y", 0.01, AT),
    Step("plate1", "offset_z", 5.0, AT), Step("plate2", "offset_x", -5.0, AT), Step("plate1", "offset_z", 2.5, AT),
    Step("plate1", "gain", 0.02, AT), Step("plate2", "delay", 0.008, AT),
)  # fmt: skip


def named(found: ArchiveJudgement, step: Step) -> bool:
    """Return whether the step stands on the card of its plate, and its date in the interval."""
    return any(
        change.quantity == step.quantity
        and change.plate == step.plate
        and change.earliest.name <= f"V{step.at:02d}" <= change.latest.name
        for card in found.plates
        for change in card.changes
    )


def covered(found: ArchiveJudgement, step: Step) -> list[bool]:
    """Return whether the 95 % interval of each change of the right plate and quantity holds the true size."""
    changes = {change for card in found.plates for change in card.changes}
    return [
        change.interval[0] <= step.size <= change.interval[1]
        for change in changes
        if (change.plate, change.quantity) == (step.plate, step.quantity)
    ]


def others(found: ArchiveJudgement, step: Step) -> int:
    """Return how many changes that matter are no change."""
    changes = {change for card in found.plates for change in card.changes if change.matters}
    return sum((change.plate, change.quantity) != (step.plate, step.quantity) for change in changes)


def row(step: Step, seeds: Iterable[int]) -> str:
    """Return one line of the table."""
    right: dict[int, list[bool]] = {after: [] for after in AFTER}
    inside: list[bool] = []
    wrong: list[bool] = []
    for seed in seeds:
        every = draw(seed, visits=AT + max(AFTER), step=step)
        for after in AFTER:
            found = judge_archive([one for one in every if int(one.visit.name[1:]) < AT + after])
            right[after].append(named(found, step))
            wrong.append(others(found, step) > 0)
        inside += covered(found, step)
    shares = " | ".join(f"{100 * np.mean(right[after]):.0f}" for after in AFTER)
    about = f"{100 * np.mean(inside or [False]):.0f} | {100 * np.mean(wrong):.0f}"
    return f"| {step.plate} {step.quantity} {step.size:+g} | {shares} | {about} |"


def clean(seeds: Iterable[int], say: Callable[[str], None]) -> None:
    """Print how often an archive without fault raises an alarm."""
    alarms, strangers = [], []
    for seed in seeds:
        found = judge_archive(draw(seed))
        alarms.append(bool(found.findings))
        strangers.append(len(found.strangers))
        if found.findings:
            say(f"<!-- seed {seed}: {found.findings[0].text} -->")
    say(f"Clean archives with an alarm: {100 * np.mean(alarms):.1f} % of {len(alarms)}; "
        f"visits or persons called unlike the others: {np.mean(strangers):.2f} an archive")  # fmt: skip


RECORDED = (
    "", "plate_position:target=plate2:x,shift=0.015", "plate_position:target=plate2:y,shift=0.015",
    "plate_offset:target=plate1:Fx,offset=5", "plate_offset:target=plate1:Fz,offset=5",
    "plate_gain:target=plate1:Fz,gain=0.03", "time_delay:delay=0.02",
)  # fmt: skip


def recorded(sessions: list[Path], text: str, *, later: int = 3) -> str:
    """Return one line of the table of recordings: what is told where ``text`` is in all from number ``later`` on."""
    with tempfile.TemporaryDirectory() as place:
        for number, session in enumerate(sessions):
            copied(sorted(session.glob("*.c3d")), Path(place) / session.name, text if number >= later else "")
            if (session / "session.toml").is_file():
                shutil.copy(session / "session.toml", Path(place) / session.name)
        found = judge_plates(Path(place)).judgement
    every = [f"{card.plate} {one.effect} {one.target}: {one.text}" for card in found.plates for one in card.findings]
    return f"| {text or 'nothing'} | {'<br>'.join(every) or 'nothing'} |"


def main() -> None:
    """Print the table."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--archives", type=int, default=40)
    ask.add_argument("--clean", type=int, default=200)
    ask.add_argument("--first", type=int, default=first_seed())
    ask.add_argument("--recorded", action="store_true")
    asked = ask.parse_args()
    if asked.recorded:
        children = sorted((Path(os.environ["BIODANCE_DATA"]) / "biomechzoo").glob("HC*"))
        print("| written from the fourth on | told |\n|---|---|")
        for text in RECORDED:
            print(recorded(children, text), flush=True)
        return
    print("| step | " + " | ".join(f"{a} after (%)" for a in AFTER) + " | size covered (%) | other changes (%) |")
    print("|---|" + "---|" * (len(AFTER) + 2))
    for step in STEPS:
        print(row(step, range(asked.first, asked.first + asked.archives)), flush=True)
    clean(range(asked.first + asked.archives, asked.first + asked.archives + asked.clean), print)

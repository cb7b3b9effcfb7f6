"""Archives of visits drawn by chance, for bench_plates.py and its tests: what every trial says of every plate, with a
truth that is known. Only records and the step from steps to places are taken from the room that judges.

Sizes are those measured on real walks (docs/benchmarks/plates.md): errors of steps have heavy tails (Student, 5 degrees
of freedom) and one step in twenty is plainly wrong; a person's feet have habits of their own, mirrored from left to
right; the declared mass of a visit is wrong; plates are zeroed a little otherwise every day.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date, timedelta

import numpy as np

from biodance.diagnosis.archive.quantities import PlateEvidence, PlateVisit
from biodance.diagnosis.archive.walking import StepRow, placed

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

"""Take one effect out of the family: how often is an innocent named when the culprit is not among the candidates.

    BIODANCE_FOREIGN_LAB=folder PYTHONPATH=tests python benchmarks/bench_removed.py --run NAME [--only own foreign]
        [--match TEXT] [--whole] [--first SEED]

One clear fault a session: the causes of tests/test_hidden_causes.py in the own laboratory (three trials), and their
likes in an independent one (four trials, real rooms: ``--noise 0.6 --camera 0.3``). Each session is diagnosed without
the culprit's effect and with the whole family (``--whole``: only that). Answers are kept per ``--run``
(`hidden_sessions.CACHE`), so that a run that was stopped goes on; the table in docs/benchmarks/diagnosis.md is printed
from all of them.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np
from hidden_faults import hidden
from hidden_sessions import CACHE
from honesty_sessions import PEOPLE, ROOM
from kept_files import kept
from test_hidden_causes import CAUSES

from biodance.diagnosis.diagnosis import Finding
from biodance.effects import causes
from biodance.lab.session.read import read_session
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine
from biodance.records import CHANNELS
from biodance.virtual_lab.faults.causes import parse_cause

UNKNOWN = "unknown"
"""Effect of a cause of the foreign laboratory that no file here describes."""
FOREIGN = (
    ("plate_position", "plate_position", "0.03", "x"), ("plate_rotation", "plate_rotation", "5", "z"),
    ("time_delay", "time_delay", "0.02", ""), ("plate_gain", "plate_gain", "0.05", "Fz"),
    ("added_mass", "added_mass", "2.4", "l_farm"), ("plate_offset", "plate_offset", "25", "Fz"),
    ("plate_crosstalk", "plate_crosstalk", "0.025", "Fx"), ("body_mass", "body_mass", "0.08", ""),
    ("lab_tilt", "lab_tilt", "3", "x"), ("plate_drift", "plate_drift", "15", "Mx"),
    ("external_contact", "external_contact", "30", "R"), ("body_weight_support", "body_weight_support", "", ""),
    ("clock_drift", "clock_drift", "0.03", ""), ("sloshing_load", "sloshing_load", "", ""),
    ("head_joint", "head_joint", "15", ""), ("marker_misplaced", "marker_misplaced", "0.12", "RKNE:x"),
    (UNKNOWN, "plate_hysteresis", "", ""), ("wobbling_mass", "wobbling_mass", "", ""),
    ("filter_mismatch", "force_filter", "3", ""), ("trunk_joint", "trunk_joint", "10", ""),
    ("joint_centre", "joint_centre", "0.06", "hipR:x"), ("segment_length", "segment_length", "0.1", "kneeL"),
    ("marker_misplaced", "marker_moved", "0.06", "RKNE:x"), ("labels_swapped", "marker_swap", "", ""),
    ("clipping", "clipping", "", ""), (UNKNOWN, "creep", "", ""),
)  # fmt: skip
"""Effect here, cause of the foreign laboratory, its size ("" its own) and target."""
_JUDGED = 40 / 65
"""Share of a foreign session over which something drifts that is judged: four dances of it, without static and squats.
"""
SAME = {
    "joint_centre": {"segment_length"}, "segment_length": {"joint_centre"}, "plate_drift": {"plate_offset"},
    "clock_drift": {"time_delay"},
}  # fmt: skip
"""Other names of the same thing: a bone of another length is a joint elsewhere; a drift from zero on is a drift about
its middle and an offset. The foreign clock drifts about the middle of a session of which only the dances are judged:
their mean delay is -7 ms."""
_DRAWN = {
    "plate_position": ("position_error_m", 0.0), "plate_rotation": ("rotation_error_rad", 0.0),
    "time_delay": ("force_late_s", 0.0), "plate_gain": ("gain", 1.0), "plate_offset": ("offset", 0.0),
    "plate_crosstalk": ("crosstalk", 0.0), "lab_tilt": ("gravity_tilt_rad", 0.0),
}  # fmt: skip
"""What the independent laboratory's own truth says of an instrument in all, and what it says of a perfect one."""
WRONG_FROM_THE_START = ("marker_misplaced", "marker_misplaced")
"""Effect and cause of the foreign laboratory of a marker that is wrong in the static trial, too: the joint that it
places lies elsewhere then, and that is what can be found."""


@dataclass(frozen=True)
class Answer:
    """What one session was told: ``named`` and ``resembled`` effects with their targets, ``z`` of what is left,
    ``size`` of the culprit where it is named, and its standard deviation.
    """

    column: str
    effect: str
    hidden: str
    without: bool
    verdict: str
    named: tuple[str, ...]
    resembled: tuple[str, ...]
    z: float
    size: tuple[float, float] | None = None

    @property
    def innocents(self) -> tuple[str, ...]:
        """Named causes that are not the culprit."""
        guilty = {self.effect, *self.likes}
        return tuple(name for name in self.named if name.split()[0] not in guilty)

    @property
    def likes(self) -> set[str]:
        """Other names of the culprit's effect."""
        own = SAME.get(self.effect, set())
        return own | {"joint_centre"} if (self.effect, self.hidden.split()[0]) == WRONG_FROM_THE_START else own

    @property
    def found(self) -> bool:
        """Whether the culprit is named."""
        return any(name.split()[0] in {self.effect, *self.likes} for name in self.named)


def own(text: str, folder: Path) -> SessionResult:
    """Return a session of the own laboratory."""
    return examine(read_session(hidden(folder / "s", text)))


def foreign(index: int, first: int = 601) -> SessionResult:
    """Return a session of the independent laboratory, of a person of its own from seed ``first`` on."""
    return examine(read_session(written(index, first)))


def written(index: int, first: int) -> Path:
    """Return the folder of a session of the independent laboratory, written once."""
    folder = CACHE / "removed_sessions" / f"{first + index}"
    told = folder.with_suffix(".truth.json")
    if (folder / "session.toml").is_file() and told.is_file():
        return folder
    _, cause, size, target = FOREIGN[index]
    sex, height, mass = PEOPLE[_person(index, first)]
    given = {"--sex": sex, "--height": height, "--mass": mass, "--cause": cause, "--size": size, "--target": target}
    asked = [str(text) for pair in given.items() if pair[1] for text in pair]
    script = Path(os.environ["BIODANCE_FOREIGN_LAB"]) / "foreign_lab.py"
    command = [sys.executable, str(script), "--seed", str(first + index), *ROOM, *asked, "--trials", "4"]
    with tempfile.TemporaryDirectory() as there:
        subprocess.run([*command, "--out", f"{there}/s"], check=True, stdout=subprocess.DEVNULL)
        for squat in Path(there, "s").glob("squat*"):
            squat.unlink()
        shutil.rmtree(folder, ignore_errors=True)
        folder.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(f"{there}/s", folder)
        shutil.move(f"{there}/s.truth.json", told)
    return folder


def _person(index: int, first: int) -> int:
    """Return the index of the person in whom a cause is hidden."""
    return (index + (first - 601) // 100) % 4


def kept_session(key: str, session: Callable[[Path], SessionResult]) -> SessionResult:
    """Return an examined session, made once."""

    def made() -> SessionResult:
        with tempfile.TemporaryDirectory() as folder, patch("biodance.pipeline.session.can_identify", lambda _: False):
            return session(Path(folder))

    return kept(CACHE / "removed" / f"{re.sub('[^A-Za-z0-9.=-]', '_', key)}.pickle", made)


def size_of(one: Finding) -> tuple[float, float]:
    """Return the size of a finding, all parameters of the unit of the first as a vector, and its standard deviation."""
    same = [p for p in one.parameters if p.unit == one.parameters[0].unit]
    value, sd = np.array([p.value for p in same]), np.array([p.sd for p in same])
    length = float(np.linalg.norm(value))
    return length, float(np.linalg.norm(value * sd) / max(length, 1e-12))


def truth(one: Answer) -> float:
    """Return the size that was hidden, as `size_of` gives it; NaN where the two laboratories say it otherwise."""
    if one.column == "own":
        return float(np.linalg.norm(next(iter(parse_cause(one.hidden).values.values()))))
    hidden, _, first = one.hidden.partition(" of ")
    index = next(k for k, row in enumerate(FOREIGN) if " ".join(filter(None, row[1:])) == hidden)
    effect, _, size, _ = FOREIGN[index]
    mass = PEOPLE[_person(index, int(first or 601))][2]
    units = {"body_mass": mass, "plate_rotation": np.pi / 180, "lab_tilt": np.pi / 180, "plate_drift": _JUDGED}
    alike = effect not in {"head_joint", "trunk_joint", "filter_mismatch", "clock_drift", "external_contact"}
    return float(size) * units.get(effect, 1.0) if size and alike else float("nan")


def there(one: Answer) -> float:
    """Return the size that is there, as `size_of` gives it: what was hidden, and what the independent laboratory drew
    of its own in the same channel, axis or clock, which nobody can tell from it; as `truth` where it draws none.
    """
    hidden, _, first = one.hidden.partition(" of ")
    if one.column == "own" or one.effect not in _DRAWN:
        return truth(one)
    index = next(k for k, row in enumerate(FOREIGN) if " ".join(filter(None, row[1:])) == hidden)
    name, nothing = _DRAWN[one.effect]
    folder = written(index, int(first or 601))
    drawn = json.loads(folder.with_suffix(".truth.json").read_text())["plate"][name]
    places = ("xyz", CHANNELS)[FOREIGN[index][3] in CHANNELS]
    own = drawn if isinstance(drawn, float) else drawn[places.index(FOREIGN[index][3])]
    return abs(own - nothing)


def answered(column: str, effect: str, said: str, result: SessionResult, *, without: bool) -> Answer:
    """Diagnose a session and say what it was told."""
    chosen = tuple(name for name in causes() if name != effect) if without else None
    one = diagnose_session(result, effects=chosen).diagnosis
    named, like = (tuple(f"{f.effect} {f.target}".strip() for f in some) for some in (one.findings, one.resembles))
    mine = next((f for f in one.findings if f.effect in {effect, *SAME.get(effect, ())} and f.parameters), None)
    return Answer(column, effect, said, without, one.verdict, named, like, one.worst, mine and size_of(mine))


def jobs(first: int = 601) -> list[tuple[str, str, str, Callable[[Path], SessionResult]]]:
    """Return column, effect, what is hidden and how to get the session."""
    mine = [("own", text.partition(":")[0], text, lambda f, t=text: own(t, f)) for text in CAUSES]
    others = "" if first == 601 else f" of {first}"
    theirs = [
        ("foreign", row[0], " ".join(filter(None, row[1:])) + others, lambda _, k=k: foreign(k, first))
        for k, row in enumerate(FOREIGN)
    ]
    return [*mine, *theirs]


def table(found: list[Answer]) -> None:
    """Print the sums, and every session in which an innocent was named without the culprit."""
    for column in ("own", "foreign"):
        for without in (True, False):
            some = [one for one in found if (one.column, one.without) == (column, without)]
            blamed = [one for one in some if one.innocents]
            culprits = [one for one in some if one.effect != UNKNOWN]
            print(f"{column}, {'without' if without else 'with'} the culprit's effect: {len(some)} sessions, innocents "
                  f"in {len(blamed)}, culprit named in {sum(one.found for one in culprits)} of {len(culprits)}, "
                  f"{dict(Counter(one.verdict for one in some))}")  # fmt: skip
            for one in blamed:
                print(f"- {one.hidden}: {one.verdict} [{', '.join(one.named)}]")


def per_cause(found: list[Answer], column: str) -> None:
    """Print what the whole family says of every cause of one column: named, sized, and with whom."""
    print("| cause | verdict | named | size, found | resembled | without its effect |", "|" + "---|" * 6, sep="\n")
    without = {one.hidden: one for one in found if one.without and one.column == column}
    for one in (one for one in found if not one.without and one.column == column):
        size = f"{truth(one):.3g}: {one.size[0]:.3g} ± {one.size[1]:.2g}" if one.size else ""
        other = without.get(one.hidden, one)
        print("", one.hidden, one.verdict, ", ".join(one.named), size, ", ".join(one.resembled),
              f"{other.verdict} {', '.join(other.named)}".strip(), "", sep=" | ")  # fmt: skip
    sized = [one for one in found if not one.without and one.column == column and one.size and truth(one) == truth(one)]
    for size, said in ((truth, "what was written"), (there, "what is there, the laboratory's own errors included")):
        inside = sum(abs(one.size[0] - size(one)) <= 1.96 * one.size[1] for one in sized)
        print(f"intervals that cover {said}: {inside} of {len(sized)}")


def main() -> None:
    """Run what is not there yet and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", required=True)
    parser.add_argument("--only", nargs="+", default=["own", "foreign"])
    parser.add_argument("--match", default="")
    parser.add_argument("--first", type=int, default=601, help="seed of the first foreign person")
    parser.add_argument("--whole", action="store_true")
    parser.add_argument("--write", action="store_true", help="only write the foreign sessions")
    asked = parser.parse_args()
    if asked.write:
        print(*(written(index, asked.first) for index in range(len(FOREIGN))), sep="\n")
        return
    kept, found = CACHE / f"removed-{asked.run}.jsonl", []
    kept.parent.mkdir(parents=True, exist_ok=True)
    if kept.is_file():
        found = [Answer(**json.loads(line)) for line in kept.read_text().splitlines()]
    known = {(one.column, one.hidden) for one in found}
    for column, effect, said, session in jobs(asked.first):
        if column not in asked.only or asked.match not in said or (column, said) in known:
            continue
        result = kept_session(f"{column}-{said}", session)
        ways = (False,) if asked.whole else (True, False)
        both = [answered(column, effect, said, result, without=without) for without in ways]
        with kept.open("a") as stream:
            stream.writelines(json.dumps(asdict(one)) + "\n" for one in both)
        found += both
        print(*both, sep="\n", flush=True)
    table(found)
    for column in asked.only:
        per_cause(found, column)


if __name__ == "__main__":
    main()

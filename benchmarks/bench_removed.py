"""Take one effect out of the family: how often is an innocent named when the culprit is not among the candidates.

    BIODANCE_FOREIGN_LAB=folder python benchmarks/bench_removed.py --run NAME [--only own foreign] [--part 1/2]
        [--minutes 20] [--out docs/benchmarks/diagnosis.md]

One clear fault a session, one for every effect of the family that has a size, in the own laboratory and in an
independent one (real rooms: ``--noise 0.6 --camera 0.3``). Each session is diagnosed twice, with the whole family and
without the culprit's effect. Sessions are tracked once and kept (`hidden_sessions.CACHE`), answers are kept per
``--run``: a run that was stopped goes on. ``--out`` writes the table into that page, between two marks.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from bench_honesty import PEOPLE, ROOM, _kept
from hidden_causes import Cause, person
from hidden_sessions import CACHE, Scenario, examined

from biodance.diagnosis.diagnosis import Finding
from biodance.effects import causes
from biodance.errors import BiodanceError
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.results import SessionResult

START, END = "<!-- removed: begin -->", "<!-- removed: end -->"
OWN = (
    "plate_position:target=plate1:x,shift=0.02", "plate_rotation:target=plate1:z,angle=0.0698132",
    "plate_gain:target=Fz,gain=0.04", "plate_offset:target=Fz,offset=20", "time_delay:delay=0.02",
    "added_mass:target=left_forearm_hand,mass=2.4", "plate_drift:target=Mx,drift=6",
    "plate_crosstalk:target=Fz->Fx,ratio=0.015", "lab_tilt:target=x,angle=0.03", "body_mass:error=5",
    "clock_drift:stretch=0.02", "external_contact:target=right_forearm_hand,force=10",
    "body_weight_support:target=pelvis,force=15,stiffness=15", "sloshing_load:target=trunk_head,mass=4,sloshing=3",
    "plate_hysteresis:target=Fz,width=3", "wobbling_mass:target=trunk_head,mass=6", "head_joint:angle=0.228",
    "marker_misplaced:target=RKNE,shift=0.06;0;0", "joint_centre:target=right_shoulder,shift=0;0;0.054",
    "filter_mismatch:cutoff=4",
)  # fmt: skip
FOREIGN = (
    ("plate_position", "plate_position", 0.02, "x"), ("plate_rotation", "plate_rotation", 4, "z"),
    ("plate_gain", "plate_gain", 0.04, "Fz"), ("plate_offset", "plate_offset", 20, "Fz"),
    ("time_delay", "time_delay", 0.02, ""), ("added_mass", "added_mass", 2.4, "l_farm"),
    ("plate_drift", "plate_drift", 10, "Mx"), ("plate_crosstalk", "plate_crosstalk", 0.015, "Fx"),
    ("lab_tilt", "lab_tilt", 1.5, "x"), ("body_mass", "body_mass", 0.06, ""),
    ("clock_drift", "clock_drift", 0.02, ""), ("external_contact", "external_contact", 20, "R"),
    ("body_weight_support", "body_weight_support", None, ""), ("sloshing_load", "sloshing_load", None, ""),
    ("plate_hysteresis", "plate_hysteresis", None, ""), ("wobbling_mass", "wobbling_mass", None, ""),
    ("head_joint", "head_joint", 15, ""), ("marker_misplaced", "marker_misplaced", 0.06, "RKNE:x"),
    ("joint_centre", "joint_centre", 0.05, "shoR:z"), ("filter_mismatch", "force_filter", 4, ""),
)  # fmt: skip
"""Effect here, cause of the foreign laboratory, its size and target."""
SAME = {name: {name} for name in causes()} | {
    "joint_centre": {"joint_centre", "segment_length"},
    "segment_length": {"joint_centre", "segment_length"},
}
"""Names that are the truth of a cause: a bone of another length is a joint elsewhere."""


@dataclass(frozen=True)
class Answer:
    """What one session was told: ``column`` own or foreign, the ``hidden`` cause and its ``effect``, ``without`` it or
    not; ``named`` and ``resembled`` causes, with their own gains, ``z`` of what is left.
    """

    column: str
    effect: str
    hidden: str
    without: bool
    verdict: str
    named: tuple[str, ...]
    resembled: tuple[str, ...]
    z: float
    headline: str
    seconds: float

    @property
    def innocents(self) -> tuple[str, ...]:
        """Named causes that are not the culprit."""
        return tuple(name for name in self.named if name.split()[0] not in SAME[self.effect])


def own_session(text: str) -> SessionResult:
    """Return a session of the own laboratory with one fault, tracked once."""
    return examined(Scenario("issue", **person(0), hidden=(text,), level="above"))


def foreign_session(index: int) -> SessionResult:
    """Return a session of the foreign laboratory with one fault, tracked once."""
    _, cause, size, target = FOREIGN[index]

    def written() -> Path:
        folder = CACHE / "foreign" / f"removed-{cause}"
        if not folder.is_dir():
            folder.parent.mkdir(parents=True, exist_ok=True)
            sex, height, mass = PEOPLE[index % len(PEOPLE)]
            who = ["--seed", str(501 + index), "--sex", sex, "--height", str(height), "--mass", str(mass)]
            given = (("--cause", cause), ("--size", size), ("--target", target))
            what = [text for name, value in given if value for text in (name, str(value))]
            script = Path(os.environ["BIODANCE_FOREIGN_LAB"]) / "foreign_lab.py"
            subprocess.run([sys.executable, str(script), *who, *ROOM, *what, "--out", str(folder)], check=True)
        return folder

    return _kept(f"removed-{cause}", written)


def answered(column: str, effect: str, hidden: str, result: SessionResult, *, without: bool) -> Answer:
    """Diagnose a session, with the whole family or without the culprit, and say what it was told."""
    start = time.process_time()
    chosen = tuple(name for name in causes() if name != effect) if without else None
    try:
        one = diagnose_session(result, effects=chosen).diagnosis
        if "KEEP" in os.environ:
            import pickle
            from dataclasses import replace

            pickle.dump(
                replace(one, witnesses=None), open(f"{os.environ['KEEP']}/{column}-{effect}-{without}.pkl", "wb")
            )
    except BiodanceError as error:
        return Answer(column, effect, hidden, without, "refused", (), (), 0.0, str(error), 0.0)
    head = next((said.text for said in one.attention if said.about == "diagnosis"), one.told)
    named, resembled = (tuple(_said(f) for f in some) for some in (one.findings, one.resembles))
    seconds = time.process_time() - start
    return Answer(column, effect, hidden, without, one.verdict, named, resembled, one.worst, head, seconds)


def _said(one: Finding) -> str:
    gain = f" ({100 * one.gain.ci95[0]:.0f} to {100 * one.gain.ci95[1]:.0f} %)" if one.gain else ""
    return f"{one.effect} {one.target}".strip() + gain


def jobs(columns: list[str]) -> list[tuple[str, str, str, object]]:
    """Return column, effect, what is hidden and how to get the session, own and foreign in turns."""
    mine = [("own", Cause(t, 0.0).name[0], t, lambda t=t: own_session(t)) for t in OWN]
    theirs = [
        ("foreign", effect, " ".join(map(str, rest)), lambda k=k: foreign_session(k))
        for k, (effect, *rest) in enumerate(FOREIGN)
    ]
    return [one for pair in zip(mine, theirs, strict=True) for one in pair if one[0] in columns]


def main() -> None:
    """Run what time allows and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", required=True)
    parser.add_argument("--only", nargs="+", default=["own", "foreign"])
    parser.add_argument("--part", default="1/1")
    parser.add_argument("--minutes", type=float, default=1e9)
    parser.add_argument("--whole", action="store_true", help="with the culprit among the candidates, too")
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    start, (part, parts) = time.monotonic(), map(int, asked.part.split("/"))
    folder = CACHE / "removed" / asked.run
    folder.mkdir(parents=True, exist_ok=True)
    found = []
    for k, (column, effect, hidden, session) in enumerate(jobs(asked.only)):
        for without in (True, False) if asked.whole else (True,):
            path = folder / f"{column}-{effect}-{'without' if without else 'whole'}.json"
            if not path.is_file() and k % parts == part - 1 and time.monotonic() - start < 60 * asked.minutes:
                one = answered(column, effect, hidden, session(), without=without)  # type: ignore[operator]
                path.write_text(json.dumps(asdict(one)))
                print(f"{time.monotonic() - start:5.0f} s {asdict(one)}", flush=True)
            if path.is_file():
                found.append(Answer(**json.loads(path.read_text())))


if __name__ == "__main__":
    main()

"""Walk and run people of the virtual laboratory on belts, with nothing wrong and with faults in the bytes of the files.

    python benchmarks/bench_belts.py [--seeds 0 1 2 3] [--whole] [--out FILE.md]

Clean sessions are asked what witnesses name and, with ``--whole``, what the whole diagnosis says; then 20 mm across,
5 % of Fz and 30 ms are written into copies, as `bench_walks` does with real recordings.
"""

import argparse
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from bench_walks import Fault, Score, copied, faults_for, judged, named

from biodance.diagnosis.witness_evidence import collect_evidence
from biodance.lab.session.read import read_session
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.session import examine
from biodance.records import Subject
from biodance.virtual_lab.simulate import simulate_session

PEOPLE = (Subject(70.0, 1.75, "M"), Subject(60.0, 1.65, "F"), Subject(82.0, 1.83, "M"), Subject(52.0, 1.58, "F"))
PROTOCOLS = ("treadmill", "run")
ASKED = ("20 mm across", "30 ms late", "Fz 5 %")
OUT = Path(__file__).resolve().parent / "measured" / "belts.md"


def scored(protocol: str, seed: int, place: Path, *, whole: bool) -> Iterator[Score]:
    """Return the scores of one person: clean first (with the verdict), then each fault."""
    source = simulate_session(PEOPLE[seed % len(PEOPLE)], protocol, place / f"{protocol}{seed}", seed=seed)
    clean, files = read_session(source), sorted(source.glob("*.c3d"))
    nothing = judged(source.name, Fault("nothing", "", ()), named(clean, collect_evidence(clean)))
    if whole:
        found = diagnose_session(examine(clean)).diagnosis
        told = "; ".join(f"{one.effect} {one.target}".strip() for one in found.findings)
        print(f"{source.name} | whole diagnosis | {found.verdict} {told}", flush=True)
    yield nothing
    for number, fault in enumerate(one for one in faults_for(clean) if one.kind in ASKED):
        folder = copied(files, place / f"{source.name} {number}", fault.text)
        shutil.copy(source / "session.toml", folder)
        session = read_session(folder)
        yield judged(source.name, fault, named(session, collect_evidence(session)))


def main() -> None:
    """Print what was named in each session, and the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="*", default=[0, 1, 2, 3])
    parser.add_argument("--protocols", nargs="*", default=PROTOCOLS)
    parser.add_argument("--whole", action="store_true")
    parser.add_argument("--out", type=Path, default=OUT)
    chosen = parser.parse_args()
    lines = ["| session | written | named | what |", "|---|---|---|---|"]
    with tempfile.TemporaryDirectory() as place:
        for protocol in chosen.protocols:
            for seed in chosen.seeds:
                for one in scored(protocol, seed, Path(place), whole=chosen.whole):
                    mark = "first" if one.first else "in the set" if one.listed else "no"
                    mark = mark if one.fault.text else "false" if one.told else "nothing"
                    lines.append(f"| {one.session} | {one.fault.kind} | {mark} | {one.told} |")
                    print(lines[-1], flush=True)
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

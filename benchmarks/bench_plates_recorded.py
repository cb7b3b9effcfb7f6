"""Archives of recordings, real and foreign, with a fault written into the files of the later visits: what is found.

    BIODANCE_DATA=folder python benchmarks/bench_plates_recorded.py [--foreign FOLDER]

The seven children of ``biomechzoo`` are visits of one laboratory (order: their names). ``--foreign`` is a folder with
sessions of the independent laboratory, each drawn with a plate of its own: of these the static trials are used.
"""

import argparse
import os
import shutil
import tempfile
from pathlib import Path

from inject import inject

from biodance.lab.c3d.raw import read_raw
from biodance.lab.plates.parameters import count_plates
from biodance.pipeline.plates import judge_plates
from biodance.virtual_lab.faults.causes import fault_of, parse_cause

REAL = (
    "", "plate_position:target=plate2:x,shift=0.015", "plate_position:target=plate2:y,shift=0.015",
    "plate_offset:target=plate1:Fx,offset=5", "plate_offset:target=plate1:Fz,offset=5",
    "plate_gain:target=plate1:Fz,gain=0.03", "time_delay:delay=0.02",
)  # fmt: skip
FOREIGN = ("", "plate_offset:target=plate1:Fz,offset=5", "plate_offset:target=plate1:Fx,offset=8")


def copied(sessions: list[Path], place: Path, text: str, *, first: int, pattern: str) -> Path:
    """Write copies of sessions, from number ``first`` on with the fault that ``text`` says; "" for none."""
    for number, session in enumerate(sessions):
        folder = place / session.name
        folder.mkdir(parents=True)
        if (session / "session.toml").is_file():
            shutil.copy(session / "session.toml", folder)
        for path in sorted(session.glob(pattern)):
            if text and number >= first and count_plates(read_raw(path))[0]:
                inject(path, folder / path.name, fault_of(parse_cause(text), {path.stem: (0.0, 1.0)}))
            else:
                shutil.copy(path, folder / path.name)
    return place


def row(kind: str, sessions: list[Path], text: str, *, first: int, pattern: str) -> str:
    """Return one line of the table."""
    with tempfile.TemporaryDirectory() as place:
        found = judge_plates(copied(sessions, Path(place), text, first=first, pattern=pattern)).judgement
    every = [(card.plate, one) for card in found.plates for one in card.findings]
    told = "<br>".join(f"{plate} {one.effect} {one.target}: {one.text}" for plate, one in every)
    written = f"{text} from {sessions[first].name} on" if text else "nothing"
    return f"| {kind}, {len(found.visits)} visits | {written} | {told or 'nothing wrong'} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--foreign", type=Path)
    chosen = parser.parse_args()
    print("| archive | written into the later visits | found |\n|---|---|---|")
    if data := os.environ.get("BIODANCE_DATA"):
        sessions = sorted(path for path in (Path(data) / "biomechzoo").iterdir() if path.is_dir())
        for text in REAL:
            print(row("real", sessions, text, first=3, pattern="*.c3d"), flush=True)
    if chosen.foreign:
        sessions = sorted(path for path in chosen.foreign.iterdir() if (path / "static.c3d").is_file())
        for text in FOREIGN:
            print(row("foreign", sessions, text, first=len(sessions) // 2, pattern="static.c3d"), flush=True)


if __name__ == "__main__":
    main()

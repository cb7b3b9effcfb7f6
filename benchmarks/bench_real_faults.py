"""Write instrument faults into copies of real recordings, diagnose, and print a table of what was named.

    BIODANCE_DATA=folder python benchmarks/bench_real_faults.py [--out FILE.md]

The table is kept where bench_diagnosis.py finds it for its page. The folder holds sessions of plug-in-gait
(``biomechzoo/HC030A``: static trial and walk) and ``adl_gait``. The fault is in every file of the copy, as in a
laboratory. HC030A has the labels LWRA and LWRB exchanged in both files, which the check of labels says; it is left out
here.
"""

import argparse
import os
import shutil
import tempfile
from pathlib import Path

from hidden_sessions import REAL
from inject import inject

from biodance.diagnosis.diagnosis import Diagnosis, Finding
from biodance.effects import discrete_effects, effects, unit_of
from biodance.errors import BiodanceError
from biodance.lab.c3d.raw import read_raw
from biodance.lab.plates.parameters import count_plates
from biodance.lab.session.read import read_session
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.session import examine
from biodance.virtual_lab.faults.causes import fault_of, parse_cause

SESSIONS = ("biomechzoo/HC030A", "biomechzoo/HC032A", "adl_gait")
FAULTS = (
    "", "plate_gain:target=plate1:Fz,gain=0.08", "plate_offset:target=plate1:Fz,offset=30",
    "plate_offset:target=plate1:Fx,offset=30",
    "plate_position:target=plate1:x,shift=0.02", "plate_position:target=plate1:y,shift=0.02", "time_delay:delay=0.03",
)  # fmt: skip


def copied(source: Path, folder: Path, text: str) -> Path:
    """Write a copy of a session with the fault that ``text`` says in every file; "" for none."""
    folder.mkdir(parents=True)
    files = sorted(source.glob("*.c3d"))
    for number, path in enumerate(files):
        clock = {path.stem: (number / len(files), (number + 1) / len(files))}
        if text and count_plates(read_raw(path))[0]:
            inject(path, folder / path.name, fault_of(parse_cause(text), clock))
        else:
            shutil.copy(path, folder / path.name)
    return folder


def diagnosed(folder: Path) -> Diagnosis | str:
    """Return the diagnosis of a session, or why there is none."""
    names = tuple(name for name in (*effects(), *discrete_effects()) if name != "labels_swapped")
    try:
        return diagnose_session(examine(read_session(folder)), effects=names).diagnosis
    except BiodanceError as error:
        return str(error)


def row(session: str, text: str, found: Diagnosis | str) -> str:
    """Return one line of the table: what was written, what was found, and the place of the truth among the causes."""
    if isinstance(found, str):
        return f"| {session} | {text or 'nothing'} | refused: {found} | | |"
    true = (
        tuple(text.partition(",")[0].partition(":target=")[::2]) if ":target=" in text else (text.partition(":")[0], "")
    )
    sets = [[(alias.effect, alias.target) for alias in finding.set] for finding in found.findings]
    place = "-"
    for number, names in enumerate(sets, start=1):
        if true in names:
            place = f"{names.index(true) + 1} of {len(names)} in finding {number}"
    own = [one for one in found.limits if text and (one.effect, one.target) == true]
    limit = f"{own[0].limit:.3g} {_unit(own[0].unit, own[0].target)}" if own else ""
    named = "; ".join(f"{one.effect} {one.target} {_sizes(one)}" for one in found.findings)
    return (
        f"| {session} | {text or 'nothing'} | {found.verdict}{': ' + named if named else ''} | "
        f"{place if text else ''} | {limit} |"
    )


def _sizes(one: Finding) -> str:
    return ", ".join(f"{p.name} {p.value:.3g} ± {p.sd:.2g} {_unit(p.unit, one.target)}" for p in one.parameters)


def _unit(unit: str, target: str) -> str:
    """Return the unit of a channel's offset, and any other as it is; "" for a ratio."""
    return unit_of(target) if unit == "N or N·m" else unit.removesuffix("1")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=REAL)
    chosen = parser.parse_args()
    data = os.environ.get("BIODANCE_DATA")
    if not data:
        parser.error("BIODANCE_DATA does not name the folder with real recordings.")
    lines = [
        "| recording | written into the copy | verdict and names | place of the truth | computed limit |",
        "|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as place:
        for session in SESSIONS:
            for number, text in enumerate(FAULTS):
                folder = copied(Path(data) / session, Path(place) / session.replace("/", "_") / str(number), text)
                lines.append(row(session, text, diagnosed(folder)))
                print(lines[-1], flush=True)
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()

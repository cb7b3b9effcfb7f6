"""OpenSim's table of forces: plates without markers."""

import math
import re
from pathlib import Path

from biodance.lab.opensim.mot import read_mot
from biodance.lab.opensim.plate_columns import plates_of
from biodance.lab.plain_text import read_bytes, sha256
from biodance.lab.readers import head_text
from biodance.records import Plate, Role, Source, Trial

NAME = "table of OpenSim"
EXTENSIONS = (".mot", ".sto")
PREFERENCE = 20


def sniff(head: bytes) -> bool:
    """Return whether the head has the line "endheader"."""
    return bool(re.search(r"^\s*endheader\s*$", head_text(head), flags=re.MULTILINE | re.IGNORECASE))


def read(path: Path, *, role: Role, subject: str | None = None) -> Trial:
    """Return the trial of a table with plate columns: plates, no markers."""
    table = read_mot(path)
    plates, said, doubts = plates_of(table, where=str(path))
    source = Source(path, sha256(read_bytes(path)), "MOT", analog_rate=plates_rate(plates))
    return Trial(path.stem, role, None, plates, source, history=said, warnings=(*table.warnings, *doubts))


def plates_rate(plates: tuple[Plate, ...]) -> float:
    """Return the rate (Hz) of plates; NaN without one."""
    return plates[0].wrench.rate if plates else math.nan

"""AMTI text: one force plate as a bare table of numbers."""

import re
from pathlib import Path

from biodance.lab.readers import head_text
from biodance.records import Role, Trial

NAME = "AMTI text"
EXTENSIONS = (".asc", ".txt", ".csv")
PREFERENCE = 90
"""Asked last: any table of numbers looks like this format."""
_NUMBER = r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?"
_CELL = rf"(?:{_NUMBER}|nan)"
_ROW = re.compile(rf"\s*{_CELL}(?:[\s,;]+{_CELL}){{5,}}[\s,;]*", flags=re.IGNORECASE)


def sniff(head: bytes) -> bool:
    """Return whether the rows after the first (which may be labels) hold at least six numbers (or nan) each; of several
    one may be damaged, which is for `read` to say.
    """
    rows = [line for line in head_text(head).splitlines()[:4] if line.strip()]
    fit = [bool(_ROW.fullmatch(line)) for line in rows[1:] or rows]
    return any(fit) and sum(fit) >= len(fit) - (len(fit) > 2)


def read(path: Path, *, role: Role, subject: str | None = None) -> Trial:
    """Return the trial of a text export (`biodance.lab.amti.read`)."""
    from biodance.lab.amti.read import read_amti_ascii

    return read_amti_ascii(path, role=role)

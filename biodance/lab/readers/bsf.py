"""AMTI NetForce: force plates in a binary file."""

import struct
from pathlib import Path

from biodance.records import Role, Trial

NAME = "AMTI NetForce"
EXTENSIONS = (".bsf",)
PREFERENCE = 30
_VERSIONS = (100, 105)


def sniff(head: bytes) -> bool:
    """Return whether the head begins with a version of NetForce."""
    return len(head) >= 8 and struct.unpack("<i", head[:4])[0] in _VERSIONS


def read(path: Path, *, role: Role, subject: str | None = None) -> Trial:
    """Return the trial of a .bsf file (`biodance.lab.amti.read`)."""
    from biodance.lab.amti.read import read_bsf

    return read_bsf(path, role=role)

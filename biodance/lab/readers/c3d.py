"""C3D: markers, analog channels and force plates in one binary file."""

from pathlib import Path

from biodance.lab.plates.told import Told
from biodance.records import Role, Trial

NAME = "C3D"
EXTENSIONS = (".c3d",)
PREFERENCE = 0
FOLLOWS_TOLD = True
KEY = 0x50
"""Second byte of every C3D file."""


def sniff(head: bytes) -> bool:
    """Return whether the head names a parameter block (2..127) and has the key of C3D files."""
    return len(head) >= 2 and head[1] == KEY and 2 <= head[0] <= 127 and b"\x00" in head


def read(path: Path, *, role: Role, subject: str | None = None, told: Told | None = None) -> Trial:
    """Return the trial of a C3D file (`biodance.lab.c3d.read`)."""
    from biodance.lab.c3d.read import read_c3d

    return read_c3d(path, role=role, subject=subject, told=told)

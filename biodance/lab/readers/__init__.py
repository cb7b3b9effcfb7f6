"""FAMILY: one recording format per file, found automatically; other packages join by the entry points
``biodance.readers``.

A file is given to the reader whose ``sniff`` knows its head (of several to the one that also has its extension, else to
the preferred one); where none does, to the one that has its extension.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from biodance.discovery import Chosen, Family, missing_of
from biodance.lab.plain_text import decode
from biodance.records import Role, Trial


class Reader(Protocol):
    """One format of recordings: a module, a class or an object.

    A reader may also have ``beside(path)``: the path of a second file that it reads together with the first and that is
    then no recording of its own (forces beside markers), None without one. With ``FOLLOWS_TOLD = True`` its ``read``
    takes ``told`` (`biodance.lab.plates.corners.Told`), what the analyst says of the plates, which it must follow; to
    the plates of other readers corners, foot and use are applied afterwards.
    """

    NAME: str
    """As it is called in a sentence, for example "C3D"."""
    EXTENSIONS: tuple[str, ...]
    """Lower case with the dot, the usual one first."""
    PREFERENCE: int
    """Of one trial in several formats the file of the lowest number is read, and its reader is preferred (C3D 0,
    bare tables 90).
    """

    def sniff(self, head: bytes) -> bool:
        """Return whether a file that begins with these bytes (8192 at most) is of this format, beyond doubt."""

    def read(self, path: Path, *, role: Role, subject: str | None) -> Trial:
        """Return the trial: metres, z up, ground on subject about the lab origin, NaN where a marker was not seen.

        What is decided on the way stands in its ``history``, what a person should look at in its ``warnings``.
        FileRefused, with the remedy, for a file that cannot be trusted. ``subject`` chooses the person where a file can
        hold several.
        """


FAMILY: Family[Reader] = Family(
    "reader", "biodance.readers", __name__, "", missing_of(Reader), lambda reader: reader.NAME
)


def readers(chosen: Chosen[Reader] = None) -> tuple[Reader, ...]:
    """Return the readers in the order in which they are asked; ``chosen`` names choose, objects join."""
    return tuple(sorted(FAMILY.choose(chosen).values(), key=lambda reader: (reader.PREFERENCE, reader.NAME)))


def extensions(chosen: Chosen[Reader] = None) -> Mapping[str, Reader]:
    """Return the reader of every extension, those of the preferred formats first."""
    found: dict[str, Reader] = {}
    for reader in readers(chosen):
        for extension in reader.EXTENSIONS:
            found.setdefault(extension, reader)
    return found


def head_text(head: bytes) -> str:
    """Return the beginning of a file as text without leading blanks; "" where it is none."""
    try:
        return decode(head, Path()).lstrip()
    except ValueError:
        return ""

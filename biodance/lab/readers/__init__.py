"""FAMILY: one recording format per file, found automatically; other packages join by the entry points
``biodance.readers``. One door for every recording: a file is given to the reader whose ``sniff`` knows its head (of
several to the one that also has its extension, else to the preferred one); where none does, to the one that has its
extension.

Markers at (0, 0, 0) were not seen, whatever the format: no marker of a person lies on the origin to the last digit.
Nor were frames that carry the markers of the frame before to the last digit (`without_frozen`).
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from biodance.discovery import Chosen, Family, missing_of
from biodance.errors import BiodanceError, FileRefused
from biodance.lab.markers.sets import MarkerSet, wearing
from biodance.lab.markers.signals import unseen_at_origin, without_frozen
from biodance.lab.plain_text import decode, read_bytes
from biodance.lab.plates import Told
from biodance.lab.plates.read import as_told
from biodance.records import Role, Trial


class Reader(Protocol):
    """One format of recordings: a module, a class or an object.

    A reader may also have ``beside(path)``: the path of a second file that it reads together with the first and that is
    then no recording of its own (forces beside markers), None without one. With ``FOLLOWS_TOLD = True`` its ``read``
    takes ``told`` (`biodance.lab.plates.Told`), what the analyst says of the plates, which it must follow;
    to the plates of other readers corners, foot and use are applied afterwards.
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


_RAW = {".qtm": "Qualisys QTM", ".x1d": "Vicon Nexus", ".x2d": "Vicon Nexus", ".tak": "OptiTrack Motive"}
_RAW |= {".cap": "Cortex", ".anb": "Cortex", ".anc": "Cortex", ".cmz": "Visual3D", ".xlsx": "Excel", ".mat": "MATLAB"}
"""Files of programs that are not read, by extension."""
_SUBJECT_DATA = {".mp": "Vicon measurements", ".vsk": "Vicon skeleton", ".enf": "Vicon Eclipse notes"}


def reader_of(path: str | Path, *, chosen: Chosen[Reader] = None) -> Reader:
    """Return the reader of a file: the one that knows its head (`sniffed`); where none does, the one that has its
    extension.

    Raises
    ------
    FileRefused
        The file is missing, empty, no ordinary file, subject data instead of a recording, or of no known format; the
        message lists the legal formats.
    """
    path = Path(path)
    head = read_head(path)
    found = sniffed(path, head, chosen)
    if found:
        return found
    extension, legal, text = path.suffix.lower(), extensions(chosen), head_text(head)
    # what the head shows of subject data
    xml, first = "<KinematicModel" in text, text.splitlines()[0] if text else ""
    notes = ".enf" if re.match(r"\[[\w ]+\]\s*$", first) else ".mp" if re.match(r"\$\w+\s*=", text) else ""
    data = ".vsk" if xml else notes
    if data or extension in _SUBJECT_DATA:
        raise FileRefused(
            f"{path}: holds {_SUBJECT_DATA[data or extension]}, not a recording. Give the folder, then it is read with "
            f"the trials."
        )
    if extension in legal:
        return legal[extension]
    what = "its content is none of the formats that can be read"
    if extension in _RAW:
        what = f"is a file of {_RAW[extension]}'s own. Export the C3D file, or a table as CSV"
    raise FileRefused(f"{path}: {what}. Legal are {', '.join(legal)}.")


def read_head(path: Path) -> bytes:
    """Return the first `HEAD` bytes of a file.

    Raises
    ------
    FileRefused
        The file is missing, empty, cannot be opened, or is none: a folder, a pipe, a device.
    """
    if path.is_dir():
        raise FileRefused(f"{path}: is a folder, a file is expected. Point at one recording.")
    # Bytes of a file that are looked at to find its reader
    return read_bytes(path, most=8192)


def sniffed(path: Path, head: bytes, chosen: Chosen[Reader] = None) -> Reader | None:
    """Return the reader that knows the head of a file, of several the one that has its extension; None if none does."""
    known = [reader for reader in readers(chosen) if reader.sniff(head)]
    return next((reader for reader in known if path.suffix.lower() in reader.EXTENSIONS), known[0] if known else None)


def read_trial(
    path: str | Path,
    *,
    role: Role = "fit",
    subject: str | None = None,
    readers: Chosen[Reader] = None,
    markers: MarkerSet | None = None,
    told: Told | None = None,
) -> Trial:
    """Read the trial in a file of any format.

    The forces of a .trc file are looked for beside it, in a .mot or .sto file of the same stem (or stem_grf,
    stem_forces).

    Parameters
    ----------
    path : str or pathlib.Path
        One recording.
    role : {"fit", "static", "validate", "check", "skip"}
        What it is for.
    subject : str, optional
        Chooses the person in a C3D file that holds several.
    readers : iterable, optional
        Objects that read further formats (`biodance.lab.readers.Reader`), or names that limit the family to some.
    markers : MarkerSet, optional
        The set that was worn; by default the known set whose labels are there.
    told : Told, optional
        What the analyst says of the plates and of the body mass; it comes before what the file says.

    Returns
    -------
    Trial
        In m, N, N·m, z up; ``history`` and ``warnings`` say what was decided.

    Raises
    ------
    FileRefused
        The file cannot be read or cannot be trusted, or its format is unknown; the message lists the legal formats.

    See Also
    --------
    read_session : A whole folder, with the subject.

    Examples
    --------
    >>> biodance.read_trial("visit/squat_1.c3d").source.format
    'C3D'
    """
    path = Path(path)
    reader = reader_of(path, chosen=readers)
    try:
        if told is not None and getattr(reader, "FOLLOWS_TOLD", False):
            trial = reader.read(path, role=role, subject=subject, told=told)  # type: ignore[call-arg]
        else:
            trial = reader.read(path, role=role, subject=subject)
            trial = trial if told is None else as_told(trial, told)
        if trial.markers is not None:
            xyz, said = unseen_at_origin(trial.markers.xyz)
            trial = replace(trial, markers=replace(trial.markers, xyz=xyz), history=(*trial.history, *said))
        trial = without_frozen(trial)
        return wearing(trial, markers) if markers else trial
    except BiodanceError:
        raise
    except Exception as error:
        raise FileRefused(
            f"{path}: a reader failed on it ({type(error).__name__}: {error}). Please report this file; others are "
            f"not affected."
        ) from error

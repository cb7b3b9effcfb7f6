"""One door for every recording: look at the content, then at the extension, and hand the file to the reader of its format."""

import re
import struct
from dataclasses import replace
from pathlib import Path

from biodance.errors import BiodanceError, FileRefused
from biodance.lab.ground_forces import has_plates, plates_of
from biodance.lab.mot import Table, columns_of, read_mot
from biodance.lab.plain_text import decode, read_bytes, sha256
from biodance.lab.trc import read_trc
from biodance.records import Plate, Role, Source, Trial

FORMATS = {
    ".c3d": "C3D",
    ".trc": "markers of OpenSim",
    ".mot": "table of OpenSim",
    ".sto": "table of OpenSim",
    ".bsf": "AMTI NetForce",
    ".asc": "AMTI text",
    ".txt": "AMTI text",
    ".csv": "AMTI text",
}
SUBJECT_DATA = {".mp": "Vicon measurements", ".vsk": "Vicon skeleton", ".enf": "Vicon Eclipse notes"}
FORCES_BESIDE = ("", "_grf", "_GRF", "_forces", "_ground_forces")
HEAD = 8192
C3D_KEY, BSF_VERSIONS = 0x50, (100, 105)


def format_of(path: str | Path) -> str:
    """Return the format of a file as the extension it should have (``.c3d``, ``.trc``, ``.mot``, ``.bsf``, ``.asc``), from its content.

    Where the content says nothing, the extension of the name decides.

    Raises
    ------
    FileRefused
        The file is missing, empty, subject data instead of a recording, or of no known format; the message lists the legal formats.
    """
    path = Path(path)
    if path.is_dir():
        raise FileRefused(f"{path}: is a folder, a file is expected. Point at one recording.")
    head = read_bytes(path)[:HEAD]
    extension = path.suffix.lower()
    found = _binary_format(head) or _text_format(head, path)
    if found in SUBJECT_DATA or (not found and extension in SUBJECT_DATA):
        raise FileRefused(
            f"{path}: holds {SUBJECT_DATA[found or extension]}, not a recording. Give the folder, then it is read with the trials."
        )
    if found or extension in FORMATS:
        return found or extension
    raise FileRefused(f"{path}: its content is none of the formats that can be read. Legal are {', '.join(FORMATS)}.")


def read_trial(path: str | Path, *, role: Role = "fit", subject: str | None = None) -> Trial:
    """Read the trial in a file of any format.

    The forces of a .trc file are looked for beside it, in a .mot or .sto file of the same stem (or stem_grf, stem_forces).

    Parameters
    ----------
    path : str or pathlib.Path
        One recording.
    role : {"fit", "static", "validate", "check", "skip"}
        What it is for.
    subject : str, optional
        Chooses the person in a C3D file that holds several.

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
    kind = format_of(path)
    try:
        return _read(path, kind, role, subject)
    except BiodanceError:
        raise
    except (ArithmeticError, LookupError, TypeError, ValueError, MemoryError, struct.error) as error:
        raise FileRefused(
            f"{path}: a reader failed on it ({type(error).__name__}: {error}). Please report this file; others are not affected."
        ) from error


def _read(path: Path, kind: str, role: Role, subject: str | None) -> Trial:
    """Hand the file to the reader of its format."""
    if kind == ".c3d":
        from biodance.lab.c3d import read_c3d

        return read_c3d(path, role=role, subject=subject)
    if kind == ".trc":
        trial = read_trc(path, role=role)
        beside = forces_beside(path)
        return _with_forces(trial, beside) if beside else trial
    if kind in (".mot", ".sto"):
        return _forces_alone(path, role)
    from biodance.lab.amti import read_amti_ascii, read_bsf

    return read_bsf(path, role=role) if kind == ".bsf" else read_amti_ascii(path, role=role)


def forces_beside(trc: Path) -> Path | None:
    """Return the .mot or .sto file with plate columns that belongs to a .trc file (or should, but is damaged); None if there is none."""
    for candidate in (trc.with_name(f"{trc.stem}{ending}{suffix}") for ending in FORCES_BESIDE for suffix in (".mot", ".sto")):
        if candidate.is_file():
            try:
                if has_plates(columns_of(candidate)):
                    return candidate
            except FileRefused:
                return candidate
    return None


def _with_forces(trial: Trial, path: Path) -> Trial:
    """Return the trial of a .trc file with the plates of the table beside it; a damaged table is a warning, the markers stay."""
    try:
        table = read_mot(path)
        plates, said = plates_of(table, where=str(path))
    except FileRefused as error:
        return replace(trial, warnings=(*trial.warnings, f"The forces beside the markers were left out. {error}"))
    digest = sha256((trial.source.sha256 + sha256(read_bytes(path))).encode())
    return replace(
        trial,
        plates=plates,
        source=replace(trial.source, format="TRC + MOT", sha256=digest, analog_rate=_rate(plates)),
        history=(*trial.history, f"Forces were read from {path.name} beside it.", *said),
        warnings=(*trial.warnings, *table.warnings, *_out_of_step(trial, table)),
    )


def _forces_alone(path: Path, role: Role) -> Trial:
    """Return the trial of a table with plate columns: plates, no markers."""
    table = read_mot(path)
    plates, said = plates_of(table, where=str(path))
    source = Source(path, sha256(read_bytes(path)), "MOT", analog_rate=_rate(plates))
    return Trial(path.stem, role, None, plates, source, history=said, warnings=table.warnings)


def _rate(plates: tuple[Plate, ...]) -> float:
    return plates[0].wrench.rate if plates else float("nan")


def _out_of_step(trial: Trial, table: Table) -> list[str]:
    """Return a warning if markers and forces do not cover the same time."""
    assert trial.markers is not None  # a .trc file always holds markers
    time = trial.markers.time
    overlap = min(time[-1], table.time[-1]) - max(time[0], table.time[0])
    if overlap >= 0.9 * (time[-1] - time[0]):
        return []
    span = f"{time[0]:g} to {time[-1]:g} s, the forces {table.time[0]:g} to {table.time[-1]:g} s"
    return [f"The markers cover {span}: they may not belong together."]


def _binary_format(head: bytes) -> str:
    if len(head) >= 2 and head[1] == C3D_KEY and 2 <= head[0] <= 127 and b"\x00" in head:
        return ".c3d"
    if len(head) >= 8 and struct.unpack("<i", head[:4])[0] in BSF_VERSIONS:
        return ".bsf"
    return ""


def _text_format(head: bytes, path: Path) -> str:
    try:
        text = decode(head, path).lstrip()
    except FileRefused:
        return ""
    if text.startswith("PathFileType"):
        return ".trc"
    if re.search(r"^\s*endheader\s*$", text, flags=re.MULTILINE | re.IGNORECASE):
        return ".mot"
    if "<KinematicModel" in text:
        return ".vsk"
    if re.match(r"\[[\w ]+\]\s*$", text.splitlines()[0] if text else ""):
        return ".enf"
    if re.match(r"\$\w+\s*=", text):
        return ".mp"
    return ".asc" if _is_number_table(text) else ""


def _is_number_table(text: str) -> bool:
    """Return True if the rows after the first (which may be labels) hold at least six numbers each."""
    number = r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?"
    row = re.compile(rf"\s*{number}(?:[\s,;]+{number}){{5,}}[\s,;]*")
    rows = [line for line in text.splitlines()[:4] if line.strip()]
    return bool(rows) and all(row.fullmatch(line) for line in rows[1:] or rows)

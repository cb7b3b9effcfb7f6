"""A copy of a C3D file in which some points carry other names; every other byte stays."""

from collections.abc import Mapping
from pathlib import Path

from biodance.errors import FileRefused
from biodance.lab.c3d.parameters import read_header, text_rows
from biodance.lab.c3d.raw import split_label


def write_relabelled(source: Path, target: Path, names: Mapping[str, str]) -> Path:
    """Write ``source`` to ``target`` with the labels renamed as ``names`` say (without the subject's prefix, which
    stays); return the path.

    Raises
    ------
    FileRefused
        The source is no C3D file, or the target exists or cannot be written.
    """
    content = bytearray(source.read_bytes())
    header = read_header(bytes(content), str(source))
    for start, width in text_rows(bytes(content), header, str(source), group="POINT", name="LABELS"):
        row = content[start : start + width].decode("latin-1")
        prefix, name = split_label(row.split("\0")[0])
        new = names.get(name, name)
        if new != name:
            label = f"{prefix}:{new}" if prefix else new
            content[start : start + width] = label.encode("latin-1").ljust(width)[:width]
    if target.exists():
        raise FileRefused(f"{target}: is there already and nothing is overwritten. Give another folder.")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
    except OSError as error:
        raise FileRefused(f"{target}: cannot be written ({error.strerror or error}).") from error
    return target

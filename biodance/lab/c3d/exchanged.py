"""Copies of a C3D recording in which markers have each other's names, in the whole trial or in some frames."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.c3d.layout import Layout
from biodance.lab.c3d.parameters import read_header, text_rows
from biodance.lab.c3d.raw import open_c3d, point_labels, split_label
from biodance.lab.plain_text import write_whole


def write_exchanged(source: Path, target: Path, exchanged: Mapping[tuple[str, str], Sequence[tuple[int, int]]]) -> Path:
    """Write ``source`` to ``target`` with the two markers of each pair of labels ``exchanged`` in frames (start, stop),
    stop excluded; return the path. Every other byte is as in the recording.

    Where all frames are exchanged the labels change places (the subject's prefix stays), else the points do.

    Raises
    ------
    FileRefused
        The source is no C3D file or lacks a label, or the target exists or cannot be written.
    """
    content, parameters, layout, _ = open_c3d(source)
    columns = {split_label(label)[1]: column for column, label in enumerate(point_labels(parameters, layout))}
    changed, names = bytearray(content), dict[str, str]()
    for pair, spans in exchanged.items():
        if absent := [label for label in pair if label not in columns]:
            raise FileRefused(
                f"{source}: holds no point {absent[0]}, so it cannot be exchanged. Name one of its points."
            )
        if tuple(spans) == ((0, layout.frames),):
            names |= {pair[0]: pair[1], pair[1]: pair[0]}
        else:
            _exchange_points(changed, layout, [columns[label] for label in pair], spans)
    _rename(changed, source, names)
    target.parent.mkdir(parents=True, exist_ok=True)
    return write_whole(target, bytes(changed))


def _exchange_points(
    content: bytearray, layout: Layout, columns: Sequence[int], spans: Sequence[tuple[int, int]]
) -> None:
    """Exchange two points, coordinates and residual, in the frames of the data section."""
    word = 4 if layout.floating else 2
    row = word * (4 * layout.points + layout.channels * layout.samples)
    data = np.frombuffer(content, dtype=np.uint8, count=layout.frames * row, offset=layout.start)
    one, other = (data.reshape(layout.frames, row)[:, 4 * word * k : 4 * word * (k + 1)] for k in columns)
    for start, stop in spans:
        one[start:stop], other[start:stop] = other[start:stop].copy(), one[start:stop].copy()


def _rename(content: bytearray, source: Path, names: Mapping[str, str]) -> None:
    """Write other ``names`` over the labels of points."""
    header = read_header(bytes(content), str(source))
    for start, width in text_rows(bytes(content), header, str(source), group="POINT", name="LABELS"):
        prefix, name = split_label(content[start : start + width].decode("latin-1").split("\0")[0])
        if name in names:
            label = f"{prefix}:{names[name]}" if prefix else names[name]
            content[start : start + width] = label.encode("latin-1").ljust(width)[:width]

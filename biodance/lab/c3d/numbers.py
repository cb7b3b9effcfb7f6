"""Read the numbers of a C3D file whose layout is known; where they smell of a misread, ezc3d judges in a child
process.
"""

import io
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.child_process import run_python
from biodance.lab.c3d.layout import Layout
from biodance.lab.c3d.parameters import MIPS, doubles, floats
from biodance.records import Array, any_coordinate

Numbers = tuple[NDArray[Any], NDArray[Any]]
"""Points (T, K, 3) in file units with NaN = not seen, analog (T * samples, C) in units."""


def read_numbers(content: bytes, layout: Layout) -> Numbers:
    """Return the points and analog values of the data section.

    A frame holds x, y, z and a word of residual and cameras for each point, then the analog samples, channel fastest;
    all 32-bit floats or all 16-bit integers. A point was not seen if its residual is negative, a coordinate is no
    finite number, or all three are zero. Source: C3D user guide, "3D point data" and "analog data".
    """
    words = layout.frames * (4 * layout.points + layout.channels * layout.samples)
    size = 4 if layout.floating else 2
    section = memoryview(content)[layout.start : layout.start + size * words]
    if layout.floating:
        rows = analog_rows = floats(section, layout.processor).reshape(layout.frames, -1)
    else:
        order = ">" if layout.processor == MIPS else "<"
        rows = np.frombuffer(section, dtype=order + "i2").reshape(layout.frames, -1)
        analog_rows = rows.view(order + "u2") if layout.unsigned else rows
    quads = rows[:, : 4 * layout.points].reshape(layout.frames, layout.points, 4)
    points = doubles(quads[..., :3])
    if not layout.floating:
        points *= layout.scale
    seen = (quads[..., 3] >= 0) & ~any_coordinate(~np.isfinite(points)) & any_coordinate(points != 0)
    points[~seen] = np.nan
    rest = doubles(analog_rows[:, 4 * layout.points :])
    with np.errstate(invalid="ignore", over="ignore"):
        analog = rest.reshape(layout.frames * layout.samples, layout.channels) if layout.channels else np.empty((0, 0))
        analog -= layout.offset
        analog *= layout.gain
    return points, analog


_PATIENCE = 60.0
"""s after which the child is given up."""
READ = """
import io, sys, warnings
import ezc3d, numpy
warnings.simplefilter("ignore")
try:
    data = ezc3d.c3d(sys.argv[1])["data"]
except Exception as error:
    sys.exit(" ".join(str(error).split())[:120] or type(error).__name__)
points, analogs = data["points"], data["analogs"]
answer = io.BytesIO()  # not stdout itself: numpy asks a file for its position, and a pipe has none
numpy.save(answer, points[:3].transpose(2, 1, 0).astype("f4"))
numpy.save(answer, analogs[0].T.astype("f4"))
sys.stdout.buffer.write(answer.getvalue())
"""


def second_opinion(path: Path, numbers: Numbers, layout: Layout) -> str:
    """Return "confirmed" if ezc3d reads the same numbers, "refuted" if it reads others, else why it does not read the
    file.

    ezc3d finds the layout on its own, so it also judges ours. Where header and parameters disagree it believes one of
    them without looking at the length of the file, as biodance does: no judgement. Left out are analog channels that
    ezc3d 1.7.2 is known to read wrong: those with a negative OFFSET, whose sign it loses, and unsigned integers, which
    it takes for signed ones.

    Parameters
    ----------
    path
        The file.
    numbers
        Points (T, K, 3) in file units, NaN = not seen, and analog (S, C), as biodance read them.
    layout
        How biodance understood the data section.
    """
    try:
        child = run_python("-c", READ, str(path), timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        return f"ezc3d gives no answer within {_PATIENCE:g} s"
    except OSError as error:
        return f"ezc3d cannot be started ({error.strerror})"
    if child.returncode < 0:
        return f"ezc3d crashes on the file (signal {-child.returncode})"
    if child.returncode:
        lines = child.stderr.decode(errors="replace").strip().splitlines()
        return f"ezc3d does not take the file ({lines[-1] if lines else f'exit code {child.returncode}'})"
    with io.BytesIO(child.stdout) as answer:
        points, analog = np.load(answer).astype(float), np.load(answer).astype(float)
    # without channels ezc3d still gives one row a frame
    ours = (numbers[0].shape, numbers[1].shape if numbers[1].size else (len(points), 0))
    if layout.notes and (points.shape, analog.shape) != ours:
        return (
            f"ezc3d believes the other of the two ({points.shape[1]} points, {analog.shape[1]} channels, "
            f"{len(points)} frames)"
        )
    return "confirmed" if _same_points(numbers[0], points) and _same_analog(numbers[1], analog, layout) else "refuted"


def _same_points(ours: Array, theirs: Array) -> bool:
    """Compare where biodance saw a point; where it did not, ezc3d may give any number."""
    seen = np.isfinite(ours)
    return ours.shape == theirs.shape and _same(ours[seen], theirs[seen])


def _same_analog(ours: Array, theirs: Array, layout: Layout) -> bool:
    judged = layout.offset >= 0
    if not ours.size or not judged.any() or (layout.unsigned and not layout.floating):
        return True
    return ours.shape == theirs.shape and _same(ours[:, judged], theirs[:, judged])


def _same(one: Array, other: Array) -> bool:
    size = np.abs(one[np.isfinite(one)]).max(initial=1.0)
    return np.allclose(one, other, rtol=1e-5, atol=1e-6 * size, equal_nan=True)

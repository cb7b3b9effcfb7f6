"""Read the data section of a C3D file whose layout is known, with either of two libraries.

ezc3d is the first choice. The pure-Python package ``c3d`` takes what ezc3d refuses (SGI/MIPS byte order, OFFSET not an integer, unsigned
analog numbers), misreads (negative offsets: it drops their sign) or reads to another size than the layout, and is the second opinion on a
file that smells of a misread.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.errors import FileRefused
from biodance.lab.c3d_layout import Layout
from biodance.lab.c3d_parameters import MIPS, PROCESSORS, RESAVE

Numbers = tuple[NDArray[Any], NDArray[Any]]
"""Points (T, K, 3) in file units with NaN = not seen, analog (T * samples, C) in units."""

LEAP = 1.0
"""m; no marker on a person moves further between two frames, at any rate in use."""


@dataclass(frozen=True, eq=False)
class Reading:
    """The numbers of a data section and the library that read them; ``notes``: why not the first choice; ``warnings``: what smells."""

    points: NDArray[Any]
    analog: NDArray[Any]
    reader: str
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def read_numbers(path: Path, layout: Layout, *, judged: tuple[int, ...], metre: float) -> Reading:
    """Return the numbers of the data section.

    ``judged`` are the points that are markers and ``metre`` is the length of one metre in file units: markers that jump smell of a misread.

    Raises
    ------
    FileRefused
        Neither library reads the file.
    """

    def leaps(numbers: Numbers) -> int:
        return _leaps(numbers[0][:, list(judged)], LEAP * metre)

    refusal = _beyond_ezc3d(layout)
    first, fault = (None, refusal) if refusal else _attempt(_with_ezc3d, path, layout)
    if first is not None and not leaps(first):
        return Reading(*first, "ezc3d")
    second, objection = _attempt(_with_c3d, path, layout)
    if first is None and second is None:
        raise FileRefused(f"{path}: neither reader takes the file (ezc3d: {fault}; c3d: {objection}). {RESAVE}")
    if first is None and second is not None:
        return Reading(*second, "c3d", (f"Read with the package c3d, because of ezc3d: {fault}.",), _jumps(leaps(second)))
    assert first is not None  # for the type checker: both None was refused
    if second is not None and leaps(second) < leaps(first):
        said = f"ezc3d reads {leaps(first)} jumps of more than {LEAP:g} m, the package c3d {leaps(second)}: its reading is taken."
        return Reading(*second, "c3d", (), (said,))
    confirmed = "a second reader finds the same" if second is not None and _same(first, second) else "a second reader could not confirm it"
    return Reading(*first, "ezc3d", (), _jumps(leaps(first), confirmed))


def _jumps(count: int, confirmed: str = "only one reader takes this file") -> tuple[str, ...]:
    return (f"Markers jump by more than {LEAP:g} m between two frames in {count} places; {confirmed}.",) if count else ()


def _beyond_ezc3d(layout: Layout) -> str:
    """Return why ezc3d is not asked; "" if it is."""
    if layout.processor == MIPS:
        return f"{PROCESSORS[MIPS]} byte order is not read"
    if layout.unsigned and not layout.floating:
        return "unsigned analog numbers are read as signed"
    if (layout.offset < 0).any():
        return "negative analog offsets are read without their sign"
    if layout.channels > 255 or layout.points > 65535:
        return "more than 255 analog channels"
    return ""


def _attempt(reader: Callable[[Path, Layout], Numbers], path: Path, layout: Layout) -> tuple[Numbers | None, str]:
    """Return the numbers, or None and the reason; a library may raise whatever it likes on a file it does not understand."""
    try:
        points, analog = reader(path, layout)
    except Exception as error:
        return None, f"{type(error).__name__}: {' '.join(str(error).split())}"[:200]
    expected = (layout.frames, layout.points, 3), (layout.frames * layout.samples if layout.channels else 0, layout.channels)
    if (points.shape, analog.shape) != expected:
        return None, f"reads points {points.shape} and analog {analog.shape} where {expected[0]} and {expected[1]} are stored"
    return (points, analog), ""


def _with_ezc3d(path: Path, layout: Layout) -> Numbers:
    import ezc3d

    data = ezc3d.c3d(str(path))["data"]
    seen = data["meta_points"]["residuals"][0].T >= 0
    points = np.ascontiguousarray(data["points"][:3].transpose(2, 1, 0))
    analog = data["analogs"][0].T if layout.channels else np.empty((0, 0))
    return _hide(points, seen), np.ascontiguousarray(analog)


def _with_c3d(path: Path, layout: Layout) -> Numbers:
    import c3d

    class Reader(c3d.Reader):  # type: ignore[misc]
        """The library's frame loop with the counts of the layout instead of its own."""

        point_used = property(lambda self: layout.points)
        point_scale = property(lambda self: -layout.scale if layout.floating else layout.scale)
        analog_used = property(lambda self: layout.channels)
        analog_per_frame = property(lambda self: layout.samples if layout.channels else 0)
        analog_format_unsigned = property(lambda self: layout.unsigned)
        first_frame = property(lambda self: 1)
        last_frame = property(lambda self: layout.frames)

        def _check_metadata(self) -> None:
            self._header.data_block = layout.start // 512 + 1

        def get_analog_transform(self) -> tuple[Any, Any]:
            return layout.gain[:, None], layout.offset[:, None]

    with open(path, "rb") as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        frames = [(p, a) for _, p, a in Reader(stream).read_frames(check_nan=False)]
    points = np.array([p for p, _ in frames], dtype=float)
    analog = np.concatenate([np.reshape(a, (layout.channels, -1)).T for _, a in frames]) if layout.channels else np.empty((0, 0))
    return _hide(points[..., :3], points[..., 3] >= 0), analog


def _hide(points: NDArray[Any], seen: NDArray[Any]) -> NDArray[Any]:
    """Return the points with NaN where the residual is negative, a coordinate is not finite, or all three are exactly zero."""
    good = seen & np.isfinite(points).all(axis=2) & (points != 0).any(axis=2)
    return np.where(good[..., None], points, np.nan)


def _leaps(points: NDArray[Any], limit: float) -> int:
    """Return how often a point moves by more than ``limit`` between two frames in which it is seen."""
    step = np.diff(points, axis=0)
    return int(np.count_nonzero(np.einsum("tki,tki->tk", step, step) > limit**2))


def _same(one: Numbers, other: Numbers) -> bool:
    return all(np.allclose(a, b, rtol=1e-5, atol=1e-6, equal_nan=True) for a, b in zip(one, other, strict=True))

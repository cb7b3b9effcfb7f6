"""Arrays and names as all records use them: checked, copied, read-only."""

from collections.abc import Hashable, Iterable
from typing import TYPE_CHECKING, Protocol, TypeGuard, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from biodance.errors import BiodanceError, known_index

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
CHANNEL_TITLES = ("Fx (N)", "Fy (N)", "Fz (N)", "Mx (N·m)", "My (N·m)", "Mz (N·m)")


class _HasName(Protocol):
    @property
    def name(self) -> str: ...


_Named = TypeVar("_Named", bound=_HasName)
_Key = TypeVar("_Key", bound=Hashable)
_Value = TypeVar("_Value")


def frozen_array(value: ArrayLike, shape: tuple[int | None, ...], what: str) -> Array:
    """Return a read-only float copy of ``value`` after checking its shape (``None`` = any length); ``value`` itself
    where it is one that a record froze before.

    Raises
    ------
    BiodanceError
        The shape is wrong; the message names ``what``, the shape found and the shape expected.
    """
    array = value if _is_frozen(value) else np.array(value, dtype=float)
    fits = array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape, strict=True))
    if not fits:
        expected = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        raise BiodanceError(f"{what} has shape {array.shape}, expected {expected}.")
    array.setflags(write=False)
    return array


def any_coordinate(flags: Mask) -> Mask:
    """Return (...) where a coordinate (..., 3) is flagged: ``flags.any(axis=-1)`` in a third of its time."""
    return np.asarray(flags[..., 0] | flags[..., 1] | flags[..., 2])


def lengths_of(vectors: Array) -> Array:
    """Return (...) how long ``vectors`` (..., 3) are: ``np.linalg.norm(vectors, axis=-1)`` in a third of its time."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def spread_frames(values: Array) -> Array:
    """Return some hundred frames of ``values`` (T, ...), spread over the recording, to tell size and place."""
    return values[:: max(1, len(values) // 256)]


def _is_frozen(value: ArrayLike) -> TypeGuard[Array]:
    """Return whether nobody can write into an array, nor into what it might be a view of."""
    return isinstance(value, np.ndarray) and value.dtype == float and not value.flags.writeable and value.base is None


def assign(record: object, **values: object) -> None:
    """Assign fields of a frozen record during its own ``__post_init__``."""
    for name, value in values.items():
        object.__setattr__(record, name, value)


def freeze(record: object, what: str, **shapes: tuple[int | None, ...]) -> None:
    """Make arrays of a frozen record read-only during its ``__post_init__``, each of its shape (`frozen_array`)."""
    for name, shape in shapes.items():
        assign(record, **{name: frozen_array(getattr(record, name), shape, f"{what}.{name}")})


def check_time(time: ArrayLike, what: str) -> Array:
    """Return times (T,) s as a read-only array; BiodanceError where they do not increase."""
    time = frozen_array(time, (None,), f"{what}.time")
    if not (time[1:] > time[:-1]).all():
        frame = int(np.argmin(np.diff(time) > 0))
        raise BiodanceError(
            f"{what}.time does not increase at sample {frame + 1} ({time[frame]:g} s, {time[frame + 1]:g} s)."
        )
    return time


def span(time: Array) -> str:
    """Return duration and rate in words."""
    rate = f" at {rate_of(time):g} Hz" if time.size > 1 else ""
    return f"{time.size} frames{rate}, {time[-1] - time[0]:.2f} s" if time.size else "no frames"


def rate_of(time: Array) -> float:
    """Return the mean sampling rate in Hz; NaN for fewer than two samples."""
    return float((time.size - 1) / (time[-1] - time[0])) if time.size > 1 else float("nan")


class Sampled:
    """What has a ``time`` (n,) s."""

    time: Array

    @property
    def rate(self) -> float:
        """Mean sampling rate, Hz; NaN for fewer than two samples."""
        return rate_of(self.time)


def by_name(trials: Iterable[_Named], name: str, kind: str) -> _Named:
    """Return the first of ``trials`` of that ``name``; UnknownName lists all where there is none."""
    some = tuple(trials)
    return some[known_index(kind, name, [one.name for one in some])]


def in_time(time: Array, values: Array, columns: Iterable[str]) -> "pd.DataFrame":
    """Return a table of ``values`` (T, n) over time."""
    import pandas as pd

    return pd.DataFrame(values, index=pd.Index(time, name="time (s)"), columns=list(columns))


def grouped(pairs: Iterable[tuple[_Key, _Value]]) -> dict[_Key, list[_Value]]:
    """Return the values of ``pairs`` of a key and a value by their key, keys and values in the order they come in."""
    found: dict[_Key, list[_Value]] = {}
    for key, value in pairs:
        found.setdefault(key, []).append(value)
    return found


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the runs of True in ``mask`` (T,) as (start, stop), stop excluded."""
    # with False at both ends the places of change are, in turn, the first True and the first False after it
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def longest_run(mask: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the first of the longest runs of True in ``mask`` (T,) as (start, stop), (0, 0) where there is none."""
    return max(runs(mask), key=lambda run: run[1] - run[0], default=(0, 0))

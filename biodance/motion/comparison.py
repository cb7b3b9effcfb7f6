"""Compare two wrenches channel by channel over the frames that may be compared."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.errors import BiodanceError, TrialRefused
from biodance.records import CHANNELS, Array, Wrench

LEAST_FRAMES = 3
"""A correlation of fewer frames says nothing."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """How two wrenches agree over ``frames`` frames.

    ``rms`` (6,) N, N·m, root mean square of the difference per channel Fx Fy Fz Mx My Mz; ``correlation`` (6)
    Pearson's, None where it is not defined; ``notes`` say why not.
    """

    frames: int
    rms: Array
    correlation: tuple[float | None, ...]
    notes: tuple[str, ...] = ()


def compare(measured: Wrench, simulated: Wrench, mask: NDArray[np.bool_] | None = None) -> Agreement:
    """Compare two wrenches of the same times over the frames where ``mask`` (T,) is True (all frames without it).

    Frames in which either wrench is not known (NaN) are left out, and said.

    Raises
    ------
    BiodanceError
        The two wrenches do not have the same times, or the mask has another length.
    TrialRefused
        No frame is left to compare.
    """
    if measured.time.shape != simulated.time.shape or not np.allclose(measured.time, simulated.time, rtol=0, atol=1e-6):
        raise BiodanceError(
            f"The wrenches have different times ({measured.time.size} and {simulated.time.size} frames). Prepare the "
            f"trial first."
        )
    chosen = np.ones(measured.time.size, dtype=bool) if mask is None else np.asarray(mask, dtype=bool)
    if chosen.shape != measured.time.shape:
        raise BiodanceError(f"The mask has {chosen.size} frames, the wrenches have {measured.time.size}.")
    known = np.isfinite(measured.value).all(axis=1) & np.isfinite(simulated.value).all(axis=1)
    used = chosen & known
    if not used.any():
        raise TrialRefused(
            f"No frame is left to compare: {chosen.sum()} of {chosen.size} may be used, and none of them is known in "
            f"both."
        )
    first, second = measured.value[used], simulated.value[used]
    rms = np.sqrt(np.mean((first - second) ** 2, axis=0))
    correlation = tuple(_pearson(a, b) for a, b in zip(first.T, second.T, strict=True))
    notes = [f"{int((chosen & ~known).sum())} frames left out: not known in both."] if np.any(chosen & ~known) else []
    flat = [name for name, value in zip(CHANNELS, correlation, strict=True) if value is None]
    if flat:
        why = f"only {used.sum()} frames" if used.sum() < LEAST_FRAMES else "constant"
        notes.append(f"No correlation of {', '.join(flat)}: {why}.")
    return Agreement(int(used.sum()), rms, correlation, tuple(notes))


def _pearson(first: Array, second: Array) -> float | None:
    """Return Pearson's correlation of two signals (T,); None where one of them does not vary or there are too few
    samples.
    """
    if first.size < LEAST_FRAMES:
        return None
    a, b = first - first.mean(), second - second.mean()
    flat = [np.linalg.norm(centred) <= 1e-9 * np.linalg.norm(signal) for centred, signal in ((a, first), (b, second))]
    return None if any(flat) else float(np.clip(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)), -1.0, 1.0))

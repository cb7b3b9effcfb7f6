"""The zero of a force plate: what its channels read while nobody stands on it."""

from dataclasses import dataclass

import numpy as np

from biodance.records import Array, runs

_BLOCK = 0.04  # s: the force is judged in means over two periods of the mains
_NEAR = 20.0  # N, readings this close to the unloaded end of the trial belong to it
_SMALL = 30.0  # N, an offset that needs no further proof
_FLAT = 5.0  # N, spread of the block means up to which a plate counts as quiet
LARGEST_SHARE = 1 / 3  # an offset of the sign of a load must stay below this share of the trial's range
_SHORTEST = 0.12  # s of unloaded signal, after one block was cut off at both ends, where the plate still rings
DEAD, LONG = 1.5, 0.5
"""N, s: a larger offset is only believed where the signal is as still as its own noise, and for longer."""
_FEW = 10  # samples: a shorter ZERO is only used where nothing better is found


@dataclass(frozen=True)
class Baseline:
    """Samples ``start`` to ``stop`` (exclusive) over which each channel is averaged, both 0 for none; ``said`` is
    the sentence about it.
    """

    start: int
    stop: int
    said: str


def find_baseline(vertical: Array, *, zero: tuple[int, int] | None, rate: float) -> Baseline:
    """Return the window in which the plate is unloaded: FORCE_PLATFORM:ZERO if it is one, else the longest found, else
    none.

    ``vertical`` (S,) N is the plate's vertical force as recorded, either sign; ``zero`` the first and last sample (from
    1) that the file names. Unloaded means: quiet, at the end of the trial's range away from the load, and either small
    or plainly no load.
    """
    written, why = _written(vertical, zero)
    if written and written.stop - written.start >= _FEW:
        return written
    found = _longest_unloaded(vertical, rate)
    if found is not None:
        level = vertical[slice(*found)].mean()
        said = (
            f"Zero: {why} The plate is unloaded in samples {found[0] + 1}-{found[1]}; their mean was subtracted "
            f"({level:.3g} N vertical)."
        )
        return Baseline(*found, said)
    if written:
        return written
    low, high = _range(vertical)
    never = f"The plate is never seen unloaded (vertical {low:.0f} to {high:.0f} N): nothing was subtracted."
    return Baseline(0, 0, f"Zero: {why} {never}")


def is_unloaded(level: float, vertical: Array) -> bool:
    """Return True if ``level`` N can be the reading of the empty plate in a trial with these readings (S,) N.

    It must be the low or the high end of the trial's range (a load goes one way only). An offset up to 30 N is
    believed; a larger one only if it is no large part of the load, or has the opposite sign.
    """
    low, high = _range(vertical)
    if abs(level) <= _SMALL:
        return level <= low + _NEAR or level >= high - _NEAR
    if high - low < 5 * _NEAR:
        return False
    load = level if level <= low + _NEAR else -level
    at_an_end = level <= low + _NEAR or level >= high - _NEAR
    return at_an_end and -(high - low) <= load <= LARGEST_SHARE * (high - low)


def block_means(values: Array, rate: float, *, length: float = _BLOCK) -> tuple[Array, int]:
    """Return the means of ``values`` (S,) over whole blocks of ``length`` s, and the samples per block (at least one
    block).
    """
    size = min(max(1, round(length * rate)), values.size)
    count = values.size // size
    return values[: count * size].reshape(count, size).mean(axis=1), size


def _written(vertical: Array, zero: tuple[int, int] | None) -> tuple[Baseline | None, str]:
    """Return the window that the file names if it is legal and unloaded, and the reason why it is not used."""
    if zero is None:
        return None, "the file names no window (ZERO is missing)."
    first, last = zero
    if not 1 <= first <= last <= vertical.size:
        return None, f"ZERO is {first} {last}, which names no samples."
    level = float(vertical[first - 1 : last].mean())
    if not is_unloaded(level, vertical):
        return None, f"ZERO names samples {first}-{last}, but the plate is loaded there ({level:.0f} N)."
    said = (
        f"Zero: mean of samples {first}-{last} as the file says (ZERO), {level:.3g} N vertical, subtracted from "
        f"every channel."
    )
    return Baseline(first - 1, last, said), f"ZERO names only {last - first + 1} samples."


def _longest_unloaded(vertical: Array, rate: float) -> tuple[int, int] | None:
    """Return the longest quiet stretch (samples) at one end of the range that is unloaded; None if there is none."""
    means, size = block_means(vertical, rate)
    found = []
    for end in (means.min(), means.max()):
        near = means[np.abs(means - end) <= _NEAR]
        middle = float(np.median(near))
        spread = 1.4826 * float(np.median(np.abs(near - middle)))
        for start, stop in runs(np.abs(means - middle) <= max(_FLAT, 4 * spread)):
            inner = slice(start + 1, stop - 1)
            if stop - start < 3:
                continue
            level, length = float(means[inner].mean()), (stop - start - 2) * size / rate
            small = abs(level) <= _SMALL
            noise = 1.5 * float(vertical[(start + 1) * size : (stop - 1) * size].std()) / np.sqrt(size)
            quiet = means[inner].std() <= (_FLAT if small else max(DEAD, noise)) and length >= (
                _SHORTEST if small else LONG
            )
            if quiet and is_unloaded(level, means):
                found.append((small, length, (start + 1) * size, (stop - 1) * size))
    return max(found)[2:] if found else None


def _range(values: Array) -> tuple[float, float]:
    low, high = np.percentile(values, [0.5, 99.5])
    return float(low), float(high)

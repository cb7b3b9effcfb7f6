"""Decide how many points, channels, samples and frames the data section of a C3D file holds, by header, parameters and
the length of the file. Where they contradict each other, only the one reading that fills the file to its last block is
believed; else the file is refused.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.errors import FileRefused
from biodance.lab.c3d import C3D_BLOCK, RESAVE, Header, Parameters, ParameterValue

_CLIPPED = 65535
"""What 16-bit frame numbers hold in a longer recording: TRIAL, LONG_FRAMES or the length of the file tells more."""


def parameter_numbers(parameters: Parameters, group: str, name: str) -> NDArray[Any]:
    """Return a numeric parameter as (n,), continued in NAME2, NAME3 ... beyond 255 entries; empty if missing."""
    family = _continued(parameters, group, name)
    arrays = [np.ravel(value, order="F") for value in family if isinstance(value, np.ndarray)]
    return np.concatenate(arrays) if arrays else np.empty(0)


def texts(parameters: Parameters, group: str, name: str) -> list[str]:
    """Return a text parameter, continued in NAME2, NAME3 ... beyond 255 entries; empty if missing or numeric."""
    return [text for value in _continued(parameters, group, name) if isinstance(value, list) for text in value]


def _continued(parameters: Parameters, group: str, name: str) -> list[ParameterValue]:
    """Return the values of a parameter and of its continuations NAME2, NAME3 ..."""
    found = parameters.get(group, {})
    return [found[name + tail] for tail in ("", *map(str, range(2, 100))) if name + tail in found]


def _scalar(parameters: Parameters, group: str, name: str) -> float:
    """Return the first number of a parameter; NaN if it is missing, empty or not finite."""
    values = parameter_numbers(parameters, group, name)
    return float(values[0]) if values.size and np.isfinite(values[0]) else math.nan


def _distinct(values: Iterable[float]) -> list[int]:
    """Return the distinct finite values >= 0 as integers, in order."""
    return list(dict.fromkeys(int(v) for v in values if math.isfinite(v) and v >= 0))


def _unsigned(value: float) -> float:
    """Return a frame number that was stored in 16 bits without its sign."""
    return value + 65536 if -32768 <= value < 0 else value


def _frame_counts(header: Header, parameters: Parameters) -> list[int]:
    """Return the frame counts that the file declares; those that end at the most that 16 bits hold tell nothing."""
    first, last = (_field(parameters, name) for name in ("ACTUAL_START_FIELD", "ACTUAL_END_FIELD"))
    spans = ((float(header.first_frame), float(header.last_frame)), (first, last))
    declared = [to - start + 1 for start, to in spans if to != _CLIPPED]
    declared += [_unsigned(_scalar(parameters, "POINT", name)) for name in ("FRAMES", "LONG_FRAMES")]
    return [count for count in _distinct(declared) if count not in (0, _CLIPPED)]


def _frames_held(content: bytes, start: int, width: int, first: int, remarks: list[str]) -> int:
    """Return how many frames of ``width`` bytes the file holds from byte ``start`` on; ``remarks`` say so."""
    size, least = len(content) - start, _CLIPPED - first + 1
    held = size // max(width, 1)
    while held > least and size - (held - 1) * width < C3D_BLOCK and not any(content[start + (held - 1) * width :]):
        held -= 1
    behind = size - held * width
    cut = f" {behind} bytes behind them were left: the file may be cut off." if behind >= C3D_BLOCK else ""
    remarks.append(
        f"Header, POINT:FRAMES and TRIAL stop at {_CLIPPED} frames, the most that 16 bits hold; the length of the file "
        f"decides: {held} frames were read.{cut}"
    )
    return max(held, least)


def _field(parameters: Parameters, name: str) -> float:
    """Return a frame number stored as two 16-bit words (low, high) in the TRIAL group; NaN if it is missing."""
    words = parameter_numbers(parameters, "TRIAL", name)
    if words.size == 0 or not np.all(np.isfinite(words)):
        return math.nan
    # Low word first.
    return _unsigned(float(words[0])) + 65536 * (_unsigned(float(words[1])) if words.size > 1 else 0)


def _first_frame_number(header: Header, parameters: Parameters, frames: int, notes: list[str]) -> int:
    """Return the number of the first frame."""
    first = _field(parameters, "ACTUAL_START_FIELD")
    spans = header.last_frame - header.first_frame + 1 == frames or header.last_frame == _CLIPPED
    if int(first) == header.first_frame if math.isfinite(first) else spans:
        return header.first_frame
    if not math.isfinite(first):
        notes.append(
            f"The first frame's number, {header.first_frame} in the header, does not fit its last one, "
            f"{header.last_frame}."
        )
        return header.first_frame
    last = _field(parameters, "ACTUAL_END_FIELD")
    if last - first + 1 == frames and header.last_frame - header.first_frame + 1 != frames:
        return int(first)
    notes.append(
        f"The first frame is {header.first_frame} in the header and {first:g} in TRIAL:ACTUAL_START_FIELD; the "
        f"header's is taken."
    )
    return header.first_frame


@dataclass(frozen=True)
class Layout:
    """Data section: byte ``start``, counts of points, channels, analog samples per frame and frames, rates in Hz (NaN =
    none).

    ``scale`` turns integer points into file units; ``gain`` (C,) and ``offset`` (C,) turn analog numbers into units:
    ``(number - offset) * gain``; ``notes`` say in sentences how contradictions were decided, ``remarks`` what is
    missing.
    """

    processor: int
    start: int
    points: int
    channels: int
    samples: int
    frames: int
    first_frame: int
    floating: bool
    unsigned: bool
    scale: float
    rate: float
    analog_rate: float
    gain: NDArray[Any]
    offset: NDArray[Any]
    notes: tuple[str, ...]
    remarks: tuple[str, ...] = ()


def read_layout(content: bytes, header: Header, parameters: Parameters, where: str) -> Layout:
    """Return the layout of the data section of a file of these bytes.

    Raises
    ------
    FileRefused
        The file is cut off, holds no data, or its header, parameters and length contradict each other without a
        decision.
    """
    notes, remarks = list[str](), list[str]()
    written = parameter_numbers(parameters, "POINT", "SCALE")
    scale = float(written[0]) if written.size else header.scale
    # the sign tells floats (< 0) from integers, where the size counts too
    if not (math.isclose(scale, header.scale, rel_tol=1e-6) or (scale < 0 and header.scale < 0)):
        raise FileRefused(
            f"{where}: the header's scale is {header.scale:g}, POINT:SCALE is {scale:g}: the points' size is not "
            f"known. {RESAVE}"
        )
    floating = header.scale < 0
    word = 4 if floating else 2
    start, points, channels, samples, frames = _counts(content, header, parameters, word, where, notes, remarks)
    rate, analog_rate = _rates(header, parameters, samples if channels else 0, notes)
    unsigned = "UNSIGNED" in (text.upper() for text in texts(parameters, "ANALOG", "FORMAT"))
    gain, offset = _analog_transform(parameters, channels, unsigned, where, remarks)
    first = _first_frame_number(header, parameters, frames, notes)
    kind = (floating, unsigned, abs(header.scale), rate, analog_rate, gain, offset)
    return Layout(
        header.processor, start, points, channels, samples, frames, first, *kind, tuple(notes), tuple(remarks)
    )


def _analog_counts(header: Header, parameters: Parameters) -> list[tuple[int, int]]:
    """Return the pairs (channels, samples per frame) that at most one statement of the file contradicts."""
    used, values, samples = _scalar(parameters, "ANALOG", "USED"), header.analog_values, header.analog_samples
    ratio = _scalar(parameters, "ANALOG", "RATE") / (_scalar(parameters, "POINT", "RATE") or math.nan)
    # Samples per frame by the rates; below one half they say nothing.
    ratio = round(ratio) if math.isfinite(ratio) and ratio > 0.5 else math.nan
    if not (used > 0 or values > 0):
        return [(0, 0)]
    if values == 0 and samples == 0:  # a header that is silent on analog data
        return [(0, 0), (int(used), int(ratio))] if math.isfinite(ratio) else [(0, 0)]
    channels = _distinct([used, *_whole_quotients(values, (samples, ratio))])
    rows = _distinct([samples, ratio, *_whole_quotients(values, channels)])

    def against(c: int, s: int) -> int:
        contradicted = (c != used and not math.isnan(used), s != samples, s != ratio and not math.isnan(ratio))
        return sum(contradicted) + (c * s != values)

    votes = {(c, s): against(c, s) for c, s in product(channels, rows) if c * s > 0}
    least = min(votes.values(), default=0)
    none = [(0, 0)] if used == 0 or values == 0 else []  # one statement says that there are no analog data
    return none + [pair for pair, count in votes.items() if count == least and count <= 1]


def _whole_quotients(total: float, divisors: Iterable[float]) -> list[float]:
    return [total / divisor for divisor in divisors if divisor > 0 and total % divisor == 0]


def _counts(
    content: bytes,
    header: Header,
    parameters: Parameters,
    word: int,
    where: str,
    notes: list[str],
    remarks: list[str],
) -> tuple[int, int, int, int, int]:
    """Return (start byte, points, channels, samples per frame, frames); say in ``notes`` what was overruled."""
    starts = _distinct([header.data_start, C3D_BLOCK * ((_scalar(parameters, "POINT", "DATA_START") or math.nan) - 1)])
    points = _distinct([header.points, _scalar(parameters, "POINT", "USED")])
    analog, frames, size = _analog_counts(header, parameters), _frame_counts(header, parameters), len(content)
    clipped = _CLIPPED in (header.last_frame, _unsigned(_scalar(parameters, "POINT", "FRAMES")))
    if not frames and clipped and len(starts) == len(points) == len(analog) == 1:
        width = word * (4 * points[0] + analog[0][0] * analog[0][1])
        frames = [_frames_held(content, starts[0], width, header.first_frame, remarks)]
    readings = [(s, p, c, n, f) for s, p, (c, n), f in product(starts, points, analog, frames)]

    def rest(reading: tuple[int, int, int, int, int]) -> int:
        start, p, c, n, f = reading
        return size - start - f * word * (4 * p + c * n)

    readings = [reading for reading in readings if 4 * reading[1] + reading[2] * reading[3] > 0]
    if not readings:
        raise FileRefused(
            f"{where}: the file declares no frame, or neither points nor analog channels, or analog counts that "
            f"contradict. {RESAVE}"
        )
    fitting = [reading for reading in readings if rest(reading) >= 0]
    if not fitting:
        start, p, c, n, f = readings[0]
        held = max(0, size - start) // (word * (4 * p + c * n))
        raise FileRefused(f"{where}: the file is cut off: it declares {f} frames and holds {held}. {RESAVE}")
    full = [reading for reading in fitting if rest(reading) < C3D_BLOCK]
    if len(readings) == 1 and (full or remarks or _all_told_twice(header, parameters)):
        return fitting[0]
    if len(full) != 1:
        raise FileRefused(
            f"{where}: header and parameters contradict each other (points {points}, channels and samples per frame "
            f"{analog}, frames {frames}, data from byte {starts}) and the file's length does not decide. {RESAVE}"
        )
    start, p, c, n, f = full[0]
    notes.append(
        f"Header and parameters disagree; the file's length decides: {p} points, {c} channels x {n} samples, {f} "
        f"frames."
    )
    return full[0]


def _all_told_twice(header: Header, parameters: Parameters) -> bool:
    """Return whether header and parameters agree on every count: bytes behind the data are then padding."""
    points = not header.points or "USED" in parameters.get("POINT", {})
    channels = _scalar(parameters, "ANALOG", "USED")
    analog = (header.analog_values > 0) == (channels > 0)
    return points and analog and {"FRAMES", "DATA_START"} <= parameters.get("POINT", {}).keys()


def _rates(header: Header, parameters: Parameters, samples: int, notes: list[str]) -> tuple[float, float]:
    """Return point and analog rate in Hz, as two of the three places in the file tell them; NaN if none is > 0."""
    analog = _scalar(parameters, "ANALOG", "RATE")
    witnesses = {"POINT:RATE": _scalar(parameters, "POINT", "RATE"), "the header": header.rate}
    witnesses["ANALOG:RATE / samples per frame"] = analog / samples if samples else math.nan
    told = {name: rate for name, rate in witnesses.items() if math.isfinite(rate) and rate > 0}
    if not told:
        return math.nan, math.nan
    # How many of the witnesses each agrees with, itself included.
    agreeing = {
        name: sum(math.isclose(rate, other, rel_tol=1e-3) for other in told.values()) for name, rate in told.items()
    }
    best = max(told, key=lambda name: agreeing[name])
    if min(agreeing.values()) < len(told) or len(told) < 2:
        heard = ", ".join(f"{name} {rate:g}" for name, rate in witnesses.items() if not math.isnan(rate))
        notes.append(f"Rates in Hz: {heard}; {told[best]:g} Hz taken, from {best}.")
    return told[best], told[best] * samples if samples else math.nan


def _analog_transform(
    parameters: Parameters, channels: int, unsigned: bool, where: str, notes: list[str]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return gain (C,) and offset (C,) of the analog channels; the gain of a channel without a scale is NaN."""
    general, gain, offset = (parameter_numbers(parameters, "ANALOG", name) for name in ("GEN_SCALE", "SCALE", "OFFSET"))
    if channels and not general.size:
        general = np.ones(1)
        notes.append("ANALOG:GEN_SCALE is missing; it was taken as 1, the channels' own SCALE stays.")
    if channels and not np.isfinite(general[:1]).all():
        raise FileRefused(f"{where}: ANALOG:GEN_SCALE is not a number: no channel has a scale. {RESAVE}")
    filled = []
    for name, values, usual in (("SCALE", gain, np.nan), ("OFFSET", offset, 0.0)):
        whole = np.full(channels, usual)
        held = np.array(values[:channels], dtype=float)
        whole[: held.size] = np.where(np.isfinite(held), held, np.nan)
        filled.append(whole)
        lacking = [str(c + 1) for c in (*np.flatnonzero(np.isnan(whole)), *range(held.size, channels))]
        if lacking:
            how = "have no numbers" if name == "SCALE" else "have the offset 0"
            which = f"channels {', '.join(dict.fromkeys(lacking))}"
            notes.append(f"ANALOG:{name} has {held.size} values for {channels} channels: {which} {how}.")
    gain, offset = filled[0] * (general[0] if channels else 1.0), filled[1]
    return gain, np.where((offset < 0) & unsigned, offset + 65536, offset)

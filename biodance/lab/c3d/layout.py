"""Decide how many points, channels, samples and frames the data section of a C3D file holds.

The numbers stand in the header, in the parameters and, as the last witness, in the length of the file. Where they
contradict each other, only a reading that fills the file to its last block is believed; if there is none, or more than
one, the file is refused.
"""

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.errors import FileRefused
from biodance.lab.c3d.declared import (
    distinct,
    first_frame_number,
    frame_counts,
    frames_held,
    is_clipped,
    parameter_numbers,
    scalar,
    texts,
)
from biodance.lab.c3d.parameters import C3D_BLOCK, RESAVE, Header, Parameters


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
    notes: list[str] = []
    scale = _agreed_scale(header, parameters, where)
    floating = scale < 0
    remarks: list[str] = []
    word = 4 if floating else 2
    start, points, channels, samples, frames = _counts(content, header, parameters, word, where, notes, remarks)
    rate, analog_rate = _rates(header, parameters, samples if channels else 0, notes)
    unsigned = "UNSIGNED" in (text.upper() for text in texts(parameters, "ANALOG", "FORMAT"))
    gain, offset = _analog_transform(parameters, channels, unsigned, where, remarks)
    first = first_frame_number(header, parameters, frames, notes)
    kind = (floating, unsigned, abs(scale), rate, analog_rate, gain, offset)
    return Layout(
        header.processor, start, points, channels, samples, frames, first, *kind, tuple(notes), tuple(remarks)
    )


def _agreed_scale(header: Header, parameters: Parameters, where: str) -> float:
    """Return the header's scale; its sign tells floats (< 0) from integers, where its size counts too."""
    written = parameter_numbers(parameters, "POINT", "SCALE")
    scale = float(written[0]) if written.size else header.scale
    if not (math.isclose(scale, header.scale, rel_tol=1e-6) or (scale < 0 and header.scale < 0)):
        raise FileRefused(
            f"{where}: the header's scale is {header.scale:g}, POINT:SCALE is {scale:g}: the points' size is not "
            f"known. {RESAVE}"
        )
    return header.scale


def _analog_counts(header: Header, parameters: Parameters) -> list[tuple[int, int]]:
    """Return the pairs (channels, samples per frame) that at most one statement of the file contradicts."""
    used, values, samples = scalar(parameters, "ANALOG", "USED"), header.analog_values, header.analog_samples
    ratio = scalar(parameters, "ANALOG", "RATE") / (scalar(parameters, "POINT", "RATE") or math.nan)
    ratio = round(ratio) if math.isfinite(ratio) and ratio > 0.5 else math.nan
    if not (used > 0 or values > 0):
        return [(0, 0)]
    if values == 0 and samples == 0:  # a header that is silent on analog data
        return [(0, 0), (int(used), int(ratio))] if math.isfinite(ratio) else [(0, 0)]
    channels = distinct([used, *(values / s for s in (samples, ratio) if s > 0 and values % s == 0)])
    rows = distinct([samples, ratio, *(values / c for c in channels if c and values % c == 0)])

    def against(c: int, s: int) -> int:
        contradicted = (c != used and not math.isnan(used), s != samples, s != ratio and not math.isnan(ratio))
        return sum(contradicted) + (c * s != values)

    votes = {(c, s): against(c, s) for c, s in product(channels, rows) if c * s > 0}
    least = min(votes.values(), default=0)
    none = [(0, 0)] if used == 0 or values == 0 else []  # one statement says that there are no analog data
    return none + [pair for pair, count in votes.items() if count == least and count <= 1]


def _counts(
    content: bytes,
    header: Header,
    parameters: Parameters,
    word: int,
    where: str,
    notes: list[str],
    remarks: list[str],
) -> tuple[int, int, int, int, int]:
    """Return (start byte, points, channels, samples per frame, frames); ``notes`` say what was overruled, ``remarks``
    that nothing but the file's length tells the frames.
    """
    starts = distinct(
        [header.data_start, (scalar(parameters, "POINT", "DATA_START") or math.nan) * C3D_BLOCK - C3D_BLOCK]
    )
    points = distinct([header.points, scalar(parameters, "POINT", "USED")])
    analog, frames, size = _analog_counts(header, parameters), frame_counts(header, parameters), len(content)
    if not frames and is_clipped(header, parameters) and len(starts) == len(points) == len(analog) == 1:
        width = word * (4 * points[0] + analog[0][0] * analog[0][1])
        frames = [frames_held(content, starts[0], width, header.first_frame, remarks)]
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
    channels = scalar(parameters, "ANALOG", "USED")
    analog = (header.analog_values > 0) == (channels > 0)
    return points and analog and {"FRAMES", "DATA_START"} <= parameters.get("POINT", {}).keys()


def _rates(header: Header, parameters: Parameters, samples: int, notes: list[str]) -> tuple[float, float]:
    """Return point and analog rate in Hz, as two of the three places in the file tell them; NaN if none is > 0."""
    analog = scalar(parameters, "ANALOG", "RATE")
    witnesses = {"POINT:RATE": scalar(parameters, "POINT", "RATE"), "the header": header.rate}
    witnesses["ANALOG:RATE / samples per frame"] = analog / samples if samples else math.nan
    told = {name: rate for name, rate in witnesses.items() if math.isfinite(rate) and rate > 0}
    if not told:
        return math.nan, math.nan
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

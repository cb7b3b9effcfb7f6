"""Write a recording as a C3D file: Intel byte order, floats, mm, N, N·mm, V."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from biodance.errors import BiodanceError
from biodance.lab.c3d import C3D_BLOCK, INTEL
from biodance.lab.c3d.subject import as_written
from biodance.lab.plain_text import write_whole
from biodance.lab.plates.decode import plate_axes
from biodance.records import Array, Markers, Plate, Trial, assign, freeze, frozen_array
from biodance.spatial import turned_wrench, wrench_about_point

FileValue = str | Sequence[str] | ArrayLike
_FileParameters = Mapping[str, Mapping[str, FileValue]]

_MOST = 255  # The longest dimension of a parameter: one byte tells it
_MM = 1000.0
_CHANNEL_KINDS = {1: "FFFLLM", 2: "FFFMMM", 3: "FFFFFFFF", 4: "VVVVVV"}
"""What each channel of a plate TYPE holds: force N, length m, moment N·m or volt."""
_DISK = {"F": (1.0, "N"), "L": (_MM, "mm"), "M": (_MM, "Nmm"), "V": (1.0, "V")}


@dataclass(frozen=True, eq=False)
class PlateRecording:
    """What one force plate recorded, as its amplifier gives it.

    ``type`` 1, 2, 3 or 4 (C3D force platform TYPE); ``corners`` (4, 3) m in the lab frame, in the order of the standard
    (+x+y, -x+y, -x-y, +x-y of the plate frame); ``origin`` (3,) m in the plate frame: TYPE 1, 2, 4 from the sensor's
    origin to the centre of the surface, TYPE 3 half the sensor distances and the depth; ``channels`` (S, C): TYPE 1 Fx
    Fy Fz N, Px Py m, Mz N·m; TYPE 2 Fx Fy Fz N, Mx My Mz N·m; TYPE 3 Fx12 Fx34 Fy14 Fy23 Fz1..4 N; TYPE 4 six V. Signs
    are stored as given. ``calibration`` (6, 6), TYPE 4 only: F = calibration @ V, three rows of N/V and three of N·m/V.
    ``labels`` of the channels; without any, ``Fx1`` and so on.
    """

    type: int
    corners: Array
    origin: Array
    channels: Array
    labels: tuple[str, ...] = ()
    calibration: Array | None = None

    def __post_init__(self) -> None:
        if self.type not in _CHANNEL_KINDS:
            raise BiodanceError(f"A plate of TYPE {self.type} cannot be written; legal are 1, 2, 3 and 4.")
        count = len(_CHANNEL_KINDS[self.type])
        channels = frozen_array(self.channels, (None, count), f"PlateRecording.channels of TYPE {self.type}")
        assign(self, channels=channels, labels=tuple(self.labels))
        freeze(self, "PlateRecording", corners=(4, 3), origin=(3,))
        if (self.type == 4) != (self.calibration is not None):
            raise BiodanceError(
                f"A plate of TYPE {self.type} has calibration {self.calibration}; TYPE 4 needs one, no other may have "
                f"one."
            )
        if self.calibration is not None:
            freeze(self, "PlateRecording", calibration=(6, 6))
        if self.labels and len(self.labels) != count:
            raise BiodanceError(f"A plate of TYPE {self.type} has {len(self.labels)} channel labels, expected {count}.")


def write_c3d(
    path: str | Path,
    *,
    markers: Markers | None,
    plates: Sequence[PlateRecording] = (),
    analog_rate: float = 0.0,
    parameters: _FileParameters | None = None,
    first_frame: int = 1,
) -> None:
    """Write markers (lab frame, m, NaN = not seen) and plates as a C3D file that all readers give back to float32
    precision.

    ``analog_rate`` Hz is a whole multiple of the markers' rate; ``markers=None`` writes plates alone. A single frame
    has no rate of its own: it takes ``analog_rate`` over its samples. ``parameters[GROUP][NAME]`` are added as they
    stand, in the units of the file (PROCESSING: Bodymass kg, Height mm), and overrule what this function would write,
    for example ``{"FORCE_PLATFORM": {"ZERO": [1, 100]}}``.

    Raises
    ------
    BiodanceError
        The file exists already, the rates or lengths do not fit each other, or a channel is not finite.
    """
    path = Path(path)
    samples = _samples(path, markers, plates, analog_rate)
    points = _points(markers, len(plates[0].channels) if markers is None and plates else 0)
    scaled = (plate.channels * [_DISK[kind][0] for kind in _CHANNEL_KINDS[plate.type]] for plate in plates)
    analog = np.concatenate([np.empty((len(points) * samples, 0)), *scaled], axis=1)
    if not np.isfinite(analog).all():
        row, column = np.argwhere(~np.isfinite(analog))[0]
        raise BiodanceError(
            f"{path}: analog channel {column + 1} is not finite at sample {row}; a C3D file holds finite numbers only."
        )
    rate = markers.rate if markers is not None and markers.time.size > 1 else analog_rate / max(samples, 1)
    if not (np.isfinite(rate) and rate > 0):
        raise BiodanceError(f"{path}: the rate would be {rate:g} Hz; give analog_rate > 0.")
    groups: dict[str, dict[str, FileValue]] = {
        "POINT": _point_group(markers, rate, len(points)),
        "ANALOG": _analog_group(plates, rate * samples),
        "FORCE_PLATFORM": _plate_group(plates),
        "TRIAL": {"ACTUAL_START_FIELD": _words(first_frame), "ACTUAL_END_FIELD": _words(first_frame + len(points) - 1)},
        "MANUFACTURER": {"COMPANY": "biodance", "SOFTWARE": "biodance"},
    }
    for group, values in (parameters or {}).items():
        groups.setdefault(group, {}).update(values)
    # The number does not change the length of the section: it is written twice.
    groups["POINT"]["DATA_START"] = 2 + len(_parameter_section(groups)) // C3D_BLOCK
    section = _parameter_section(groups)
    header = _header(points, analog, samples, first_frame, rate, 2 + len(section) // C3D_BLOCK)
    rows = np.concatenate([points.reshape(len(points), -1), analog.reshape(len(points), -1)], axis=1)
    data = rows.astype("<f4").tobytes()
    write_whole(path, header + section + data + bytes(-len(data) % C3D_BLOCK))


def _samples(path: Path, markers: Markers | None, plates: Sequence[PlateRecording], analog_rate: float) -> int:
    """Return the analog samples per frame after checking that rates and lengths fit."""
    if markers is None and not plates:
        raise BiodanceError(f"{path}: there is nothing to write, neither markers nor plates.")
    if not plates:
        return 0
    lengths = {len(plate.channels) for plate in plates}
    frames = markers.time.size if markers is not None else min(lengths)
    samples = round(min(lengths) / frames) if frames else 0
    if len(lengths) > 1 or samples < 1 or lengths != {samples * frames}:
        raise BiodanceError(
            f"{path}: plates have {sorted(lengths)} samples for {frames} frames; a whole number per frame is needed."
        )
    if markers is not None and markers.time.size > 1 and not np.isclose(analog_rate, samples * markers.rate, rtol=1e-4):
        raise BiodanceError(
            f"{path}: analog rate {analog_rate:g} Hz and {samples} samples per frame do not fit the markers' rate "
            f"{markers.rate:g} Hz."
        )
    return samples


def _points(markers: Markers | None, frames: int) -> Array:
    """Return (T, K, 4): x y z mm and residual 0, or 0 0 0 -1 where the marker was not seen."""
    if markers is None:
        return np.empty((frames, 0, 4))
    points = np.zeros((*markers.seen.shape, 4))
    points[..., :3] = np.where(markers.seen[..., None], _MM * markers.xyz, 0.0)
    points[..., 3] = np.where(markers.seen, 0.0, -1.0)
    return points


def _words(number: int) -> Array:
    """Return a frame number as two 16-bit words, low and high."""
    return np.array([number % 65536, number // 65536]).astype(np.uint16).astype(np.int16)  # type: ignore[return-value]


def _point_group(markers: Markers | None, rate: float, frames: int) -> dict[str, FileValue]:
    labels = list(markers.names) if markers is not None else []
    clipped = int(np.uint16(min(frames, 65535)).astype(np.int16))
    return {
        "USED": len(labels),
        "SCALE": -0.1,
        "RATE": float(rate),
        "DATA_START": 0,
        "FRAMES": clipped,
        "LABELS": labels,
        "DESCRIPTIONS": [""] * len(labels),
        "UNITS": ["mm"],
        "X_SCREEN": ["+X"],
        "Y_SCREEN": ["+Z"],
    }


def _analog_group(plates: Sequence[PlateRecording], rate: float) -> dict[str, FileValue]:
    names = {
        1: "Fx Fy Fz Px Py Mz",
        2: "Fx Fy Fz Mx My Mz",
        3: "Fx12 Fx34 Fy14 Fy23 Fz1 Fz2 Fz3 Fz4",
        4: "V1 V2 V3 V4 V5 V6",
    }
    labels = [
        label
        for number, plate in enumerate(plates, start=1)
        for label in plate.labels or [f"{name}{number}" for name in names[plate.type].split()]
    ]
    count = len(labels)
    return {
        "USED": count,
        "LABELS": labels,
        "DESCRIPTIONS": [""] * count,
        "GEN_SCALE": 1.0,
        "SCALE": np.ones(count),
        "OFFSET": np.zeros(count, dtype=int),
        "UNITS": [_DISK[kind][1] for plate in plates for kind in _CHANNEL_KINDS[plate.type]],
        "RATE": float(rate),
    }


def _plate_group(plates: Sequence[PlateRecording]) -> dict[str, FileValue]:
    count = len(plates)
    width = max((len(_CHANNEL_KINDS[plate.type]) for plate in plates), default=6)
    channel, matrix, first = np.zeros((width, count), dtype=int), np.zeros((6, 6, count)), 1
    for index, plate in enumerate(plates):
        size = len(_CHANNEL_KINDS[plate.type])
        channel[:size, index] = np.arange(first, first + size)
        first += size
        if plate.calibration is not None:
            # Rows of force stay N/V, those of moment become N·mm/V.
            matrix[:, :, index] = plate.calibration * np.repeat([1.0, _MM], 3)[:, None]
    group: dict[str, FileValue] = {
        "USED": count,
        "TYPE": np.array([plate.type for plate in plates], dtype=int),
        "ZERO": np.array([1, 0]),
        "CORNERS": np.reshape([_MM * plate.corners.T for plate in plates], (count, 3, 4)).transpose(1, 2, 0),
        "ORIGIN": np.reshape([_MM * plate.origin for plate in plates], (count, 3)).T,
        "CHANNEL": channel,
    }
    return group | ({"CAL_MATRIX": matrix} if any(plate.calibration is not None for plate in plates) else {})


def _header(points: Array, analog: Array, samples: int, first_frame: int, rate: float, data_block: int) -> bytes:
    """Return the first 512 bytes; frame numbers beyond 16 bits are clipped here and stand in the TRIAL group."""
    last = min(first_frame + len(points) - 1, 65535)
    words = [points.shape[1], samples * analog.shape[1], min(first_frame, 65535), last, 10]
    head = bytes([2, 0x50]) + np.array(words, dtype="<u2").tobytes() + np.array([-0.1], dtype="<f4").tobytes()
    tail = np.array([data_block, samples], dtype="<u2").tobytes() + np.array([rate], dtype="<f4").tobytes()
    return (head + tail).ljust(C3D_BLOCK, b"\0")


def _parameter_section(groups: _FileParameters) -> bytes:
    """Return the section: 4 bytes of header, every group with its parameters, padded to whole blocks."""
    records = []
    for number, (group, values) in enumerate(groups.items(), start=1):
        records.append(_record_bytes(group, -number, b""))
        for name, value in values.items():
            for part, (tail, piece) in enumerate(_pieces(value, f"{group}:{name}")):
                records.append(_record_bytes(f"{name}{part + 1}" if part else name, number, tail + piece))
    body = b"".join(records) + b"\0\0"
    blocks = -(-(len(body) + 4) // C3D_BLOCK)
    if blocks > _MOST:
        raise BiodanceError(f"The parameters need {blocks} blocks, a C3D file has room for {_MOST}. Store fewer.")
    return (bytes([1, 0x50, blocks, INTEL]) + body).ljust(blocks * C3D_BLOCK, b"\0")


def _record_bytes(name: str, group: int, data: bytes) -> bytes:
    """Return one record without a description; ``group`` < 0 defines a group, > 0 puts a parameter into it."""
    raw = name.encode("ascii")
    return bytes([len(raw), group & 0xFF]) + raw + (len(data) + 3).to_bytes(2, "little") + data + b"\0"


def _pieces(value: FileValue, what: str) -> list[tuple[bytes, bytes]]:
    """Return (type and dimensions, data) of a value, in pieces of at most 255 entries."""
    if isinstance(value, str):
        raw = value.encode()[:_MOST]
        return [(bytes([0xFF, 1, len(raw)]), raw)]
    if isinstance(value, Sequence) and all(isinstance(entry, str) for entry in value):
        rows = [str(entry).encode()[:_MOST] for entry in value]
        width = max((len(row) for row in rows), default=0)
        parts = [rows[i : i + _MOST] for i in range(0, len(rows), _MOST)] or [[]]
        return [(bytes([0xFF, 2, width, len(part)]), b"".join(row.ljust(width) for row in part)) for part in parts]
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or array.ndim > 7 or (array.ndim > 1 and max(array.shape) > _MOST):
        raise BiodanceError(
            f"Parameter {what} has values of type {array.dtype} and shape {array.shape}; text or numbers are legal."
        )
    if array.ndim <= 1:
        flat = np.atleast_1d(array)
        return [_number_piece(flat[i : i + _MOST]) for i in range(0, flat.size, _MOST)] or [_number_piece(flat)]
    return [_number_piece(array)]


def _number_piece(array: np.ndarray[Any, Any]) -> tuple[bytes, bytes]:
    whole = array.dtype.kind in "iu" and (array.size == 0 or -32768 <= array.min() <= array.max() <= 32767)
    shape = b"" if array.shape == (1,) else bytes(array.shape)
    data = array.astype("<i2" if whole else "<f4").tobytes(order="F")
    return bytes([2 if whole else 4, len(shape)]) + shape, data


def write_trial(trial: Trial, path: Path) -> None:
    """Write a trial as a C3D file: mm, N, N·mm, float32; z up; plates as TYPE 2 about the centres of their surfaces.

    The force in a plate's axes is the ground's action on the subject. What a trial holds beside markers, plates and
    measurements of the body is left out.

    Raises
    ------
    BiodanceError
        Markers and plates have rates that do not fit, a wrench is not finite, or the file exists.
    """
    plates = [plate_recording(plate) for plate in trial.plates]
    rate = trial.plates[0].wrench.rate if trial.plates else 0.0
    said = {"PROCESSING": as_written(trial.measurements)} if trial.measurements else None
    first = trial.source.first_frame
    write_c3d(path, markers=trial.markers, plates=plates, analog_rate=rate, first_frame=first, parameters=said)


def plate_recording(plate: Plate) -> PlateRecording:
    """Return what a plate of TYPE 2 records: the wrench in its own axes, about the centre of its surface."""
    own = turned_wrench(wrench_about_point(plate.wrench.value, plate.centre), plate_axes(plate.corners).T)
    return PlateRecording(2, plate.corners, np.zeros(3), own)

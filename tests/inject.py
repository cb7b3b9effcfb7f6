"""Write an instrument's fault into a copy of a REAL recording: exact ground truth on real skin, feet and cameras.

The copy has the bytes of the original everywhere but in the numbers that the fault changes: analog samples, marker
coordinates, corners of the plates. Parameters, labels, units and signs stay as the laboratory wrote them.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from biodance.errors import BiodanceError
from biodance.lab.c3d import DEC, MIPS, floats, integers, read_header
from biodance.lab.c3d.layout import Layout
from biodance.lab.c3d.raw import RawC3d, open_c3d, read_raw
from biodance.lab.c3d.write import PlateRecording
from biodance.lab.plates import PlateParameters, count_plates, plate_parameters
from biodance.lab.plates.read import decode_plates
from biodance.lab.plates.sense import gravity_sign, sensor_below, with_loads_on_plates
from biodance.lab.readers.c3d import file_frame
from biodance.records import Array, Markers
from biodance.virtual_lab.visit import Fault, Recording


@dataclass(frozen=True, eq=False)
class _Axes:
    """From the file's axes and unit to the lab's: ``metres`` per unit, ``turn`` (3, 3)."""

    metres: float
    turn: Array

    def lab(self, points: Array) -> Array:
        return self.metres * points @ self.turn.T

    def file(self, points: Array) -> Array:
        return points @ self.turn / self.metres


@dataclass(frozen=True, eq=False)
class _Stored:
    """How one plate is stored: its ``parameters``, ``factors`` (C,) to SI, ``sign`` (+1 reaction, -1 load) and SI
    ``recording``.
    """

    parameters: PlateParameters
    factors: Array
    sign: float
    recording: PlateRecording


def inject(path_in: Path, path_out: Path, fault: Fault) -> Path:
    """Write a copy of the C3D file ``path_in`` with ``fault`` in it to ``path_out`` and return that path.

    ``fault`` sees the file as a `Recording`: markers in m (lab frame, z up), plates in SI with the reaction on the
    subject, TYPE 2 and 4. It may change samples, coordinates and corners, not their number, labels or rates.

    Raises
    ------
    BiodanceError
        ``path_out`` exists, the file has plates of other types, or the fault changes what cannot be written into a
        copy.
    """
    if path_out.exists():
        raise BiodanceError(f"{path_out}: the file exists already and is not overwritten. Choose another name.")
    content = bytearray(path_in.read_bytes())
    raw = read_raw(path_in)
    _, _, layout, _ = open_c3d(path_in)
    header = read_header(bytes(content), str(path_in))
    metres, turn = file_frame(raw)
    names = _names(raw)
    seen = Markers(names, np.arange(len(raw.points)) / raw.rate, metres * raw.points)
    axes = _Axes(metres, turn)
    plates = _plates(raw, axes)
    markers = replace(seen, xyz=axes.lab(raw.points))
    before = Recording(path_in.stem, "fit", markers, tuple(plate.recording for plate in plates), raw.analog_rate, {})
    after = fault(before)
    _refuse_other_changes(path_in, before, after)
    rows = _rows(content, layout)
    _put_markers(rows, layout, raw.points, axes.file(after.markers.select(names).xyz))
    for stored, changed in zip(plates, after.plates, strict=True):
        _put_channels(rows, layout, stored, changed)
        _put_corners(content, header.data_start, layout, stored, axes.file(changed.corners))
    section = _bytes(rows, layout)
    content[layout.start : layout.start + len(section)] = section
    path_out.write_bytes(content)
    return path_out


def _plates(raw: RawC3d, axes: _Axes) -> tuple[_Stored, ...]:
    out = []
    for number in range(1, count_plates(raw)[0] + 1):
        plate = plate_parameters(raw, number, metres=axes.metres, turn=axes.turn)
        if plate.type not in (2, 4):
            raise BiodanceError(
                f"{raw.path}: plate {number} is of TYPE {plate.type}; faults are written into TYPE 2 and 4."
            )
        columns = list(plate.channels)
        factors = np.array(plate.factors)
        signals = raw.analog[:, columns] * (factors if plate.type == 2 else 1.0)
        matrix = None if plate.calibration is None else plate.calibration * factors[:, None]
        corners = axes.lab(plate.corners)
        decoded, _, _ = decode_plates(raw, [plate], metres=axes.metres, turn=axes.turn, mass=None)
        (reading,), _ = with_loads_on_plates(decoded)
        origin = sensor_below(reading.vector, reading.axes)[0]
        recording = PlateRecording(plate.type, corners, origin, signals, calibration=matrix)
        sign = -1.0 if gravity_sign(reading.sensor[reading.loaded], reading.axes) < 0 else 1.0
        out.append(_Stored(plate, factors, sign, replace(recording, channels=sign * signals)))
    return tuple(out)


def _names(raw: RawC3d) -> tuple[str, ...]:
    """Return the labels without the subject, with their column before them where they occur twice."""
    short = [label.rpartition(":")[2] for label in raw.labels]
    return tuple(label if short.count(label) == 1 else f"{column}:{label}" for column, label in enumerate(short))


def _refuse_other_changes(path: Path, before: Recording, after: Recording) -> None:
    same = (
        set(before.markers.names) == set(after.markers.names)
        and np.array_equal(before.markers.time, after.markers.time)
        and np.array_equal(before.analog_rate, after.analog_rate, equal_nan=True)
        and before.parameters == after.parameters
        and all(a.channels.shape == b.channels.shape for a, b in zip(before.plates, after.plates, strict=True))
    )
    if not same:
        raise BiodanceError(
            f"{path}: this fault changes rates, lengths, labels or typed measures; only numbers can be written into a "
            f"copy."
        )


def _rows(content: bytearray, layout: Layout) -> Array:
    """Return a copy of the data section (frames, words) as numbers."""
    words = layout.frames * (4 * layout.points + layout.channels * layout.samples)
    section = bytes(content[layout.start : layout.start + (4 if layout.floating else 2) * words])
    if layout.floating:
        numbers = floats(section, layout.processor)
    else:
        numbers = integers(section, layout.processor, "u2" if layout.unsigned else "i2")
    return numbers.reshape(layout.frames, -1).copy()


def _bytes(numbers: Array, layout: Layout) -> bytes:
    """Return numbers as the file's processor stores them; DEC: exponent two larger, words exchanged (inverse of
    ``lab.floats``).
    """
    if numbers.dtype.kind != "f":
        return numbers.tobytes()
    if layout.processor != DEC:
        return np.ascontiguousarray(numbers, dtype=">f4" if layout.processor == MIPS else "<f4").tobytes()
    bits = (np.ascontiguousarray(numbers, dtype=np.float32) * np.float32(4.0)).view(np.uint32)
    return np.stack([bits >> 16, bits & 0xFFFF], axis=-1).astype("<u2").tobytes()


def _put_markers(rows: Array, layout: Layout, before: Array, after: Array) -> None:
    """Overwrite the points (T, K, 3) that changed; both in file units and axes."""
    changed = ~(np.isclose(after, before, rtol=0, atol=1e-5) | (np.isnan(after) & np.isnan(before))).all(axis=2)
    seen = np.isfinite(after).all(axis=2, keepdims=True)
    places = np.where(seen, after, 0.0) / (1.0 if layout.floating else layout.scale)
    quads = np.concatenate([places, seen - 1.0], axis=2)
    points = rows[:, : 4 * layout.points].reshape(*changed.shape, 4)
    points[changed] = (quads if layout.floating else np.round(quads))[changed]
    rows[:, : 4 * layout.points] = points.reshape(layout.frames, -1)


def _put_channels(rows: Array, layout: Layout, stored: _Stored, changed: PlateRecording) -> None:
    moved = np.any(changed.channels != stored.recording.channels, axis=0)
    factors = stored.factors if stored.parameters.type == 2 else np.ones(6)
    samples = rows[:, 4 * layout.points :].reshape(layout.frames * layout.samples, layout.channels)
    for k in np.flatnonzero(moved):
        column = stored.parameters.channels[k]
        number = stored.sign * changed.channels[:, k] / factors[k] / layout.gain[column] + layout.offset[column]
        samples[:, column] = number if layout.floating else np.round(number)
    rows[:, 4 * layout.points :] = samples.reshape(layout.frames, -1)


def _put_corners(content: bytearray, stop: int, layout: Layout, stored: _Stored, corners: Array) -> None:
    """Overwrite the twelve floats of a plate's ``corners`` (4, 3), file units and axes, where they stand in the
    parameter section.
    """
    written = stored.parameters.corners
    if np.allclose(corners, written, rtol=0, atol=1e-4):
        return
    old, new = _bytes(written.ravel(), layout), _bytes(corners.ravel(), layout)
    if content.count(old, 0, stop) != 1:
        raise BiodanceError(
            f"Plate {stored.parameters.number}: its corners stand in the file {content.count(old, 0, stop)} times."
        )
    at = content.find(old, 0, stop)
    content[at : at + len(new)] = new

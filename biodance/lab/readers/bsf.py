"""AMTI NetForce: force plates in a binary file."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.errors import FileRefused
from biodance.lab.plain_text import LARGEST_NUMBER, read_bytes, sha256
from biodance.lab.plates import INCH, POUND
from biodance.lab.plates.decode import DEEPEST, LONGEST_SIDE, SHORTEST_SIDE
from biodance.lab.readers.amti_text import PLATE_UPRIGHT, amti_plate
from biodance.records import Array, Role, Source, Trial
from biodance.settings import STANDARD_GRAVITY

NAME = "AMTI NetForce"
EXTENSIONS = (".bsf",)
PREFERENCE = 30


def sniff(head: bytes) -> bool:
    """Return whether the head begins with a version of NetForce."""
    return len(head) >= 8 and struct.unpack("<i", head[:4])[0] in _SAMPLE


def _layout(text: str) -> Any:
    """Return the packed little-endian record of ``name type [count]`` entries between commas."""
    entries = [entry.split() for entry in text.split(",")]
    return np.dtype(
        [(name, kind if kind[0] == "S" else "<" + kind, *map(int, count)) for name, kind, *count in entries]
    )


MAIN = _layout(
    "version i4, size i4, plates i4, instruments i4, name S100, date S12, birth S12, weight f8, height f8, sex S4, "
    "trials i4, seconds f8, zero_method i4, weight_method i4, delay i4, trigger_method i4, trigger_channel i4, before "
    "i4, after i4, trigger_value f8, gap S4, rate i4, protocol S150, test S200, comments S150, description S150, "
    "examiner S100, gap2 S2, metric i4"
)
INSTRUMENT = _layout(
    "size i4, serial i4, layout i4, model S20, channels i4, indices i4 4, length f4, width f4, offset f4 3, "
    "sensitivity f4 32, numbers i4 32, turn f4 16, distance f4 3, gain f4 32, excitation f4 32, counts_per_volt f4 32, "
    "timing f4 5, zero i4 32, rate i4, trigger f4, end f4"
)
_SAMPLE = {100: np.dtype("<i2"), 105: np.dtype("<f8")}
_MOST_PLATES = 16


def _load(block: NDArray[Any], header: Any, version: int, where: str) -> Array:
    """Return the load (S, 6) N, N·m on a plate, plate axes, from its samples as stored."""
    factor = np.ones(6)
    if version == 100:  # lbf, in·lbf a count
        told = ("sensitivity", "gain", "excitation", "counts_per_volt")
        product = np.prod([header[name][:6].astype(float) for name in told], axis=0)
        if not ((np.abs(product) <= LARGEST_NUMBER**2) & (np.abs(product) >= 1 / LARGEST_NUMBER)).all():
            raise FileRefused(
                f"{where} holds ADC counts but a calibration value is 0 or no number. Enter the calibration in "
                f"NetForce and save again."
            )
        # Counts over counts a volt and gain: volts of the bridge; the sensitivity is µV per volt of excitation a unit.
        factor = 1e6 / product
    return block.astype(float) * factor * np.array([POUND] * 3 + [POUND * INCH] * 3)


def _main_header(content: bytes, path: Path) -> Any:
    """Return the main header after checking every count in it."""
    if len(content) < MAIN.itemsize:
        raise FileRefused(
            f"{path}: has {len(content)} bytes, the header of a .bsf file alone has {MAIN.itemsize}. The file is cut "
            f"off: copy it again."
        )
    main = np.frombuffer(content, MAIN, 1)[0]
    if int(main["version"]) not in _SAMPLE:
        raise FileRefused(
            f"{path}: is no .bsf file of version 100 or 105 (it says {int(main['version'])}). Check what the file is."
        )
    legal = {
        "number of plates": (int(main["plates"]), 1, _MOST_PLATES),
        "number of other instruments": (int(main["instruments"]), 0, _MOST_PLATES),
        "rate": (int(main["rate"]), 1, 100_000),
        "header size": (int(main["size"]), MAIN.itemsize - 4, 100 * MAIN.itemsize),
    }
    for what, (value, low, high) in legal.items():
        if not low <= value <= high:
            raise FileRefused(
                f"{path}: the {what} is {value}, legal are {low} to {high}. The file is damaged: export it again."
            )
    if not 0 < float(main["seconds"]) < 1e6:
        raise FileRefused(
            f"{path}: the trial lasts {float(main['seconds']):g} s. The file is damaged: export it again."
        )
    return main


def _instruments(content: bytes, main: Any, path: Path) -> tuple[list[Any], int]:
    """Return the headers of all plates and instruments and the byte after the last one."""
    at, headers = 4 + int(main["size"]), []
    for number in range(int(main["plates"]) + int(main["instruments"])):
        if at + INSTRUMENT.itemsize > len(content):
            raise FileRefused(
                f"{path}: ends inside the header of instrument {number + 1}. The file is cut off: copy it again."
            )
        header = np.frombuffer(content, INSTRUMENT, 1, offset=at)[0]
        if (
            not INSTRUMENT.itemsize <= int(header["size"]) <= 10 * INSTRUMENT.itemsize
            or not 1 <= int(header["channels"]) <= 32
        ):
            raise FileRefused(
                f"{path}: the header of instrument {number + 1} says {int(header['size'])} bytes and "
                f"{int(header['channels'])} channels. Export it again."
            )
        headers.append(header)
        at += int(header["size"])
    return headers, at


def _data(content: bytes, samples: int, channels: int, kind: Any, start: int, headers: int, path: Path) -> NDArray[Any]:
    """Return the samples (S, C) after checking that exactly that many bytes follow the headers."""
    need, found = samples * channels * kind.itemsize, len(content) - start
    if found != need or not samples:
        raise FileRefused(
            f"{path}: {found} bytes follow the {headers + 1} headers, {samples} samples of {channels} channels need "
            f"{need}. The file is cut off or damaged: copy or export it again."
        )
    data = np.frombuffer(content, kind, samples * channels, offset=start).reshape(samples, channels)
    wrong = np.logical_not(np.abs(data) <= LARGEST_NUMBER)
    if wrong.any():
        at = int(np.argwhere(wrong)[0][0]) + 1
        raise FileRefused(f"{path}: sample {at} is not a number that a plate records. Export it again.")
    return data


def read(path: str | Path, *, role: Role = "fit", subject: str | None = None) -> Trial:
    """Read a NetForce .bsf file, version 100 or 105, as a trial without markers.

    The wrench is the ground's action ON the subject in N, N·m about the lab origin: the centre of the first plate's
    surface, x as the plate's x, z up.

    Raises
    ------
    FileRefused
        The file is missing, damaged or cut off, has another version, or a plate has no calibration or an impossible
        size.
    """
    path = Path(path)
    content = read_bytes(path)
    main = _main_header(content, path)
    version, rate, plates, warnings, centre = int(main["version"]), float(main["rate"]), [], [], np.zeros(3)
    headers, end = _instruments(content, main, path)
    channels, count = [int(header["channels"]) for header in headers], int(main["plates"])
    samples, first = round(float(main["seconds"]) * int(main["rate"])), np.concatenate([[0], np.cumsum(channels)])
    data = _data(content, samples, sum(channels), _SAMPLE[version], end, len(headers), path)
    stored = "ADC counts times the calibration in the header" if version == 100 else "engineering units"
    for i, header in enumerate(headers[:count]):
        where = f"{path}: plate {i + 1}"
        if channels[i] != 6:
            raise FileRefused(
                f"{where} has {channels[i]} channels, legal are 6 (Fx to Mz). Export the trial as text instead."
            )
        load = _load(data[:, first[i] : first[i] + 6], header, version, where)
        size = (float(header["width"]) * INCH, float(header["length"]) * INCH)
        offset, distance = header["offset"].astype(float) * INCH, header["distance"].astype(float) * INCH
        _refuse_nonsense(size, offset, where)
        if i:
            centre = centre + PLATE_UPRIGHT @ distance
            warnings.append(_placed(PLATE_UPRIGHT @ distance, i + 1))
        model = bytes(header["model"]).split(b"\0")[0].decode("latin-1").strip()
        name = f"{model or 'Plate'}, serial {int(header['serial'])}"
        said = (f"{name}: {stored}; lbf and in·lbf were converted to N and N·m.",)
        done, odd = amti_plate(i + 1, load, size, centre, offset, rate=rate, said=said)
        plates.append(done)
        warnings += odd
    history = [f"AMTI NetForce file, version {version}, {rate:g} Hz."]
    if others := sum(channels[count:]):
        history.append(f"{others} channels of other instruments were not read.")
    source = Source(path, sha256(content), f"AMTI .bsf {version}", analog_rate=rate)
    # the subject's mass (kg) and height (m), where they make sense
    mass, height = float(main["weight"]), float(main["height"])
    if not int(main["metric"]):
        mass, height = mass * POUND / STANDARD_GRAVITY, height * INCH
    elif height > 3:
        height /= 100
    measures = {"Bodymass": mass} if 10 <= mass <= 300 else {}
    measures |= {"Height": height} if 0.5 <= height <= 2.5 else {}
    return Trial(path.stem, role, None, tuple(plates), source, "", measures, tuple(history), tuple(warnings))


def _refuse_nonsense(size: tuple[float, float], offset: Array, where: str) -> None:
    if not SHORTEST_SIDE <= min(size) <= max(size) <= LONGEST_SIDE:
        raise FileRefused(
            f"{where} is {size[0]:.3g} x {size[1]:.3g} m, legal are sides of {SHORTEST_SIDE:g} to {LONGEST_SIDE:g} m. "
            f"Enter the plate's size in NetForce and save again."
        )
    if not np.abs(offset).max() <= DEEPEST:
        path, _, plate = where.rpartition(": ")
        raise FileRefused(
            f"{path}: the sensor of {plate} is said to lie {np.abs(offset).max():.3g} m off. Correct its offset in "
            f"NetForce."
        )


def _placed(away: Array, number: int) -> str:
    if not away.any():
        return (
            f"Plate {number}: the file says no distance to the plate before it, so both lie at one place. Enter "
            f"it in NetForce."
        )
    return (
        f"Plate {number} was put ({', '.join(f'{d:.3g}' for d in away)}) m from the plate before it, as the file "
        f"says. Check that."
    )

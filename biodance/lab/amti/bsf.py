"""The bytes of AMTI NetForce's .bsf files, version 100 (ADC counts) and 105 (engineering units); little-endian,
imperial units throughout.

Layout: NetForce manual, appendix B, as read by the Biomechanical ToolKit (version 100) and BMC's AMTIbsf (version 105).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.errors import FileRefused
from biodance.lab.plain_text import LARGEST_NUMBER
from biodance.lab.plates.parameters import INCH, POUND
from biodance.records import Array


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
IMPERIAL = np.array([POUND] * 3 + [POUND * INCH] * 3)
_MICROVOLT = 1e6
MOST_PLATES, MOST_CHANNELS, FASTEST = 16, 32, 100_000


@dataclass(frozen=True, eq=False)
class BsfPlate:
    """One plate: ``load`` (S, 6) N, N·m applied to it, plate axes; ``size`` (x, y) m; ``offset``, ``distance`` (3,)
    m from the header.
    """

    model: str
    serial: int
    size: tuple[float, float]
    offset: Array
    distance: Array
    load: Array


@dataclass(frozen=True, eq=False)
class BsfContent:
    """What a .bsf file holds: ``version``, ``rate`` Hz, ``main`` header record, ``plates``, and the other
    instruments' channel count.
    """

    version: int
    rate: float
    main: Any
    plates: tuple[BsfPlate, ...]
    other_channels: int


def parse_bsf(content: bytes, path: Path) -> BsfContent:
    """Return the content of a .bsf file in SI units.

    Raises
    ------
    FileRefused
        The bytes are no .bsf file of version 100 or 105, the sizes contradict each other, or a plate has no
        calibration.
    """
    main = _main_header(content, path)
    version, rate = int(main["version"]), int(main["rate"])
    headers, end = _instruments(content, main, path)
    channels = [int(h["channels"]) for h in headers]
    samples = round(float(main["seconds"]) * rate)
    data = _data(content, samples, sum(channels), _SAMPLE[version], end, len(headers), path)
    first = np.concatenate([[0], np.cumsum(channels)])
    plates = []
    for i, header in enumerate(headers[: int(main["plates"])]):
        if channels[i] != 6:
            raise FileRefused(
                f"{path}: plate {i + 1} has {channels[i]} channels, legal are 6 (Fx to Mz). Export the trial as text "
                f"instead."
            )
        block = data[:, first[i] : first[i] + 6].astype(float)
        factor = _counts_to_pounds(header, i + 1, path) if version == 100 else np.ones(6)
        plates.append(_plate(header, block * factor * IMPERIAL))
    return BsfContent(version, float(rate), main, tuple(plates), sum(channels[int(main["plates"]) :]))


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
        "number of plates": (int(main["plates"]), 1, MOST_PLATES),
        "number of other instruments": (int(main["instruments"]), 0, MOST_PLATES),
        "rate": (int(main["rate"]), 1, FASTEST),
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
            or not 1 <= int(header["channels"]) <= MOST_CHANNELS
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


def _counts_to_pounds(header: Any, number: int, path: Path) -> Array:
    """Return (6,) lbf, in·lbf a count: 1e6 / (sensitivity * gain * excitation * counts per volt)."""
    product = np.prod(
        [header[name][:6].astype(float) for name in ("sensitivity", "gain", "excitation", "counts_per_volt")], axis=0
    )
    if not (np.abs(product) <= LARGEST_NUMBER**2).all() or (np.abs(product) < 1 / LARGEST_NUMBER).any():
        raise FileRefused(
            f"{path}: plate {number} holds ADC counts but a calibration value is 0 or no number. Enter the "
            f"calibration in NetForce and save again."
        )
    return _MICROVOLT / product


def _plate(header: Any, load: Array) -> BsfPlate:
    model = bytes(header["model"]).split(b"\0")[0].decode("latin-1").strip()
    size = (float(header["width"]) * INCH, float(header["length"]) * INCH)
    offset, distance = header["offset"].astype(float) * INCH, header["distance"].astype(float) * INCH
    return BsfPlate(model, int(header["serial"]), size, offset, distance, load)

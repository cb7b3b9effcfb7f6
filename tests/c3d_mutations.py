"""Damage C3D files and judge what the reader makes of them: a refusal, or the right numbers, never another ending."""

from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np
from hypothesis import strategies as st

from biodance.errors import BiodanceError
from biodance.lab.c3d.raw import RawC3d, read_raw
from biodance.lab.readers import c3d
from biodance.records import Trial


@dataclass(frozen=True)
class Original:
    """A sound file with what it holds; ``stored`` (S, C) are the analog numbers before gain and offset."""

    content: bytes
    raw: RawC3d
    trial: Trial
    stored: np.ndarray

    @property
    def data_start(self):
        order = "big" if self.content[515] == 86 else "little"
        return 512 * (int.from_bytes(self.content[16:18], order) - 1)


def original(path: Path):
    """Return a sound file with what its bytes and its parameters mean."""
    raw = read_raw(path)
    gain, offset = transform(raw, raw.analog.shape[1])
    return Original(path.read_bytes(), raw, c3d.read_c3d(path), raw.analog / gain + offset)


def transform(raw, channels):
    """Return gain and offset (C,) as the parameters say."""
    if not channels:
        return np.ones(0), np.zeros(0)
    group = raw.parameters["ANALOG"]
    general, scale, offset = (np.ravel(group[name], order="F") for name in ("GEN_SCALE", "SCALE", "OFFSET"))
    unsigned = "UNSIGNED" in [text.upper() for text in group.get("FORMAT", [])]
    offset = np.where((offset < 0) & unsigned, offset + 65536, offset)
    return scale[:channels] * general[0], offset[:channels]


@dataclass(frozen=True)
class Damage:
    """What happens to a file: its ``kind``; ``places`` (3,) as shares of where that may be, the ``count`` first of them
    hit by ``values``; the ``word`` put in, the ``size`` of a piece lost or doubled, the ``extra`` bytes at the end.

    Every damage is drawn whole, whatever its kind needs, so that hypothesis sees one shape of examples.
    """

    kind: str
    places: tuple[float, ...]
    values: tuple[int, ...]
    count: int
    word: int
    size: int
    extra: bytes


DAMAGES = st.builds(
    Damage,
    kind=st.sampled_from(["header", "parameters", "parameters", "word", "cut", "add", "lose", "double", "anywhere"]),
    places=st.tuples(*[st.floats(0.0, 1.0, exclude_max=True)] * 3),
    values=st.tuples(*[st.sampled_from([0, 1, 2, 127, 128, 255]) | st.integers(0, 255)] * 3),
    count=st.integers(1, 3),
    word=st.sampled_from([0, 1, 2, 255, 256, 32767, 32768, 65535]),
    size=st.sampled_from([1, 2, 16, 512]),
    extra=st.binary(min_size=1, max_size=2000),
)


def damaged(first: Original, one: Damage) -> bytes:
    """Return the content with some bytes of header or parameters overwritten, or with a piece of the file missing,
    doubled or added.
    """
    raw, start, place = bytearray(first.content), first.data_start, one.places[0]
    if one.kind in ("header", "parameters", "anywhere"):
        low, high = {"header": (0, 24), "parameters": (512, start), "anywhere": (0, len(raw))}[one.kind]
        for share, value in list(zip(one.places, one.values, strict=True))[: one.count]:
            raw[low + int(share * (high - low))] = value
    elif one.kind == "word":
        at = 2 * int(12 * one.places[1]) if place < 0.5 else 512 + int((2 * place - 1) * (start - 514))
        raw[at : at + 2] = one.word.to_bytes(2, "little")
    elif one.kind == "cut":
        raw = raw[: int(place * (len(raw) + 1))]
    elif one.kind == "add":
        raw += one.extra
    else:
        at = 512 + int(place * (start - 511))
        raw[at : at + one.size] = raw[at : at + one.size] * 2 if one.kind == "double" else b""
    return bytes(raw)


def judge(first: Original, content: bytes, path: Path):
    """Read ``content``; raise AssertionError if it is accepted with numbers other than its intact data and its
    parameters mean.
    """
    path.write_bytes(content)
    try:
        raw = read_raw(path)
        with patch.object(c3d, "read_raw", return_value=raw):  # once is enough: a second judge is a process of its own
            trial = c3d.read_c3d(path)
    except BiodanceError as refusal:
        assert len(str(refusal)) > 20  # noqa: PT017
        return "refused"
    start = first.data_start
    if not content[start:].startswith(first.content[start:]):
        return "other data"
    said = " ".join((*raw.warnings, *trial.warnings))
    frames = len(first.raw.points)
    if "FRAMES" not in first.raw.parameters.get("POINT", {}) and len(raw.points) < frames:
        frames = len(
            raw.points
        )  # the header alone tells the count, and the rest could be padding: the numbers must be right all the same
    np.testing.assert_allclose(
        raw.points, first.raw.points[:frames], rtol=2e-6
    )  # the two scales of an integer file may differ that much
    said_of_scales = any(word in said for word in ("ANALOG:GEN_SCALE", "ANALOG:SCALE", "ANALOG:OFFSET"))
    if not said_of_scales:
        judge_analog(first, raw, frames)
    for name in ("rate", "analog_rate"):
        same = np.allclose(getattr(raw, name), getattr(first.raw, name), rtol=1e-3, equal_nan=True)
        assert same or "Rates in Hz" in said, name
    assert frames < len(first.raw.points) or raw.first_frame == first.raw.first_frame or "first frame" in said.lower()
    judge_markers(first.trial, trial, said)
    return "accepted"


def judge_analog(first, raw, frames):
    """Analog numbers are the stored ones, scaled as the parameters say."""
    gain, offset = transform(raw, raw.analog.shape[1])
    expected = (first.stored[: len(first.stored) * frames // len(first.raw.points)] - offset) * gain
    assert raw.analog.shape == expected.shape
    with np.errstate(invalid="ignore", over="ignore"):
        np.testing.assert_allclose(raw.analog, expected, rtol=1e-5, atol=1e-30 + 1e-6 * np.abs(expected).max(initial=0))


def judge_markers(first, trial, said):
    """Markers that kept their label are where they were, unless the reader says that it decided about units, axes or
    labels.
    """
    if first.markers is None or trial.markers is None or "Rates in Hz" in said:
        return
    for name in set(first.markers.names) & set(trial.markers.names):
        same = np.allclose(first.markers[name], trial.markers[name], rtol=1e-6, atol=1e-9, equal_nan=True)
        assert same or any(word in said for word in ("POINT:UNITS", "Up is", "Label")), name

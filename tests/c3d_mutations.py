"""Damage C3D files and judge what the reader makes of them: a refusal, or the right numbers, never another ending."""

from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np
from hypothesis import strategies as st

from biodance.errors import BiodanceError
from biodance.lab.c3d import read
from biodance.lab.c3d.raw import RawC3d, read_raw
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
    return Original(path.read_bytes(), raw, read.read_c3d(path), raw.analog / gain + offset)


def transform(raw, channels):
    """Return gain and offset (C,) as the parameters say."""
    if not channels:
        return np.ones(0), np.zeros(0)
    group = raw.parameters["ANALOG"]
    general, scale, offset = (np.ravel(group[name], order="F") for name in ("GEN_SCALE", "SCALE", "OFFSET"))
    unsigned = "UNSIGNED" in [text.upper() for text in group.get("FORMAT", [])]
    offset = np.where((offset < 0) & unsigned, offset + 65536, offset)
    return scale[:channels] * general[0], offset[:channels]


@st.composite
def mutations(draw, content, start):
    """Return the content with some bytes of header or parameters overwritten, or with a piece of the file missing,
    doubled or added.
    """
    kind = draw(
        st.sampled_from(["header", "parameters", "parameters", "word", "cut", "add", "lose", "double", "anywhere"])
    )
    raw = bytearray(content)
    if kind in ("header", "parameters", "anywhere"):
        low, high = {"header": (0, 24), "parameters": (512, start), "anywhere": (0, len(raw))}[kind]
        for _ in range(draw(st.integers(1, 3))):
            raw[draw(st.integers(low, high - 1))] = draw(
                st.sampled_from([0, 1, 2, 127, 128, 255]) | st.integers(0, 255)
            )
    elif kind == "word":
        at = draw(st.sampled_from(range(0, 24, 2)) | st.integers(512, start - 2))
        raw[at : at + 2] = draw(st.sampled_from([0, 1, 2, 255, 256, 32767, 32768, 65535])).to_bytes(2, "little")
    elif kind == "cut":
        raw = raw[: draw(st.integers(0, len(raw)))]
    elif kind == "add":
        raw += draw(st.binary(min_size=1, max_size=2000))
    else:
        at, size = draw(st.integers(512, start)), draw(st.sampled_from([1, 2, 16, 512]))
        raw[at : at + size] = raw[at : at + size] * 2 if kind == "double" else b""
    return bytes(raw)


def judge(first: Original, content: bytes, path: Path):
    """Read ``content``; raise AssertionError if it is accepted with numbers other than its intact data and its
    parameters mean.
    """
    path.write_bytes(content)
    try:
        raw = read_raw(path)
        with patch.object(read, "read_raw", return_value=raw):  # once is enough: a second judge is a process of its own
            trial = read.read_c3d(path)
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

"""Lay down C3D files byte by byte for the tests, in every byte order and storage, without any code of the reader
under test.
"""

import struct
from dataclasses import dataclass, field

import numpy as np

INTEL, DEC, MIPS = 84, 85, 86


def dec_float(value):
    """Return VAX F bytes: exponent biased by 128 instead of 126, 16-bit words in the other order."""
    low, high = struct.unpack("<HH", struct.pack("<f", np.float32(value) * 4))
    return struct.pack("<HH", high, low)


def pack_floats(values, processor):
    """Return numbers as the bytes of a processor's 4-byte floats."""
    values = np.asarray(values, dtype=np.float32).ravel()
    if processor == DEC:
        return b"".join(map(dec_float, values))
    return values.astype(">f4" if processor == MIPS else "<f4").tobytes()


def pack_words(values, processor):
    """Return integers as the bytes of a processor's 16-bit words."""
    return (
        (np.asarray(values).ravel().astype(np.int64) & 0xFFFF).astype(">u2" if processor == MIPS else "<u2").tobytes()
    )


def text(*rows):
    """Return a text parameter: kind, shape and bytes."""
    width = max((len(row) for row in rows), default=0)
    return ("text", (width, len(rows)), "".join(row.ljust(width) for row in rows).encode())


def whole(*values, shape=None):
    """Return an integer parameter: kind, shape and values."""
    return ("whole", shape or (len(values),), values)


def real(*values, shape=None):
    """Return a floating point parameter: kind, shape and values."""
    return ("real", shape or (len(values),), values)


@dataclass
class File:
    """A C3D file to be: points (T, K, 4) as stored (x y z residual), analog (T * samples, C) as stored numbers."""

    points: np.ndarray
    analog: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    processor: int = INTEL
    scale: float = -1.0  # < 0: floats
    rate: float = 100.0
    first: int = 1
    header: dict = field(default_factory=dict)
    parameters: dict = field(
        default_factory=dict
    )  # overrules: {"GROUP": {"NAME": text(...) | whole(...) | real(...) | None}}

    def bytes(self):
        frames, count = self.points.shape[:2]
        channels = self.analog.shape[1]
        samples = len(self.analog) // frames if channels else 0
        groups = {
            "POINT": {
                "USED": whole(count),
                "SCALE": real(self.scale),
                "RATE": real(self.rate),
                "DATA_START": whole(0),
                "FRAMES": whole(frames),
                "LABELS": text(*(f"M{i}" for i in range(min(count, 255)))),
                "UNITS": text("mm"),
            },
            "ANALOG": {
                "USED": whole(channels),
                "LABELS": text(*(f"A{i}" for i in range(channels))),
                "GEN_SCALE": real(1.0),
                "SCALE": real(*np.ones(channels)),
                "OFFSET": whole(*np.zeros(channels, dtype=int)),
                "UNITS": text(*["V"] * channels),
                "RATE": real(self.rate * samples),
            },
        }
        for group, values in self.parameters.items():
            groups[group] = {k: v for k, v in (groups.get(group, {}) | values).items() if v is not None}
        if "DATA_START" in groups["POINT"] and groups["POINT"]["DATA_START"] == whole(0):
            groups["POINT"]["DATA_START"] = whole(2 + len(self.section(groups)) // 512)
        section = self.section(groups)
        fields = {
            "points": count,
            "values": samples * channels,
            "first": self.first,
            "last": self.first + frames - 1,
            "scale": self.scale,
            "start": 2 + len(section) // 512,
            "samples": samples,
            "rate": self.rate,
        } | self.header
        words = [fields[k] for k in ("points", "values", "first", "last")] + [0]
        head = b"\x02\x50" + pack_words(words, self.processor) + pack_floats([fields["scale"]], self.processor)
        head += pack_words([fields["start"], fields["samples"]], self.processor) + pack_floats(
            [fields["rate"]], self.processor
        )
        rows = np.concatenate([self.points.reshape(frames, -1), self.analog.reshape(frames, -1)], axis=1)
        data = pack_floats(rows, self.processor) if self.scale < 0 else pack_words(np.round(rows), self.processor)
        return head.ljust(512, b"\0") + section + data + bytes(-len(data) % 512)

    def section(self, groups):
        body = b""
        for number, (group, values) in enumerate(groups.items(), start=1):
            body += struct.pack("bb", len(group), -number) + group.encode() + self.tail(b"")
            for name, (kind, shape, content) in values.items():
                code, data = {
                    "text": (-1, lambda c: c),
                    "whole": (2, lambda c: pack_words(c, self.processor)),
                    "real": (4, lambda c: pack_floats(c, self.processor)),
                }[kind]
                record = struct.pack("bB", code, len(shape)) + bytes(shape) + data(content)
                body += struct.pack("bb", len(name), number) + name.encode() + self.tail(record)
        blocks = -(-(len(body) + 6) // 512)
        return (bytes([1, 0x50, blocks, self.processor]) + body).ljust(512 * blocks, b"\0")

    def tail(self, record):
        return pack_words([len(record) + 3], self.processor) + record + b"\0"

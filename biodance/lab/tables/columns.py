"""Which column of a table is the time, which three are a marker, which six a force plate: by the labels, however they
are spelled (``LASIx``, ``LASI_X``, ``LASI.x``, ``X LASI``; ``Fx1``, ``FP1_Fx``, ``Force_X_1``).
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from biodance.lab.plates.parameters import channel_groups

_TIME = re.compile(
    r"(?:time|t|time[\s_]?stamps?|stamps?|elapsed(?:[\s_]?time)?|seconds?|secs?)"
    r"(?:[\s_.]*(s|secs?|seconds?|ms|msecs?|milliseconds?|us|µs|ns))?",
    flags=re.IGNORECASE,
)
_BEHIND = re.compile(r"(.+?)[\s_.:\-]*([xyz])(?:[\s_.]+(mm|cm|m))?", flags=re.IGNORECASE)
_BEFORE = re.compile(r"([xyz])[\s_.:\-]+(.+?)(?:[\s_.]+(mm|cm|m))?", flags=re.IGNORECASE)
_TURNED = re.compile(r"(force|moment|torque)[\s_.]*([xyz])|(?<![A-Za-z])(t)([xyz])(?![a-z])", flags=re.IGNORECASE)
FEWEST_MARKERS = 3
"""Markers that a table must hold: fewer have no frame."""


@dataclass(frozen=True)
class TableColumns:
    """``time`` column, None = none, and the unit that its label says; ``markers`` label -> columns of x, y, z, and the
    ``length`` unit their labels say; ``plates`` columns of Fx Fy Fz Mx My Mz of each; ``others`` labels of columns that
    are none of these; ``broken`` markers of which an axis is missing.
    """

    time: int | None
    time_unit: str
    markers: dict[str, tuple[int, int, int]]
    length: str
    plates: tuple[tuple[int, ...], ...]
    others: tuple[str, ...]
    broken: tuple[str, ...]


def columns_in(labels: Sequence[str]) -> TableColumns:
    """Return what the columns with these ``labels`` hold."""
    times = [(k, match) for k, label in enumerate(labels) if (match := _TIME.fullmatch(label))]
    time = times[0][0] if times else None
    forces = [_as_channel(label) for label in labels]
    plates = tuple(group for group in channel_groups(forces) if len(group) == 6)
    taken = {*(k for group in plates for k in group), *([time] if time is not None else [])}
    free = [k for k in range(len(labels)) if k not in taken]
    behind, before = (_triples(labels, free, pattern, axis) for pattern, axis in ((_BEHIND, 2), (_BEFORE, 1)))
    found, length = max((behind, before), key=lambda some: sum(len(axes) == 3 for axes in some[0].values()))
    markers = {name: (axes["x"], axes["y"], axes["z"]) for name, axes in found.items() if len(axes) == 3}
    broken = tuple(name for name, axes in found.items() if len(axes) == 2)
    used = taken | {k for some in markers.values() for k in some}
    others = tuple(labels[k] for k in range(len(labels)) if k not in used and labels[k])
    return TableColumns(time, (times[0][1][1] or "") if times else "", markers, length, plates, others, broken)


def _as_channel(label: str) -> str:
    """Return the label of a force column as ``Fx``, ``Mz`` with what else it says: Force_X_1 is FX_1, Tz is Mz."""
    return _TURNED.sub(lambda m: ("F" if (m[1] or "").lower() == "force" else "M") + (m[2] or m[4]), label)


def _triples(
    labels: Sequence[str], free: Sequence[int], pattern: re.Pattern[str], axis: int
) -> tuple[dict[str, dict[str, int]], str]:
    """Return the columns of each marker by axis, and the unit of length of the labels."""
    found: dict[str, dict[str, int]] = {}
    units = set()
    for k in free:
        if match := pattern.fullmatch(labels[k]):
            found.setdefault(match[3 - axis].strip(), {}).setdefault(match[axis].lower(), k)
            units.add((match[3] or "").lower())
    return found, units.pop() if len(units) == 1 else ""

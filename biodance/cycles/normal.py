"""Normal bands: what the curves of a laboratory's own people look like, each person counted once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from biodance.cycles.curves import CurveGroup, mean_and_sd
from biodance.cycles.cut import PERCENT
from biodance.records import Array, frozen_array
from biodance.records.arrays import assign

FEWEST_PEOPLE = 3
"""People without whom there is no band."""
_EVERY = 5
"""% between two values of a band in a file."""


@dataclass(frozen=True, eq=False)
class NormalCurve:
    """One quantity of one kind of cycle over ``people``: ``mean`` and ``sd`` between them (101,) at `PERCENT` in
    ``unit``; both sides together.
    """

    kind: str
    quantity: str
    unit: str
    people: int
    mean: Array
    sd: Array

    def __post_init__(self) -> None:
        assign(
            self,
            mean=frozen_array(self.mean, (PERCENT.size,), f"NormalCurve {self.quantity}"),
            sd=frozen_array(self.sd, (PERCENT.size,), f"NormalCurve {self.quantity}, sd"),
        )


def normal_curves(people: Mapping[str, Sequence[CurveGroup]]) -> tuple[NormalCurve, ...]:
    """Return the bands of all quantities that at least `FEWEST_PEOPLE` have all through the cycle.

    ``people`` by name, with the curves of all their trials; a person's own mean is over trials and sides.
    """
    found: dict[tuple[str, str, str], list[Array]] = {}
    for groups in people.values():
        for key in dict.fromkeys((one.kind, one.quantity, one.unit) for one in groups):
            same = [one.mean for one in groups if (one.kind, one.quantity, one.unit) == key]
            found.setdefault(key, []).append(mean_and_sd(np.stack(same))[0])
    bands = []
    for (kind, quantity, unit), means in found.items():
        whole = [one for one in means if np.isfinite(one).mean() > 0.9]
        if len(whole) >= FEWEST_PEOPLE:
            bands.append(NormalCurve(kind, quantity, unit, len(whole), *mean_and_sd(np.stack(whole))))
    return tuple(bands)


def normal_toml(bands: Sequence[NormalCurve]) -> list[str]:
    """Return the lines of ``[normal]`` in lab.toml: every fifth per cent; NaN where less than two are known."""
    lines = []
    for one in bands:
        lines += [f'[normal."{one.kind} {one.quantity}"]', f'unit = "{one.unit}"', f"people = {one.people}"]
        for name, values in (("mean", one.mean), ("sd", one.sd)):
            row = [f"{v:.4g}" for v in values[::_EVERY]]
            half = len(row) // 2
            lines += [f"{name} = [{', '.join(row[:half])},", f"  {', '.join(row[half:])}]"]
        lines.append("")
    return lines


def normal_of(raw: Mapping[str, Mapping[str, object]]) -> tuple[NormalCurve, ...]:
    """Return the bands of ``[normal]``, read from a lab.toml.

    Raises
    ------
    KeyError, TypeError, ValueError
        It is not what `normal_toml` writes.
    """
    found = []
    for name, row in raw.items():
        kind, quantity = name.split(" ")
        mean, sd = (np.interp(PERCENT, PERCENT[::_EVERY], np.asarray(row[key], dtype=float)) for key in ("mean", "sd"))
        found.append(NormalCurve(kind, quantity, str(row["unit"]), int(str(row["people"])), mean, sd))
    return tuple(found)

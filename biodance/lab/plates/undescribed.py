"""Analog channels that look like force plates by their labels, in a file that describes no plate."""

import re
from collections.abc import Sequence

from biodance.lab.c3d.raw import RawC3d

_SIX = ("fx", "fy", "fz", "mx", "my", "mz")
_EIGHT = ("fx12", "fx34", "fy14", "fy23", "fz1", "fz2", "fz3", "fz4")
_WORDS = re.compile(r"force|moment|torque|[\s._+:-]", flags=re.IGNORECASE)
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight")


def channel_groups(labels: Sequence[str]) -> tuple[tuple[int, ...], ...]:
    """Return the columns (from 0) of every set of channels that are those of one plate: three forces and three moments,
    or the eight forces of a plate with four sensors, with the same text around them (``AMTI_1.FX``, ``Fx1``,
    ``Force.Fx1`` and ``Moment.Mx1``).
    """
    found: list[tuple[int, ...]] = []
    for parts, pattern in ((_EIGHT, r"(f[xy](?:12|34|14|23)|fz[1-4])"), (_SIX, r"([fm][xyz])")):
        plates: dict[str, dict[str, int]] = {}
        for column, label in enumerate(labels):
            match = re.fullmatch(rf"(.*?){pattern}(\D?\d*)", _WORDS.sub("", label).lower())
            if match and not any(column in group for group in found):
                plates.setdefault(match[1] + "|" + match[3], {}).setdefault(match[2], column)
        found += [tuple(columns[part] for part in parts) for columns in plates.values() if set(parts) <= set(columns)]
    return tuple(sorted(found))


def undescribed_plates(raw: RawC3d) -> str:
    """Return the sentence about channels of a file without described plates that look like some; "" for none."""
    groups = channel_groups(raw.analog_labels)
    if not groups:
        return ""
    columns = [column for group in groups for column in group]
    units = ", ".join(dict.fromkeys(raw.analog_units[column] or "no unit" for column in columns))
    count = _NUMBERS[len(groups)] if len(groups) < len(_NUMBERS) else str(len(groups))
    names = f"{raw.analog_labels[columns[0]]} ... {raw.analog_labels[columns[-1]]}, in {units}"
    return (
        f"{len(columns)} channels ({names}) look like {count} force plate{'s' * (len(groups) > 1)}, which the file "
        f"does not describe: no plate was read. Give geometry, channels and sensitivity in session.toml: corners_m, "
        f"channels and sensitivity in [plates.plate1] (docs/session_folder.md; `biodance init` begins it)."
    )

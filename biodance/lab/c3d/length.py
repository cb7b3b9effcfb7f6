"""Which length the numbers of a C3D file mean: POINT:UNITS says it, the size of a person and of a plate checks it."""

import math

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.c3d.declared import parameter_numbers, texts
from biodance.lab.c3d.parameters import Parameters
from biodance.records import Array, any_coordinate, spread_frames

_METRES = {"mm": 1e-3, "cm": 1e-2, "dm": 1e-1, "m": 1.0, "in": 0.0254}
_PREFIXES = {"mm": "milli", "cm": "centi", "dm": "deci", "m": ""}
_SPELLINGS = {
    **{
        f"{prefix}{metre}": unit
        for unit, prefix in _PREFIXES.items()
        for metre in ("meter", "meters", "metre", "metres")
    },
    **{unit: unit for unit in _METRES},
    **dict.fromkeys(("inch", "inches"), "in"),
}
_GUESSES = ("mm", "cm", "m")
PERSON = 1.5
"""m, the largest extent of the markers on a person: about 0.9 m for legs alone, up to 2.3 m with arms spread or
raised.
"""

PLATE = 0.6
"""m, the longest side of a force plate: 0.4 m to 1.2 m in the makers' sheets."""

_CORNERS = ("FORCE_PLATFORM", "CORNERS")
_BELIEVABLE = (0.05, 4.75)
"""Extents, m, that a declared unit may give: the markers on a hand, a person who lies or leaps; outside it is
overruled.
"""


def metres_per_unit(
    parameters: Parameters, points: Array, *, where: str
) -> tuple[float, tuple[str, ...], tuple[str, ...]]:
    """Return the length of one file unit in metres, history and warnings.

    ``points`` (T, K, 3) are the markers in file units. A missing or unknown unit, and one that would make the person or
    the plates smaller than 5 cm or larger than 4.75 m, is decided by sense among mm, cm and m, and said so.

    Raises
    ------
    FileRefused
        The unit is missing and neither markers nor plates tell it.
    """
    written = next(iter(texts(parameters, "POINT", "UNITS")), "")
    unit = _SPELLINGS.get(written.strip(" .").casefold(), "")
    size, expected, what = _size(parameters, points)
    if unit and (math.isnan(size) or _BELIEVABLE[0] <= size * _METRES[unit] <= _BELIEVABLE[1]):
        return _METRES[unit], (f"Lengths are in {unit} (POINT:UNITS).",), ()
    if math.isnan(size) and not np.isfinite(points).any() and not parameter_numbers(parameters, *_CORNERS).size:
        return _METRES["mm"], ("The file holds no lengths, so its unit of length does not matter.",), ()
    if math.isnan(size):
        raise FileRefused(
            f"{where}: POINT:UNITS is {written!r} and neither markers nor plates tell the unit of length (mm, cm or "
            "m). Write the unit into the file and read it again."
        )
    guess = min(_GUESSES, key=lambda name: abs(math.log(size * _METRES[name] / expected)))
    said = f"POINT:UNITS is {written!r}; {what} of {size:.4g} can only be in {guess}, so lengths are in {guess}."
    return _METRES[guess], (said,), (said + " Check the sizes in the report.",)


def _extents(points: Array) -> Array:
    """Return the largest side of the box about the markers (T, K, 3) in frames that show four of them."""
    frames = points[(~any_coordinate(~np.isfinite(points))).sum(axis=1) >= 4]
    if not len(frames):
        return np.empty(0)
    return np.asarray((np.nanmax(frames, axis=1) - np.nanmin(frames, axis=1)).max(axis=1))


def _size(parameters: Parameters, points: Array) -> tuple[float, float, str]:
    """Return a length in file units, what it should be in metres, and its name; NaN if the file holds none."""
    extents = _extents(spread_frames(points))
    if extents.size:
        extent = float(np.median(extents))
        if 0 < extent < math.inf:
            return extent, PERSON, "a cloud of markers"
    corners = parameter_numbers(parameters, *_CORNERS)
    if corners.size >= 12 and np.isfinite(corners).all():
        longest = float(np.linalg.norm(np.diff(corners[:12].reshape(4, 3), axis=0), axis=1).max())
        if 0 < longest < math.inf:
            return longest, PLATE, "a plate side"
    return math.nan, PERSON, ""

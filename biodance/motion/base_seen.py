"""Where a robot's base is when something sees it: markers on its root link, or the inclination that its own IMU tells.

Without either the base follows from the standing foot through the joints (`grounded`), and an ankle that gives tilts
all that stands on it unseen. Axes of the base: x forwards, y up, z right, as of the root of every body here; those in
which a user gives markers and inclinations: forwards, left, up.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.parts import UPRIGHT
from biodance.errors import TrialRefused
from biodance.records import Array, Markers
from biodance.spatial import cross, elementary_rotation, rigid_fit, skew

_LEAST = 3
"""Markers that fix a posture."""
_FAR = 0.02
"""m RMS: markers so far from where they are said to be are not those."""


@dataclass(frozen=True, eq=False)
class BaseSeen:
    """The base at T instants: ``rotation`` (T, 3, 3), of which an IMU knows the upward direction alone, and its
    ``position`` (T, 3) m, None from an IMU.
    """

    rotation: Array
    position: Array | None = None

    def __getitem__(self, pick: slice) -> "BaseSeen":
        """Return some of the instants."""
        return BaseSeen(self.rotation[pick], None if self.position is None else self.position[pick])

    def corrected(self, rotation: Array, position: Array, foot: Array) -> tuple[Array, Array]:
        """Return turn (T, 3, 3) and place (T, 3) m of the base, given those that follow from the standing foot, whose
        middle is at ``foot`` (T, 3) m: inclinations turn all about that.
        """
        if self.position is not None:
            return self.rotation, self.position
        up = np.einsum("tij,tkj,k->ti", rotation, self.rotation, np.array([0.0, 0.0, 1.0]))
        turn = _onto_vertical(up)
        return turn @ rotation, foot + np.einsum("tij,tj->ti", turn, position - foot)


def base_of_markers(markers: Markers, places: dict[str, tuple[float, float, float]], where: str) -> tuple[Array, Array]:
    """Return turn (T, 3, 3) and place (T, 3) m of the base, NaN where too few markers were seen.

    ``places`` m of the markers from the root link's origin: forwards, left, up.

    Raises
    ------
    TrialRefused
        Markers are missing, too few, or not where they are said to be.
    """
    lacks = [name for name in places if name not in markers.names]
    if lacks or len(places) < _LEAST:
        what = f"markers {', '.join(lacks)} are missing" if lacks else f"{len(places)} markers tell no posture"
        raise TrialRefused(f"{where}: {what}; recording.toml [base] markers needs three and more of those recorded.")
    local = np.array(list(places.values())) @ UPRIGHT
    seen = markers.xyz[:, [markers.names.index(name) for name in places]]
    whole = np.isfinite(seen).all(axis=(1, 2))
    if not whole.any():
        raise TrialRefused(f"{where}: at no time all markers of the base were seen.")
    rotation, position = np.full((len(seen), 3, 3), np.nan), np.full((len(seen), 3), np.nan)
    turn, position[whole] = rigid_fit(local, seen[whole])
    rotation[whole] = turn
    off = seen[whole] - position[whole][:, None] - np.einsum("tij,kj->tki", turn, local)
    rms = float(np.sqrt(np.mean(np.sum(off**2, axis=2))))
    if rms > _FAR:
        raise TrialRefused(
            f"{where}: the markers of the base are {1000 * rms:.0f} mm RMS from where recording.toml says; legal are "
            f"{1000 * _FAR:.0f} mm. Give m from the root link's origin: forwards, left, up."
        )
    return rotation, position


def base_of_inclinations(roll: Array, pitch: Array) -> BaseSeen:
    """Return the base of an IMU: ``roll`` (T,) rad, right side down, and ``pitch`` (T,) rad, front down, about the
    base's own axes (heading, then pitch, then roll).
    """
    return BaseSeen(elementary_rotation("y", pitch) @ elementary_rotation("x", roll) @ UPRIGHT)


def _onto_vertical(up: Array) -> Array:
    """Return the smallest turns (T, 3, 3) that bring unit vectors ``up`` (T, 3) upright."""
    axis = cross(up, np.array([0.0, 0.0, 1.0]))
    K = skew(axis)
    return np.asarray(np.eye(3) + K + K @ K / (1 + up[:, 2])[:, None, None])

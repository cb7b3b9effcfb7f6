"""How large everything is that is no fault: soft tissue, joint centres, installed plates, and what is left; learned from null sessions.

Errors of a person repeat with the movement, so that counting residuals as independent noise would name a cause in every session. The sizes
of all nuisances and the covariance of the rest per band are learned together by expectation maximisation on null sessions: virtual
subjects whose file is in `tolerances.toml`, or a laboratory's own sessions (`learn`).
"""

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from biodance.records import Array, frozen_array

REFERENCE = 70.0
"""kg: the noise is stated for a person of this mass and grows in proportion to it."""
FLOOR = np.diag([0.15**2] * 3 + [0.05**2] * 3)
"""(6, 6) N², N²·m²: no band claims less."""
MARKER_FLOOR = 0.0003
"""m: calibrated cameras."""


@dataclass(frozen=True, eq=False)
class Tolerances:
    """``sizes`` standard deviation by key: an effect and its target (``plate_gain Fz``), a group of elementary errors (``slide thigh``) or
    a marker's segment (``marker thigh``), in the unit of its column; ``noise`` (B, 6, 6) covariance of one coefficient at `REFERENCE`;
    ``energy``, ``energy_sd`` (B, 6) mean square of the whitened residual in null sessions and its standard deviation; ``threshold`` of
    the evidence (natural logarithm) that no more than a few null sessions reach; ``origin`` in words.
    """

    sizes: Mapping[str, float]
    noise: Array
    energy: Array
    energy_sd: Array
    threshold: float
    origin: str = ""

    def __post_init__(self) -> None:
        bands = len(self.noise)
        object.__setattr__(self, "sizes", MappingProxyType(dict(self.sizes)))
        object.__setattr__(self, "noise", frozen_array(self.noise, (bands, 6, 6), "Tolerances.noise"))
        for name in ("energy", "energy_sd"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), (bands, 6), f"Tolerances.{name}"))

    def size(self, key: str) -> float:
        """Return the standard deviation of ``key``; 0 for one that was never learned: it is then no nuisance."""
        return self.sizes.get(key, 0.0)

    def knows(self, effect: str) -> bool:
        """Return whether any size of ``effect`` was learned."""
        return any(key.split()[0] == effect for key in self.sizes)

    def whiteners(self, mass: float) -> Array:
        """Return (B, 6, 6) matrices that whiten a coefficient of a person of ``mass`` kg."""
        return np.linalg.inv(np.linalg.cholesky(self.noise)) * (REFERENCE / mass)


@cache
def shipped() -> Tolerances:
    """Return the tolerances that come with biodance, learned from virtual subjects (`tolerances.toml` says which)."""
    return read_tolerances((files("biodance.diagnose") / "tolerances.toml").read_text(encoding="utf-8"))


def read_tolerances(text: str) -> Tolerances:
    """Return the tolerances from the text of a TOML file."""
    raw = tomllib.loads(text)
    return Tolerances(
        raw["sizes"], np.array(raw["noise"]), np.array(raw["energy"]), np.array(raw["energy_sd"]), raw["threshold"], raw["origin"]
    )


def to_toml(found: Tolerances) -> str:
    """Return the tolerances as the text of a TOML file that `read_tolerances` reads."""
    lines = [f'origin = "{found.origin}"', f"threshold = {found.threshold:.4g}"]
    for name in ("energy", "energy_sd"):
        rows = ", ".join("[" + ", ".join(f"{x:.4g}" for x in row) + "]" for row in getattr(found, name))
        lines.append(f"{name} = [{rows}]")
    lines.append("noise = [")
    lines += ["  [" + ", ".join("[" + ", ".join(f"{x:.5g}" for x in row) + "]" for row in band) + "]," for band in found.noise]
    lines += ["]", "", "[sizes]"]
    lines += [f'"{key}" = {value:.4g}' for key, value in sorted(found.sizes.items())]
    return "\n".join(lines) + "\n"


def key_of(name: str, target: str) -> str:
    """Return the key of an effect at a target: plates share their tolerances, and so do the sides of the body."""
    plate, colon, rest = target.partition(":")
    kind = rest if colon and plate.startswith("plate") else re.sub(r"^(right_|left_|[LR](?=[A-Z]{3}))", "", target)
    return f"{name} {kind}".strip()


@dataclass(frozen=True, eq=False)
class Null:
    """One session without fault: ``target`` (r,); ``columns`` (r, K) in unit size with their ``keys`` (K), "" for the parameters' prior
    (unit normal); ``band`` (m,) of the 6 m wrench rows; ``marker_keys`` of the rows that follow; ``mass`` kg.
    """

    target: Array
    columns: Array
    keys: tuple[str, ...]
    band: NDArray[np.intp]
    marker_keys: tuple[str, ...]
    mass: float


def whitened(rows: Array, band: NDArray[np.intp], marker_keys: tuple[str, ...], mass: float, tolerances: Tolerances) -> Array:
    """Return ``rows`` (r, n) in units of their standard deviation."""
    count = 6 * band.size
    wrench = rows[:count].reshape(band.size, 6, -1)
    white = np.empty_like(wrench)
    for b, matrix in enumerate(tolerances.whiteners(mass).astype(rows.dtype)):
        chosen = band == b
        white[chosen] = matrix @ wrench[chosen]
    known = [tolerances.size(key) for key in marker_keys]
    sd = np.array([max(size, MARKER_FLOOR) if size > 0 else np.inf for size in known], dtype=rows.dtype)
    return np.concatenate([white.reshape(count, -1), rows[count:] / sd[:, None]])


def learn(nulls: Iterable[Null], start: Tolerances, *, rounds: int = 10) -> Tolerances:
    """Return the sizes and the noise under which the null sessions are most probable, by ``rounds`` of expectation maximisation."""
    sessions = tuple(nulls)
    found = start
    for _ in range(rounds):
        found = _improved(sessions, found)
    return found


def _improved(sessions: tuple[Null, ...], found: Tolerances) -> Tolerances:
    """Return the tolerances after one round."""
    square: dict[str, float] = {}
    count: dict[str, int] = {}
    noise, rows = np.zeros_like(found.noise), np.zeros(len(found.noise))
    for null in sessions:
        size = np.array([1.0 if key == "" else found.size(key) for key in null.keys])
        scaled = null.columns * size.astype(null.columns.dtype)
        X = whitened(scaled, null.band, null.marker_keys, null.mass, found)
        y = whitened(null.target[:, None].astype(X.dtype), null.band, null.marker_keys, null.mass, found)[:, 0]
        factor = cho_factor((X.T @ X).astype(float) + np.eye(X.shape[1]), lower=True)
        mean = cho_solve(factor, (X.T @ y).astype(float))
        covariance = cho_solve(factor, np.eye(len(mean)))
        for j, key in enumerate(null.keys):
            if key:
                square[key] = square.get(key, 0.0) + size[j] ** 2 * (mean[j] ** 2 + covariance[j, j])
                count[key] = count.get(key, 0) + 1
        left = null.target - scaled @ mean
        spread = scaled @ np.linalg.cholesky(covariance).astype(scaled.dtype)
        wrench = 6 * null.band.size
        parts = np.concatenate([left[:wrench, None], spread[:wrench]], axis=1).reshape(null.band.size, 6, -1)
        for b in range(len(noise)):
            some = parts[null.band == b].transpose(1, 0, 2).reshape(6, -1).astype(float)
            noise[b] += some @ some.T * (REFERENCE / null.mass) ** 2
            rows[b] += np.sum(null.band == b)
        for key, row in zip(null.marker_keys, range(wrench, len(left)), strict=True):
            square[key] = square.get(key, 0.0) + float(left[row] ** 2 + (spread[row] ** 2).sum())
            count[key] = count.get(key, 0) + 1
    sizes = {key: float(np.sqrt(square[key] / count[key])) for key in square}
    return replace(found, sizes={**found.sizes, **sizes}, noise=noise / np.maximum(rows, 1)[:, None, None] + FLOOR)

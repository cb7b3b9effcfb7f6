"""How large everything is that is no fault: soft tissue, joint centres, installed plates, and what is left; learned
from null sessions.

Errors of a person repeat with the movement, so that counting residuals as independent noise would name a cause in
every session. The sizes of all nuisances, what is expected of them, and the covariance of the rest per band are
learned together on null sessions (`learning`): of virtual subjects, whose sizes stand in the one table and the rest
in ``anthropometry/uncertainty/null_sessions.toml``, or a laboratory's own.
"""

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.tables.error_sizes import error_rows, error_size
from biodance.library import locate
from biodance.records import Array, assign, freeze

REFERENCE_PERSON = 70.0
"""kg: the noise is stated for a person of this mass and grows in proportion to it."""
BEFORE = " before"
"""End of the key of what belongs to a joint where no functional calibration was made."""
OTHER = "other"
"""Target of the size of all targets that have none of their own."""
HABIT = "habit "
"""Beginning of the key of what persons do by habit and `Effect.shown` takes off: spread of all other rows only."""
CALIBRATED = ("joint_centre", "tilt")
"""Quantities that a functional calibration changes."""


@dataclass(frozen=True)
class InstrumentNoise:
    """How quiet the recordings were from which tolerances were learned; those that come with biodance unless said.

    Parameters
    ----------
    camera : float
        m per axis, white noise of a marker (`session_noise.camera_noise`).
    plate : tuple of float
        (6,) N, N·m per root Hz, noise density of a plate (`session_noise.plate_noise`).
    marker_distance : float
        m: root mean square distance of a marker to the body, first quartile over the markers; NaN = that of the table
        of sizes.
    skin : tuple of float
        (B,) m per axis and coefficient, by band: what markers do on the body that no movement explains
        (`SkinUnrest.waves`).
    swing : tuple of float
        (B,) m, the same of what they lag behind the acceleration (`SkinUnrest.swing`; the most of six own sessions).
    """

    camera: float = 1.0e-4
    plate: tuple[float, ...] = (0.0077, 0.0077, 0.0304, 0.0068, 0.0099, 0.0032)
    marker_distance: float = float("nan")
    skin: tuple[float, ...] = (3.8e-3, 3.8e-3, 1.8e-3, 5.0e-4, 1.6e-4)
    swing: tuple[float, ...] = (3.4e-4, 4.9e-4, 5.1e-4, 3.9e-4, 1.04e-4)

    @property
    def distance(self) -> float:
        """m: the distance of a marker to the body that is usual."""
        known = np.isfinite(self.marker_distance)
        return self.marker_distance if known else error_size("marker_distance", "first quartile", state="after")


@dataclass(frozen=True, eq=False)
class Tolerances:
    """``sizes`` standard deviation by key: an effect and its target (``plate_gain Fz``), a group of elementary errors
    (``slide thigh``) or a marker's segment (``marker thigh``), in the unit of its column; ``noise`` (B, 6, 6)
    covariance of one coefficient at `REFERENCE_PERSON`; ``movement`` (B, 6) mean square of a coefficient of the
    wrench that the null sessions' movement needs, at `REFERENCE_PERSON`; ``origin`` in words; ``means`` what every
    null session shows of a nuisance, by `mean_key` or group, in the unit of its column (flesh sags downwards in
    everybody); ``norms`` by kind of observation (`Observation.kind`): what a laboratory's own sessions share beyond
    what is expected everywhere, and its standard deviation; ``zeros`` (B, 6, 6) the part of ``noise`` that is the
    plates' zero, an error like the other sizes: it hides causes, and no noise does.
    """

    sizes: Mapping[str, float]
    noise: Array
    movement: Array
    origin: str = ""
    means: Mapping[str, float] = field(default_factory=dict)
    instruments: "InstrumentNoise" = field(default_factory=InstrumentNoise)
    norms: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    zeros: Array = field(default_factory=lambda: np.zeros(()))

    def __post_init__(self) -> None:
        bands = len(self.noise)
        tables = ("sizes", "means", "norms")
        assign(self, **{name: MappingProxyType(dict(getattr(self, name))) for name in tables})
        assign(self, zeros=np.broadcast_to(self.zeros, self.noise.shape))
        freeze(self, "Tolerances", noise=(bands, 6, 6), zeros=(bands, 6, 6), movement=(bands, 6))

    def size(self, key: str) -> float:
        """Return the standard deviation of ``key``; 0 for one that was never learned: it is then no nuisance. A joint
        before functional calibration has the size of one after it where nothing is known of the difference, and a
        target that nobody knows (a marker of another set) that of `OTHER` ones.
        """
        known = self.sizes.get(key, self.sizes.get(key.removesuffix(BEFORE), 0.0))
        return known or self.sizes.get(f"{key.partition(' ')[0]} {OTHER}", 0.0)

    def mean(self, key: str) -> float:
        """Return what is expected of ``key`` in a session without fault; 0 where nothing was learned."""
        return self.means.get(key, 0.0)

    def knows(self, effect: str) -> bool:
        """Return whether any size of ``effect`` was learned."""
        return any(key.split()[0] == effect for key in self.sizes)

    def whiteners(self, mass: float) -> Array:
        """Return (B, 6, 6) matrices that whiten a coefficient of a person of ``mass`` kg."""
        # L^-1 of S = L L'; S grows with mass², so L^-1 shrinks with mass.
        return np.linalg.inv(np.linalg.cholesky(self.noise)) * (REFERENCE_PERSON / mass)


@cache
def shipped() -> Tolerances:
    """Return the tolerances that come with biodance, learned from virtual subjects (``null_sessions.toml`` says
    which).
    """
    rest = read_tolerances(locate("anthropometry/uncertainty", "null_sessions").read_text(encoding="utf-8"))
    return without_habits(replace(rest, sizes=table_sizes()))


_PHYSICS = ("sag ",)
"""Beginnings of the keys of means that hold in every laboratory: flesh sags downwards in everybody."""


def without_habits(found: Tolerances) -> Tolerances:
    """Return the tolerances with no expected mean but of what is physics: what else the sessions they were learned on
    have in common is a habit of that laboratory and may be otherwise elsewhere, so that it counts as spread,
    sd' = sqrt(sd² + mean²), with the mean square over sides and axes. Of a size that the markers show by themselves
    the habit is taken off there (`Effect.shown`), so that it widens the other rows alone (`HABIT`).
    """
    habits: dict[str, list[float]] = {}
    for key, mean in found.means.items():
        if not key.startswith(_PHYSICS):
            effect, *target = key.split()[:-1]
            # The last word is the parameter: effect and target make the key of the size.
            habits.setdefault(key_of(effect, " ".join(target)), []).append(mean)
    wider = {}
    for key, means in habits.items():
        shown = found.size(f"shown {key}") > 0
        if found.size(key) > 0:
            own = 0.0 if shown else found.size(key)
            # Root mean square about zero: a mean that may be otherwise elsewhere counts as spread.
            wider[HABIT + key if shown else key] = float(np.sqrt(own**2 + np.mean(np.square(means))))
    physics = {key: mean for key, mean in found.means.items() if key.startswith(_PHYSICS)}
    return replace(found, sizes={**found.sizes, **wider}, means=physics)


_BETWEEN = "real_laboratories"
_LEARNED = ("null_sessions", "family", "real_sessions", _BETWEEN)
"""Where the sizes were learned by which sessions without fault are judged."""


@cache
def between_laboratories() -> frozenset[str]:
    """Return the keys of sizes that are a spread between real laboratories."""
    return frozenset(_key(row) for row in error_rows() if row["learned_on"] == _BETWEEN)


def table_sizes() -> dict[str, float]:
    """Return by key the sizes that sessions without fault are judged by: learned ones, and of joints as marked."""
    return {_key(r): float(r["sd"]) for r in error_rows() if r["learned_on"] in _LEARNED or r["quantity"] in CALIBRATED}


def _key(row: Mapping[str, str]) -> str:
    """Return the key of a row of the table."""
    key = " ".join((row["quantity"], row["target"])).removesuffix(" session")
    return key + (BEFORE if row["state"] == "before" else "")


def read_tolerances(text: str) -> Tolerances:
    """Return the tolerances from the text of a TOML file."""
    return tolerances_of(tomllib.loads(text))


def tolerances_of(raw: Mapping[str, Any]) -> Tolerances:
    """Return the tolerances from the tables of a TOML file."""
    return Tolerances(
        raw.get("sizes", {}),
        np.array(raw["noise"]),
        np.array(raw["movement"]),
        raw["origin"],
        raw.get("means", {}),
        _instruments(raw.get("instruments", {})),
    )


def _instruments(raw: Mapping[str, Any]) -> InstrumentNoise:
    """Return the instruments of a table ``[instruments]``; those that come with biodance without one."""
    usual = InstrumentNoise()
    return InstrumentNoise(
        float(raw.get("camera_m", usual.camera)),
        tuple(map(float, raw.get("plate_n_per_root_hz", usual.plate))),
        float(raw.get("marker_distance_m", usual.marker_distance)),
        tuple(map(float, raw.get("skin_m", usual.skin))),
        tuple(map(float, raw.get("swing_m", usual.swing))),
    )


def to_toml(found: Tolerances, *, under: str = "") -> str:
    """Return the tolerances as the text of a TOML file that `read_tolerances` reads; ``under`` the name of a table
    that holds them ("" for none).
    """
    prefix = f"{under}." if under else ""
    head = [f"[{under}]"] if under else []
    lines = [*head, f'origin = "{found.origin}"']
    lines += ["movement = [", *(f"  [{', '.join(f'{x:.4g}' for x in row)}]," for row in found.movement), "]"]
    lines.append("noise = [")
    for band in found.noise:
        lines += ["  [", *(f"    [{', '.join(f'{x:.5g}' for x in row)}]," for row in band), "  ],"]
    own = found.instruments
    known = np.isfinite(own.marker_distance)
    lines += [
        "]",
        "",
        f"[{prefix}instruments]",
        f"camera_m = {own.camera:.4g}",
        f"plate_n_per_root_hz = [{', '.join(f'{x:.4g}' for x in own.plate)}]",
        *([f"marker_distance_m = {own.marker_distance:.4g}"] if known else []),
        f"skin_m = [{', '.join(f'{x:.4g}' for x in own.skin)}]",
        f"swing_m = [{', '.join(f'{x:.4g}' for x in own.swing)}]",
        "",
        f"[{prefix}sizes]",
    ]
    lines += [f'"{key}" = {value:.9g}' for key, value in sorted(found.sizes.items())]
    lines += ["", f"[{prefix}means]"] + [f'"{key}" = {value:.4g}' for key, value in sorted(found.means.items())]
    return "\n".join(lines) + "\n"


def key_of(name: str, target: str) -> str:
    """Return the key of an effect at a target: plates share their tolerances, and so do the sides of the body."""
    plate, colon, rest = target.partition(":")
    kind = rest if colon and plate.startswith("plate") else re.sub(r"^(right_|left_|[LR](?=[A-Z]{3}))", "", target)
    return f"{name} {kind}".strip()


def in_state(key: str, joint: str, body: Body) -> str:
    """Return ``key`` as it holds for a ``joint`` of ``body`` ("" for what belongs to none): before or after a
    functional calibration.

    After it, a joint that the movement did not show stays where it was; its errors hardly show in that movement
    either, and such joints are among those that the sizes were learned on.
    """
    return key if not joint or body.joint_errors else key + BEFORE


def mean_key(name: str, target: str, parameter: str) -> str:
    """Return the key of what is expected of one parameter of an effect: sides of the body each have their own, as
    signs may be mirrored.
    """
    plate, colon, rest = target.partition(":")
    return " ".join(filter(None, (name, rest if colon and plate.startswith("plate") else target, parameter)))


_PIECE = 128
"""Coefficients whitened at once: a few at a time need little memory."""


def whitened(
    rows: Array,
    band: NDArray[np.intp],
    marker_keys: tuple[str, ...],
    mass: float,
    tolerances: Tolerances,
    *,
    loud: Array | None = None,
    out: Array | None = None,
) -> Array:
    """Return ``rows`` (r, n) in units of their standard deviation, those of the plates ``loud`` (m,) times that of
    their band, written into ``out`` (contiguous; may be ``rows`` itself: they are the largest arrays of a diagnosis) or
    a new array.
    """
    count = 6 * band.size
    out = np.empty(rows.shape, rows.dtype) if out is None else out
    wrench, white = (some[:count].reshape(band.size, 6, math.prod(rows.shape[1:])) for some in (rows, out))
    # One matrix per band, applied to (n, 6, columns) at once.
    for b, matrix in enumerate(tolerances.whiteners(mass).astype(rows.dtype)):
        here = np.flatnonzero(band == b)
        for some in (here[start : start + _PIECE] for start in range(0, here.size, _PIECE)):
            white[some] = matrix @ wrench[some]
    if loud is not None:
        white /= loud[:, None, None].astype(rows.dtype)
    known, cameras = [tolerances.size(key) for key in marker_keys], error_size("camera", "marker")
    # A marker without a known size has infinite variance: its rows become zero and tell nothing.
    sd = np.array([max(size, cameras) if size > 0 else np.inf for size in known], dtype=rows.dtype)
    out[count:] = rows[count:] / sd[:, None]
    return out

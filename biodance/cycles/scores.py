"""What healthy people do, in bands, and how far a gait lies from it, in one number: GPS with its MAP, and GDI."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from biodance.cycles.curves import WHOLE, CurveGroup, CycleCurve, mean_and_sd
from biodance.cycles.cut import PERCENT, Cycle
from biodance.cycles.summary import Spread, spread
from biodance.errors import BiodanceError
from biodance.records import SIDES, Array, freeze, grouped

SCORE_ANGLES = (
    *("pelvis_tilt", "pelvis_obliquity", "pelvis_rotation", "hip_flexion", "hip_adduction", "hip_rotation"),
    *("knee_flexion", "ankle_dorsiflexion", "foot_progression"),
)
"""The nine angles of both scores, in the order of a gait vector."""
_EVERY = 2
"""% between two of the 51 instants of a cycle that the scores look at."""
_PELVIS = 3
"""The first of `SCORE_ANGLES` are the pelvis': both sides share them."""
FEATURES = 15
"""Gait features that the index keeps (Schwartz and Rozumalski 2008: 98 % of the variance of their strides)."""


_FEWEST_PEOPLE = 3  # People without whom there is no band
_WRITTEN_EVERY = 5  # % between two values of a band in a file


@dataclass(frozen=True, eq=False)
class NormalCurve:
    """One quantity over ``people``: ``mean`` and ``sd`` between them (101,) at `PERCENT` in ``unit``."""

    kind: str
    quantity: str
    unit: str
    people: int
    mean: Array
    sd: Array

    def __post_init__(self) -> None:
        freeze(self, f"NormalCurve {self.quantity}", mean=WHOLE, sd=WHOLE)


def normal_curves(people: Mapping[str, Sequence[CurveGroup]]) -> tuple[NormalCurve, ...]:
    """Return the bands of all quantities that at least `_FEWEST_PEOPLE` have all through the cycle.

    ``people`` by name, with the curves of all their trials; a person's own mean is over trials and sides.
    """
    every = ((name, one) for name, groups in people.items() for one in groups)
    means = grouped(((one.kind, one.quantity, one.unit), (name, one.mean)) for name, one in every)
    bands = []
    for (kind, quantity, unit), own in means.items():
        of_people = [mean_and_sd(np.stack(some))[0] for some in grouped(own).values()]
        whole = [mean for mean in of_people if np.isfinite(mean).mean() > 0.9]
        if len(whole) >= _FEWEST_PEOPLE:
            bands.append(NormalCurve(kind, quantity, unit, len(whole), *mean_and_sd(np.stack(whole))))
    return tuple(bands)


def normal_toml(bands: Sequence[NormalCurve], table: str = "normal") -> list[str]:
    """Return the lines of a ``table`` in lab.toml: every fifth per cent; NaN where less than two are known."""
    lines = []
    for one in bands:
        lines += [f'[{table}."{one.kind} {one.quantity}"]', f'unit = "{one.unit}"', f"people = {one.people}"]
        for name, values in (("mean", one.mean), ("sd", one.sd)):
            row = [f"{v:.4g}" for v in values[::_WRITTEN_EVERY]]
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
    bands = []
    for name, row in raw.items():
        kind, quantity = name.split(" ")
        # Written in steps: straight lines between them.
        mean, sd = (
            np.interp(PERCENT, PERCENT[::_WRITTEN_EVERY], np.asarray(row[key], dtype=float)) for key in ("mean", "sd")
        )
        bands.append(NormalCurve(kind, quantity, str(row["unit"]), int(str(row["people"])), mean, sd))
    return tuple(bands)


_Key = TypeVar("_Key", bound=Hashable)


@dataclass(frozen=True)
class GaitScores:
    """How far a gait lies from a reference.

    ``variables`` (quantity, side) -> gait variable score, deg, mean over cycles: the movement analysis profile; ``gps``
    side -> gait profile score, deg; ``overall`` that of both sides, deg, NaN where one is missing; ``gdi`` side -> gait
    deviation index, {} without a `DeviationReference`; ``people`` that the reference is of.
    """

    variables: Mapping[tuple[str, str], Spread]
    gps: Mapping[str, Spread]
    overall: float
    gdi: Mapping[str, Spread]
    people: int


@dataclass(frozen=True, eq=False)
class DeviationReference:
    """What the gait deviation index is told against: ``basis`` (k, 459), orthonormal rows, the features; ``control``
    (k,) the healthy mean of the features; ``mean`` and ``sd`` of the logarithm of the healthy people's distance to it.
    """

    basis: Array
    control: Array
    mean: float
    sd: float

    def __post_init__(self) -> None:
        k = len(self.control)
        freeze(self, "DeviationReference", basis=(k, 51 * len(SCORE_ANGLES)), control=(k,))

    def index(self, vector: Array) -> float:
        """Return the index of a gait vector (459,) deg: 100 healthy, every 10 less one standard deviation."""
        # z of the log distance; ten points per standard deviation.
        return 100.0 - 10.0 * (float(np.log(_distance(self.basis, self.control, vector))) - self.mean) / self.sd


def deviation_reference(strides: Array, healthy: Array, *, features: int = FEATURES) -> DeviationReference:
    """Return the reference of the gait deviation index.

    Parameters
    ----------
    strides : (n, 459) array
        Gait vectors, deg, of all who were measured, patients too: their singular vectors are the features.
    healthy : (m, 459) array
        One of each healthy leg.
    features : int
        How many features are kept; at most n.

    Raises
    ------
    BiodanceError
        Fewer strides than features, or fewer than two healthy legs.

    References
    ----------
    Schwartz and Rozumalski 2008, doi:10.1016/j.gaitpost.2008.05.001: the singular vectors are of the vectors as they
    are, without their mean taken off.
    """
    if len(strides) < features or len(healthy) < 2:
        raise BiodanceError(
            f"A gait deviation index needs at least {features} strides and two healthy legs; there are {len(strides)} "
            f"and {len(healthy)}. Measure more people."
        )
    # Rows of V': the right singular vectors are directions in the space of gait vectors.
    basis = np.linalg.svd(strides, full_matrices=False)[2][:features]
    control = (healthy @ basis.T).mean(axis=0)
    distance = np.log([_distance(basis, control, one) for one in healthy])
    return DeviationReference(basis, control, float(distance.mean()), float(distance.std(ddof=1)))


def deviation_toml(one: DeviationReference) -> list[str]:
    """Return the lines of ``[gait_deviation_index]`` in lab.toml."""
    rows = ["    [" + ",\n     ".join(_nine(row)) + "]," for row in one.basis]
    control = ",\n  ".join(_nine(one.control))
    said = [f"control = [{control}]", f"mean = {one.mean:.6g}", f"sd = {one.sd:.6g}"]
    return ["[gait_deviation_index]", *said, "basis = [", *rows, "]", ""]


def _nine(row: Array) -> list[str]:
    """Return numbers as text, nine to a line."""
    return [", ".join(f"{value:.6g}" for value in row[k : k + 9]) for k in range(0, len(row), 9)]


def deviation_of(raw: Mapping[str, Any] | None) -> DeviationReference | None:
    """Return the reference that `deviation_toml` wrote; None of None."""
    if raw is None:
        return None
    basis, control = (np.array(raw[key], dtype=float) for key in ("basis", "control"))
    return DeviationReference(basis, control, float(raw["mean"]), float(raw["sd"]))


def _distance(basis: Array, control: Array, vector: Array) -> float:
    return float(np.linalg.norm(basis @ vector - control))


def gait_vectors(curves: Sequence[CycleCurve]) -> dict[Cycle, Array]:
    """Return the gait vector (459,) deg of every gait cycle in which all nine angles are known throughout."""
    found: dict[Cycle, dict[str, Array]] = {}
    for one in curves:
        if one.quantity in SCORE_ANGLES and one.cycle.kind == "gait" and np.isfinite(one.value).all():
            found.setdefault(one.cycle, {})[one.quantity] = one.value[::_EVERY]
    whole = {cycle: angles for cycle, angles in found.items() if len(angles) == len(SCORE_ANGLES)}
    return {cycle: np.concatenate([angles[name] for name in SCORE_ANGLES]) for cycle, angles in whole.items()}


def gait_scores(
    curves: Sequence[CycleCurve], normal: Sequence[NormalCurve], deviation: DeviationReference | None = None
) -> GaitScores | None:
    """Return the scores of the gait cycles of which ``curves`` are; None without all nine angles in ``normal``, or
    without a cycle in which all are known.

    Notes
    -----
    A gait variable score is the root mean square, over 51 instants of the cycle, of the difference to the reference's
    mean; a side's profile score the root mean square of its nine; that of both sides of 15: the pelvis counts once,
    with the left cycles (Baker et al. 2009, doi:10.1016/j.gaitpost.2009.05.020). The index: see `deviation_reference`.
    """
    bands = _gait_bands(normal)
    vectors = gait_vectors(curves)
    if not set(SCORE_ANGLES) <= set(bands) or not vectors:
        return None
    usual = np.stack([bands[name].mean[::_EVERY] for name in SCORE_ANGLES])
    # Root mean square over the instants of the cycle (axis 1), one for each angle.
    profile = {
        cycle: np.sqrt(np.mean((vector.reshape(usual.shape) - usual) ** 2, axis=1)) for cycle, vector in vectors.items()
    }
    by_side = {side: [rows for cycle, rows in profile.items() if cycle.side == side] for side in SIDES}
    seen = {side: np.stack(rows) for side, rows in by_side.items() if rows}
    variables = _known_spreads(
        {(name, side): rows[:, k] for side, rows in seen.items() for k, name in enumerate(SCORE_ANGLES)}
    )
    # Root mean square of the nine, cycle by cycle.
    gps = _known_spreads({side: np.sqrt(np.mean(rows**2, axis=1)) for side, rows in seen.items()})
    index = {cycle: deviation.index(one) for cycle, one in vectors.items()} if deviation is not None else {}
    gdi = _known_spreads({side: [value for cycle, value in index.items() if cycle.side == side] for side in seen})
    people = min(bands[name].people for name in SCORE_ANGLES)
    return GaitScores(variables, gps, _overall(seen), gdi, people)


def _gait_bands(normal: Sequence[NormalCurve]) -> dict[str, NormalCurve]:
    """Return the reference's angles in gait by their names."""
    return {one.quantity: one for one in normal if one.kind == "gait" and one.unit == "deg"}


def _known_spreads(values: Mapping[_Key, Iterable[float]]) -> dict[_Key, Spread]:
    """Return mean, sd and number of the values of each key, without the keys of which none is known."""
    return {key: told for key, some in values.items() if (told := spread(some))}


def _overall(seen: Mapping[str, Array]) -> float:
    """Return the profile score of both sides of a person; NaN where a side is missing."""
    if set(seen) != set(SIDES):
        return float("nan")
    right, left = (seen[side].mean(axis=0) for side in SIDES)
    # Nine of the left side and six of the right one: the pelvis' three belong to both.
    return float(np.sqrt(np.mean(np.concatenate([left, right[_PELVIS:]]) ** 2)))

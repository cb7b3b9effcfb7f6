"""How many sessions end nearer to the truth than the table: how many did, and how many of a hundred would if table and
data were exactly as uncertain as they say.

Of a table that happens to fit a person no measurement is better, so that no method makes all sessions better. Under a
right model the error that is left, r, and the step from the table, d, are independent (the error of a posterior mean is
independent of the data): r has the posterior's covariance, d what the prior's has beyond it, and the table was off by
r - d.
"""

from typing import Any

import numpy as np

from biodance.identification.knowledge import segment_quantities
from biodance.identification.posterior import Posterior
from biodance.records import Array

_DRAWS = 20_000


def expected_better(posterior: Posterior) -> Array:
    """Return the probabilities (3,) that the ``posterior`` is nearer to the truth than its prior in mass, in CoM and in
    both: root mean squares over all segments, linearised about the prior.
    """
    segments = posterior.prior.phi.reshape(-1, 10)
    slope = np.zeros((len(segments), 4, 10 * len(segments)))
    for i, phi in enumerate(segments):
        slope[i, :, 10 * i : 10 * i + 10] = segment_quantities(phi)[1][:4]
    left, step = (
        _drawn(slope.reshape(-1, slope.shape[2]), covariance, seed)
        for seed, covariance in enumerate((posterior.covariance, posterior.prior.covariance - posterior.covariance))
    )
    nearer = [_sizes(left, k) < _sizes(left - step, k) for k in (slice(0, 1), slice(1, 4))]
    return np.array([nearer[0].mean(), nearer[1].mean(), (nearer[0] & nearer[1]).mean()])


def _drawn(slope: Array, covariance: Array, seed: int) -> Array:
    """Return draws (n, N, 4) of mass kg and CoM m of N segments."""
    value, vector = np.linalg.eigh(slope @ covariance @ slope.T)
    normal = np.random.default_rng(seed).normal(size=(_DRAWS, len(value)))
    return np.asarray((normal * np.sqrt(np.maximum(value, 0.0)) @ vector.T).reshape(_DRAWS, -1, 4))


def _sizes(errors: Array, which: slice) -> Array:
    return np.asarray(np.sum(errors[:, :, which] ** 2, axis=(1, 2)))


def better(found: dict[str, Any]) -> Array:
    """Return whether a row of `bench_chain.identified` is nearer to the truth than its table in mass, in CoM and in
    both (3,).
    """
    nearer = []
    for name in ("mass", "com"):
        off, was = (np.array(found[which][name]) - np.array(found["true"][name]) for which in ("identified", "table"))
        nearer.append(bool(np.sum(off**2) < np.sum(was**2)))
    return np.array([*nearer, all(nearer)])


def told(rows: list[dict[str, Any]]) -> str:
    """Return how many of the rows are better than the table in mass, CoM and both, and of how many that is expected."""
    counts = np.sum([better(row) for row in rows], axis=0)
    chances = [row["chance"] for row in rows if "chance" in row]
    if not chances:
        return f"{counts[0]}, {counts[1]}, {counts[2]} of {len(rows)}"
    mass, com, both = 100 * np.mean(chances, axis=0)
    return f"{counts[0]}, {counts[1]}, {counts[2]} of {len(rows)} (expected {mass:.0f}, {com:.0f}, {both:.0f} %)"

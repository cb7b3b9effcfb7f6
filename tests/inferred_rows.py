"""Evidence that is drawn rather than recorded: rows of plates, markers and observations with known scales, and the
Gaussian densities that they have by brute force.
"""

from dataclasses import dataclass, replace

import numpy as np

from biodance.diagnosis.candidates import SCALE, Candidate, log_priors
from biodance.effects import Care, Effect, Parameter
from biodance.inference.columns import VisibleColumns
from biodance.inference.rows import BODY, Rows
from biodance.inference.scales import EACH, LOUD, Scales, prior_sd
from biodance.inference.sets import Search
from biodance.records import Array
from biodance.uncertainty.bands import BANDS
from biodance.uncertainty.tolerances import Tolerances

GROUPS = (BODY, "slide", Care.OTHER)
"""Groups of the drawn columns."""


@dataclass(frozen=True)
class Drawn(Effect):
    """A cause of which only the columns are known."""

    name = "drawn"
    parameters = (Parameter("size", "N", 1.0, "a draw"),)
    prior = 0.2


@dataclass(frozen=True, eq=False)
class DrawnRows(Rows):
    """Rows whose causes add ``columns`` (r, p) per unit, by target, whatever their size."""

    columns: dict[str, Array] | None = None

    @property
    def plates(self) -> int:
        """Rows with a band and channel."""
        return int(np.sum((self.block >= 0) & (self.block < 6 * len(BANDS))))

    @property
    def simulated(self) -> int:
        """Rows of plates and markers."""
        return int(np.sum(self.block >= 0))

    def white(self, rows: Array) -> Array:
        """Return the rows: they are white."""
        return rows

    def possible(self, effect: Effect, theta: Array) -> bool:
        """Return that everything can be."""
        return True

    def observed(self, effect: Effect) -> Array:
        """Return the rows of the observations."""
        return self.columns[effect.target][self.simulated :]

    def added(self, effect: Effect, theta: Array) -> Array:
        """Return what a cause adds."""
        return self.columns[effect.target] @ theta

    def slopes(self, effect: Effect, theta: Array) -> Array:
        """Return its derivative."""
        return self.columns[effect.target]


def rows(
    rng: np.random.Generator,
    *,
    plates: int = 60,
    markers: int = 12,
    observations: int = 5,
    width: int = 4,
    blocks: int = 12,
    each: int = 0,
    causes: dict[str, Array] | None = None,
) -> DrawnRows:
    """Return rows with columns of three groups of ``width`` each and a target of unit noise; so many columns of the
    last group belong to ``each`` of its members.
    """
    count = plates + markers + observations
    group = np.repeat(np.arange(len(GROUPS)), width)
    member = np.where(group == len(GROUPS) - 1, np.cumsum(group == len(GROUPS) - 1) - 1, -1)
    member = member // each if each else np.full(group.size, -1)
    X = rng.normal(size=(count, group.size))
    block = np.concatenate([np.arange(plates) % blocks, np.full(markers, 6 * len(BANDS)), np.full(observations, -1)])
    empty = Tolerances({}, np.zeros((0, 6, 6)), np.zeros((0, 6)))
    return DrawnRows(None, empty, None, X, rng.normal(size=count), group, member, block, GROUPS, columns=causes or {})


def search(drawn: DrawnRows) -> Search:
    """Return the search for all causes of some rows, at their true columns."""
    every = tuple(
        Candidate(Drawn(target), (SCALE * one).astype(np.float32), (False,)) for target, one in drawn.columns.items()
    )
    Z = np.concatenate([SCALE * one for one in drawn.columns.values()], axis=1)
    cuts = tuple(slice(k, k + 1) for k in range(len(every)))
    return Search(drawn, every, log_priors(every), VisibleColumns.of(drawn), Z, cuts)


def covariance(drawn: DrawnRows, scales: Scales, *more: Array) -> Array:
    """Return the covariance (r, r) of the target under given ``scales``, with ``more`` columns of unit coefficients;
    observations as loud as their weights say.
    """
    X = drawn.X * scales.of(drawn.group, drawn.member)
    sd = np.ones(len(drawn.y))
    sd[: drawn.plates] = np.exp(scales.noise)
    sd[drawn.simulated :] = scales.weights**-0.5
    return np.diag(sd**2) + X @ X.T + sum((Z @ Z.T for Z in more), np.zeros((len(sd), len(sd))))


def log_prior(drawn: DrawnRows, scales: Scales) -> float:
    """Return the log prior density of scales up to its constant."""
    columns = np.sum((scales.groups / prior_sd(drawn)) ** 2) + np.sum((scales.members / EACH) ** 2)
    return float(-0.5 * columns - 0.5 * (scales.noise / LOUD) ** 2)


def with_target(drawn: DrawnRows, y: Array) -> DrawnRows:
    """Return the rows with another target (r,)."""
    return replace(drawn, y=y)

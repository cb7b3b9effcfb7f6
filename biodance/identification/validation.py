"""Cross-validation: the table's and the identified body on trials, beside the measured wrench; how sure the gain is;
and what the trials that were fitted tell of their plates.

Root mean squares alone cannot rank methods of identification (a wrong body can fit well), so the errors of the
parameters and their intervals belong beside these numbers.

Errors of plates lie within the tolerances of installed ones (a millimetre, some milliradians, a few per mille of
crosstalk, a newton of zero), most probable beside the identified body. Intervals count them; and since the same plates
err alike in movement that was kept, every body is compared there with what the fitted trials tell of the plates beside
it. With X = [W E], E the errors of one standard deviation each, X' S^-1 (y - W phi) is X' S^-1 E z, with noise and
wrong kinematics of the covariance of `mismatch`, and z ~ N(0, 1). At the identified phi, E[z | phi] is the mean that z
would have in a joint fit: the posterior is Gaussian, and phi its mean. Identification took for noise what the plates
read, and in the mean of a trial that is most of it: the noise is learned once more without.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit

from biodance.body.body import Body
from biodance.errors import BiodanceError
from biodance.identification.identification import Identification
from biodance.identification.knowledge import SIGMAS
from biodance.identification.mismatch import PlateRows, inverse_root, mismatch, softness
from biodance.identification.statistics import START, WORTH, Fit, statistics, usable
from biodance.identification.tissue import Tissue, TissueInTrial
from biodance.motion.dynamics import Agreement, compare, predict_wrench
from biodance.records import CHANNELS, Array, Wrench
from biodance.spatial import wrench_about_point
from biodance.threads import Sendable
from biodance.uncertainty.bands import Noise
from biodance.uncertainty.learning import noise_of
from biodance.uncertainty.plates import plate_errors, plate_sources


@dataclass(frozen=True, eq=False)
class PlateReadings(Sendable):
    """Errors of the plates as fitted trials tell them.

    ``size`` (m,) of each source of `plates.SOURCES`, behind them of the corrections that were made (`Fit.doubts`), in
    their standard deviations; ``covariance`` (m, m); ``layout`` with the point that they are described about.
    """

    size: Array
    covariance: Array
    layout: Noise

    def rows(self, fit: Fit, body: Body) -> Array:
        """Return (T, 6, m) N, N·m about the lab origin: what one standard deviation of each adds to the wrench that the
        ``body`` needs in a trial.
        """
        wrench = predict_wrench(body, fit.motion).value
        rows = plate_errors(wrench, fit.motion.rate, self.layout, plate_sources())
        more = fit.doubts if fit.doubts.size else np.zeros((len(wrench), 6, len(self.size) - rows.shape[2]))
        return np.concatenate([rows, more], axis=2)

    def added(self, fit: Fit, body: Body) -> Array:
        """Return (T, 6) N, N·m about the lab origin: what these errors add to what the plates read in a trial."""
        return np.asarray(self.rows(fit, body) @ self.size)

    def told(self, fits: Sequence[Fit], body: Body) -> str:
        """Return in words what the plates read beside the ``body`` in the mean of some trials, with 95 % intervals; ""
        where nothing is sure.
        """
        frames = np.concatenate([self.rows(fit, body)[fit.use] for fit in fits])
        # Mean over the frames, then about the plates' point.
        rows = self.layout.shift @ frames.mean(axis=0)
        mean = rows @ self.size
        sd = np.sqrt(np.diag(rows @ self.covariance @ rows.T))
        sure = [
            f"{channel} {value:+.1f} ± {SIGMAS * one:.1f} {'N' if channel[0] == 'F' else 'N·m'}"
            for channel, value, one in zip(CHANNELS, mean, sd, strict=True)
            if abs(value) > SIGMAS * one
        ]
        return ", ".join(sure)


def plate_readings(found: Identification, fits: tuple[Fit, ...], *bodies: Body) -> tuple[PlateReadings, ...]:
    """Return what the trials that were fitted tell of their plates beside each of some bodies.

    Parameters
    ----------
    found : Identification
        With its noise, the sizes of what disturbs it, and how sure its parameters are.
    fits : tuple of Fit
        The trials that it was identified from, at least one; each with the doubts of the corrections made in it.
    *bodies : Body
        The identified one, and others in its place: the table's.

    Returns
    -------
    tuple of PlateReadings
        Mean and covariance of the errors beside each; the covariance counts how sure the identified parameters are.
    """
    used, about, _ = usable(found.body, fits)
    softer = softness(found.body, used, found.noise.bands)
    rows, told = _rows(found, used, found.noise, softer), []
    for body in bodies:
        first = _readings(found, rows, body)
        # What the plates read is taken off before the noise is learned again.
        off = tuple(replace(f, wrench=Wrench(f.wrench.time, f.wrench.value - first.added(f, body))) for f in used)
        left = statistics(found.body, off, Noise.unit(about, found.noise.bands))
        moments = left.moments(body.sip.phi, found.posterior.covariance)
        noise = replace(found.noise, covariance=noise_of(moments, start=START, worth=WORTH))
        told.append(_readings(found, _rows(found, used, noise, softer), body))
    return tuple(told)


def tissue_beside(found: Identification, fits: tuple[Fit, ...], body: Body, plates: PlateReadings) -> Tissue:
    """Return what the trials that were fitted tell of skin, flesh and joints beside a ``body`` and what its ``plates``
    read.
    """
    used, about, _ = usable(found.body, fits)
    return Tissue(body, used, tuple(plates.added(fit, body) for fit in used), about)


def _rows(found: Identification, used: tuple[Fit, ...], noise: Noise, softer: float) -> PlateRows:
    """Return what ``used`` trials tell of parameters and plates under a ``noise``, whatever the body."""
    rows = mismatch(found.body, used, noise, softer=softer, with_rows=True).rows
    assert rows is not None
    return rows


def _readings(found: Identification, rows: PlateRows, body: Body) -> PlateReadings:
    """Return what the ``rows`` tell of the plates beside a ``body``."""
    phi, H, sizes = body.sip.phi, rows.normal, found.sizes
    half = inverse_root(sizes.noise * H + sizes.kinematics**2 * rows.kinematics @ rows.kinematics.T)
    # half r with r = H (phi, z) + errors: columns of parameters and of plates, in units of the errors.
    of_body, of_plates = np.split(half @ H, [len(phi)], axis=1)
    # Posterior precision of z: data plus its unit-normal prior.
    after = np.linalg.inv(of_plates.T @ of_plates + np.eye(of_plates.shape[1]))
    gain = after @ of_plates.T
    slope = gain @ of_body
    # var(z) = var(z | phi) + D C D' with D = -gain of_body.
    covariance = after + slope @ found.posterior.covariance @ slope.T
    return PlateReadings(gain @ (half @ rows.target - of_body @ phi), covariance, Noise.unit(found.noise.about))


BLOCK_SECONDS = 1.0
"""s: errors of a person's trial are correlated over about a movement; blocks this long are drawn as units."""


@dataclass(frozen=True)
class ShareRemoved:
    """Share of an RMS residual that a model removes, ``value`` (0.12 = 12 % of it, negative = it adds) with its 95 %
    interval ``ci95``; None: fewer than three blocks of one second.
    """

    value: float
    ci95: tuple[float, float] | None


@dataclass(frozen=True)
class ParameterGain:
    """What the right total ``mass`` removes, what its ``distribution`` over the segments removes of the rest, and of
    what is then left skin, flesh and joints as fitted trials tell them (``tissue``; None where these told nothing).
    """

    mass: ShareRemoved
    distribution: ShareRemoved
    tissue: ShareRemoved | None = None


@dataclass(frozen=True, eq=False)
class TrialValidation:
    """One trial: ``measured``, ``table`` and ``identified`` wrenches about ``about`` (3,) m, the frames ``use`` (T,)
    compared, and how well each agrees (paper Table II, Fig. 9); ``weighed`` the mass on the plates over the table's;
    ``tissue`` what skin, flesh and joints do in it, as fitted trials tell; None where these tell nothing.
    """

    name: str
    about: Array
    measured: Wrench
    table: Wrench
    identified: Wrench
    use: NDArray[np.bool_]
    table_agreement: Agreement
    identified_agreement: Agreement
    weighed: float = 1.0
    tissue: TissueInTrial | None = None

    @cached_property
    def extended(self) -> Wrench | None:
        """The identified wrench with what skin, flesh and joints add, about ``about``; None where nothing tells it."""
        if self.tissue is None or not self.tissue.tissue.readings.scales:
            return None
        added = wrench_about_point(self.tissue.added, self.about)
        return Wrench(self.identified.time, self.identified.value + added)

    @cached_property
    def extended_agreement(self) -> Agreement | None:
        """How well `extended` agrees; None without it."""
        return None if self.extended is None else compare(self.measured, self.extended, self.use)

    @cached_property
    def gain(self) -> ParameterGain:
        """What the identified parameters gain on the table's, parted into mass and distribution.

        Between them stands the table with the mass on the plates, all masses and inertias in proportion. A model's
        residual is the root of its summed squares over frames and channels, each channel in units of what the
        identified parameters leave of it; intervals by a bootstrap over blocks of one second.
        """
        scaled = Wrench(self.table.time, self.weighed * self.table.value)
        models = (self.table, scaled, self.identified, *([] if self.extended is None else [self.extended]))
        found = [_block_squares(self, model) for model in models]
        # Channels in units of what the identified body leaves: newtons and newton metres count alike.
        unit = np.maximum(found[2].sum(axis=0), _TINY)
        blocks = np.maximum(np.stack([(squares / unit).sum(axis=1) for squares in found], axis=1), _TINY)

        def removed(first: int, second: int) -> ShareRemoved:
            share = removed_share(blocks.sum(axis=0), first, second)
            if len(blocks) < FEWEST_BLOCKS:
                return ShareRemoved(float(share), None)
            low, high = block_interval(lambda sums: removed_share(sums, first, second), blocks)
            return ShareRemoved(float(share), (float(low), float(high)))

        return ParameterGain(removed(0, 1), removed(1, 2), None if self.extended is None else removed(2, 3))


@dataclass(frozen=True, eq=False)
class ResidualRatio:
    """How much smaller the RMS residual of the second model is: ratio first / second of forces and of moments with 95 %
    intervals.

    ``force``, ``moment`` the ratios; ``force_interval``, ``moment_interval`` (2,) from a block bootstrap; ``blocks``
    drawn from.
    """

    force: float
    moment: float
    force_interval: tuple[float, float]
    moment_interval: tuple[float, float]
    blocks: int

    @property
    def is_proven(self) -> bool:
        """Whether the second model is better: both 95 % intervals lie above 1."""
        return min(self.force_interval[0], self.moment_interval[0]) > 1


def validate(
    body: Body,
    identified: Body,
    fit: Fit,
    *,
    about: Array,
    mass: float | None = None,
    plates: tuple[PlateReadings, PlateReadings] | None = None,
    tissue: Tissue | None = None,
) -> TrialValidation:
    """Return how the table (``body.sip``) and the identified body predict the wrench of one trial, moments about
    ``about`` (3,) m lab; ``mass`` kg on the plates, by default what was identified; ``plates`` what fitted trials tell
    of their errors beside the one and the other, which its prediction holds; ``tissue`` what they tell of skin, flesh
    and joints, for the prediction that holds this as well.

    ``about``: the middle of the plates, or `standing_point` of the session; moments about the distant lab origin hide
    the differences.

    Raises
    ------
    TrialRefused
        No frame of the trial may be compared.
    """
    predicted = [predict_wrench(one, fit.motion).value for one in (body, identified)]
    if plates is not None:
        added = (told.added(fit, one) for told, one in zip(plates, (body, identified), strict=True))
        predicted = [value + more for value, more in zip(predicted, added, strict=True)]
    measured, table, found = (
        Wrench(fit.wrench.time, wrench_about_point(value, about)) for value in (fit.wrench.value, *predicted)
    )
    return TrialValidation(
        fit.name,
        about,
        measured,
        table,
        found,
        fit.use,
        compare(measured, table, fit.use),
        compare(measured, found, fit.use),
        float((mass or identified.sip.mass.sum()) / body.sip.mass.sum()),
        None if tissue is None else TissueInTrial(tissue, fit.motion),
    )


_DRAWS, FEWEST_BLOCKS = 1000, 3
"""Of the bootstrap, and blocks that it needs."""
_TINY = 1e-12
"""N², N²·m²: least unit of a channel."""


def removed_share(squares: Array, first: int, second: int) -> Array:
    """Return the share of a residual, the root of summed ``squares`` (..., models), that the ``second`` model removes
    of the ``first``'s.
    """
    return np.asarray(1 - np.sqrt(squares[..., second] / squares[..., first]))


def block_interval(statistic: Callable[[Array], Array], blocks: Array) -> Array:
    """Return the 95 % interval (2, ...) of a ``statistic`` of the sum of ``blocks`` (n, ...), from samples drawn of
    them with replacement.

    Few blocks are less alike than their samples: percentiles are as far from the estimate as Student's t wants it, by
    sqrt(n / (n - 1)) t(0.975, n - 1) / 1.96 times (the expanded percentile interval of Hesterberg 2015,
    doi:10.1080/00031305.2015.1089789).
    """
    n = len(blocks)
    drawn = np.random.default_rng(0).integers(0, n, (_DRAWS, n))
    value, spread = statistic(blocks.sum(axis=0)), statistic(blocks[drawn].sum(axis=1))
    wider = np.sqrt(n / (n - 1)) * stdtrit(n - 1, 0.975) / ndtri(0.975)
    return np.asarray(value + wider * (np.percentile(spread, [2.5, 97.5], axis=0) - value))


def residual_ratio(trials: tuple[TrialValidation, ...]) -> ResidualRatio:
    """Return the ratio of RMS residuals table / identified over all ``trials`` with a block-bootstrap interval.

    Raises
    ------
    BiodanceError
        There are fewer than three blocks of one second: no interval can be given.
    """
    # Squares of three forces and three moments, each summed.
    a, b = (
        np.concatenate([_block_squares(one, getattr(one, name)) for one in trials]).reshape(-1, 2, 3).sum(axis=2)
        for name in ("table", "identified")
    )
    if len(a) < FEWEST_BLOCKS:
        raise BiodanceError(
            f"The trials hold {len(a)} blocks of {BLOCK_SECONDS:g} s; an interval of the gain needs {FEWEST_BLOCKS}. "
            f"Record longer."
        )
    low, high = block_interval(lambda sums: np.sqrt(sums[..., 0, :] / sums[..., 1, :]), np.stack([a, b], axis=1))
    force, moment = np.sqrt(a.sum(axis=0) / b.sum(axis=0))
    return ResidualRatio(
        float(force), float(moment), (float(low[0]), float(high[0])), (float(low[1]), float(high[1])), len(a)
    )


def _block_squares(trial: TrialValidation, simulated: Wrench) -> Array:
    """Return the summed squared differences (n, 6) of measured and simulated wrench in blocks of one second."""
    size, use = max(1, round(BLOCK_SECONDS * trial.measured.rate)), np.flatnonzero(trial.use)
    difference = (trial.measured.value - simulated.value) ** 2
    # np.array_split: no block is much shorter than the others.
    return np.array([difference[piece].sum(axis=0) for piece in np.array_split(use, max(1, use.size // size))])

"""Accept named causes: the trials as they would have been recorded, or the body that moves right, and what that
gains elsewhere.
"""

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.effects import Case, NamedCause, Transient
from biodance.errors import BiodanceError
from biodance.identification.statistics import Fit
from biodance.identification.validation import BLOCK_SECONDS, FEWEST_BLOCKS, block_interval, removed_share
from biodance.lab.prepare import highest_frequency
from biodance.motion.dynamics import predict_wrench
from biodance.records import Array, freeze
from biodance.spatial import wrench_about_point
from biodance.uncertainty.bands import BANDS

_TINY = 1e-6
"""N, N·m: least unit of a channel."""


def accept(case: Case, named: tuple[NamedCause, ...]) -> Case:
    """Return ``case`` without the ``named`` causes: its trial corrected, or its body and motion."""
    for one in reversed(named):
        case = _without_course(case, one) if one.course else one.effect.corrected(case, one.theta)
    return case


def _without_course(case: Case, one: NamedCause) -> Case:
    """Return ``case`` without a cause that came and went; as it is where nobody knows its course in this trial."""
    columns = one.effect.local(case) if isinstance(one.effect, Transient) else None
    course = one.course.get(case.trial.name)
    if columns is None or course is None:
        return case
    count = min(columns.shape[2], course.size)
    return case.with_added(case.trial.plates[0], -columns[:, :, :count] @ course[:count])


def case_fit(case: Case, use: NDArray[np.bool_]) -> Fit:
    """Return a case as a trial to identify from."""
    return Fit(case.trial.name, case.motion, case.trial.wrench, use, cutoff=highest_frequency(case.trial.settings))


@dataclass(frozen=True, eq=False)
class Residuals:
    """What a body leaves of trials: per trial ``left`` (T, 6) N, N·m about the standing point, frames ``use`` (T,),
    ``rate`` and ``cutoff`` Hz of their low-pass.
    """

    names: tuple[str, ...]
    left: tuple[Array, ...]
    use: tuple[NDArray[np.bool_], ...]
    rate: tuple[float, ...]
    cutoff: tuple[float, ...]


def residuals_of(body: Body, fits: tuple[Fit, ...], about: Array) -> Residuals:
    """Return measured minus predicted wrench of ``body`` in every trial, about ``about`` (3,) m."""
    left = tuple(wrench_about_point(fit.wrench.value - predict_wrench(body, fit.motion).value, about) for fit in fits)
    rows = ((f.name, f.use, f.motion.rate, f.cutoff) for f in fits)
    names, use, rate, cutoff = zip(*rows, strict=True) if fits else ((), (), (), ())
    return Residuals(names, left, use, rate, cutoff)


@dataclass(frozen=True, eq=False)
class Gain:
    """What a finding gains on trials that were not used to find it: all findings accepted, against all but this one
    with the rest fitted again (a single one: against the model in use, identified body and nominal laboratory).

    ``rms_before``, ``rms_after`` (6,) N, N·m, root mean square residual per channel; ``channels`` (6, 2) 95 % interval
    of the share of it that the finding removes (0.2 = a fifth, negative = it adds); ``ci95`` (2,) the same for all
    channels together, each in units of what the accepted model leaves of the trials that were used (excludes 0: a
    proven gain); ``score``, ``score_se`` change of the log predictive density per second, natural logarithm, with
    standard error; ``trials`` judged on.
    """

    rms_before: Array
    rms_after: Array
    ci95: tuple[float, float]
    trials: tuple[str, ...]
    score: float = float("nan")
    score_se: float = float("nan")
    channels: Array = field(default_factory=lambda: np.full((6, 2), np.nan))

    def __post_init__(self) -> None:
        freeze(self, "Gain", channels=(6, 2), rms_before=(6,), rms_after=(6,))

    @property
    def proven(self) -> bool:
        """Whether the interval excludes zero."""
        return self.ci95[0] > 0


def gain_by_naming(before: Residuals, after: Residuals, *, fitted: tuple[Residuals, Residuals]) -> Gain:
    """Return what naming the causes gains on trials that were not used: ``before`` and ``after`` hold the same trials.

    ``fitted`` the same two bodies on the trials that were used: what the better one leaves there is the unit in which
    the channels are added up, and their residual covariances per band are the two predictive densities.

    Raises
    ------
    BiodanceError
        There are fewer than three blocks of one second: no interval can be given.
    """
    aligned = zip(before.left, after.left, before.use, before.rate, strict=True)
    pairs = [(_blocks(left, use, rate), _blocks(right, use, rate)) for left, right, use, rate in aligned]
    a, b = (np.concatenate([pair[i] for pair in pairs]) for i in (0, 1))
    if len(a) < FEWEST_BLOCKS:
        raise BiodanceError(
            f"The kept trials hold {len(a)} blocks of {BLOCK_SECONDS:g} s; an interval of the gain needs "
            f"{FEWEST_BLOCKS}."
        )
    blocks, unit = np.stack([a, b], axis=2), np.maximum(_rms(fitted[1]), _TINY) ** 2
    channels = block_interval(lambda squares: removed_share(squares, 0, 1), blocks).T
    low, high = block_interval(lambda squares: removed_share(squares, 0, 1), (blocks / unit[:, None]).sum(axis=1))
    score, error = _density_gain(before, after, fitted)
    names = tuple(dict.fromkeys(before.names))
    return Gain(_rms(before), _rms(after), (float(low), float(high)), names, score, error, channels)


def _density_gain(before: Residuals, after: Residuals, fitted: tuple[Residuals, Residuals]) -> tuple[float, float]:
    """Return the change of the log predictive density per second and its standard error over the coefficients of each
    band.

    The spread expected in a kept trial is what the same body leaves of all others, used and kept: in those that were
    used it is too good.
    """
    changes, bands, count = [], [], len(before.names)
    for k in range(count):
        others = [i for i in range(count) if i != k]
        then, now = (
            _log_density(part(kept, [k]), join_residuals(used, part(kept, others)))
            for kept, used in zip((before, after), fitted, strict=True)
        )
        changes.append(now[0] - then[0])
        bands.append(now[1])
    change, band = np.concatenate(changes), np.concatenate(bands)
    seconds = sum(float(use.sum()) / rate for use, rate in zip(before.use, before.rate, strict=True))
    spread = [change[band == b] for b in np.unique(band)]
    error = np.sqrt(sum(some.size * some.var(ddof=1) for some in spread if some.size > 1))
    return float(change.sum() / seconds), float(error / seconds)


def part(found: Residuals, trials: list[int]) -> Residuals:
    """Return some of the trials, by their index."""
    return Residuals(*(tuple(getattr(found, one.name)[k] for k in trials) for one in fields(Residuals)))


def join_residuals(first: Residuals, second: Residuals) -> Residuals:
    """Return the trials of both."""
    return Residuals(*(getattr(first, one.name) + getattr(second, one.name) for one in fields(Residuals)))


def _rms(found: Residuals) -> Array:
    """Return (6,) root mean square over the used frames of all trials."""
    return np.sqrt(
        np.mean(np.concatenate([left[use] for left, use in zip(found.left, found.use, strict=True)]) ** 2, axis=0)
    )


def _blocks(left: Array, use: NDArray[np.bool_], rate: float) -> Array:
    """Return the summed squares (n, 6) of blocks of one second."""
    frames = np.flatnonzero(use)
    pieces = np.array_split(frames, max(1, frames.size // max(1, round(BLOCK_SECONDS * rate))))
    return np.array([np.sum(left[piece] ** 2, axis=0) for piece in pieces if piece.size])


def _coefficients(found: Residuals) -> tuple[Array, NDArray[np.intp]]:
    """Return the cosine coefficients (n, 6) of all residuals and their bands (n,)."""
    values, bands = [], []
    for left, use, rate, cutoff in zip(found.left, found.use, found.rate, found.cutoff, strict=True):
        there = BANDS.at(rate).below(cutoff)
        for pick in BANDS.runs(use, rate):
            band = there.of(pick.size)
            values.append(there.coefficients(left[pick])[band >= 0])
            bands.append(band[band >= 0])
    return np.concatenate(values), np.concatenate(bands)


def _log_density(found: Residuals, fitted: Residuals) -> tuple[Array, NDArray[np.intp]]:
    """Return (n,) log predictive densities under the residual covariance per band of the trials used, and the bands."""
    values, bands = _coefficients(found)
    known, known_bands = _coefficients(fitted)
    out = np.zeros(len(values))
    for b in np.unique(bands):
        here, there = values[bands == b], known[known_bands == b]
        # One sample of 1 N and 0.5 N·m more: regular with few coefficients, too.
        spread = (there.T @ there + np.diag([1.0] * 3 + [0.25] * 3)) / (len(there) + 1)
        # Gaussian of zero mean, without the constant that drops out of differences.
        out[bands == b] = (
            -0.5 * np.sum(here * np.linalg.solve(spread, here.T).T, axis=1) - 0.5 * np.linalg.slogdet(spread)[1]
        )
    return out, bands

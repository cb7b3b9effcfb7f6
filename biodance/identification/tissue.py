"""What skin, flesh and joints that are not as the model has them do to a person's wrench, as the fitted trials tell it.

Beside the identified body and what the plates read, trials leave y - W phi - plates = G z + noise. Columns of G are the
elementary errors of `uncertainty.sources` in the wrench: a segment's markers that slide with the joints beside it or
sag with their acceleration, matter that moves against its segment, hinges and joint centres that lie elsewhere. What is
left of real people repeats from stride to stride (docs/decisions/2026-11-29-plates-of-kept-movement.md).

Each z is N(0, s²), of the size of the table times a scale of the session for each kind of error, whose logarithm is
N(0, 0.6²); the noise is learned beside, band by band. Scales and noise are the most probable ones (expectation
maximisation), sizes their posterior mean. The body is not fitted again: what it gains is judged without this, and what
this gains on kept movement stands beside it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.changes import parts_as_segments
from biodance.body.tables.error_sizes import error_size
from biodance.identification.mismatch import long_runs
from biodance.identification.statistics import START, WORTH, Fit, Statistics, empty
from biodance.motion.dynamics import predict_wrench
from biodance.records import Array, Motion
from biodance.threads import Sendable, one_thread
from biodance.uncertainty.bands import BANDS, Noise
from biodance.uncertainty.learning import maximise, noise_of
from biodance.uncertainty.response import ErrorSource, Response
from biodance.uncertainty.sources import Centre, Flesh, Sag, Slide, Tilt, deviations, of_clusters, of_whole

TISSUE_KINDS: Mapping[type[ErrorSource], str] = {
    Slide: "skin",
    Sag: "sag",
    Flesh: "flesh",
    Tilt: "joints",
    Centre: "joints",
}
"""What the kinds of errors are called that share a scale of the session."""
_SPREAD = 0.6
"""Standard deviation of the logarithm of a scale: that of soft tissue in diagnosis (decision one-posterior)."""
_VISIBLE = 1e-3
"""Share of the largest direction of a kind below which rows do not show one."""
_ROUNDS, _SETTLED = 60, 1e-3


@dataclass(frozen=True, eq=False)
class TissueReadings:
    """Errors of skin, flesh and joints as fitted trials tell them.

    ``body`` with its parts as segments; ``size`` (K,) of each of its `sources`, in their own units; ``scales`` how many
    times as large as in the table each of `TISSUE_KINDS` is in this session.
    """

    body: Body
    size: Array
    scales: Mapping[str, float]

    def added(self, motion: Motion) -> Array:
        """Return (T, 6) N, N·m about the lab origin: what these errors add to the wrench that a ``motion`` needs."""
        trial, sources = Response.of(self.body, motion), sources_of(self.body)
        # Frame by frame, and K errors summed at once: (F, 9, K) of a long trial would not fit into memory.
        moved = [_functionals(sources, part) @ self.size for _, part in trial.parts()]
        return np.asarray(trial.wrench(np.concatenate(moved)[:, :, None])[:, :, 0])


@dataclass(frozen=True, eq=False)
class Tissue(Sendable):
    """What some trials tell of skin, flesh and joints beside a ``body``, computed when asked for.

    ``fits`` the trials that it was identified from; ``plates`` (T, 6) N, N·m about the lab origin, for each of them,
    what the plates read beside the body; ``about`` (3,) m, the point that the noise is described about.
    """

    body: Body
    fits: tuple[Fit, ...]
    plates: tuple[Array, ...]
    about: Array

    @cached_property
    def readings(self) -> TissueReadings:
        """Posterior means under the most probable scales and noise; zeros without a run of usable frames."""
        return _readings(self)


@dataclass(frozen=True, eq=False)
class TissueInTrial(Sendable):
    """What fitted trials tell of skin, flesh and joints, in another ``motion``."""

    tissue: Tissue
    motion: Motion

    @cached_property
    def added(self) -> Array:
        """(T, 6) N, N·m about the lab origin: what it adds to the wrench that the motion needs."""
        return self.tissue.readings.added(self.motion)


def sources_of(body: Body) -> tuple[ErrorSource, ...]:
    """Return the kinds of errors of a ``body`` whose parts are segments."""
    return (*of_clusters(body), Centre(body))


@one_thread()
def _readings(tissue: Tissue) -> TissueReadings:
    whole, layout = parts_as_segments(tissue.body), Noise.unit(tissue.about)
    sources = sources_of(whole)
    kinds = np.repeat([TISSUE_KINDS[type(source)] for source in sources], [len(source.groups) for source in sources])
    sd = np.concatenate([_sizes(source, whole, tissue.body) for source in sources])
    rows, band = _rows(tissue, whole, layout)
    back, kind = [], []
    for one in dict.fromkeys(kinds.tolist()):
        directions = _directions(rows[:, :, :-1][:, :, kinds == one] * sd[kinds == one])
        back.append(np.zeros((len(sd), directions.shape[1])))
        back[-1][kinds == one] = sd[kinds == one, None] * directions
        kind += [one] * directions.shape[1]
    turn = np.concatenate(back, axis=1)
    data = empty(turn.shape[1], layout)
    data.add_coefficients(np.concatenate([rows[:, :, :-1] @ turn, rows[:, :, -1:]], axis=2), band)
    value, scales = _most_probable(data, np.array(kind))
    return TissueReadings(whole, turn @ value, scales)


def _sizes(source: ErrorSource, whole: Body, body: Body) -> Array:
    """Return the standard deviations (K,) of a kind of errors of the ``whole`` body, parts as in ``body``."""
    if isinstance(source, Sag):
        return np.array([error_size(*of_whole(group, body).split(" ")) for group in source.groups])
    return deviations(whole, (source,))


def _functionals(sources: tuple[ErrorSource, ...], trial: Response) -> Array:
    return np.concatenate([source.functional(trial) for source in sources], axis=2)


def _rows(tissue: Tissue, whole: Body, layout: Noise) -> tuple[Array, NDArray[np.intp]]:
    """Return the coefficients (n, 6, K + 1) of all errors of unit size and of what trials leave, and their bands."""
    body, sources = tissue.body, sources_of(whole)
    found, bands = [np.zeros((0, 6, sum(len(source.groups) for source in sources) + 1))], [np.zeros(0, dtype=np.intp)]
    left = {
        fit.name: fit.wrench.value - predict_wrench(body, fit.motion).value - read
        for fit, read in zip(tissue.fits, tissue.plates, strict=True)
    }
    for fit, pick in long_runs(tissue.fits, BANDS):
        trial = Response.of(whole, fit.motion.at(pick))
        errors = trial.wrench(_functionals(sources, trial))
        both = np.concatenate([errors, left[fit.name][pick, :, None]], axis=2)
        band = BANDS.at(fit.motion.rate).below(fit.cutoff).of(len(pick))
        found.append(BANDS.coefficients(layout.shift @ both)[band >= 0])
        bands.append(band[band >= 0])
    return np.concatenate(found), np.concatenate(bands)


def _directions(columns: Array) -> Array:
    """Return an orthonormal basis (K, k) of what columns (n, 6, K) show of K alike unknowns."""
    flat = columns / np.sqrt(np.diag(START))[:, None]
    value, vector = np.linalg.eigh(np.tensordot(flat, flat, axes=((0, 1), (0, 1))))
    return np.asarray(vector[:, value > _VISIBLE**2 * max(value.max(initial=0.0), 1e-300)])


@dataclass(frozen=True, eq=False)
class _Learned:
    noise: Noise
    log_scale: Array


def _most_probable(data: Statistics, kind: NDArray[np.str_]) -> tuple[Array, dict[str, float]]:
    """Return the posterior mean (k,) of unknowns of unit size, and the scales of their kinds."""
    names = list(dict.fromkeys(kind.tolist()))
    of = np.array([names.index(one) for one in kind], dtype=np.intp)
    count = np.bincount(of, minlength=len(names)).astype(float)

    def posterior(now: _Learned) -> tuple[Array, Array]:
        scale = np.exp(now.log_scale)[of]
        normal = data.normal_matrix(now.noise)
        # z = scale u with u ~ N(0, 1): (S N S + 1) u = S t.
        covariance = np.linalg.inv(scale[:, None] * normal[:-1, :-1] * scale + np.eye(len(scale)))
        return scale * (covariance @ (scale * normal[:-1, -1])), scale[:, None] * covariance * scale

    def improved(now: _Learned) -> _Learned:
        mean, covariance = posterior(now)
        square = np.bincount(of, mean**2 + np.diag(covariance), minlength=len(names)).astype(float)
        noise = noise_of(data.moments(mean, covariance), start=START, worth=WORTH)
        return _Learned(replace(now.noise, covariance=noise), _scales(square, count, now.log_scale))

    start = Noise(np.tile(START, (len(BANDS), 1, 1)), data.layout.about, BANDS)
    first = _Learned(start, np.zeros(len(names)))
    found = maximise(first, improved, lambda one: one.noise.covariance, rounds=_ROUNDS, tolerance=_SETTLED)
    return posterior(found)[0], dict(zip(names, np.exp(found.log_scale).tolist(), strict=True))


def _scales(square: Array, count: Array, start: Array) -> Array:
    """Return the logarithms l that maximise -count l - square exp(-2 l) / 2 - l² / (2 _SPREAD²), by Newton."""
    scale = start
    for _ in range(_ROUNDS):
        told = square * np.exp(-2 * scale)
        slope, curvature = told - count - scale / _SPREAD**2, 2 * told + 1 / _SPREAD**2
        scale = scale + np.clip(slope / curvature, -1.0, 1.0)
    return scale

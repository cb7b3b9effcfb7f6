"""Is what is left like what sessions without fault leave? The test that may say "unexplained", apart from the search
for names.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter1d

from biodance.diagnosis.consequence import Adequacy
from biodance.diagnosis.diagnosis import Verdict
from biodance.diagnosis.evidence import linear_posterior
from biodance.diagnosis.model import Model
from biodance.records import CHANNELS, Array, Motion
from biodance.uncertainty.bands import BANDS

if TYPE_CHECKING:
    from biodance.effects import QualityCheck

LIMIT = 4.5
"""Standard deviations of null sessions beyond which one band of one channel is not adequate."""
_BEYOND = 9.0
"""Standard deviations beyond which a name does not tell the main part."""
CONFLICT_LIMIT = 3.5
"""Standard deviations by which the body may be more unlike the table than people are (sessions without fault: 1.4 at
most of 14 of the own laboratory; beyond it in 1 of 36 of an independent one, whose people are drawn around other
tables: 4.1).
"""
STRETCHED = 7.0
"""Standard deviations beyond which no tolerance of a cause is believed: with the right cause named at most 6.1 in 22
sessions (own and foreign laboratory), with it out of the family 7.8 to 24 wherever it had hidden there.
"""

_STRIDE, _EQUAL, _FEWEST = (0.4, 2.0), 0.95, 3
"""s of a stride; correlation of joint angles a stride apart from which strides are equal; so many fit into a trial."""
LOUDER, _LOUDEST = 1.15, 2.0
"""A laboratory is believed to be so many times as loud as the one of the tolerances from the first number on, and at
most the second: 95 % of the family of laboratories (`virtual_lab.recording.family`, whose sizes are drawn with a
standard deviation of 0.4 in their natural logarithm).
"""
TORN = STRETCHED * _LOUDEST
"""Standard deviations beyond which a tolerance is none in any laboratory: what is small was learned in few, and may be
as many times as large in another one as that may be loud.
"""
_TIE = 1e-9
"""Share by which powers may differ and still be equal: the first of them is told. A slow band of a short trial may hold
one cosine, which is as large at the end as at the start.
"""
_SECONDS = 70.0
"""s of measured contact in the sessions from which the spread of null sessions was learned; in a shorter one chance
alone spreads more.
"""


def energies(found: Model) -> Array:
    """Return (B, 6): mean square of the whitened residual that is left, per band and channel."""
    band = found.problem.spectrum.band
    square = found.posterior.residual[: 6 * band.size].reshape(-1, 6) ** 2
    return np.array([square[band == b].mean(axis=0) if (band == b).any() else np.ones(6) for b in range(len(BANDS))])


def unlikely(found: Model) -> Array:
    """Return (B, 6): how far `energies` are from sessions without fault that are as long and as loud as this one, in
    standard deviations: what is louder in all bands and channels alike, up to `LOUDER`, is no sign of one of them.

    The mean of n squares has the variance 2 energy² / n, of which the learned spread holds that of long sessions. Mean
    squares are skewed; their cube root is nearly normal (Wilson and Hilferty 1931, doi:10.1073/pnas.17.12.684).
    """
    where, known = found.problem.spectrum, found.tolerances
    mean = energies(found) / loudness(found) ** 2
    count = np.maximum(1, np.bincount(where.band, minlength=len(BANDS)))[:, None]
    chance = 2 * known.energy**2 / count * max(0.0, 1 - where.seconds / _SECONDS)
    spread = np.sqrt(known.energy_sd**2 + chance)
    root = spread / known.energy / 3
    return np.asarray((np.cbrt(mean / known.energy) - 1 + root**2) / root)


def residual_scale(found: Model) -> float:
    """Return the residual relative to that of the laboratory of the tolerances: median over bands and channels, which a
    fault of a single channel or band does not affect; 1 to `_LOUDEST`.
    """
    square = float(np.median(energies(found) / found.tolerances.energy))
    return float(np.clip(np.sqrt(square), 1.0, _LOUDEST))


def loudness(found: Model) -> float:
    """Return the `residual_scale` as far as it is no sign of anything: at most `LOUDER`."""
    return min(residual_scale(found), LOUDER)


def sizes(found: Model) -> Array:
    """Return (B, 6): root mean square over the time of all trials of what is left, N and N·m, per band and channel."""
    where = found.problem.spectrum
    frames = max(1, sum(pick.size for picks in where.picks for pick in picks))
    left = found.in_newtons(found.posterior.residual)
    return np.sqrt([np.sum(left[where.band == b] ** 2, axis=0) / frames for b in range(len(BANDS))])


def largest_z(left: tuple[Adequacy, ...]) -> float:
    """Return the largest z over the bands whose residual is also relevant in N or N·m; 0 if there is none."""
    return max((row.z for row in left if row.matters), default=0.0)


def adequacy(found: Model) -> tuple[Adequacy, ...]:
    """Return how far every band of every channel is from null sessions, worst first; the worst, and the worst that
    matters, with its second.
    """
    spectrum, names = found.problem.spectrum, [case.trial.name for case in found.problem.cases]
    z, size = unlikely(found), sizes(found)
    square = found.posterior.residual[: 6 * spectrum.band.size].reshape(-1, 6) ** 2
    rows = []
    for b in range(len(z)):
        here = spectrum.band == b
        total = np.array([[square[here & (spectrum.trial == t), c].sum() for c in range(6)] for t in range(len(names))])
        for c in range(6):
            rows.append(
                Adequacy(
                    CHANNELS[c],
                    (BANDS.edges[b], BANDS.edges[b + 1]),
                    float(z[b, c]),
                    names[int(np.argmax(total[:, c]))],
                    size=float(size[b, c]),
                )
            )
    rows.sort(key=lambda row: -row.z)
    told = {0, next((i for i, row in enumerate(rows) if row.matters), 0)}
    return tuple(replace(row, second=_when(found, row)) if i in told else row for i, row in enumerate(rows))


def _when(found: Model, row: Adequacy) -> float:
    """Return the second of the trial's recording around which what is left in ``row`` is largest."""
    spectrum = found.problem.spectrum
    index = [case.trial.name for case in found.problem.cases].index(row.trial)
    left = found.posterior.residual[: 6 * spectrum.band.size].reshape(-1, 6)[
        spectrum.trial == index, CHANNELS.index(row.channel)
    ]
    bands, time = spectrum.layout.bands.at(spectrum.rates[index]), found.problem.cases[index].motion.time
    best, second, start = -1.0, float("nan"), 0
    for pick in spectrum.picks[index]:
        band = bands.of(pick.size)
        full = np.zeros(pick.size)
        full[band >= 0] = left[start : start + int(np.sum(band >= 0))]
        start += int(np.sum(band >= 0))
        full[band != BANDS.edges.index(row.band_hz[0])] = 0.0
        power = uniform_filter1d(bands.samples(full) ** 2, max(1, round(bands.rate)))
        largest = float(power.max())
        if largest > best * (1 + _TIE):
            best, second = largest, float(time[pick[int(np.argmax(power >= largest * (1 - _TIE)))]])
    return second


def prior_data_conflict(found: Model) -> float:
    """Return how much further the body is from its prior than people are, as a standard normal deviate.

    Its unit-normal coefficients u have the posterior mean distribution N(0, 1 - C) with C their posterior covariance,
    so |u|² is a sum of squares weighted by the eigenvalues of 1 - C; its cube root is nearly normal. A fault absorbed
    by the body leaves no residual but an unusual body.
    """
    k = found.problem.factor.shape[1]
    u, unit = found.posterior.mean[:k], np.eye(len(found.posterior.mean))[:k]
    weight = np.clip(1 - np.linalg.eigvalsh(found.posterior.covariance(unit)), 0.0, 1.0)
    if weight.sum() < 1e-9:
        return 0.0
    spread = 2 / 9 * float(np.sum(weight**2) / weight.sum() ** 2)
    return float((np.cbrt(u @ u / weight.sum()) - 1 + spread) / np.sqrt(spread))


def conflict_at_loudness(found: Model) -> float:
    """Return `prior_data_conflict`; where it exceeds `CONFLICT_LIMIT`, recompute it with the noise of a session as loud
    as this one is in all bands and channels alike (`loudness`): no fault of one band or channel excuses a strange body.
    """
    plain = prior_data_conflict(found)
    return (
        plain
        if plain <= CONFLICT_LIMIT
        else prior_data_conflict(_weighed(found, np.full((len(BANDS), 6), 1 / loudness(found))))
    )


def conflict_at_own_noise(found: Model) -> float:
    """Return `prior_data_conflict`; where it exceeds `CONFLICT_LIMIT`, recompute it with the noise raised to the
    residual of each band and channel that is noisier than in fault-free sessions: a restless person is not an unusual
    body.
    """
    plain = prior_data_conflict(found)
    if plain <= CONFLICT_LIMIT:
        return plain
    return prior_data_conflict(_weighed(found, np.minimum(1.0, np.sqrt(found.tolerances.energy / energies(found)))))


def with_strides_once(found: Model) -> Model:
    """Return the model in which the equal strides of a trial (treadmills) count as one: whoever walks on repeats the
    errors of skin, joints and segments, and twenty equal strides are no twenty pieces of evidence on a body.
    """
    where = found.problem.spectrum
    repeats = np.array([strides_alike(case.motion) for case in found.problem.cases])
    if (repeats == 1).all():
        return found
    return _weighed(found, 1 / np.sqrt(repeats[where.trial])[:, None])


def strides_alike(motion: Motion) -> float:
    """Return how often a motion repeats itself with the period of a stride; 1 where it does not."""
    angles = motion.q[:, 7:] - motion.q[:, 7:].mean(axis=0)
    lags = np.arange(round(_STRIDE[0] * motion.rate), round(min(_STRIDE[1] * motion.rate, len(angles) / _FEWEST)))
    if not lags.size or not np.square(angles).sum() > 0:
        return 1.0
    alike = [1 - np.square(angles[k:] - angles[:-k]).mean() / (2 * np.square(angles).mean()) for k in lags]
    best = int(np.argmax(alike))
    return float(len(angles) / lags[best]) if alike[best] > _EQUAL else 1.0


def _weighed(found: Model, weight: Array) -> Model:
    """Return the model with the plates' rows weighed: by band and channel (B, 6), or one by one (n, 1)."""
    posterior, band = found.posterior, found.problem.spectrum.band
    every = np.ones(posterior.y.size)
    rows = weight[band] if len(weight) == len(BANDS) else weight
    every[: 6 * band.size] = np.broadcast_to(rows, (band.size, 6)).ravel()
    return replace(found, posterior=linear_posterior(every[:, None] * posterior.X, every * posterior.y))


def stretch(found: Model) -> float:
    """Return the largest deviation that any tolerance of a cause had to take, in its standard deviations: a cause that
    nobody looks for leaves no residual if it may be as large as it likes.
    """
    named = sum(course.size for one in found.named for course in one.course.values())
    start = found.problem.factor.shape[1] + found.problem.kinematics.shape[1]
    return float(np.abs(found.posterior.mean[start : found.posterior.mean.size - named]).max(initial=0.0))


def verdict(named: int, worst: float, checks: "tuple[QualityCheck, ...]", *, in_conflict: bool = False) -> Verdict:
    """Return the verdict from how many causes were named, the ``worst`` z that is left where it matters (`largest_z`),
    the data-quality checks, and whether body or tolerances are ``in_conflict``: a name beside which they must be
    strange is only resembled.
    """
    failed = any(not quality.ok for quality in checks)
    if worst <= LIMIT and not in_conflict:
        return "named, complete" if named or failed else "nothing wrong"
    if (failed or (named and not in_conflict)) and worst <= _BEYOND:
        return "named, incomplete"
    return "unexplained"

"""What disturbs a session beyond the noise: kinematics that are wrong coherently, plates within their tolerances; how
large by evidence.

The errors of independent sources, each of one standard deviation, enter the equations b = W' S^-1 y as scores W' S^-1
e; with the scores as columns of F the covariance is F F', exact over all sources (`uncertainty/sources`). The model
is b ~ N(H phi, noise H + kinematics² F_kinematics F_kinematics' + F_plates F_plates'),  and the two sizes are those
under which the session's own b is most probable given the table (evidence). What is left
for the parameters is H (...)^-1 H in place of H.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.body.changes import parts_as_segments
from biodance.body.parts import shift_matter
from biodance.body.tables.error_sizes import error_size
from biodance.identification.posterior import Information
from biodance.identification.statistics import Fit
from biodance.motion.dynamics import regressor_of
from biodance.motion.kinematics import segment_motion
from biodance.records import Array, Index, Motion, Sip
from biodance.uncertainty.bands import Bands, Noise
from biodance.uncertainty.caution import shift_slope
from biodance.uncertainty.plates import PLATE_SOURCES, plate_errors, plate_sources
from biodance.uncertainty.response import Response
from biodance.uncertainty.sources import deviations, of_markers, transpose

EVERY, PREDICTING = 8, 300
"""Frames: one of so many (two of a run at least) is enough to predict the size of the marker residuals from; of long
sessions so many in all (seven minutes: 303 for 1212, the prediction changes by 0.05 %)."""
SHORTEST = 8
"""Frames: shorter runs have no accelerations worth the name."""
KINEMATICS = (0.7, 1.0, 1.4, 2.0, 2.8)
_NOISE = (1.7, 2.2, 3.0, 4.5, 7.0, 10.0, 15.0, 22.0)
"""Sizes among which the evidence chooses: of the kinematic errors, and variance factor of the noise (never below 1.7:
the parameters absorb part of what is noise)."""


@dataclass(frozen=True, eq=False)
class Mismatch:
    """``kinematics`` (p, n), ``plates`` (p, m): scores W' S^-1 e over all trials of n and m independent sources of
    errors e, each of one standard deviation. Behind the plates stand the corrections that were made (`Fit.doubts`), and
    the shares of `Body.parts`. ``rows``: what the same trials tell of parameters, plates and corrections together; None
    where nobody asked.
    """

    kinematics: Array
    plates: Array
    rows: "PlateRows | None" = None


@dataclass(frozen=True, eq=False)
class PlateRows:
    """The equations of p parameters and m errors of plates and corrections, X = [W E]: ``normal`` X' S^-1 X (p + m,
    p + m), ``target`` X' S^-1 y (p + m,) and ``kinematics`` X' S^-1 e (p + m, n).
    """

    normal: Array
    target: Array
    kinematics: Array


@dataclass(frozen=True)
class Sizes:
    """How large the disturbances are: ``kinematics`` (1 = as drawn), ``noise`` variance factor (1 = as learned)."""

    kinematics: float
    noise: float


def mismatch(
    body: Body, fits: tuple[Fit, ...], noise: Noise, *, softer: float | None = None, with_rows: bool = False
) -> Mismatch:
    """Return the scores of kinematics and plates over all trials; ``with_rows`` what they tell of the plates, too.

    Skin and flesh slide ``softer`` times as much as the table says, by default as the markers show (`softness`).
    """
    whole, found = parts_as_segments(body), nothing(body)
    sources, size = of_markers(whole), len(found.kinematics)
    doubts = max((fit.doubts.shape[2] for fit in fits), default=0)
    asked = size + (PLATE_SOURCES + doubts) * with_rows
    scores = np.zeros((asked, found.kinematics.shape[1]))
    products = np.zeros((asked, size + found.plates.shape[1] + doubts + 1))
    for fit, pick in long_runs(fits, noise.bands):
        motion = fit.motion.at(pick)
        # Noise at the rate of this trial's thinned samples.
        white = noise.at(fit.motion.rate)
        beside = fit.doubts[pick] if fit.doubts.size else np.zeros((pick.size, 6, doubts))
        rows = np.concatenate([*_rows(body, motion, white, beside), fit.wrench.value[pick][:, :, None]], axis=2)
        weight = white.weighted(rows[:, :, :asked])
        # Sums over frames and channels of (S^-1 row)' row: W'S^-1 [W E doubts y].
        products += np.tensordot(weight, rows, axes=((0, 1), (0, 1)))
        del rows  # a half of what a long run keeps
        scores += transpose(sources, Response.of(whole, motion), weight).T
    # Soft tissue belongs to no joint; joint centres and hinges keep their sizes.
    soft = np.array([not joint for source in sources for joint in source.joints])
    more = softness(body, fits, noise.bands) if softer is None else softer
    scores *= np.where(soft, more, 1.0) * deviations(whole, sources)
    told = PlateRows(products[:, :asked], products[:, -1], scores) if with_rows else None
    return Mismatch(scores[:size], products[:size, size:-1], told)


def _rows(body: Body, motion: Motion, noise: Noise, doubts: Array) -> tuple[Array, ...]:
    """Return the regressor W (F, 6, p) of a run, and the errors of plates, the ``doubts`` (F, 6, n) and the errors of
    the shares of parts in its wrench.
    """
    links = regressor_of(segment_motion(body, motion), gravity=body.gravity)
    W = links if body.sharing is None else links @ body.sharing
    # Plates err on the wrench that the table's body needs: to first order any body near it.
    return W, plate_errors(W @ body.sip.phi, motion.rate, noise, plate_sources()), doubts, links @ share_errors(body)


def softness(body: Body, fits: tuple[Fit, ...], bands: Bands) -> float:
    """Return how many times the skin slides what the table says: by how much the markers' residuals are larger than
    that predicts, 1 where they are not.
    """
    whole = parts_as_segments(body)
    sources = of_markers(whole)
    variance, predicted, observed = deviations(whole, sources) ** 2, 0.0, 0.0
    every = max(EVERY, sum(pick.size for _, pick in long_runs(fits, bands)) // PREDICTING)
    for fit, pick in long_runs(fits, bands):
        residual = fit.motion.residual[pick]
        if residual.shape[1] and np.isfinite(residual).any():
            few = pick[:: min(every, max(1, pick.size // 2))]
            trial = Response.of(whole, fit.motion.at(few))
            # Mean square distances add over independent sources: sum of variance times unit square.
            predicted += float(variance @ np.concatenate([source.squares(trial) for source in sources])) * pick.size
            observed += float(np.nanmean(residual**2)) * pick.size
    return float(np.sqrt(max(1.0, observed / predicted))) if predicted > 0 else 1.0


def long_runs(fits: tuple[Fit, ...], bands: Bands) -> Iterator[tuple[Fit, Index]]:
    """Yield every run of used frames that is long enough, with its trial."""
    for fit in fits:
        for pick in bands.runs(fit.use, fit.motion.rate):
            if pick.size >= SHORTEST:
                yield fit, pick


def nothing(body: Body) -> Mismatch:
    """Return the scores of no frames."""
    size, sources = 10 * len(body.segments), sum(len(source.groups) for source in of_markers(parts_as_segments(body)))
    return Mismatch(np.zeros((size, sources)), np.zeros((size, PLATE_SOURCES + share_errors(body).shape[1])))


def share_errors(body: Body) -> Array:
    """Return what the table's share of its `parts` may be off, (10 M, K) parameters of the M links, each column of one
    standard deviation: the part has more, the rest of its segment less, the whole is the same.

    Without them a part that moves would weigh its whole: what a nodding head shows, over the table's share of it.
    """
    table, count, columns = body.sharing, len(body.segments), []
    if table is None:
        return np.zeros((10 * count, 0))
    phi = table @ body.sip.phi
    for k, part in enumerate(body.parts):
        own = slice(10 * (count + k), 10 * (count + k + 1))
        rest = slice(10 * part.segment, 10 * (part.segment + 1))
        _, origin = body.place_on_segment(body.segment_joint[count + k])
        for error in _part_errors(part.name, phi[own]).T:
            column = np.zeros(len(phi))
            # The rest of the segment loses what the part gains, seen from the segment's origin.
            column[own], column[rest] = error, -shift_matter(origin) @ error
            columns.append(column)
    return np.array(columns).T


def _part_errors(name: str, phi: Array) -> Array:
    """Return the errors (10, 4) of a part of parameters ``phi`` (10,): its mass, and where along three axes its matter
    lies.
    """
    off = error_size("part_com", "head" if name == "head" else "other")
    return np.column_stack([error_size("segment_mass", "floor") * phi, off * shift_slope(phi)])


def covariance(H: Array, found: Mismatch, sizes: Sizes) -> Array:
    """Return the covariance (p, p) of b = W' S^-1 y at given parameters."""
    M, P = (x @ x.T for x in (found.kinematics, found.plates))
    return np.asarray(sizes.noise * H + sizes.kinematics**2 * M + P)


def evident_sizes(data: Information, found: Mismatch, prior: Sip) -> Sizes:
    """Return the sizes of the disturbances under which the session's data are most probable, given the table."""
    # b = W'S^-1 y has the covariance H under unit noise: in a basis with B H B' = 1 that is 1.
    H = data.triangle.T @ data.triangle
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    value, vector = np.linalg.eigh(H / np.outer(scale, scale))
    keep = value > 1e-9 * value.max()
    # Directions that the data hardly show are left out before they are divided by their size.
    basis = (vector[:, keep] / np.sqrt(value[keep])).T / scale
    e = basis @ (data.triangle.T @ (data.target - data.triangle @ prior.phi))
    # The table's covariance through b = H phi: B H P H B'.
    spread = basis @ H @ prior.covariance @ H @ basis.T
    moved, wrong = (basis @ scores for scores in (found.kinematics, found.plates))
    M, P = moved @ moved.T, spread + wrong @ wrong.T
    best, chosen = -np.inf, Sizes(1.0, 1.0)
    for kinematics in KINEMATICS:
        # One eigendecomposition for all noise factors, which only add to the eigenvalues.
        value, vector = np.linalg.eigh(kinematics**2 * M + P)
        turned = (vector.T @ e) ** 2
        for noise in _NOISE:
            likely = -0.5 * float(np.sum(np.log(value + noise) + turned / (value + noise)))
            if likely > best:
                best, chosen = likely, Sizes(kinematics, noise)
    return chosen


def temper(data: Information, found: Mismatch, sizes: Sizes) -> Information:
    """Return the information that is left for the parameters: H C^+ H, with C the covariance of b at given
    parameters.
    """
    R = data.triangle
    H = R.T @ R
    # Half' half = C^+: generalised least squares on b = H phi.
    half = inverse_root(covariance(H, found, sizes))
    rows = np.linalg.qr(np.column_stack([half @ H, half @ (R.T @ data.target)]), mode="r")
    triangle = np.zeros_like(data.R)
    triangle[: len(rows)] = rows
    # The misfit that no parameter explains stays beside what this triangle leaves.
    triangle[-1, -1] = np.hypot(triangle[-1, -1], data.R[-1, -1])
    return Information(triangle, data.frames)


def inverse_root(C: Array) -> Array:
    """Return X (k, p) with X' X = C^+ of a covariance ``C`` (p, p), directions that nothing moves left out."""
    # Units of the diagonal: otherwise masses would decide which directions are nothing.
    scale = np.sqrt(np.maximum(np.diag(C), 1e-300))
    value, vector = np.linalg.eigh(C / np.outer(scale, scale))
    keep = value > 1e-13 * value.max()
    return np.asarray((vector[:, keep] / np.sqrt(value[keep])).T / scale)

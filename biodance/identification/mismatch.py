"""What disturbs a session beyond the noise: kinematics that are wrong coherently, plates within their tolerances, how
large by evidence; and regression calibration: what noise in the kinematics takes from the parameters, given back.

The errors of independent sources, each of one standard deviation, enter the equations b = W' S^-1 y as scores W' S^-1
e; with the scores as columns of F the covariance is F F', exact over all sources (`uncertainty/sources`). The model
is b ~ N(H phi, noise H + kinematics² F_kinematics F_kinematics' + F_plates F_plates'),  and the two sizes are those
under which the session's own b is most probable given the table (evidence). What is left
for the parameters is H (...)^-1 H in place of H.

Fast movement is small movement: beyond 1 Hz skin and a trunk that is no rigid body add accelerations that nobody made.
They stand in the regressor, not in the wrench, and least squares answers with parameters that are too small (a light
trunk). What the true regressor is to be expected, given the measured one, is gain times measured (Carroll et al. 2006,
Measurement Error in Nonlinear Models, doi:10.1201/9781420010138). The gain is measured where it acts: what the plates
show of the wrench that trunk, legs and arms are predicted to need, band by band and channel by channel.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.body.changes import parts_as_segments
from biodance.body.parts import shift_matter
from biodance.body.tables.error_sizes import error_size
from biodance.identification.loads import PossibleTables, more_probable_table, with_room
from biodance.identification.posterior import BodyPosterior, Information, find_posterior
from biodance.identification.statistics import PAIRS, Fit, Statistics, learn_noise
from biodance.lab.markers.sets import part_of
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
    table, columns = body.sharing, []
    if table is None:
        return np.zeros((10 * len(body.segments), 0))
    phi = table @ body.sip.phi
    for k, part in enumerate(body.parts):
        (own, origin), rest = body.part_place(k), slice(10 * part.segment, 10 * (part.segment + 1))
        shared, other, way = (rest, own, -origin) if part.rest_moves else (own, rest, origin)
        for error in _part_errors(part.name, phi[shared]).T:
            column = np.zeros(len(phi))
            # The other piece of the segment loses what this one gains, seen from its own origin.
            column[shared], column[other] = error, -shift_matter(way) @ error
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


_FAST = 1.0
"""Hz: bands that begin here or higher are calibrated; in slower ones the gain is 1 within 1 % on virtual people."""
_SPREAD = 0.3
"""Standard deviation of a gain about 1 before the data."""
_PARTS = (("pelvis", "trunk_head"), ("thigh", "shank", "foot"), ("upper_arm", "forearm_hand"))


def undiluted(total: Statistics, phi: Array, known: Information, table: Sip) -> Statistics:
    """Return the statistics with the regressor as it is to be expected without the noise of its kinematics.

    Parameters
    ----------
    total : Statistics
        As measured, p = 10 parameters of each of N segments.
    phi : (p,) array
        SIP under which the gains are measured: those of a fit to ``total``.
    known : Information
        ``total`` whitened, without gains.
    table : Sip
        What is known of the N segments before the data.

    Returns
    -------
    Statistics
        The columns of trunk, legs and arms times their gains (0 to 1), in every band from 1 Hz and every channel of
        the wrench; slower bands and the wrench as they were. Matter at a joint moves alike on either side of it,
        whatever the gains: they act on what can be known of the parameters, so that no gain shows what no movement
        does.
    """
    kinds = [part_of(name) for name in table.segments]
    parts = np.repeat([[kind in part for kind in kinds] for part in _PARTS], 10, axis=1)
    learned, gram = _learned(known, table), np.array(total.gram)
    for band in np.flatnonzero((np.array(total.layout.bands.edges[:-1]) >= _FAST) & (total.count > 0)):
        turn = np.zeros((6, *learned.shape))
        for channel, square in enumerate(total.own[band]):
            # A part whose wrench is W (parts * phi): one column for each gain.
            gain = _gains(square, parts * phi, int(total.count[band]))
            # Columns times gain are columns plus (gain - 1); segments of no part and the target stay.
            lost = np.append(np.where(parts.any(axis=0), gain @ parts - 1.0, 0.0), 0.0)
            # X turn (phi, -1) = W (phi + lost * what can be known of phi) - y: each channel has its own gains.
            turn[channel] = np.eye(len(lost)) + lost[:, None] * learned
        # X_c'X_d per pair of channels becomes turn_c' (X_c'X_d) turn_d.
        gram[band] = turn[PAIRS[0]].swapaxes(1, 2) @ gram[band] @ turn[PAIRS[1]]
    return Statistics(gram, total.count, total.layout)


_NOTHING = 1e-6
"""Share of what the table knows that data must tell to tell anything: far above rounding (1e-12; with 1e-8 the last
digits of markers moved parameters by 2e-6 of their deviations), far below the least that a session of people told
(4e-5)."""


def _learned(known: Information, table: Sip) -> Array:
    """Return the matrix (p + 1, p + 1) that gives from true parameters, (phi, -1), those that the ``table`` expects of
    a body that moves alike, and -1: the table's own where the data tell nothing.
    """
    spread = table.covariance @ known.triangle.T
    learned, nothing = np.eye(len(table.phi) + 1), _NOTHING * np.eye(len(spread))
    # P R' (R P R' + eps)^-1 R: what least squares with the table as prior gives back of true parameters.
    share = spread @ np.linalg.solve(known.triangle @ spread + nothing, known.triangle)
    # With (phi, -1): share phi - (share phi0 - phi0) = phi0 + share (phi - phi0).
    learned[:-1, :-1], learned[:-1, -1] = share, share @ table.phi - table.phi
    return learned


_MOST = 0.6
"""Standard deviations by which giving back may move a mass. What is given back is unsure by about its own size, and no
interval counts that: they are too short by a sixth at most."""


def gains_move_masses(before: BodyPosterior, after: BodyPosterior) -> bool:
    """Whether giving back what noise takes moves a mass by more than `_MOST` of its standard deviations.

    A gain and the mass under which it is measured stand in for each other: where movement is slow and noise is most of
    what is fast, each round lowers the one and raises the other.
    """
    sd = np.sqrt(np.diag(before.covariance)[::10])
    return bool(np.any(np.abs(after.mean - before.mean)[::10] > _MOST * sd))


def _gains(gram: Array, parts: Array, count: int) -> Array:
    """Return the gains (G,) of the wrenches that ``parts`` (G, p) of the body are predicted to need, from the second
    moments (p + 1, p + 1) of [W y] in one channel.
    """
    # Normal equations of y on the parts' wrenches: q_ij = (W phi_i)'(W phi_j), seen_i = (W phi_i)'y.
    square, seen = parts @ gram[:-1, :-1] @ parts.T, parts @ gram[:-1, -1]
    left = gram[-1, -1] - seen @ np.linalg.lstsq(square, seen, rcond=None)[0]
    # Mean square of what the unconstrained fit leaves, never zero: relative and absolute floor.
    noise = max(float(left), 1e-9 * float(gram[-1, -1])) / count + 1e-12
    # Ridge towards a gain of 1: prior N(1, _SPREAD²) adds 1 / _SPREAD² to precision and target.
    precision = square / noise + np.eye(len(parts)) / _SPREAD**2
    return np.clip(np.linalg.solve(precision, seen / noise + 1.0 / _SPREAD**2), 0.0, 1.0)


_ROUNDS, _AGAIN = 2, 4
"""How often the dilution is measured under the parameters of the fit before; rounds of learning the noise anew after
it."""


@dataclass(frozen=True, eq=False)
class Calibrated:
    """``data`` whitened, less what disturbs them; ``sizes`` of the disturbances; ``noise`` as learned; ``diluted``
    whether noise in the kinematics takes from the parameters what cannot be given back.
    """

    data: Information
    sizes: Sizes
    noise: Noise
    diluted: bool = False


def discounted(total: Statistics, noise: Noise, found: Mismatch | None, room: Sip) -> Calibrated:
    """Return the data of ``total`` whitened by ``noise``, less what twins and plates disturb (``found``), sizes chosen
    by evidence under the table ``room`` that may carry a load.
    """
    data = total.information(noise)
    if found is None:
        return Calibrated(data, Sizes(0.0, 1.0), noise)
    sizes = evident_sizes(data, found, room)
    return Calibrated(temper(data, found, sizes), sizes, noise)


def undo_dilution(
    body: Body,
    total: Statistics,
    measured: Calibrated,
    found: Mismatch,
    tables: PossibleTables,
    room: Sip,
    loads: Array,
) -> Calibrated:
    """Return the ``measured`` data of ``total`` with their dilution given back; as they are, and ``diluted``, where
    that moves a mass by more than its intervals can bear. ``tables`` as they may be before the data; ``loads`` the
    covariance (p, p) of those that nobody declared, ``room`` the table that may carry them.
    """
    now, known = measured, total.information(measured.noise)
    for _ in range(_ROUNDS):
        table, _, _ = more_probable_table(now.data, tables, body)
        posterior = find_posterior(now.data, table)
        # With a load where the data make one more probable: arms that are too light for what they carry show more
        # than is predicted, and no dilution.
        loaded = find_posterior(now.data, with_room(table, loads))
        likely = max(posterior, loaded, key=lambda one: one.log_evidence)
        real = undiluted(total, likely.mean, known, table)
        now = discounted(real, learn_noise(real, room, rounds=_AGAIN), found, room)
        # Gains are measured under these parameters: where they move them far, one stands in for the other.
        if gains_move_masses(posterior, find_posterior(now.data, table)):
            return Calibrated(measured.data, measured.sizes, measured.noise, diluted=True)
    return now

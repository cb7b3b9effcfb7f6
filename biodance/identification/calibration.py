"""Regression calibration of a session: its data discounted by what twins and plates disturb, with what noise in the
kinematics takes from the parameters given back (regression dilution).

Fast movement is small movement: beyond 1 Hz skin and a trunk that is no rigid body add accelerations that nobody made.
They stand in the regressor, not in the wrench, and least squares answers with parameters that are too small (a light
trunk). What the true regressor is to be expected, given the measured one, is gain times measured (Carroll et al. 2006,
Measurement Error in Nonlinear Models, doi:10.1201/9781420010138). The gain is measured where it acts: what the plates
show of the wrench that trunk, legs and arms are predicted to need, band by band and channel by channel.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.body.human.skeleton import kind_of
from biodance.identification.loads import PossibleTables, more_probable_table, with_room
from biodance.identification.mismatch import Mismatch, Sizes, evident_sizes, temper
from biodance.identification.posterior import BodyPosterior, Information, find_posterior
from biodance.identification.statistics import PAIRS, Statistics, learn_noise
from biodance.records import Array, Sip
from biodance.uncertainty.bands import Noise

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
    kinds = [kind_of(name) for name in table.segments]
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

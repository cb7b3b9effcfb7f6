"""Added mass: which segment carries a load, how heavy, where on it, how sure - against an earlier session or against
the table.

Hypotheses "a load sits on segment s" are compared with "no load" by Bayes factors under one linear Gaussian model: the
body as known before (the posterior of the reference session, or the table), plus the ten parameters of a load whose
mass and place inside the segment's box are unknown. The load's prior is the second moment of such loads, so that light
and heavy ones both fit; its size is then estimated under a wider prior, which does not shrink it; a load is positive.
The smallest load that the session could have found is computed from its information alone.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import norm

from biodance.body.body import Body
from biodance.identification.identification import Identification
from biodance.identification.information import Information
from biodance.identification.knowledge import SIGMAS
from biodance.identification.loads import compact_load, load_moments
from biodance.identification.posterior import prior_factor
from biodance.records import Array, Sip

_THRESHOLD = 0.05
"""p of "no load" below which a load is announced."""


WIDE = 5.0
"""How much wider than for a typical load the prior of its size is; the typical one shrinks 2.4 kg on a forearm by
0.03.
"""


@dataclass(frozen=True, eq=False)
class LoadCandidate:
    """The hypothesis of a load on one segment.

    ``mass`` kg with ``sd``; ``place`` (3,) m of its CoM in the segment's joint frame with ``place_sd`` (3,), NaN where
    the mass is less than twice its sd; ``log_bayes_factor`` against no load; ``probability`` among all hypotheses;
    ``smallest`` kg, the load on this segment that this session would find in half of the cases.
    """

    segment: str
    mass: float
    sd: float
    place: Array
    place_sd: Array
    log_bayes_factor: float
    probability: float
    smallest: float

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the mass, kg."""
        return self.mass - SIGMAS * self.sd, self.mass + SIGMAS * self.sd


@dataclass(frozen=True, eq=False)
class LoadSearch:
    """All hypotheses, most probable first; ``p_no_load`` probability that nothing was added; ``reference`` in words."""

    suspects: tuple[LoadCandidate, ...]
    p_no_load: float
    reference: str

    @property
    def found(self) -> bool:
        """Whether a load is announced."""
        return self.p_no_load < _THRESHOLD and self.suspects[0].mass > 0

    @property
    def best(self) -> LoadCandidate:
        """The most probable hypothesis."""
        return self.suspects[0]

    @property
    def set(self) -> tuple[str, ...]:
        """Segments, most probable first, that hold 95 % of the probability of a load."""
        share = np.cumsum([s.probability for s in self.suspects]) / sum(s.probability for s in self.suspects)
        return tuple(s.segment for s in self.suspects[: int(np.searchsorted(share, 0.95)) + 1])


def added_mass(session: Identification, *, reference: Identification | None = None) -> LoadSearch:
    """Return where and how much mass ``session`` carries beyond ``reference`` (an unloaded session of the same person)
    or the table.

    Against the table alone, a load on pelvis, trunk or thigh cannot be told from a wrong table or a wrong scale:
    ``set`` then holds several segments.

    Raises
    ------
    NotSolved
        Nothing was identified from the reference.
    """
    before = session.belief.prior if reference is None else expect_unloaded(reference, session)
    rows, surprise = surprised(session.data, before)
    found = [_suspect(session.body, i, rows[:, 10 * i : 10 * i + 10], surprise) for i in range(len(before.segments))]
    weight = np.array([f.log_bayes_factor for f in found]) - np.log(len(found))
    top = max(0.0, float(weight.max()))
    total = np.exp(-top) + np.exp(weight - top).sum()
    chance = np.exp(weight - top) / total
    suspects = tuple(replace(found[i], probability=float(chance[i])) for i in np.argsort(-chance))
    words = "the table" if reference is None else f"the session with {', '.join(reference.trials)}"
    return LoadSearch(suspects, float(np.exp(-top) / total), words)


def expect_unloaded(reference: Identification, session: Identification) -> Sip:
    """Return what ``reference`` lets expect of the unloaded body in ``session``, with covariance.

    The belief of the reference, moved by what the table itself changed between the sessions (another static trial,
    other lengths).

    Raises
    ------
    NotSolved
        The reference contradicts every possible body, so its belief is none of a body.
    """
    shift = session.belief.prior.phi - reference.belief.prior.phi
    return Sip(reference.sip.segments, reference.belief.mean + shift, reference.belief.covariance)


def surprised(data: Information, before: Sip) -> tuple[Array, Array]:
    """Return the data's rows (r, p) and what they show beyond ``before`` (r,), whitened by noise and by the uncertainty
    of ``before``.

    With R phi = y + noise and phi ~ N(before): y - R before has the covariance 1 + R P R'.
    """
    A = data.triangle @ prior_factor(before)
    L = np.linalg.cholesky(np.eye(len(A)) + A @ A.T)
    both = np.column_stack([data.triangle, data.target - data.triangle @ before.phi])
    white = solve_triangular(L, both, lower=True)
    return white[:, :-1], white[:, -1]


def _suspect(body: Body, i: int, rows: Array, surprise: Array) -> LoadCandidate:
    """Return the hypothesis of a load on segment ``i`` whose columns are ``rows`` (r, 10); its probability is filled
    in later.
    """
    U = load_moments(body, i)
    B = rows @ U
    S, t = B.T @ B, B.T @ surprise
    inner, wide = (np.linalg.inv(np.eye(len(S)) / scale**2 + S) for scale in (1.0, WIDE))
    load, covariance = U @ wide @ t, U @ wide @ U.T
    mass, sd = float(load[0]), float(np.sqrt(covariance[0, 0]))
    occam = -0.5 * float(np.linalg.slogdet(np.eye(len(S)) + S)[1])
    bayes = occam + 0.5 * float(t @ inner @ t) + float(norm.logcdf(mass / sd) + np.log(2.0))
    place, place_sd = np.full(3, np.nan), np.full(3, np.nan)
    if mass > 2 * sd:
        place = load[1:4] / mass
        slope = np.column_stack([-place / mass, np.eye(3) / mass])
        place_sd = np.sqrt(np.diag(slope @ covariance[:4, :4] @ slope.T))
    shown = B.T @ (rows @ compact_load(body.boxes[i].mean(axis=0)))
    per_kg = 0.5 * float(shown @ inner @ shown)
    wanted = (
        np.log((1 - _THRESHOLD) / _THRESHOLD * len(body.segments))
        - np.log(2.0)
        - occam
        - 0.5 * float(np.trace(S @ inner))
    )
    smallest = float(np.sqrt(max(wanted, 0.0) / per_kg)) if per_kg > 0 else float("inf")
    return LoadCandidate(body.segments[i], mass, sd, place, place_sd, bayes, 0.0, smallest)

"""Added mass: which segment carries a load, how heavy, where on it, how sure - against an earlier session or against
the table.

The hypotheses are "no load" and "m kg on segment s", under one linear Gaussian model: the body as known before (the
posterior of the reference session, or the table) plus the load. What was known before may be wrong by more than its
standard deviations say (another laboratory's people, a table that cuts the trunk elsewhere), and without a reference
the declared mass may be wrong or include the load: these hypotheses (`unloaded_bodies`) are weighted by their evidence
together with the load, so that a load is announced only where an odd body cannot do as well.

A load of m kg has the parameters m (u + G z): u and G G' are mean and covariance of a load of 1 kg whose place is
unknown (`unit_load`), z is standard normal. Whitened data y, in which the body's own uncertainty is noise of unit
variance, then have the mean m b and the covariance 1 + m² D D', with b = B u, D = B G and B the segment's columns. For
every m that is closed form, so "no load" and every mass stand in one table of weights: the probability of no load and
the interval of the mass are read from the same numbers and cannot contradict each other.

Whether there is a load is a question of evidence, for which mass and place need a proper prior. How heavy it is, is
not: the data tell mass and first moments, m and m x, and a place that is as likely anywhere in and near the box spreads
the first moments of m kg over a volume of m³. The evidence prefers lighter loads for it: 2.4 ± 0.3 kg near the middle
of a segment came out 0.1 kg light. The size is weighed by Jeffreys' prior, for which a mass is not the less probable
the better its first moments are known: `LoadView.log_place_information` gives back what the evidence takes.
"""

from bisect import bisect_left
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from biodance.identification.identification import Identification
from biodance.identification.loads import ODDS, matter_follows_joint, unit_load, with_matter_placed, with_sides
from biodance.identification.posterior import Information
from biodance.records import Array, Sip
from biodance.threads import one_thread
from biodance.uncertainty.caution import in_other_frames

_ODD = (1.0, 1.5, 2.25, 3.4)
"""Times that the body may differ from what was known before by more than its standard deviations, equally probable."""
_DECLARED = ((0.0, False, 0.4), (0.0, True, 0.4), (2.5, False, 0.2))
"""What the declared mass may be: kg by which it is wrong (standard deviation), whether it holds the load, probability.
"""


@dataclass(frozen=True, eq=False)
class UnloadedBody:
    """One hypothesis on the body without a load: its prior ``before``, with ``log_prior``; ``holds``: whether the
    declared mass includes the load, so that the body is lighter by it.
    """

    before: Sip
    log_prior: float
    holds: bool


def expect_unloaded(reference: Identification, session: Identification) -> Sip:
    """Return what ``reference`` lets expect of the unloaded body in ``session``, with covariance.

    The posterior of the reference, moved by what the table itself changed between the sessions (another static trial,
    other lengths), with the trunk's matter in the same of its two places, known as on another day (markers glued
    anew). The session's table counts at the mass of the
    reference: the mass that the session declares may hold the load.

    Raises
    ------
    NotSolved
        The reference contradicts every possible body, so its posterior is none of a body.
    """
    along = matter_follows_joint(reference.posterior.prior, reference.body)
    same = with_matter_placed(session.posterior.prior, session.body, along=along)
    table = scaled_to_mass(same, float(reference.posterior.prior.mass.sum()))
    shift = table.phi - reference.posterior.prior.phi
    moved = Sip(reference.sip.segments, reference.posterior.mean + shift, reference.posterior.covariance)
    return in_other_frames(moved, session.body.joint_errors)


def tables_by_sides(session: Identification) -> tuple[tuple[Sip, float], ...]:
    """Return the table of ``session`` with sides alike and with each side on its own, each with its log probability: a
    load on one side may not pass for sides that are not alike, nor what a side has of its own for a load.
    """
    prior = session.posterior.prior
    alike, apart = (prior if session.apart == one else with_sides(prior, apart=one) for one in (False, True))
    # Odds of 2 for alike sides as log probabilities: 1 / (1 + e^-odds) and 1 / (1 + e^odds).
    return (alike, float(-np.log1p(np.exp(-ODDS)))), (apart, float(-np.log1p(np.exp(ODDS))))


def table_like(one: Identification, other: Identification) -> Sip:
    """Return the table of session ``one`` with the trunk's matter and the sides as in session ``other``."""
    table = with_matter_placed(
        one.posterior.prior, one.body, along=matter_follows_joint(other.posterior.prior, other.body)
    )
    apart = one.apart and table is one.posterior.prior
    return table if apart == other.apart else with_sides(table, apart=other.apart)


def scaled_to_mass(prior: Sip, mass: float) -> Sip:
    """Return the table ``prior`` scaled to a body of the same build with a total mass of ``mass`` kg."""
    ratio = mass / float(prior.mass.sum())
    # A body scaled by r: mean times r, covariance times r².
    return Sip(prior.segments, ratio * prior.phi, ratio**2 * np.asarray(prior.covariance))


def unloaded_bodies(tables: tuple[tuple[Sip, float], ...], *, weighed: bool) -> tuple[UnloadedBody, ...]:
    """Return the hypotheses on the body without a load: priors inflated from each of the ``tables`` (given with log
    probabilities), and, unless it was ``weighed`` without a load, a declared mass that includes the load or is wrong.
    """
    cases = ((0.0, False, 1.0),) if weighed else _DECLARED
    return tuple(
        UnloadedBody(inflate_prior(table, times, wrong), log + float(np.log(share / len(_ODD))), holds)
        for table, log in tables
        for wrong, holds, share in cases
        for times in _ODD
    )


def inflate_prior(before: Sip, times: float, wrong: float = 0.0) -> Sip:
    """Return ``before`` with all standard deviations multiplied by ``times`` at unchanged uncertainty of the total
    mass; then with an error of the total mass of standard deviation ``wrong`` kg, distributed over the segments in
    proportion.
    """
    covariance = np.asarray(before.covariance)
    total = np.tile(np.eye(10)[0], len(before.segments))
    # C 1 (1 the masses): covariance of every parameter with the total mass.
    gain = covariance @ total
    known = float(total @ gain)
    if known > 0:
        # The part of C that goes with the total: its variance is known, only the rest is inflated.
        shared = np.outer(gain, gain) / known
        covariance = times**2 * (covariance - shared) + shared
    # One kilogram of this body in its own proportions.
    body = before.phi / (total @ before.phi)
    return Sip(before.segments, before.phi, covariance + wrong**2 * np.outer(body, body))


def whiten_innovation(data: Information, before: Sip) -> tuple[Array, Array, float]:
    """Return the rows of the data (r, p) and the innovation relative to ``before`` (r,), both whitened by noise and by
    the uncertainty of ``before``, and the log evidence of the data without a load.

    With R phi = y + noise and phi ~ N(before, P): y - R before has the covariance 1 + R P R'.
    """
    # Innovation y - R phi0 has the covariance 1 + R P R' = L L'.
    spread = data.triangle @ before.covariance @ data.triangle.T
    L = np.linalg.cholesky(np.eye(len(spread)) + spread)
    both = np.column_stack([data.triangle, data.target - data.triangle @ before.phi])
    white = solve_triangular(L, both, lower=True)
    # - log|L L'| / 2 - |L^-1 innovation|² / 2.
    log_evidence = -float(np.log(np.diag(L)).sum()) - 0.5 * float(white[:, -1] @ white[:, -1])
    return white[:, :-1], white[:, -1], log_evidence


MASSES = np.geomspace(0.005, 50.0, 1200)
"""(n,) kg at which the posterior is tabled: 0.8 % apart."""
_USUAL = 5.0
"""kg: loads are half normal with this deviation; it shrinks 2.4 ± 0.25 kg by 0.006 kg."""
_TAIL = 0.025
"""Probability on each side of a 95 % interval."""


@dataclass(frozen=True, eq=False)
class LoadPosterior:
    """``none`` probability that there is no load; ``weight`` (n,) probability of a load of each of `MASSES`, with
    ``none`` summing to 1.
    """

    none: float
    weight: Array

    @property
    def mass(self) -> float:
        """Expected load, kg: 0 counts with the probability of no load."""
        return float(self.weight @ MASSES)

    @property
    def sd(self) -> float:
        """Standard deviation of the load, kg."""
        # E[m²] - E[m]².
        return float(np.sqrt(max(float(self.weight @ MASSES**2) - self.mass**2, 0.0)))

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the load, kg, each tail 2.5 %; it starts at 0 where no load is more probable than that."""
        low, high = (self._quantile(share) for share in (_TAIL, 1 - _TAIL))
        return low, high

    def _quantile(self, share: float) -> float:
        # Distribution function at the middle of each cell; the mass `none` sits at zero.
        below = self.none + np.cumsum(self.weight) - 0.5 * self.weight
        return float(np.interp(share, np.append(self.none, below), np.append(0.0, MASSES), left=0.0))


@dataclass(frozen=True, eq=False)
class LoadView:
    """What data say of a load on one segment, in the directions in which its place is unknown.

    Where the body's mass holds the load's, b is less by what a body shows per kilogram.

    ``squares`` b'b; ``shown`` b'y; ``strength`` (k,) eigenvalues of D'D; ``unit`` and ``surprise`` (k,) D'b and D'y in
    their basis; ``ways`` (10, k) parameters per kg that each direction changes; ``mean`` (10,) u.
    """

    squares: float
    shown: float
    strength: Array
    unit: Array
    surprise: Array
    ways: Array
    mean: Array

    @classmethod
    def of(cls, columns: Array, surprise: Array, unit: tuple[Array, Array], less: Array) -> "LoadView":
        """Return the view through ``columns`` (r, 10) of a segment at what the data show, ``surprise`` (r,); ``unit``
        mean (10,) and factor (10, k) of a load of 1 kg, ``less`` (r,) what the body shows less for every kilogram of
        it.
        """
        mean, factor = unit
        # Mean of a load's data per kg, and what its unknown place adds; (r,) and (r, k).
        b, D = columns @ mean - less, columns @ factor
        # In the eigenvectors of D'D the covariance 1 + m² D D' is diagonal on the directions of D.
        strength, basis = np.linalg.eigh(D.T @ D)
        D = D @ basis
        return cls(
            float(b @ b), float(b @ surprise), np.maximum(strength, 0.0), D.T @ b, D.T @ surprise, factor @ basis, mean
        )

    def log_ratio(self, masses: Array) -> Array:
        """Return the log likelihood ratio (n,) of loads of ``masses`` (n,) kg against none."""
        # Of each direction (k, 1) for every mass: Woodbury for the quadratic form of N(y; m b, 1 + m² D D').
        surprise, unit, wide = self.surprise[:, None], self.unit[:, None], self._wide(masses)
        spread = ((masses * (surprise - masses * unit)) ** 2 / wide).sum(axis=0) - np.log(wide.prod(axis=0))
        return np.asarray(masses * self.shown - 0.5 * masses**2 * self.squares + 0.5 * spread)

    def log_place_information(self, masses: Array) -> Array:
        """Return half the logarithm (n,) of how much better the place of loads of ``masses`` (n,) kg is known after
        the data: what the evidence of each mass pays for places that the data exclude.
        """
        return np.asarray(0.5 * np.log(self._wide(masses).prod(axis=0)))

    def at_the_mean(self, masses: Array) -> tuple[Array, Array]:
        """Return sum u² / (1 + m² D'D) and sum log(1 + m² D'D) (n,) for ``masses`` (n,) kg, see `log_ratio_if`."""
        wide = self._wide(masses)
        return (self.unit[:, None] ** 2 / wide).sum(axis=0), np.log(wide.prod(axis=0))

    def _wide(self, masses: Array) -> Array:
        """Return (k, n) the eigenvalues of 1 + m² D D' other than 1; their product is its determinant."""
        return np.asarray(1 + np.multiply.outer(self.strength, masses**2))

    def place(self, weight: Array) -> tuple[Array, Array]:
        """Return mean and standard deviation (3,) m of the load's CoM in the segment's frame, over masses of
        ``weight`` (n,).
        """
        m = MASSES[:, None]
        narrow = 1 / (1 + m**2 * self.strength)
        # E[z | m, y] = m (D'y - m D'b) / (1 + m² w) per direction, turned into metres by `ways`.
        place = self.mean[1:4] + (m * narrow * (self.surprise - m * self.unit)) @ self.ways[1:4].T
        share = weight / weight.sum()
        mean = share @ place
        # Law of total variance over the masses: var(z | m) = 1 / (1 + m² w), plus that of the means.
        return mean, np.sqrt(share @ (narrow @ (self.ways[1:4] ** 2).T + (place - mean) ** 2))


def log_ratio_if(true: float, masses: Array, squares: Array, own: Array, wide: Array) -> Array:
    """Return the log likelihood ratio (r, n) of loads of ``masses`` (n,) kg against none in r views, if the data showed
    a load of ``true`` kg at the mean place and nothing else; ``squares`` (r,) b'b, ``own`` and ``wide`` (r, n) of each
    view `at_the_mean`.
    """
    # y = true b: m b'y - m² b'b / 2 = (true m - m² / 2) b'b.
    shown = np.multiply.outer(squares, true * masses - 0.5 * masses**2)
    return np.asarray(shown + 0.5 * (masses**2 * (true - masses) ** 2 * own - wide))


def log_mass_prior(masses: Array) -> Array:
    """Return the log probability (n,) of each of ``masses`` (n,) kg, given that there is a load."""
    # Half normal density times the width of each mass's cell (the masses are spaced geometrically).
    log = -0.5 * (masses / _USUAL) ** 2 + np.log(np.gradient(masses))
    return np.asarray(log - np.log(np.exp(log).sum()))


_THRESHOLD = 0.01
"""Probability of "no load" below which a load is announced."""
_UNTOLD = 0.5
"""Probability of "no load" from which the answer is "none"; between the two limits it cannot be told."""
_COARSE, _TRUE = MASSES[::6], np.geomspace(0.05, 25.0, 60)
"""kg: masses over which the smallest load that can be found is integrated and searched."""

LoadStatus = Literal["found", "none", "cannot tell"]


@dataclass(frozen=True, eq=False)
class LoadCandidate:
    """The hypothesis of a load on one segment.

    ``posterior`` of its mass, no load included; ``place`` (3,) m of its CoM in the segment's joint frame with
    ``place_sd`` (3,), NaN where the interval of the mass holds zero; ``log_bayes_factor`` against no load;
    ``probability`` among all hypotheses; ``smallest`` kg, the load on this segment that this session would find in half
    of the cases.
    """

    segment: str
    posterior: LoadPosterior
    place: Array
    place_sd: Array
    log_bayes_factor: float
    probability: float
    smallest: float

    @property
    def mass(self) -> float:
        """Expected mass, kg; 0 counts with the probability of no load."""
        return self.posterior.mass

    @property
    def sd(self) -> float:
        """Standard deviation of the mass, kg."""
        return self.posterior.sd

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the mass, kg; it starts at 0 unless no load is less probable than 2.5 %."""
        return self.posterior.interval


@dataclass(frozen=True, eq=False)
class LoadSearch:
    """All hypotheses, most probable first; ``p_no_load`` probability that nothing was added; ``reference`` in words;
    ``doubts`` why no load may be stated from this session whatever its data say, () if it may; ``lies_on`` the segment
    on which the place of the most probable one lies, "" where nobody looked (`nearest_segment`).
    """

    suspects: tuple[LoadCandidate, ...]
    p_no_load: float
    reference: str
    doubts: tuple[str, ...] = ()
    lies_on: str = ""

    @property
    def status(self) -> LoadStatus:
        """Whether a load is "found" (announced: none is improbable, the interval of its mass excludes zero and the
        session can see loads of this size), there is "none" (more probable than one), or one "cannot tell" (between
        the two, or with `doubts`).
        """
        if self.doubts:
            return "cannot tell"
        if self.p_no_load >= _UNTOLD:
            return "none"
        seen = self.best.interval[0] > 0 and self.best.mass >= self.best.smallest
        return "found" if self.p_no_load < _THRESHOLD and seen else "cannot tell"

    @property
    def found(self) -> bool:
        """Whether a load is announced."""
        return self.status == "found"

    @property
    def best(self) -> LoadCandidate:
        """The most probable hypothesis."""
        return self.suspects[0]

    @property
    def set(self) -> tuple[str, ...]:
        """Segments, most probable first, that hold 95 % of the probability of a load."""
        # Probabilities of a load alone, without "no load": they sum to one over the segments.
        share = np.cumsum([s.probability for s in self.suspects]) / sum(s.probability for s in self.suspects)
        return tuple(s.segment for s in self.suspects[: int(np.searchsorted(share, 0.95)) + 1])

    @property
    def segments(self) -> tuple[str, ...]:
        """Segments that may carry the load: the `set`, and the one on which the load's place lies, if it is another."""
        return self.set if self.lies_on in ("", *self.set) else (*self.set, self.lies_on)


@one_thread()
def added_mass(
    session: Identification, *, reference: Identification | None = None, doubts: tuple[str, ...] = ()
) -> LoadSearch:
    """Return where and how much mass ``session`` carries beyond ``reference`` (an unloaded session of the same person)
    or the table; ``doubts`` why none may be stated.

    Which mass the session declares, with the load or without, does not matter: beside a reference the reference's
    counts, and without one the declared mass may hold the load. Against the table alone, a load on pelvis, trunk or
    thigh cannot be told from a wrong table or a wrong scale.

    Raises
    ------
    NotSolved
        Nothing was identified from the reference.
    """
    tables = tables_by_sides(session) if reference is None else ((expect_unloaded(reference, session), 0.0),)
    segments = tables[0][0].segments
    units = tuple(unit_load(session.body, i) for i in range(len(segments)))
    bodies = tuple(
        _Judged.of(session.data, units, one) for one in unloaded_bodies(tables, weighed=reference is not None)
    )
    none = np.array([one.log_none for one in bodies])
    # (rivals, segments, masses): evidence of each body without load, times the likelihood
    # ratio, prior of mass and segment.
    load = np.array([one.log_none + one.log_ratio for one in bodies]) + log_mass_prior(MASSES) - np.log(len(units))
    total = logsumexp(np.append(load.ravel(), none))
    log_none = float(logsumexp(none) - total)
    found = [_suspect(name, i, bodies, load[:, i] - total, log_none) for i, name in enumerate(segments)]
    words = "the table" if reference is None else f"the session with {', '.join(reference.trials)}"
    return LoadSearch(tuple(sorted(found, key=lambda one: -one.probability)), float(np.exp(log_none)), words, doubts)


@dataclass(frozen=True, eq=False)
class _Judged:
    """One explanation of the body, with what it lets see of a load on each segment."""

    log_prior: float
    log_none: float
    log_det: float
    views: tuple[LoadView, ...]
    log_ratio: Array

    @classmethod
    def of(cls, data: Information, units: tuple[tuple[Array, Array], ...], rival: UnloadedBody) -> "_Judged":
        before = rival.before
        rows, innovation, evidence = whiten_innovation(data, before)
        # A body whose declared mass holds the load is lighter by phi / M per kilogram of it.
        less = float(rival.holds) * rows @ before.phi / before.mass.sum()
        columns = (rows[:, 10 * i : 10 * i + 10] for i in range(len(units)))
        views = tuple(LoadView.of(part, innovation, unit, less) for part, unit in zip(columns, units, strict=True))
        ratio = np.array([view.log_ratio(MASSES) for view in views])
        # The evidence without its data term: - sum log L_kk, for data that are imagined (`_smallest`).
        log_det = evidence + 0.5 * float(innovation @ innovation)
        return cls(rival.log_prior, rival.log_prior + evidence, log_det, views, ratio)


def _suspect(segment: str, i: int, bodies: tuple[_Judged, ...], load: Array, none: float) -> LoadCandidate:
    """Return the hypothesis of a load on segment ``i`` from the log probabilities of it (rivals, n) and of ``none``."""
    chance = float(logsumexp(load))
    size = load + np.array([one.views[i].log_place_information(MASSES) for one in bodies])
    # Jeffreys' weights change the masses within a rival, not how probable the rival is.
    size += (logsumexp(load, axis=1) - logsumexp(size, axis=1))[:, None]
    here = np.exp(size - np.logaddexp(chance, none))
    posterior = LoadPosterior(float(np.exp(none - np.logaddexp(chance, none))), here.sum(axis=0))
    place, place_sd = np.full(3, np.nan), np.full(3, np.nan)
    if posterior.interval[0] > 0:
        # The place under the most probable rival; its masses are integrated over.
        likely = int(np.argmax(here.sum(axis=1)))
        place, place_sd = bodies[likely].views[i].place(here[likely])
    # Each segment had 1 / n of the prior of a load: log n takes it out of the ratio.
    bayes = chance - none + float(np.log(len(bodies[0].views)))
    return LoadCandidate(segment, posterior, place, place_sd, bayes, float(np.exp(chance)), _smallest(bodies, i))


def _smallest(bodies: tuple[_Judged, ...], i: int) -> float:
    """Return the load (kg) on segment ``i`` from which on "no load" is improbable enough; infinite if none is."""
    prior = log_mass_prior(_COARSE) - np.log(len(bodies[0].views))
    squares = np.array([one.views[i].squares for one in bodies])
    own, wide = np.swapaxes([one.views[i].at_the_mean(_COARSE) for one in bodies], 0, 1)
    nothing = np.array([one.log_prior + one.log_det for one in bodies])

    def announced(true: float) -> bool:
        # Imagined data y = true b: - y'y / 2 in units in which "no load" has unit variance.
        none = nothing - 0.5 * true**2 * squares
        load = none[:, None] + log_ratio_if(true, _COARSE, squares, own, wide)
        left = np.logaddexp.reduce(none)
        return bool(left - np.logaddexp(left, np.logaddexp.reduce((load + prior).ravel())) < np.log(_THRESHOLD))

    # Announced from some mass on: bisection over an increasing list of booleans.
    at = bisect_left(range(len(_TRUE)), True, key=lambda step: announced(float(_TRUE[step])))
    return float(_TRUE[at]) if at < len(_TRUE) else float("inf")

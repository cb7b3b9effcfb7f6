"""A session as one linear problem: rows by frequency and rows of the markers, and all columns that are no fault.

    y = W (phi - phi0) + K k + noise        W regressor, K elementary kinematic errors, both unit normal once scaled

Columns of faults come from `candidates`; sizes of everything from `tolerances`.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.changes import parts_as_segments
from biodance.diagnosis.consequence import LEAST_FORCE, LEAST_MOMENT
from biodance.diagnosis.spectrum import SHORTEST_RUN, Spectrum, spectrum, thinned
from biodance.discovery import Chosen
from biodance.effects import Case, Effect, effects
from biodance.identification.posterior import prior_factor
from biodance.identification.statistics import Fit, usable
from biodance.lab.prepare import highest_frequency
from biodance.motion.dynamics import regressor_of
from biodance.records import Array, Motion, Sip, Trial, Wrench, runs
from biodance.uncertainty.caution import widened_prior
from biodance.uncertainty.sources import Errors, forward, of_clusters, of_whole
from biodance.uncertainty.tolerances import in_state

_LIGHTEST = 0.2
"""Share of the table's mass below which an identified segment is not believed."""


@dataclass(frozen=True, eq=False)
class TrialWindow:
    """One trial to look at: ``trial`` prepared, its ``motion``, ``use`` (T,) frames whose wrench may be compared,
    ``start`` and ``end`` of it as shares of the session's time.
    """

    trial: Trial
    motion: Motion
    use: NDArray[np.bool_]
    start: float
    end: float

    @property
    def fit(self) -> Fit:
        """The trial as identification takes it."""
        cutoff = highest_frequency(self.trial.settings)
        return Fit(self.trial.name, self.motion, self.trial.wrench, self.use, cutoff=cutoff)

    @property
    def runs(self) -> tuple[float, ...]:
        """Seconds of every run of frames that can be compared and is long enough."""
        rate = self.motion.rate
        if not np.isfinite(rate):
            return ()
        return tuple((stop - start) / rate for start, stop in runs(self.use) if stop - start >= SHORTEST_RUN * rate)

    @property
    def seconds(self) -> float:
        """For how many seconds it can be compared, in runs that are long enough."""
        return sum(self.runs)

    def case(self, body: Body, phi: Array) -> Case:
        """Return the trial as effects see it, at the rate of the markers, with the parameters ``phi`` (10N,)."""
        time = np.linspace(self.start, self.end, self.motion.time.size)
        return Case(body, _bridged(self.trial), self.motion, phi, time)


def _bridged(trial: Trial) -> Trial:
    """Return the trial with straight lines where a plate's force is unknown: such frames are never compared."""
    plates = []
    for plate in trial.plates:
        time, value = plate.wrench.time, plate.wrench.value
        known = np.isfinite(value).all(axis=1)
        if known.any() and not known.all():
            value = np.stack([np.interp(time, time[known], channel[known]) for channel in value.T], axis=1)
            plate = replace(plate, wrench=Wrench(time, value))
        plates.append(plate)
    return replace(trial, plates=tuple(plates))


@dataclass(frozen=True, eq=False)
class Problem:
    """The session in rows, not yet whitened.

    ``cases`` thinned trials with the parameters in use; ``spectrum`` where rows come from; ``target`` (r,) measured
    minus what the prior's mean predicts; ``prior`` of the parameters and ``factor`` S (p, k) of its covariance; ``sip``
    (r, k) columns W S; ``kinematics`` (r, K) columns of unit errors of ``groups`` (K), many and in single precision;
    ``markers`` number m of marker rows, near the end; the last s rows: sizes that the markers alone show of the causes
    ``shown`` (s; effect, target); ``notes`` what was left out.
    """

    cases: tuple[Case, ...]
    spectrum: Spectrum
    target: Array
    prior: Sip
    factor: Array
    sip: Array
    kinematics: NDArray[np.float32]
    groups: tuple[str, ...]
    markers: int
    notes: tuple[str, ...] = ()
    shown: tuple[tuple[str, str], ...] = ()

    @property
    def looked_at(self) -> frozenset[str]:
        """Names of the trials that give rows."""
        pairs = zip(self.cases, self.spectrum.picks, strict=True)
        return frozenset(case.trial.name for case, picks in pairs if picks)

    @property
    def wrench_rows(self) -> int:
        """Number of rows that come from the plates: six per coefficient."""
        return 6 * self.spectrum.band.size

    @property
    def mass(self) -> float:
        """Mass of the body before the data, kg."""
        return float(self.cases[0].body.sip.mass.sum())

    def padded(self, rows: Array) -> Array:
        """Return (r,): ``rows`` (m, 6) of the plates, and nothing in the others."""
        return np.concatenate([rows.ravel(), np.zeros(len(self.target) - rows.size)])

    def columns(self, some: Sequence[Effect]) -> list[Array]:
        """Return (r, p) for each of ``some`` effects: what one unit of each parameter adds to the rows."""
        wrench = self.spectrum.rows(np.concatenate([one.columns(case) for one in some], axis=2) for case in self.cases)
        markers = np.concatenate([self.marker_rows(one) for one in some], axis=1)
        found = np.concatenate([wrench.reshape(self.wrench_rows, -1), markers])
        return np.split(found, np.cumsum([len(one.parameters) for one in some])[:-1], axis=1)

    def felt(self, rows: Array) -> Array:
        """Return (k,): of what matters, how many times columns ``rows`` (r, k) change the wrench of all trials (the
        largest of the channels' root mean squares in `LEAST_FORCE` or `LEAST_MOMENT`); infinite for one that the
        markers show by themselves.
        """
        frames = max(1, sum(pick.size for picks in self.spectrum.picks for pick in picks))
        wrench, markers = np.split(rows, [self.wrench_rows])
        # Parseval: squares of orthonormal coefficients over the frames are a mean square over time.
        size = np.sqrt(np.sum(wrench.reshape(-1, 6, rows.shape[1]) ** 2, axis=0) / frames)
        share = (size / np.repeat([LEAST_FORCE, LEAST_MOMENT], 3)[:, None]).max(axis=0)
        return np.where(np.any(markers != 0, axis=0), np.inf, share)

    def unit(self, effect: Effect) -> Array:
        """Return the columns (r, p) of one effect, computed once."""
        if effect not in self._units:
            self._units[effect] = self.columns([effect])[0]
        return self._units[effect]

    @cached_property
    def _units(self) -> dict[Effect, Array]:
        return {}

    def marker_rows(self, effect: Effect) -> Array:
        """Return (m + s, p): what one unit of each parameter of ``effect`` adds to the marker rows and to the sizes
        shown.
        """
        found = [effect.marker_columns(case) for case in self.cases]
        out = np.zeros((self.markers, len(effect.parameters)))
        share = _shares(self.spectrum, len(self.cases))
        for case, columns, weight in zip(self.cases, found, share, strict=True):
            if columns is not None:
                full = np.zeros((len(case.body.markers.names), 3, columns.shape[2]))
                full[list(case.marker_columns)] = columns
                out += weight * full.reshape(self.markers, -1)
        sizes = np.zeros((len(self.shown), out.shape[1]))
        # A size that the markers show answers to its own cause alone, in the first parameter.
        sizes[[one == (effect.name, effect.target) for one in self.shown], 0] = 1.0
        return np.concatenate([out, sizes])

    def with_parameters(self, phi: Array) -> "Problem":
        """Return the problem whose faults are predicted with the parameters ``phi`` (10N,); what is measured against
        stays the prior.
        """
        return replace(self, cases=tuple(case.with_parameters(phi) for case in self.cases))

    def with_loud(self, loud: Array) -> "Problem":
        """Return the problem whose rows of the plates are ``loud`` (m,) times as loud as their bands."""
        return replace(self, spectrum=replace(self.spectrum, loud=loud))

    def with_matter(self, phi: Array) -> "Problem":
        """Return the problem whose kinematic errors move the matter of ``phi`` (10N,): what is heavier than the
        table errs more.
        """
        body = self.cases[0].body
        table, own = phi.reshape(-1, 10).copy(), body.sip.phi.reshape(-1, 10)
        absurd = table[:, 0] < _LIGHTEST * own[:, 0]
        table[absurd] = own[absurd]
        heavier = replace(body, sip=Sip(body.sip.segments, table.ravel(), body.sip.covariance))
        rows, _ = _kinematic_rows(self.spectrum, _errors(heavier, self.cases, self.spectrum), len(self.shown))
        return replace(self, kinematics=rows)


def problem(
    body: Body,
    windows: tuple[TrialWindow, ...],
    *,
    prior: Sip | None = None,
    chosen: Chosen[Effect] = None,
    shortest: float = SHORTEST_RUN,
) -> Problem:
    """Return the problem of ``windows`` at a session of ``body``; ``prior`` of its parameters, by default the table's
    with widened sd; runs of frames shorter than ``shortest`` s are left out.

    What the markers show by themselves is read for the whole family and for the ``chosen`` effects (`effects`).

    Raises
    ------
    TrialRefused
        No trial has ``shortest`` s of believable, fully measured frames.
    """
    before = prior or widened_prior(body.sip)
    used, about, notes = usable(body, tuple(window.fit for window in windows))
    kept = {fit.name: fit.use for fit in used}
    named = ((window, kept[window.trial.name]) for window in windows if window.trial.name in kept)
    pairs = [thinned(window.case(body, before.phi), use) for window, use in named]
    cases = tuple(case for case, _ in pairs)
    where = spectrum(cases, tuple(use for _, use in pairs), about, shortest=shortest)
    factor = prior_factor(before)
    # W S: one column per unit-normal coefficient of the prior.
    W = where.rows(regressor_of(case.segments, gravity=body.gravity, sharing=body.sharing) @ factor for case in cases)
    shown = sizes_shown(cases, {**effects(), **effects(chosen)})
    rows, unit = _kinematic_rows(where, _errors(body, cases, where), len(shown))
    W = W.reshape(-1, W.shape[2])
    sip = np.concatenate([W, np.zeros((len(rows) - len(W), W.shape[1]))])
    groups = tuple(in_state(of_whole(group, body), joint, body) for group, joint in unit)
    measured = where.rows(tuple(case.residual[:, :, None] for case in cases))
    target = np.concatenate([measured.ravel(), _mean_markers(cases, where).ravel(), list(shown.values())])
    markers = len(rows) - len(W) - len(shown)
    return Problem(cases, where, target, before, factor, sip, rows, groups, markers, notes, tuple(shown))


def sizes_shown(cases: tuple[Case, ...], causes: Mapping[str, Effect]) -> dict[tuple[str, str], float]:
    """Return by effect and target the size of the first parameter that the markers of the session show by
    themselves.
    """
    found = {}
    for name, kind in causes.items():
        for one in kind.at_all_targets(cases[0]) if type(kind).shown is not Effect.shown else ():
            size = one.shown(*cases)
            found[name, one.target] = 0.0 if size is None else float(size[0])
    return found


def _errors(body: Body, cases: tuple[Case, ...], where: Spectrum) -> Iterator[tuple[int, NDArray[np.intp], Errors]]:
    """Yield the errors of every run with its trial's index and frames, one after the other: they are large."""
    sources = of_clusters(parts_as_segments(body))
    for index, (case, picks) in enumerate(zip(cases, where.picks, strict=True)):
        for pick in picks:
            yield index, pick, forward(sources, case.motion.at(pick))


def _kinematic_rows(
    where: Spectrum, errors: Iterable[tuple[int, NDArray[np.intp], Errors]], sizes: int
) -> tuple[NDArray[np.float32], tuple[tuple[str, str], ...]]:
    """Return the rows (r, K) of the errors: wrenches, mean markers, no ``sizes`` shown; and group and joint of each."""
    wrench: list[NDArray[np.float32]] = []
    names: tuple[tuple[str, str], ...] = ()
    markers, frames = np.zeros(()), 0
    for index, pick, one in errors:
        bands = where.bands(index)
        kept = bands.of(pick.size) >= 0
        rows = bands.coefficients(where.layout.shift @ one.wrench)[kept]
        wrench.append(rows.reshape(-1, rows.shape[2]).astype(np.float32))
        names = names or tuple(zip(one.groups, one.joints, strict=True))
        # Mean over all runs, weighted with their frames.
        markers = markers + pick.size * one.markers
        frames += pick.size
    mean = (markers / frames).reshape(-1, len(names)).astype(np.float32)
    return np.concatenate([*wrench, mean, np.zeros((sizes, len(names)), dtype=np.float32)]), names


def _shares(where: Spectrum, count: int) -> Array:
    """Return the share (count,) of the used time that belongs to each trial."""
    seconds = np.array([sum(pick.size for pick in picks) for picks in where.picks[:count]], dtype=float)
    return np.asarray(seconds / seconds.sum())


def _mean_markers(cases: tuple[Case, ...], where: Spectrum) -> Array:
    """Return (M, 3) m: mean residual of every marker of the body over the session; zero if never seen."""
    out = np.zeros((len(cases[0].body.markers.names), 3))
    for case, weight in zip(cases, _shares(where, len(cases)), strict=True):
        out[list(case.marker_columns)] += weight * case.marker_residual
    return out

"""What about a robot or its laboratory is not as drawn: encoder zeros, joints that give or have play, plate faults.

Masses and all small errors that are usual count as in the identification. Beside them every cause is tried alone, much
larger than usual: by how much the recording becomes more probable with it (evidence, nats). The best one is taken out
of the recording, and the others are tried again. A cause is named only if the motion that was kept for validation, too,
becomes more probable with it; causes that the recording cannot tell from it are named with it.
"""

from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.robot_columns import (
    LOADED_KINDS,
    AnyMotion,
    Columns,
    RobotCause,
    cause_columns,
    motion_changes,
    without,
)
from biodance.identification.learning import WORTH
from biodance.identification.mismatch import long_runs
from biodance.identification.posterior import prior_factor
from biodance.identification.robot import THINNED, RobotMotion, place_changes, robot_start, slow_wrench
from biodance.identification.statistics import Statistics, empty
from biodance.motion.dynamics import regressor
from biodance.records import Array
from biodance.threads import one_thread
from biodance.uncertainty.learning import maximise, noise_of
from biodance.uncertainty.noise import Noise
from biodance.uncertainty.plates import plate_errors, plate_sources

_CLEAR, _LIKE = 8.0, 3.0
"""Nats: least evidence of a cause; causes within so many of the best are not told apart from it."""
_WORST = 4.0
"""Standard deviations of a cause that is there, beyond which none is believed: it would be seen without us."""
_SHARED = 0.15
"""Of what gives or has play: how far its size may be off because nobody knows how two standing feet share the load."""
_MOST = 4
"""Causes that are looked for, one after the other."""
_ROUNDS = 12


@dataclass(frozen=True)
class RobotFinding:
    """A ``cause``, its ``value`` ± ``sd`` in the cause's unit, the evidence ``gain`` and that on motion not used,
    ``kept_gain`` (NaN without such), nats; ``rivals`` that would explain as much.
    """

    cause: RobotCause
    value: float
    sd: float
    gain: float
    kept_gain: float
    rivals: tuple[RobotCause, ...] = ()


@one_thread()
def robot_causes(
    body: Body, fitted: tuple[AnyMotion, ...], kept: tuple[AnyMotion, ...] = ()
) -> tuple[tuple[RobotFinding, ...], tuple[AnyMotion, ...]]:
    """Return what is wrong, in the order of finding, empty if the drawing with other masses explains the recording; and
    all trials without it.

    ``fitted`` and ``kept`` trials; all frames in which a foot certainly stands are used.
    """
    trials, found = (*fitted, *kept), list[RobotFinding]()
    columns = cause_columns(body, fitted, trials)
    size, here = prior_factor(body.sip).shape[1], np.array(columns.usual)
    noise = replace(columns.layout, covariance=np.tile(robot_start(body), (len(columns.layout.bands), 1, 1)))
    while True:
        first, *rest = _gathered(body, trials, len(fitted), columns)
        noise = _learned(first, noise, np.append(np.ones(size), np.maximum(columns.wide, here)), robot_start(body))
        fit = _equations(first, noise)
        every = _equations(sum(rest, first), noise)
        found, trials = _refined(body, found, trials, columns, every, here)
        gain, both = (_gains(A, b, here, columns.wide)[size:] for A, b in (fit, every))
        best, rivals = _chosen(columns, both, both - gain, [one.cause for one in found])
        if best < 0 or len(found) == _MOST:
            return tuple(found), trials
        here[best] = np.hypot(columns.wide[best], here[best])
        later = float(both[best] - gain[best]) if kept else float("nan")
        cause = columns.causes[best]
        assert cause is not None
        found.append(RobotFinding(cause, 0.0, 0.0, float(both[best]), later, rivals))
        found, trials = _refined(body, found, trials, columns, every, here)


def _chosen(columns: Columns, gain: Array, later: Array, known: list[RobotCause]) -> tuple[int, tuple[RobotCause, ...]]:
    """Return the column of the best cause (-1: none is clear) and the causes that cannot be told from it."""
    free = np.array([one is not None and one not in known for one in columns.causes])
    ranked = np.where(free & (later >= 0), gain, -np.inf)
    best = int(np.argmax(ranked))
    if not ranked[best] > _CLEAR:
        return -1, ()
    like = [columns.causes[k] for k in np.flatnonzero(ranked > ranked[best] - _LIKE) if k != best]
    return best, tuple(one for one in like if one is not None)


def _refined(
    body: Body,
    found: list[RobotFinding],
    trials: tuple[AnyMotion, ...],
    columns: Columns,
    equations: tuple[Array, Array],
    here: Array,
) -> tuple[list[RobotFinding], tuple[AnyMotion, ...]]:
    """Return the findings with what is left of them added, and the trials without that."""
    A, b = equations
    size, out = len(b) - len(here), []
    covariance = _posterior(A, np.append(np.ones(size), here))
    for one in found:
        k = columns.causes.index(one.cause)
        more, sd = float((covariance @ b)[size + k]), float(np.sqrt(covariance[size + k, size + k]))
        per, most = one.cause.per, _WORST * columns.wide[k]
        more = float(np.clip(one.value / per + more, -most, most) - one.value / per)
        value = one.value + more * per
        unshared = _SHARED * abs(value) if one.cause.kind in LOADED_KINDS else 0.0
        out.append(replace(one, value=value, sd=float(np.hypot(sd * per, unshared))))
        trials = tuple(without(body, trial, columns, one.cause, more) for trial in trials)
    return out, trials


def _gathered(body: Body, trials: tuple[RobotMotion, ...], fitted: int, columns: Columns) -> list[Statistics]:
    """Return the second moments of the ``fitted`` first trials, and of the others where there are some."""
    parts = [_products(body, one, columns, k) for k, one in enumerate(trials)]
    return [sum(some[1:], some[0]) for some in (parts[:fitted], parts[fitted:]) if some]


def _products(body: Body, one: RobotMotion, columns: Columns, trial: int) -> Statistics:
    """Return the second moments of [W S, causes, what the drawing leaves] of one trial."""
    S, layout = prior_factor(body.sip), columns.layout
    changes = motion_changes(body, one, columns.of_motion)
    plates, fit, slow = plate_sources(), one.fit, slow_wrench(body, one.grounded, one.angle)
    count = S.shape[1] + len(columns.causes)
    first, some = columns.places[trial]
    first -= changes.shape[2] + len(plates.delay)
    total = empty(count, layout)
    for _, pick in long_runs((fit,), layout.bands):
        motion = fit.motion.at(pick)
        W = regressor(body, motion)
        places = np.zeros((pick.size, 6, len(columns.causes) - changes.shape[2] - len(plates.delay)))
        places[:, :, first : first + some] = place_changes(slow[pick], one.grounded, pick)
        near = np.minimum(pick // THINNED, len(changes) - 1)
        faults = plate_errors(slow[pick], motion.rate, layout, plates)
        left = (fit.wrench.value[pick] - W @ body.sip.phi)[:, :, None]
        total.add(np.concatenate([W @ S, changes[near], faults, places, left], axis=2), fit.motion.rate)
    return total


def _equations(total: Statistics, noise: Noise) -> tuple[Array, Array]:
    """Return X' S^-1 X (c, c) and X' S^-1 y (c,)."""
    H = total.normal_matrix(noise)
    return H[:-1, :-1], H[:-1, -1]


def _learned(total: Statistics, noise: Noise, sd: Array, start: Array) -> Noise:
    """Return the noise that is left where every cause may be there, from ``noise`` on."""

    def improved(before: Noise) -> Noise:
        A, b = _equations(total, before)
        covariance = _posterior(A, sd)
        left = noise_of(total.moments(covariance @ b, covariance), start=start, worth=WORTH)
        return replace(before, covariance=left)

    return maximise(noise, improved, lambda one: one.covariance, rounds=_ROUNDS, tolerance=1e-2)


def _posterior(A: Array, sd: Array) -> Array:
    """Return the covariance (c, c) of unknowns with standard deviations ``sd`` (c,) before the data."""
    inner = np.eye(len(sd)) + sd[:, None] * A * sd
    return np.asarray(sd[:, None] * np.linalg.solve(inner, np.diag(sd)))


def _gains(A: Array, b: Array, usual: Array, large: Array) -> Array:
    """Return the evidence (c,) nats gained when each unknown alone may also be as large as ``wide`` (c,)."""
    sd, wide = (np.append(np.ones(len(b) - len(one)), one) for one in (usual, large))
    C = _posterior(A, sd)
    AC = A @ C
    score, precision = b - AC @ b, np.maximum(np.diag(A) - np.einsum("ij,ji->i", AC, A), 0.0)
    more = 1 + wide**2 * precision
    return np.asarray(0.5 * (score * wide) ** 2 / more - 0.5 * np.log(more))

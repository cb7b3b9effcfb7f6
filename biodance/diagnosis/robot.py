"""What about a robot or its laboratory is not as drawn: encoder zeros, joints that give or have play, plate faults.

Masses and all small errors that are usual count as in the identification. Beside them every cause is tried alone, much
larger than usual: by how much the recording becomes more probable with it (evidence, nats). The most probable one is
taken out of the recording, and the others are tried again. A cause is named from the same probability on as a person's
(`NAMED`), that it or one of its set is there, and only if the motion that was kept for validation becomes more probable
with it, too.
Each is a column: what a recording shows of it at unit size, and the recording without it.
"""

from collections import Counter
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from scipy.special import logsumexp

from biodance.body.body import Body
from biodance.diagnosis.candidates import IN_SET, TOGETHER
from biodance.diagnosis.consequence import NAMED
from biodance.effects import effects, unit_of
from biodance.identification.mismatch import long_runs
from biodance.identification.posterior import prior_factor
from biodance.identification.robot import (
    GIVE,
    THINNED,
    ZERO,
    Loads,
    RobotMotion,
    angle_changes,
    leg_chains,
    loads,
    place_changes,
    places_of,
    robot_start,
    slow_wrench,
)
from biodance.identification.statistics import WORTH, Statistics, empty, standing_point
from biodance.lab.plates.faults import DELAY, OFFSET
from biodance.motion.dynamics import regressor
from biodance.motion.grounded import ground_again
from biodance.records import Array, Wrench
from biodance.threads import one_thread
from biodance.uncertainty.bands import Bands, Noise
from biodance.uncertainty.learning import maximise, noise_of
from biodance.uncertainty.plates import SOURCES, Plates, plate_errors, plate_sources, source_sizes

AnyMotion = TypeVar("AnyMotion", bound=RobotMotion)
_WIDE = 10.0
"""Standard deviation of a cause that is there, over the usual error of its kind."""
_LOADED = 2.0
"""The same of what gives or has play, in units of `GIVE`; usual is none."""
_ALIKE = 0.33
"""Of the RMS torque of its like: a joint that bears less says nothing of whether both give."""
_LOADED_KINDS = ("flexible_joint", "backlash", "soft_sole")
_SOLE = {"forwards": 0, "sideways": 1}
_BANDS_OF_CAUSES = Bands((0.0, 0.04, 0.3, 1.0), 25.0)
"""Hz. Beyond, what a motion needs is more and more the encoders' noise, twice differentiated: masses that explain it
come out small (regression dilution), and any cause made from a smoother motion makes up for them. With 2.5 and 6 Hz as
well a clean recording in MuJoCo was blamed for a gain of Mx of 7 % (63 nats); without, for nothing.
"""


@dataclass(frozen=True)
class RobotCause:
    """One thing that may be wrong: ``kind`` (encoder_zero, flexible_joint, backlash, soft_sole, plate_gain,
    plate_crosstalk, plate_rotation, plate_position, plate_offset, time_delay), ``where`` joints, direction or channel,
    what one column means: ``per`` of ``unit``, and the ``joints`` (numbers) whose angle is wrong.
    """

    kind: str
    where: str
    per: float
    unit: str
    joints: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class _Columns:
    """All columns beside the parameters (None: a place on the plate), ``usual`` and ``wide`` (k,) deviations."""

    causes: tuple[RobotCause | None, ...]
    usual: Array
    wide: Array
    layout: Noise
    places: tuple[tuple[int, int], ...]

    @property
    def of_motion(self) -> tuple[RobotCause, ...]:
        """The causes, first of all, that show a motion as it was not."""
        return tuple(one for one in self.causes if one is not None and _moves(one))


def _moves(cause: RobotCause) -> bool:
    return bool(cause.joints) or cause.kind == "soft_sole"


def _cause_columns(body: Body, fitted: tuple[RobotMotion, ...], trials: tuple[RobotMotion, ...]) -> _Columns:
    """Return what may be wrong in ``trials``; units by the loads of those ``fitted``."""
    found = [loads(body, one.grounded, one.fit.wrench.value) for one in fitted]
    torque, moment = (np.mean([getattr(one, name) for one in found], axis=0) for name in ("torque", "moment"))
    names = [joint.name for joint in body.joints]
    causes: list[RobotCause | None] = [
        RobotCause("encoder_zero", name, ZERO, "rad", (j,)) for j, name in enumerate(names)
    ]
    encoders, groups = len(causes), _legs_and_pairs(body, torque)
    for some in groups:
        # One unit: `GIVE` rad at the mean RMS torque, as rad per N·m.
        per = GIVE / float(torque[list(some)].mean() + 1e-9)
        causes.append(RobotCause("flexible_joint", _both(names, some), per, "rad/(N·m)", some))
    causes += [RobotCause("backlash", _both(names, some), 2 * GIVE, "rad", some) for some in groups]
    causes += [RobotCause("soft_sole", way, GIVE / float(moment[k] + 1e-9), "rad/(N·m)") for way, k in _SOLE.items()]
    loaded = slice(encoders, len(causes))
    causes += _plate_causes()
    usual, wide = np.ones(len(causes)), np.full(len(causes), _WIDE)
    usual[loaded], wide[loaded] = 0.0, _LOADED
    counts = [places_of(one.grounded) for one in trials]
    starts = len(causes) + np.cumsum([0, *counts[:-1]])
    places = np.ones(sum(counts))
    return _Columns(
        (*causes, *[None] * len(places)),
        np.append(usual, places),
        np.append(wide, places),
        Noise.unit(standing_point(tuple(one.fit for one in fitted)), _BANDS_OF_CAUSES),
        tuple((int(start), count) for start, count in zip(starts, counts, strict=True)),
    )


def _legs_and_pairs(body: Body, torque: Array) -> list[tuple[int, ...]]:
    """Return every joint of the legs, and each right one with its left where both bear ``torque`` (n,) N·m."""
    right, left = leg_chains(body)
    pairs = [pair for pair in zip(right, left, strict=False) if len(right) == len(left) and pair[0] != pair[1]]
    both = [pair for pair in pairs if torque[list(pair)].min() > _ALIKE * torque[list(pair)].max()]
    return [*((j,) for j in sorted({*right, *left})), *both]


def _both(names: list[str], some: tuple[int, ...]) -> str:
    return " and ".join(names[j] for j in some)


def _plate_causes() -> list[RobotCause]:
    """Return the causes of `plate_sources`, in its order."""
    out = []
    for (fault, place), size in zip(SOURCES, source_sizes(), strict=True):
        where = "plate" if fault is DELAY else place.replace("->", " to ")
        unit = unit_of(place) if fault is OFFSET else fault.unit.replace("1", "")
        out.append(RobotCause(fault.name, where, float(size), unit))
    return out


def _unit(one: RobotMotion, cause: RobotCause, found: Loads) -> tuple[Array, Array]:
    """Return by how much the joints (T, n) and the sole (T, 3), rad, are not where one unit of a cause shows them."""
    angle, tilt, some = np.zeros_like(one.angle), np.zeros((len(one.angle), 3)), list(cause.joints)
    match cause.kind:
        case "encoder_zero":
            angle[:, some] = -ZERO
        case "flexible_joint":
            angle[:, some] = cause.per * found.soft[:, some]
        case "backlash":
            angle[:, some] = GIVE * found.play[:, some]
        case _:
            tilt[:] = cause.per * (found.forwards, found.sideways)[_SOLE[cause.where]]
    return angle, tilt


def _without(body: Body, one: AnyMotion, columns: _Columns, cause: RobotCause, amount: float) -> AnyMotion:
    """Return a trial without ``amount`` units of a cause."""
    fit = one.fit
    if _moves(cause):
        angle, tilt = _unit(one, cause, loads(body, one.grounded, fit.wrench.value))
        angle = one.angle + amount * angle
        found = ground_again(body, one.grounded, angle, tilt=amount * tilt)
        return replace(one, fit=replace(fit, motion=found.motion), angle=angle, grounded=found)
    plates, k = plate_sources(), columns.causes.index(cause) - len(columns.of_motion)
    fault = Plates(plates.mixing[k : k + 1], plates.offset[k : k + 1], plates.delay[k : k + 1])
    about = Noise.unit(standing_point((fit,)))
    error = plate_errors(slow_wrench(body, one.grounded, one.angle), fit.motion.rate, about, fault)[:, :, 0]
    return replace(one, fit=replace(fit, wrench=Wrench(fit.wrench.time, fit.wrench.value - amount * error)))


_PRIOR = 0.03
"""Probability, before any data, that a robot has an encoder's zero off, a joint that gives, play, or a sole that gives,
each shared by its places; those of a plate's causes stand in their effects (`Effect.prior`).
"""
_WORST = 4.0
"""Standard deviations of a cause that is there, beyond which none is believed: it would be seen without us."""
_SHARED = 0.15
"""Of what gives or has play: how far its size may be off because nobody knows how two standing feet share the load."""
_MOST = 4
"""Causes that are looked for, one after the other."""


@dataclass(frozen=True)
class RobotFinding:
    """A ``cause``, its ``value`` ± ``sd`` in the cause's unit, the evidence ``gain`` and that on motion not used,
    ``kept_gain`` (NaN without such), nats; the ``probability`` that it or one of its ``rivals``, the others of its set,
    is there.
    """

    cause: RobotCause
    value: float
    sd: float
    gain: float
    kept_gain: float
    probability: float
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
    columns = _cause_columns(body, fitted, trials)
    size, here = prior_factor(body.sip).shape[1], np.array(columns.usual)
    noise = replace(columns.layout, covariance=np.tile(robot_start(body), (len(columns.layout.bands), 1, 1)))
    while True:
        parts, count = [_products(body, one, columns, k) for k, one in enumerate(trials)], len(fitted)
        first, *rest = (sum(some[1:], some[0]) for some in (parts[:count], parts[count:]) if some)
        noise = _learned(first, noise, np.append(np.ones(size), np.maximum(columns.wide, here)), robot_start(body))
        fit = _equations(first, noise)
        every = _equations(sum(rest, first), noise)
        found, trials = _refined(body, found, trials, columns, every, here)
        gain, both = (_gains(A, b, here, columns.wide)[size:] for A, b in (fit, every))
        best, rivals, probability = _chosen(columns, both, both - gain, [one.cause for one in found])
        if probability < NAMED or len(found) == _MOST:
            return tuple(found), trials
        # From now on this cause may be as large as one that is there.
        here[best] = np.hypot(columns.wide[best], here[best])
        later = float(both[best] - gain[best]) if kept else float("nan")
        cause = columns.causes[best]
        assert cause is not None
        found.append(RobotFinding(cause, 0.0, 0.0, float(both[best]), later, probability, rivals))
        found, trials = _refined(body, found, trials, columns, every, here)


def _chosen(
    columns: _Columns, gain: Array, later: Array, known: list[RobotCause]
) -> tuple[int, tuple[RobotCause, ...], float]:
    """Return the column of the most probable further cause, the others of its set (`IN_SET` of the posterior, and what
    the data cannot tell from it), and the probability that one of them is there, of one more cause or none.
    """
    free = np.array([one is not None and one not in known for one in columns.causes])
    odds = np.where(free & (later >= 0), gain + _log_priors(columns.causes), -np.inf)
    # Bayes over "none" (log odds 0) and every cause alone.
    share = np.exp(odds - logsumexp(np.append(odds, 0.0)))
    best, kept, held = int(np.argmax(share)), list[int](), 0.0
    for k in np.argsort(-share)[: int(np.isfinite(odds).sum())]:
        if held < IN_SET * share.sum() or gain[k] >= gain[best] - TOGETHER:
            kept.append(int(k))
        held += share[k]
    rivals = (columns.causes[k] for k in kept if k != best)
    return best, tuple(one for one in rivals if one is not None), float(share[kept].sum())


def _log_priors(causes: tuple[RobotCause | None, ...]) -> Array:
    """Return (k,) the log odds of every cause before any data; 0 of a place, which is none."""
    places, plates = Counter(one.kind for one in causes if one), effects()
    prior = {kind: plates[kind].prior if kind in plates else _PRIOR for kind in places}
    share = np.array([prior[one.kind] / places[one.kind] if one else 0.5 for one in causes])
    return np.asarray(np.log(share / (1 - share)))


def _refined(
    body: Body,
    found: list[RobotFinding],
    trials: tuple[AnyMotion, ...],
    columns: _Columns,
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
        # The correction may not carry the whole value beyond `most`.
        more = float(np.clip(one.value / per + more, -most, most) - one.value / per)
        value = one.value + more * per
        unshared = _SHARED * abs(value) if one.cause.kind in _LOADED_KINDS else 0.0
        out.append(replace(one, value=value, sd=float(np.hypot(sd * per, unshared))))
        trials = tuple(_without(body, trial, columns, one.cause, more) for trial in trials)
    return out, trials


def _products(body: Body, one: RobotMotion, columns: _Columns, trial: int) -> Statistics:
    """Return the second moments of [W S, causes, what the drawing leaves] of one trial."""
    S, layout = prior_factor(body.sip), columns.layout
    # The change (T / `THINNED`, 6, k) of the wrench by one unit of every cause of motion.
    found = loads(body, one.grounded, one.fit.wrench.value)
    units = [_unit(one, cause, found) for cause in columns.of_motion]
    angles, tilts = (np.stack(part, axis=2) for part in zip(*units, strict=True))
    changes = angle_changes(body, one.grounded, one.angle, angles, tilts)
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

    return maximise(noise, improved, lambda one: one.covariance, rounds=12, tolerance=1e-2)


def _posterior(A: Array, sd: Array) -> Array:
    """Return the covariance (c, c) of unknowns with standard deviations ``sd`` (c,) before the data."""
    # C = D (1 + D A D)^-1 D with D = diag(sd): right for deviations of zero, too.
    inner = np.eye(len(sd)) + sd[:, None] * A * sd
    return np.asarray(sd[:, None] * np.linalg.solve(inner, np.diag(sd)))


def _gains(A: Array, b: Array, usual: Array, large: Array) -> Array:
    """Return the evidence (c,) nats gained when each unknown alone may also be as large as ``wide`` (c,)."""
    sd, wide = (np.append(np.ones(len(b) - len(one)), one) for one in (usual, large))
    C = _posterior(A, sd)
    AC = A @ C
    # Each unknown beside all others at their usual size: score b - A C b, information diag(A - A C A).
    score, precision = b - AC @ b, np.maximum(np.diag(A) - np.einsum("ij,ji->i", AC, A), 0.0)
    more = 1 + wide**2 * precision
    # Evidence of a variance wide² more: 1/2 (s w)² / (1 + w² p) - 1/2 log(1 + w² p).
    return np.asarray(0.5 * (score * wide) ** 2 / more - 0.5 * np.log(more))

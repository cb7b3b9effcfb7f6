"""What about a robot or its laboratory is not as drawn: encoder zeros, joints that give or have play, plate faults.

Masses and all small errors that are usual count as in the identification. Beside them every cause is tried alone, much
larger than usual: by how much the recording becomes more probable with it (evidence, nats). The best one is taken out
of the recording, and the others are tried again. A cause is named only if the motion that was kept for validation, too,
becomes more probable with it; causes that the recording cannot tell from it are named with it.
"""

from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.identification.identification import standing_point
from biodance.identification.learning import START, WORTH
from biodance.identification.mismatch import SHORTEST
from biodance.identification.posterior import prior_factor
from biodance.identification.robot import RobotMotion
from biodance.identification.robot_errors import (
    GIVE,
    THINNED,
    ZERO,
    angle_changes,
    leg_joints,
    load_angles,
    place_changes,
    thinned,
)
from biodance.identification.statistics import Statistics, empty, layout_for
from biodance.motion.grounded import ground
from biodance.motion.regressor import regressor
from biodance.records import CHANNELS, Array, Wrench
from biodance.threads import one_thread
from biodance.uncertainty.learning import maximise, noise_of
from biodance.uncertainty.noise import Noise
from biodance.uncertainty.plates import Plates, plate_errors, plate_sources
from biodance.uncertainty.tolerances import REFERENCE_PERSON

_WIDE = 10.0
"""Standard deviation of a cause that is there, over the usual error of its kind."""
_LOADED = 2.0
"""The same of joints that give or have play, in units of `GIVE`; usual is none."""
_CLEAR, _LIKE = 8.0, 3.0
"""Nats: least evidence of a cause; causes within so many of the best are not told apart from it."""
_MOST = 4
"""Causes that are looked for, one after the other."""
_ROUNDS = 12
_OF_JOINTS = ("encoder_zero", "flexible_joint", "backlash")


@dataclass(frozen=True)
class RobotCause:
    """One thing that may be wrong: ``kind`` (encoder_zero, flexible_joint, backlash, plate_gain, plate_crosstalk,
    plate_rotation, plate_position, plate_offset, time_delay), ``where`` joint or channel, and what one column means:
    ``per`` of ``unit``.
    """

    kind: str
    where: str
    per: float
    unit: str


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


@dataclass(frozen=True, eq=False)
class _Columns:
    """Names and meaning of all columns beside the parameters: ``usual`` and ``wide`` (k,) standard deviations."""

    causes: tuple[RobotCause | None, ...]
    usual: Array
    wide: Array
    layout: Noise


@one_thread()
def robot_causes(
    body: Body, fitted: tuple[RobotMotion, ...], kept: tuple[RobotMotion, ...] = ()
) -> tuple[tuple[RobotFinding, ...], tuple[RobotMotion, ...]]:
    """Return what is wrong, in the order of finding, empty if the drawing with other masses explains the recording; and
    all trials without it.

    ``fitted`` and ``kept`` trials; all frames in which a foot certainly stands are used.
    """
    trials, found = (*fitted, *kept), list[RobotFinding]()
    columns = _columns(body, fitted, len(trials))
    size, here = prior_factor(body.sip).shape[1], np.array(columns.usual)
    while True:
        parts = [_gathered(body, one, columns, k, len(trials)) for k, one in enumerate(trials)]
        first, rest = _sum(parts[: len(fitted)]), _sum(parts[len(fitted) :])
        noise = _learned(first, np.append(np.ones(size), np.maximum(columns.wide, here)), _start(body))
        fit = _equations(first, noise)
        every = tuple(a + b for a, b in zip(fit, _equations(rest, noise), strict=True)) if kept else fit
        found, trials = _refined(body, found, trials, columns, every, here)
        gain, both = (_gains(*some, here, columns.wide)[size:] for some in (fit, every))
        best, rivals = _chosen(columns, both, both - gain, [one.cause for one in found])
        if best < 0 or len(found) == _MOST:
            return tuple(found), trials
        here[best] = np.hypot(columns.wide[best], here[best])
        later = float(both[best] - gain[best]) if kept else float("nan")
        cause = columns.causes[best]
        assert cause is not None
        found.append(RobotFinding(cause, 0.0, 0.0, float(both[best]), later, rivals))
        found, trials = _refined(body, found, trials, columns, every, here)


def _chosen(
    columns: _Columns, gain: Array, later: Array, known: list[RobotCause]
) -> tuple[int, tuple[RobotCause, ...]]:
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
    trials: tuple[RobotMotion, ...],
    columns: _Columns,
    equations: tuple[Array, Array],
    here: Array,
) -> tuple[list[RobotFinding], tuple[RobotMotion, ...]]:
    """Return the findings with what is left of them added, and the trials without that."""
    A, b = equations
    size, out = len(b) - len(here), []
    covariance = _posterior(A, np.append(np.ones(size), here))
    for one in found:
        k = columns.causes.index(one.cause)
        more, sd = float((covariance @ b)[size + k]), float(np.sqrt(covariance[size + k, size + k]))
        per = one.cause.per
        out.append(replace(one, value=one.value + more * per, sd=sd * per))
        trials = tuple(_without(body, trial, one.cause, k, more) for trial in trials)
    return out, trials


def _without(body: Body, one: RobotMotion, cause: RobotCause, column: int, amount: float) -> RobotMotion:
    """Return a trial without ``amount`` of the cause in ``column``."""
    fit, n = one.fit, len(body.joints)
    if cause.kind in _OF_JOINTS:
        shape = np.zeros_like(one.angle)
        j = [joint.name for joint in body.joints].index(cause.where)
        soft, play, _ = load_angles(body, one.grounded, fit.wrench.value)
        unit = {"encoder_zero": -ZERO * np.ones(len(shape)), "flexible_joint": cause.per * soft[:, j]}
        shape[:, j] = amount * unit.get(cause.kind, GIVE * play[:, j])
        angle = one.angle + shape
        found = ground(body, fit.motion.time, angle, lean=one.grounded.lean, base=one.grounded.base)
        return RobotMotion(replace(fit, motion=found.motion), angle, found)
    plates = plate_sources()
    k = column - n - 2 * len(leg_joints(body))
    one_fault = Plates(plates.mixing[k : k + 1], plates.offset[k : k + 1], plates.delay[k : k + 1])
    about = layout_for(standing_point((fit,)))
    error = plate_errors(fit.wrench.value, fit.motion.rate, about, one_fault)[:, :, 0]
    return replace(one, fit=replace(fit, wrench=Wrench(fit.wrench.time, fit.wrench.value - amount * error)))


def _columns(body: Body, fitted: tuple[RobotMotion, ...], trials: int) -> _Columns:
    """Return what every column means: encoders, joints that give, play, plate, places of the trials."""
    legs = leg_joints(body)
    torque = np.mean([load_angles(body, one.grounded, one.fit.wrench.value)[2] for one in fitted], axis=0)
    names = [joint.name for joint in body.joints]
    causes: list[RobotCause | None] = [RobotCause("encoder_zero", name, ZERO, "rad") for name in names]
    causes += [RobotCause("flexible_joint", names[j], GIVE / float(torque[j] + 1e-9), "rad/(N·m)") for j in legs]
    causes += [RobotCause("backlash", names[j], 2 * GIVE, "rad") for j in legs]
    causes += _plate_causes()
    loaded = slice(len(names), len(names) + 2 * len(legs))
    usual, wide = np.ones(len(causes)), np.full(len(causes), _WIDE)
    usual[loaded], wide[loaded] = 0.0, _LOADED
    places = np.ones(3 * trials)
    about = standing_point(tuple(one.fit for one in fitted))
    return _Columns(
        (*causes, *[None] * len(places)), np.append(usual, places), np.append(wide, places), layout_for(about)
    )


def _plate_causes() -> list[RobotCause]:
    """Return the causes of `plate_sources`, in its order."""
    plates = plate_sources()
    rows, columns = np.divmod(np.arange(36), 6)
    out = []
    for k, (r, c) in enumerate(zip(rows, columns, strict=True)):
        per, where = float(plates.mixing[k, r, c]), CHANNELS[c] if r == c else f"{CHANNELS[c]} to {CHANNELS[r]}"
        out.append(RobotCause("plate_gain" if r == c else "plate_crosstalk", where, per, ""))
    out += [
        RobotCause("plate_rotation", axis, float(np.abs(plates.mixing[36 + i]).max()), "rad")
        for i, axis in enumerate("xyz")
    ]
    out += [
        RobotCause("plate_position", axis, float(np.abs(plates.mixing[39 + i]).max()), "m")
        for i, axis in enumerate("xyz")
    ]
    units = ("N",) * 3 + ("N·m",) * 3
    out += [
        RobotCause("plate_offset", channel, float(plates.offset[42 + i, i]), unit)
        for i, (channel, unit) in enumerate(zip(CHANNELS, units, strict=True))
    ]
    return [*out, RobotCause("time_delay", "plate", float(plates.delay[48]), "s")]


def _gathered(body: Body, one: RobotMotion, columns: _Columns, place: int, trials: int) -> Statistics:
    """Return the second moments of [W S, causes, what the drawing leaves] of one trial."""
    S, layout, legs, n = prior_factor(body.sip), columns.layout, list(leg_joints(body)), len(body.joints)
    soft, play, _ = load_angles(body, one.grounded, one.fit.wrench.value)
    per = np.array([cause.per for cause in columns.causes[n : n + len(legs)] if cause])
    shapes = np.zeros((len(one.angle), n, n + 2 * len(legs)))
    shapes[:, range(n), range(n)] = ZERO
    shapes[:, legs, range(n, n + len(legs))] = per * soft[:, legs]
    shapes[:, legs, range(n + len(legs), n + 2 * len(legs))] = GIVE * play[:, legs]
    shapes[:, :, :n] *= -1
    changes = angle_changes(body, one.grounded, one.angle, shapes)
    plates, fit = plate_sources(), one.fit
    count = S.shape[1] + changes.shape[2] + len(plates.delay) + 3 * trials
    total = empty(count, layout)
    gram, frames = total.gram.copy(), total.count.copy()
    for pick in layout.bands.runs(fit.use, fit.motion.rate):
        if pick.size < SHORTEST:
            continue
        motion = thinned(fit.motion, pick)
        W = regressor(body, motion)
        seen = fit.wrench.value[pick]
        places = np.zeros((pick.size, 6, 3 * trials))
        places[:, :, 3 * place : 3 * place + 3] = place_changes(seen, one.grounded)
        near = np.minimum(pick // THINNED, len(changes) - 1)
        faults = plate_errors(seen, motion.rate, layout, plates)
        left = (seen - W @ body.sip.phi)[:, :, None]
        rows = np.concatenate([W @ S, changes[near], faults, places, left], axis=2)
        X = layout.bands.coefficients(layout.shift @ rows)
        band = layout.bands.at(fit.motion.rate).of(len(X))
        for b in np.unique(band[band >= 0]):
            flat = X[band == b].reshape(-1, 6 * (count + 1))
            gram[b] += (flat.T @ flat).reshape(6, count + 1, 6, count + 1)
            frames[b] += len(flat)
    return Statistics(gram, frames, layout)


def _sum(parts: list[Statistics]) -> Statistics | None:
    total = parts[0] if parts else None
    for part in parts[1:]:
        assert total is not None
        total = total + part
    return total


def _start(body: Body) -> Array:
    return np.asarray(START * (float(body.sip.mass.sum()) / REFERENCE_PERSON) ** 2)


def _learned(total: Statistics | None, sd: Array, start: Array) -> Noise:
    """Return the noise that is left where every cause may be there."""
    assert total is not None

    def improved(noise: Noise) -> Noise:
        A, b = _equations(total, noise)
        covariance = _posterior(A, sd)
        left = noise_of(total.moments(covariance @ b, covariance), start=start, worth=WORTH)
        return replace(noise, covariance=left)

    first = Noise(np.tile(start, (len(total.count), 1, 1)), total.layout.about, total.layout.bands)
    return maximise(first, improved, lambda one: one.covariance, rounds=_ROUNDS, tolerance=1e-2)


def _equations(total: Statistics | None, noise: Noise) -> tuple[Array, Array]:
    """Return X' S^-1 X (c, c) and X' S^-1 y (c,)."""
    assert total is not None
    weight = np.linalg.inv(noise.covariance)
    H = np.einsum("bcd,bcidj->ij", weight, total.gram, optimize=True)
    return H[:-1, :-1], H[:-1, -1]


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

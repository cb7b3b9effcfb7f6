"""What the witnesses of a session say together: which cause, how big, how sure, what else it could be.

Each observation is what is expected, plus what the causes add (their traces), plus parts of the expectation that
several observations share (a person's foot, a laboratory's markers), plus its own error. Shared parts and sizes of
causes are normal before the data; own errors have heavy tails (Student, 4 degrees of freedom), because one step in
twenty is odd. The evidence of a cause is the integral over all of them by Laplace's method (Bishop 2006, section 4.4).
Signs of channels have no size: they are undone in the recording, and the witnesses are asked again.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from biodance.diagnosis.candidates import SCALE
from biodance.diagnosis.diagnosis import Alias, Estimate, Finding
from biodance.diagnosis.heard import Testimony, put_right
from biodance.diagnosis.naming import TOGETHER
from biodance.effects import Effect, causes
from biodance.effects.added_mass import AddedMass
from biodance.effects.body_mass import BodyMass
from biodance.records import Array

THRESHOLD = 2.0
"""Natural logarithm of the evidence, less that of the number of targets that are seen, from which a cause is named."""
_TAIL = 4.0
"""Degrees of freedom of an observation's own error."""
_RARE = 3.0
_RARER = {"plate_crosstalk": 1.0}
"""Natural logarithms: so much rarer than other faults are a channel of the wrong sign, and cross-talk that looks like a
plate beside its place."""
_BROAD = 10.0
"""Typical sizes: that large ones are rare counts for a name; the size itself is told as the witnesses show it."""
_AGAIN = 2
"""Times that the witnesses are asked again about a recording with the named causes put right."""
SOMEWHERE = (AddedMass.name, "")
"""Effect and target of a load of which only the weight is known."""
_ROUNDS = 3
_STEPS = 30
_SURE = 2.0
_USUAL = {
    ("plate_position", "m"): 0.006,
    ("plate_rotation", "rad"): 0.03,
    ("plate_gain", "1"): 0.02,
    ("plate_offset", "N"): 7.0,
    ("plate_offset", "N·m"): 2.0,
    ("plate_crosstalk", "m"): 0.006,
    ("time_delay", "s"): 0.008,
    ("body_mass", "kg"): 0.7,
}
"""Sizes up to which laboratories have a cause without calling it a fault: plates 2 to 5 mm off (Collins 2009), zeros of
public recordings to 6 N, clocks within a frame, clothes and shoes."""
_ALIKE = {
    "plate_position": 0.005,
    "plate_crosstalk": 0.005,
    "plate_rotation": 0.01,
    "plate_gain": 0.004,
    "time_delay": 0.002,
}
"""Standard deviation of what careful laboratories have (same units): no size is surer against "as the file says"."""
_VERTICAL = 18.0
"""N of vertical zero, which readers take off: public recordings have up to 16."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """One explanation: its ``log_evidence``, the sizes ``theta`` (p,) of its causes with ``covariance`` (p, p)."""

    log_evidence: float
    theta: Array
    covariance: Array


def fit(value: Array, sd: Array, shared: Array, Z: Array, size: Array) -> Explanation:
    """Return the explanation of values (n,) less expectation, with own ``sd`` (n,), by ``shared`` (n, k) parts of unit
    normal size and causes whose columns ``Z`` (n, p) have sizes of standard deviation ``size`` (p,).
    """
    A = np.concatenate([shared, Z * size], axis=1)
    weight, u = np.ones(value.size), np.zeros(A.shape[1])
    for _ in range(_STEPS):
        H = (A * (weight / sd**2)[:, None]).T @ A + np.eye(A.shape[1])
        factor = cho_factor(H, lower=True)
        new = cho_solve(factor, A.T @ (weight / sd**2 * value))
        weight = (_TAIL + 1) / (_TAIL + ((value - A @ new) / sd) ** 2)
        done, u = np.abs(new - u).max(initial=0.0) < 1e-4, new
        if done:
            break
    left = (value - A @ u) / sd
    tails = -0.5 * (_TAIL + 1) * np.log1p(left**2 / _TAIL).sum()
    inverse = cho_solve(factor, np.eye(len(u)))
    p = Z.shape[1]
    theta, covariance = size * u[len(u) - p :], inverse[len(u) - p :, len(u) - p :] * np.outer(size, size)
    log_evidence = float(tails - 0.5 * u @ u - np.log(np.diag(factor[0])).sum())
    return Explanation(log_evidence, theta, covariance)


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A cause beside those named before: its log Bayes factor and ``score`` (less the number of targets); ``found``
    the sizes of all.
    """

    names: tuple[str, str]
    log_bayes_factor: float
    score: float
    found: Explanation

    @property
    def alias(self) -> Alias:
        """The cause with its evidence."""
        return Alias(*self.names, self.log_bayes_factor)


@dataclass(frozen=True, eq=False)
class Verdicts:
    """What the witnesses' evidence names: ``findings``; ``left`` the testimony with turned signs put right; ``first``
    all causes at the first round, most probable first.
    """

    findings: tuple[Finding, ...]
    left: Testimony
    first: tuple[Alias, ...] = ()


def weigh(testimony: Testimony) -> Verdicts:
    """Return the causes that the witnesses' evidence carries, at most three, each with size and look-alikes."""
    heard = testimony.counting
    value = np.array([one.value - one.expected for one in heard.observations])
    if not value.size:
        return Verdicts((), heard)
    named: list[tuple[Hypothesis, tuple[Alias, ...]]] = []
    first: tuple[Alias, ...] = ()
    for number in range(_ROUNDS):
        chosen = tuple(one.names for one, _ in named if one.names in heard.causes)
        ranking = _ranked(heard, value, chosen, signs=number == 0)
        first = first or tuple(one.alias for one in ranking)
        best = next((one for one in ranking if one.score >= THRESHOLD and _matters(heard, one)), None)
        if best is None:
            break
        near = [o for o in ranking if o is best or best.score - o.score <= TOGETHER]
        near.sort(key=lambda o: o is not best)
        named.append((best, (*(o.alias for o in near), *_loads(near))))
        if best.names in heard.turned:
            break  # the traces of other causes hold only once the sign is mended
    return Verdicts(_findings(heard, value, named), heard, first)


def _loads(near: Iterable[Hypothesis]) -> tuple[Alias, ...]:
    """Return a load somewhere, where a body that is heavier than declared is among what cannot be told apart: to
    witnesses, who only weigh, the two are the same.
    """
    heavier = (one for one in near if one.names == (BodyMass.name, "") and one.found.theta[-1] > 0)
    return tuple(Alias(*SOMEWHERE, one.log_bayes_factor) for one in heavier)


def _ranked(heard: Testimony, value: Array, named: tuple[tuple[str, str], ...], *, signs: bool) -> list[Hypothesis]:
    """Return every cause beside the named ones with its evidence, most probable first."""
    before = _explained(heard, value, named)
    count = Counter(names[0] for names in heard.causes if heard.seen_by(names))  # who is not seen is not mistaken
    found = []
    for names in heard.causes:
        if names in named or not np.abs(heard.traces[names]).any():
            continue
        one = _explained(heard, value, (*named, names))
        bayes = one.log_evidence - before.log_evidence
        score = bayes - float(np.log(max(1, count[names[0]]))) - _RARER.get(names[0], 0.0)
        found.append(Hypothesis(names, bayes, score, one))
    for names, turned in heard.turned.items() if signs else ():
        known = np.isfinite(turned)
        one = _explained(heard, turned, named, known)
        bayes = one.log_evidence - _explained(heard, value, named, known).log_evidence
        found.append(Hypothesis(names, bayes, bayes - _RARE - float(np.log(len(heard.turned))), one))
    return sorted(found, key=lambda one: -one.score)


def _explained(
    heard: Testimony, value: Array, names: tuple[tuple[str, str], ...], known: Array | None = None
) -> Explanation:
    Z = np.stack([heard.traces[name] for name in names], axis=1) if names else np.empty((value.size, 0))
    return _fitted(heard, value, Z, np.array([SCALE * _typical(*name) for name in names]), known)


def _fitted(heard: Testimony, value: Array, Z: Array, size: Array, known: Array | None = None) -> Explanation:
    kept = np.ones(value.size, dtype=bool) if known is None else known.astype(bool)
    sd = np.array([one.sd for one in heard.observations])[kept]
    return fit(value[kept], sd, heard.shared[kept], Z[kept], size)


def _sized(heard: Testimony, value: Array, names: tuple[tuple[str, str], ...]) -> Explanation:
    """Return the explanation by named causes with their sizes as the witnesses show them: where the causes are put
    right, the witnesses are asked again, for what a cause adds is no straight line.
    """
    size = np.array([_BROAD * _typical(*name) for name in names])
    Z = np.stack([heard.traces[name] for name in names], axis=1) if names else np.empty((value.size, 0))
    found = _fitted(heard, value, Z, size)
    for _ in range(_AGAIN if heard.recorded and names else 0):
        added, slopes = put_right(heard, dict(zip(names, map(float, found.theta), strict=True)))
        again = value + added + slopes @ found.theta
        found = _fitted(heard, np.nan_to_num(again), slopes, size, np.isfinite(again))
    return found


def _typical(effect: str, target: str) -> float:
    """Return the typical size of a cause, as the family of effects has it."""
    kind = causes()[effect]
    return float(kind.typical[0]) if isinstance(kind, Effect) else 1.0


def _matters(heard: Testimony, one: Hypothesis) -> bool:
    """Return whether the last cause of an explanation is larger than what laboratories have without fault, and sure."""
    if one.names not in heard.causes:
        return True
    cause, size = heard.causes[one.names], abs(float(one.found.theta[-1]))
    usual = _USUAL.get((cause.effect, cause.unit), 0.0)
    if cause.effect == "plate_offset" and cause.target.endswith("Fz"):
        usual = _VERTICAL
    sd = float(np.hypot(one.found.covariance[-1, -1] ** 0.5, _ALIKE.get(cause.effect, 0.0)))
    return size > usual + sd and size > _SURE * sd


def _findings(heard: Testimony, value: Array, named: list[tuple[Hypothesis, tuple[Alias, ...]]]) -> tuple[Finding, ...]:
    """Return the named causes with their sizes, all fitted together."""
    sized = tuple(one.names for one, _ in named if one.names in heard.causes)
    last, found = _sized(heard, value, sized), []
    for one, near in named:
        kind, visible = causes()[one.names[0]], 1.0
        estimates: tuple[Estimate, ...] = ()
        if one.names in sized:
            i, cause = sized.index(one.names), heard.causes[one.names]
            sd = float(np.hypot(last.covariance[i, i] ** 0.5, _ALIKE.get(cause.effect, 0.0)))
            estimates = (Estimate(cause.parameter, float(last.theta[i]), sd, cause.unit),)
            visible = _visible(heard, one.names)
        found.append(Finding(*one.names, estimates, near, visible, advice=f"{_said(heard, one.names)} {kind.advice}"))
    return tuple(found)


def size_by(heard: Testimony, names: tuple[str, str]) -> tuple[float, float] | None:
    """Return the size of a cause and its standard deviation by the witnesses alone, wider by as much as they contradict
    each other; None where they are blind to it.
    """
    counting = heard.counting
    if names not in counting.causes or not counting.seen_by(names):
        return None
    value = np.array([one.value - one.expected for one in counting.observations])
    one = _sized(counting, value, (names,))
    sd = _disagreement(counting, names, value - counting.traces[names] * one.theta[0]) * one.covariance[0, 0] ** 0.5
    return float(one.theta[0]), float(np.hypot(sd, _ALIKE.get(names[0], 0.0)))


def _disagreement(heard: Testimony, names: tuple[str, str], left: Array) -> float:
    """Return how many times as far apart the observations that see a cause lie as their errors say, at least 1, from
    what is ``left`` (n,) of all: the Birge ratio (Birge 1932, doi:10.1103/PhysRev.40.207).
    """
    sees = heard.sees(names)
    if sees.sum() < 2:
        return 1.0
    own = np.array([one.sd for one in heard.observations])[sees]
    spread = np.diag(own**2) + heard.shared[sees] @ heard.shared[sees].T
    return max(1.0, float(left[sees] @ np.linalg.solve(spread, left[sees]) / (sees.sum() - 1)) ** 0.5)


def _visible(heard: Testimony, names: tuple[str, str]) -> float:
    """Return the share of a cause that stays visible when all shared parts of the expectations may adapt."""
    sd = np.array([one.sd for one in heard.observations])
    z, N = heard.traces[names] / sd, heard.shared / sd[:, None]
    inner = np.linalg.solve(np.eye(N.shape[1]) + N.T @ N, N.T @ z)
    return float(np.sqrt(np.clip((z @ z - z @ N @ inner) / max(float(z @ z), 1e-300), 0.0, 1.0)))


def _said(heard: Testimony, names: tuple[str, str]) -> str:
    """Return which witnesses carry a finding, in words."""
    if names not in heard.causes:
        return "With this sign turned back, the pressure lies under the feet and a step brakes first and pushes then."
    seen = heard.seen_by(names)
    return f"Seen by: {', '.join(name.replace('_', ' ') for name in seen)}." if seen else ""

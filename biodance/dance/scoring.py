"""How well a dance was danced: what it was planned to tell of every segment, what the recording tells, and which
transitions are worth dancing once more.

Planned and performed motion are judged alike: on the body of the session, with the noise and the disturbances of a
typical session (`dance.expectation`), so that only the movement makes the difference. What is compared is information,
the share of the table's variance that the movement removes.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from biodance import display
from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.expectation import JUDGED_RATE, MovementEvidence, movement_evidence, removed_shares, typical_noise
from biodance.errors import BiodanceError
from biodance.motion.dynamics import predict_wrench
from biodance.records import Motion
from biodance.uncertainty.noise import Noise

_STILL = 1.0
"""s: a hold says nothing more after this time."""
PROPOSED = 3
"""Transitions that are proposed for repetition."""


@dataclass(frozen=True)
class SegmentExcitation:
    """What a dance was ``planned`` to tell of a ``segment``, and what was ``reached``: share of the table's variance
    removed, 0 to 1, mean over its ten inertial parameters.
    """

    segment: str
    planned: float
    reached: float


@dataclass(frozen=True)
class Repetition:
    """One ``transition`` of a dance, counted from 1: it leads from cue ``transition`` to the next one. Planned from
    ``start`` to ``end`` s of the dance; ``gain``: by how much dancing it once more, as planned, raises the share of
    the table's variance removed, mean over the segments; ``most`` the segment that gains most.
    """

    transition: int
    start: float
    end: float
    gain: float
    most: str


@dataclass(frozen=True, eq=False)
class PerformanceScore:
    """How well a dance was danced.

    Parameters
    ----------
    dance : str
        Name of its protocol.
    excitation : tuple of SegmentExcitation
        Planned and reached, segment by segment.
    repetitions : tuple of Repetition
        The transitions whose repetition would gain most together, best first.
    seconds : float
        Recorded and used, s.

    Examples
    --------
    >>> identified = biodance.identify(result, dance="dance.npz")
    >>> identified.performance.repeat
    (1,)
    """

    dance: str
    excitation: tuple[SegmentExcitation, ...]
    repetitions: tuple[Repetition, ...]
    seconds: float

    def __repr__(self) -> str:
        planned, reached = (np.mean([getattr(one, name) for one in self.excitation]) for name in ("planned", "reached"))
        told = f"{100 * reached:.0f} % of the table's variance removed, planned {100 * planned:.0f} %"
        return f"PerformanceScore({self.dance!r}: {told})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), None, [f"Repeat transition {k}." for k in self.repeat])

    @property
    def repeat(self) -> tuple[int, ...]:
        """Numbers of the transitions to repeat, best first."""
        return tuple(one.transition for one in self.repetitions)


def score_performance(
    dance: Dance, body: Body, recorded: tuple[tuple[Motion, NDArray[np.bool_]], ...]
) -> PerformanceScore:
    """Return how well ``dance`` was danced in the motions ``recorded`` of ``body``, each with its usable frames (T,).

    `PROPOSED` transitions are chosen one after another, each the one that raises the mean share most beside those
    chosen before.

    Raises
    ------
    BiodanceError
        The dance has joints that the body has not, or nothing was recorded.
    """
    _same_joints(dance, body)
    if not any(use.any() for _, use in recorded):
        raise BiodanceError("No trial with role fit has motion and plates, so nobody knows how the dance was danced.")
    brief = replace(dance, hold=np.minimum(dance.hold, _STILL))
    plan = _in_joints_of(body, dance, brief.motion(JUDGED_RATE))
    noise = typical_noise(predict_wrench(body, plan))
    planned = removed_shares(movement_evidence(body, plan, noise=noise).posterior())
    parts = [movement_evidence(body, motion, use, noise=noise) for motion, use in recorded if use.any()]
    total = sum(parts[1:], parts[0])
    reached = removed_shares(total.posterior())
    rows = tuple(SegmentExcitation(*row) for row in zip(body.segments, planned.tolist(), reached.tolist(), strict=True))
    seconds = sum(float(use.sum()) / motion.rate for motion, use in recorded)
    return PerformanceScore(dance.protocol, rows, _repetitions(dance, body, total, noise), seconds)


def _same_joints(dance: Dance, body: Body) -> None:
    names, own = ([joint.name for joint in one.joints] for one in (dance.body, body))
    if [name for name in own if name in names] != names or dance.body.segments != body.segments:
        other = sorted(set(names) ^ set(own)) or ["the order"]
        raise BiodanceError(
            f"Dance {dance.protocol}: was designed for a body with other joints than that of this session "
            f"({', '.join(other[:3])}). Give the dance that was shown."
        )


def _repetitions(dance: Dance, body: Body, known: MovementEvidence, noise: Noise) -> tuple[Repetition, ...]:
    """Return the transitions that gain most beside what is ``known``, best first; steps to another place, which the
    feet cannot simply repeat, are left out.
    """
    some = {
        phase: _once(dance, body, phase.start, phase.end, noise)
        for phase in dance.phases
        if phase.kind == "move"
        and np.array_equal(dance.stances[phase.posture - 1].ankle, dance.stances[phase.posture].ankle)
    }
    out: list[Repetition] = []
    while some and len(out) < PROPOSED:
        before = removed_shares(known.posterior())
        gains = {phase: removed_shares((known + one).posterior()) - before for phase, one in some.items()}
        best = max(gains, key=lambda phase: float(gains[phase].mean()))
        segment = body.segments[int(np.argmax(gains[best]))]
        out.append(Repetition(best.posture, best.start, best.end, float(gains[best].mean()), segment))
        known = known + some.pop(best)
    return tuple(out)


def _once(dance: Dance, body: Body, start: float, end: float, noise: Noise) -> MovementEvidence:
    """Return what the planned movement between two instants tells, at the rate of the judgement."""
    time = np.arange(max(2, round((end - start) * JUDGED_RATE)) + 1) / JUDGED_RATE
    phase = next(phase for phase in dance.phases if phase.start == start)
    state = dance.state(phase, np.minimum(start + time, end))
    motion = dance.chain.motion(time, state.x, state.v, state.a)
    return movement_evidence(body, _in_joints_of(body, dance, motion), noise=noise)


def _in_joints_of(body: Body, dance: Dance, motion: Motion) -> Motion:
    """Return a planned motion in the coordinates of a body that may have joints which the dance leaves at zero."""
    names = [joint.name for joint in dance.body.joints]
    new = np.flatnonzero([joint.name not in names for joint in body.joints])
    if not new.size:
        return motion
    before, root = new - np.arange(new.size), body.nq - len(body.joints)
    q = np.insert(motion.q, before + root, 0.0, axis=1)
    v, a = (np.insert(part, before + body.n_root, 0.0, axis=1) for part in (motion.v, motion.a))
    return Motion(motion.time, q, v, a, joint_names=tuple(joint.name for joint in body.joints))

"""Who moves, as markers tell it: placed once for all examinations of a session that differ in its plates alone."""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.identification.limbs import with_declared_limbs
from biodance.motion.contact import carried_elsewhere
from biodance.pipeline.body import body_of, shown_joints, starting_from
from biodance.pipeline.trial_result import ShownJoints, Step, TrialResult
from biodance.records import Mask, Session, Sip, Subject


@dataclass(frozen=True, eq=False)
class Placed:
    """The ``body`` of a ``subject`` with the joints that its markers ``shown``, ``plain`` without them, its ``source``
    in words, its ``prior``, and the ``steps`` to it; from the ``known`` body of an earlier session where there is one.
    Frames ``hidden`` (T,) of each trial, in which something else carries, placed no joint.
    """

    subject: Subject
    known: Body | None
    hidden: tuple[Mask, ...]
    body: Body | None
    plain: Body | None
    source: str
    prior: Sip | None
    shown: ShownJoints
    steps: tuple[Step, ...]

    def holds(self, other: "tuple[Subject, Body | None, tuple[Mask, ...]]") -> bool:
        """Return whether another subject, known body and hidden frames are those of this one."""
        subject, known, hidden = other
        return subject == self.subject and known is self.known and all(map(np.array_equal, hidden, self.hidden))


def place(
    session: Session,
    read: tuple[TrialResult, ...],
    known: Body | None,
    earlier: tuple[Placed, tuple[TrialResult, ...]] | None,
) -> Placed:
    """Return who moves in the prepared trials ``read`` of a session; the body of an ``earlier`` examination where its
    trials have the same markers, and nothing else carries in other frames.

    Raises
    ------
    SessionRefused
        The ``known`` body is of another person.
    """
    subject = session.subject
    hidden = tuple(_hidden(one, subject.mass) for one in read)
    if earlier is not None and earlier[0].holds((subject, known, hidden)) and _same_markers(read, earlier[1]):
        return earlier[0]
    steps: list[Step] = []
    body, source = body_of(subject, read, session.settings, steps)
    prior = None
    if body is not None and known is not None:
        body, prior, source = starting_from(known, body, subject.mass, source)
    elif body is not None:
        body, limbs = with_declared_limbs(body, subject)
        source = f"{source} {limbs}".strip()
    plain, shown = body, ShownJoints()
    if body is not None:
        body, shown = shown_joints(body, read, steps)
    return Placed(subject, known, hidden, body, plain, source, prior, shown, tuple(steps))


def _hidden(one: TrialResult, mass: float) -> Mask:
    trial = one.trial
    if not one.usable or trial.markers is None or not trial.plates:
        return np.zeros(0, dtype=bool)
    return carried_elsewhere(trial, weight=trial.settings.gravity * mass)


def _same_markers(some: tuple[TrialResult, ...], others: tuple[TrialResult, ...]) -> bool:
    """Return whether the trials of two examinations have equal markers."""
    for one, other in zip(some, others, strict=True):
        ours, theirs = one.trial.markers, other.trial.markers
        if ours is None or theirs is None:
            if ours is not theirs:
                return False
        elif ours.names != theirs.names or not all(
            np.array_equal(*pair, equal_nan=True) for pair in ((ours.time, theirs.time), (ours.xyz, theirs.xyz))
        ):
            return False
    return True

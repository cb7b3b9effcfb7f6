"""Who moves, as markers tell it: placed once for all examinations of a session that differ in its plates alone."""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.pipeline.trial_result import ShownJoints, Step
from biodance.records import Mask, Sip, Subject


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

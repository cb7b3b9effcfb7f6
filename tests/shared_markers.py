"""Sessions with the markers of an earlier one, as where only forces are wrong: what markers alone tell is found once.

The engine itself takes it from there for a copy with other forces (``examine(..., earlier=...)``), and looks whether
the markers are the same; exchanged labels are looked for in markers alone; errors of the kinematics are those of the
same body in the same motion.
"""

import hashlib
import pickle
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from typing import Any

import pytest

from biodance.effects import labels_swapped
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine
from biodance.records import Markers, Motion, Session, Trial
from biodance.uncertainty import sources
from biodance.uncertainty.response import ErrorSource

KEPT, ERRORS, SMALL = 4, 16, 1e7
"""Sessions that are remembered, the last ones; and trials with the errors of their kinematics, of so many bytes."""
_sessions: dict[str, SessionResult] = {}
_exchanges: dict[str, Any] = {}
_errors: dict[str, sources.Errors] = {}
_look, _forward = labels_swapped.exchanged_labels, sources.forward


def digest(*things: object) -> str:
    """Return a digest of markers to the last bit, and of what else prints itself whole."""
    found = hashlib.sha256()
    for one in things:
        if isinstance(one, Markers):
            found.update(repr((one.names, one.xyz.shape)).encode() + one.time.tobytes() + one.xyz.tobytes())
        else:
            found.update(repr(one).encode())
    return found.hexdigest()


def examined_beside(session: Session, **how: Any) -> SessionResult:
    """Return the session examined; what only its markers tell is taken from one with the same that was before it."""
    key = digest(session.subject, *(part for one in session.trials for part in (one.name, one.role, one.markers)))
    found = examine(session, **{"earlier": _sessions.pop(key, None), **how})
    _sessions[key] = found
    while len(_sessions) > KEPT:
        del _sessions[next(iter(_sessions))]
    return found


def exchanged_once(trial: Trial, static: Markers | None, known: Any = (), others: Sequence[Markers] = ()) -> Any:
    """Return which labels are exchanged in a trial: found once for the same markers."""
    key = digest(trial.role, trial.marker_set, trial.markers, static, known, *others)
    if key not in _exchanges:
        _exchanges[key] = _look(trial, static, known, others)
    return _exchanges[key]


def forward_once(kinds: tuple[ErrorSource, ...], motion: Motion) -> sources.Errors:
    """Return what errors do in a motion: found once for the same kinds, body and motion, for nobody to write into."""
    own = [(type(one), [getattr(one, part.name) for part in fields(one) if part.name != "body"]) for one in kinds]
    body = [getattr(kinds[0].body, part.name) for part in fields(kinds[0].body)]
    key = hashlib.sha256(pickle.dumps((own, body, motion.time, motion.q, motion.v, motion.a))).hexdigest()
    found = _errors.pop(key, None) or _forward(kinds, motion)
    found.wrench.setflags(write=False)
    found.markers.setflags(write=False)
    if found.wrench.nbytes < SMALL:
        _errors[key] = found
    while len(_errors) > ERRORS:
        del _errors[next(iter(_errors))]
    return found


@contextmanager
def markers_asked_once() -> Iterator[None]:
    """Let the commands take what only markers tell from the session with the same markers that they had before."""
    with pytest.MonkeyPatch.context() as patch:
        for place in ("biodance.pipeline.session.examine", "biodance.pipeline.front.examine"):
            patch.setattr(place, examined_beside)
        patch.setattr(labels_swapped, "exchanged_labels", exchanged_once)
        yield

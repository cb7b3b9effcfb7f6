"""Sessions with the markers of an earlier one, as where only forces are wrong: what markers alone tell is found once.

The engine itself takes it from there for a copy with other forces (``examine(..., earlier=...)``), and looks whether
the markers are the same; exchanged labels are looked for in markers alone.
"""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import pytest

from biodance.effects import labels_swapped
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine, followed
from biodance.records import Markers, Session, Trial

KEPT = 4
"""Sessions that are remembered, the last ones."""
_sessions: dict[str, SessionResult] = {}
_exchanges: dict[str, Any] = {}
_look = labels_swapped.exchanged_labels


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
    return _beside(examine, session, how)


def followed_beside(session: Session, **how: Any) -> SessionResult:
    """Return the same without what the segments weigh, as the commands begin."""
    return _beside(followed, session, how)


def _beside(stages: Callable[..., SessionResult], session: Session, how: dict[str, Any]) -> SessionResult:
    key = digest(session.subject, *(part for one in session.trials for part in (one.name, one.role, one.markers)))
    found = stages(session, **{"earlier": _sessions.pop(key, None), **how})
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


@contextmanager
def markers_asked_once() -> Iterator[None]:
    """Let the commands take what only markers tell from the session with the same markers that they had before."""
    with pytest.MonkeyPatch.context() as patch:
        for place in ("biodance.pipeline.session.followed", "biodance.pipeline.front.followed"):
            patch.setattr(place, followed_beside)
        patch.setattr(labels_swapped, "exchanged_labels", exchanged_once)
        yield

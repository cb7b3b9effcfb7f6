"""The copy of a session in which faults that are too large for gates and statistics are undone: all else is judged
there, since a large fault has small companions everywhere.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from biodance.effects import DiscreteEffect, Effect, QualityCheck, Recorded
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.judged_trials import all_windows, cases_of
from biodance.pipeline.results import MendedCopy, SessionResult
from biodance.pipeline.session import examine
from biodance.records import Trial

_ROUNDS = 3
"""How often it is looked again: with one fault undone, another one shows."""

_Cause = Effect | DiscreteEffect


def with_faults_undone(
    result: SessionResult,
    mended: MendedCopy | None,
    chosen: Mapping[str, _Cause],
    *,
    reference: SessionIdentification | None,
    tell: Callable[[str], None],
) -> MendedCopy | None:
    """Return a copy of the session examined again without what the checks of the ``chosen`` causes find and can undo
    (`Checked.undone`), beside what was ``mended`` already; that, if there is none.
    """
    undoing = [kind for kind in chosen.values() if kind.undoes()]
    found: list[QualityCheck] = []
    for _ in range(_ROUNDS):
        recorded = Recorded(result.session, cases_of(result.body, all_windows(result.trials)))
        known = {(one.effect, one.target, one.trials) for one in found}
        failed = [(kind, one) for kind in undoing for one in kind.check(recorded) if not one.ok]
        new = [(kind, one) for kind, one in failed if (one.effect, one.target, one.trials) not in known]
        if not new:
            break
        found += [replace(one, advice=kind.advice) for kind, one in new]
        tell(f"examining a copy without {', '.join(sorted({one.effect.replace('_', ' ') for _, one in new}))}")
        trials = tuple(_undone(trial, new) for trial in result.session.trials)
        result = examine(replace(result.session, trials=trials), reference=reference)
    if not found:
        return mended
    exchanged, checks = (mended.exchanged, mended.checks) if mended else ({}, ())
    return MendedCopy(result, exchanged, (*checks, *found))


def _undone(trial: Trial, found: Iterable[tuple[_Cause, QualityCheck]]) -> Trial:
    """Return a trial as read without what was found in it."""
    for kind, one in found:
        if trial.plates and one.meant(trial):
            trial = kind.undone(trial, one)
    return trial

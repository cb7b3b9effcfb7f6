"""A session with its exchanged labels put right in a copy: in memory, and as files."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from biodance.effects import Gate, Recorded, gates
from biodance.effects.labels_swapped import exchanges, renamed
from biodance.lab.c3d.results import write_relabelled
from biodance.pipeline.looked_at import all_looks, cases_of
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine
from biodance.records import Session

_ROUNDS = 3
"""How often exchanged labels are looked for again: a static trial that was wrong hides others."""


def with_right_labels(result: SessionResult, *, tell: Callable[[str], None]) -> tuple[SessionResult, tuple[Gate, ...]]:
    """Return the session examined again with its labels exchanged, until no two carry each other's names, and the
    checks that named them; the same result and no check where none do.
    """
    checks = gates(result.session, cases_of(result.body, all_looks(result.trials)), chosen=("labels_swapped",))
    for _ in range(_ROUNDS):
        found = exchanges(Recorded(result.session, cases_of(result.body, all_looks(result.trials))))
        if not found:
            break
        tell("examining a copy with the labels exchanged")
        trials = tuple(
            renamed(trial, found[trial.name]) if trial.name in found else trial for trial in result.session.trials
        )
        result = examine(replace(result.session, trials=trials))
    return result, tuple(gate for gate in checks if not gate.ok)


def write_mended(session: Session, mended: Session, folder: Path) -> tuple[Path, ...]:
    """Write a copy of every C3D file whose labels were exchanged into ``folder``/mended; return their paths.

    Every other byte is as in the recording.
    """
    written = []
    for trial, after in zip(session.trials, mended.trials, strict=True):
        if trial.markers is None or after.markers is None or trial.source.format != "C3D":
            continue
        names = dict(zip(trial.markers.names, after.markers.names, strict=True))
        if any(old != new for old, new in names.items()):
            written.append(write_relabelled(trial.source.path, folder / "mended" / trial.source.path.name, names))
    return tuple(written)

"""Copies of a session in which faults are undone: corrected trials and labels put right, as accepting the findings
writes them; and the copy without faults that are too large for statistics, in which all else is judged, since a
large fault has small companions everywhere.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from biodance.display import spaced
from biodance.effects import DiscreteEffect, Effect, QualityCheck, Recorded
from biodance.effects.labels_swapped import WORSE, exchanges, named_exchanges, renamed
from biodance.errors import BiodanceError
from biodance.lab.c3d.results import write_exchanged
from biodance.lab.c3d.write import write_trial
from biodance.lab.corrections import (
    APPLIED,
    PlateCorrection,
    corrected_trial,
    corrections_text,
    joined_corrections,
)
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.judged_trials import recorded_of
from biodance.pipeline.results import MendedCopy, SessionResult
from biodance.pipeline.session import examine
from biodance.records import Session, Trial

CORRECTED = "corrected"
"""Folder with the trials that were corrected."""
MENDED = "mended"
"""Folder with the copies of recordings whose exchanged labels were put right."""


class Written(NamedTuple):
    """One ``file`` that accepting has written, its path in the folder of results, and ``what`` was changed in it."""

    file: str
    what: str


def write_corrected(
    session: Session, earlier: tuple[PlateCorrection, ...], accepted: tuple[PlateCorrection, ...], folder: Path
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Write the trials of a session without the causes ``accepted`` as C3D into ``folder``, with the session.toml that
    makes them a session; return their names, and why others could not be written.

    Markers and plates are as read (m turned to mm, z up, plates TYPE 2), other analog channels are left out. What was
    corrected ``earlier`` is in ``session`` already; `APPLIED` says that all of it is off, so that none is corrected
    twice.
    """
    folder.mkdir()
    text = corrections_text(joined_corrections(earlier, accepted))
    (folder / APPLIED).write_text(text, encoding="utf-8", newline="\n")
    (folder / "session.toml").write_text(_session_toml(session), encoding="utf-8", newline="\n")
    written, refused = [], []
    for trial in session.trials:
        try:
            write_trial(corrected_trial(trial, accepted), folder / f"{trial.name}.c3d")
            written.append(trial.name)
        except BiodanceError as error:
            refused.append(f"Trial {trial.name} was not written corrected. {error}")
    return tuple(written), tuple(refused)


def _session_toml(session: Session) -> str:
    """Return what is known of the subject (nothing guessed), a marker set of the user's own and the roles, as a
    session.toml says them.
    """
    subject = session.subject
    said = {"mass_kg": subject.mass - sum(subject.devices.values()), "height_m": subject.stature, "age": subject.age}
    guessed = {{"mass": "mass_kg", "stature": "height_m"}.get(what, what) for what in subject.guessed}
    lines = ["[subject]", *(f"{key} = {float(x)}" for key, x in said.items() if np.isfinite(x) and key not in guessed)]
    lines += [f'sex = "{subject.sex}"'] * (subject.sex in ("F", "M") and "sex" not in guessed)
    lines += [f'prosthesis = "{subject.prosthesis}"'] * bool(subject.prosthesis)
    lines += ["", "[devices]", *(f"{segment} = {kg}" for segment, kg in subject.devices.items())] * bool(
        subject.devices
    )
    own = {trial.marker_set for trial in session.trials if trial.marker_set.endswith(".toml")}
    for file in own:
        lines += ["", "[markers]", f"file = {json.dumps(str(Path(file).resolve()))}"]
    feet = {f"plate{n}": plate.foot for trial in session.trials for n, plate in enumerate(trial.plates, start=1)}
    for name, foot in feet.items():
        lines += ["", f"[plates.{name}]", f'foot = "{foot}"'] * bool(foot)
    for trial in session.trials:
        lines += ["", f"[trials.{json.dumps(trial.name)}]", f'role = "{trial.role}"', *_said_of(trial)]
    return "\n".join(lines) + "\n"


def _said_of(trial: Trial) -> Iterator[str]:
    """Yield what session.toml says of the steps of a trial: what it says of labels is done in the copy."""
    spans = [[one.start, one.end, *([one.side] if one.side else [])] for one in trial.left_out]
    kinds = {True: "strike", False: "off"}
    events = [f'{{side = "{e.side}", kind = "{kinds[e.down]}", time = {e.time}}}' for e in trial.events]
    if spans:
        yield f"leave_out = {json.dumps(spans)}"
    if events:
        yield f"events = [{', '.join(events)}]"


def with_right_labels(
    result: SessionResult,
    recorded: Recorded,
    *,
    reference: SessionIdentification | None = None,
    tell: Callable[[str], None],
) -> MendedCopy | None:
    """Return the session, ``recorded`` as checks see it, examined again with those labels exchanged that carry each
    other's names; None where none do.

    Proven before it is kept: a trial that the body follows clearly worse with other names (`WORSE`) keeps its own.
    """
    found = recorded.once(exchanges)
    while found:
        tell("examining a copy with the labels exchanged")
        trials = tuple(renamed(trial, found.get(trial.name, {})) for trial in result.session.trials)
        mended = examine(replace(result.session, trials=trials), reference=reference, known=result.known)
        worse = {
            after.name
            for before, after in zip(result.trials, mended.trials, strict=True)
            if before.fit and after.fit and after.fit.total_rms > WORSE * before.fit.total_rms
        } & found.keys()
        if not worse:
            return MendedCopy(mended, found, named_exchanges(result.session, found))
        found = {name: pairs for name, pairs in found.items() if name not in worse}
    return None


def write_mended(session: Session, right: MendedCopy, folder: Path) -> tuple[tuple[Written, ...], tuple[str, ...]]:
    """Write a copy of every C3D file with exchanged labels put right into ``folder``/mended; return what was written,
    and why others could not be. Every other byte is as in the recording.
    """
    written, refused = [], []
    for trial in session.trials:
        pairs, file = right.exchanged.get(trial.name, {}), trial.source.path
        if pairs and trial.source.format == "C3D":
            path = write_exchanged(file, folder / MENDED / file.name, pairs)
            written.append(
                Written(f"{MENDED}/{path.name}", f"names exchanged: {', '.join(f'{a} and {b}' for a, b in pairs)}")
            )
        elif pairs:
            refused.append(f"Trial {trial.name} was not written with its labels put right: only C3D files are copied.")
    return tuple(written), tuple(refused)


_ROUNDS = 3
"""How often it is looked again: with one fault undone, another one shows."""

_Cause = Effect | DiscreteEffect


def with_faults_undone(
    result: SessionResult,
    recorded: Recorded,
    mended: MendedCopy | None,
    chosen: Mapping[str, _Cause],
    *,
    reference: SessionIdentification | None,
    tell: Callable[[str], None],
) -> tuple[MendedCopy | None, Recorded]:
    """Return a copy of the session, as checks see it ``recorded``, examined again without what the checks of the
    ``chosen`` causes find and can undo (`Checked.undone`), beside what was ``mended`` already; that, if there is none;
    and what the checks see of it.
    """
    undoing = [kind for kind in chosen.values() if kind.undoes()]
    found: list[QualityCheck] = []
    for _ in range(_ROUNDS):
        known = {(one.effect, one.target, one.trials) for one in found}
        failed = [(kind, one) for kind in undoing for one in recorded.once(kind.check) if not one.ok]
        failed = [pair for pair in failed if any(_undone(t, [pair]) is not t for t in result.session.trials)]
        new = [(kind, one) for kind, one in failed if (one.effect, one.target, one.trials) not in known]
        if not new:
            break
        found += [replace(one, advice=kind.advice) for kind, one in new]
        tell(f"examining a copy without {', '.join(sorted({spaced(one.effect) for _, one in new}))}")
        trials = tuple(_undone(trial, new) for trial in result.session.trials)
        result = examine(
            replace(result.session, trials=trials), reference=reference, known=result.known, earlier=result
        )
        recorded = recorded_of(result)
    if not found:
        return mended, recorded
    exchanged, checks = (mended.exchanged, mended.checks) if mended else ({}, ())
    return MendedCopy(result, exchanged, (*checks, *found)), recorded


def _undone(trial: Trial, found: Iterable[tuple[_Cause, QualityCheck]]) -> Trial:
    """Return a trial as read without what was found in it."""
    for kind, one in found:
        if trial.plates and one.meant(trial):
            trial = kind.undone(trial, one)
    return trial

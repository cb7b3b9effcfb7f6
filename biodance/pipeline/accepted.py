"""What accepting the findings of a session writes: corrected trials, and copies with exchanged labels put right."""

import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.diagnosis.diagnosis import Finding
from biodance.effects import QualityCheck, Recorded, check_quality
from biodance.effects.labels_swapped import exchanges, renamed
from biodance.errors import BiodanceError
from biodance.lab.c3d.ezc3d_object import write_trial
from biodance.lab.c3d.results import write_relabelled
from biodance.lab.corrections import (
    APPLIED,
    PARAMETER_OF,
    PlateCorrection,
    corrected_trial,
    corrections_text,
    joined_corrections,
)
from biodance.pipeline.judged_trials import all_windows, cases_of
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine
from biodance.records import Session

CORRECTED = "corrected"
"""Folder with the trials that were corrected."""
_ROUNDS = 3
"""How often exchanged labels are looked for again: a static trial that was wrong hides others."""


def accepted_corrections(findings: Iterable[Finding], source: str) -> tuple[PlateCorrection, ...]:
    """Return the ``findings`` that can be corrected in recordings, found in ``source``."""
    out = []
    for one in findings:
        size = {p.name: p for p in one.parameters}.get(PARAMETER_OF.get(one.effect, ""))
        if size is not None and np.isfinite(size.value):
            out.append(PlateCorrection(one.effect, one.target, size.value, size.sd, source))
    return tuple(out)


def write_corrected(
    session: Session, earlier: tuple[PlateCorrection, ...], accepted: tuple[PlateCorrection, ...], folder: Path
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Write the trials of a session without the causes ``accepted`` as C3D into ``folder``, with the session.toml that
    makes them a session; return their names, and why others could not be written.

    Markers and plates are as read (m turned to mm, z up, plates TYPE 2), other analog channels are left out. What was
    corrected ``earlier`` is in ``session`` already.
    """
    if folder.is_dir() and (folder / APPLIED).is_file():
        for path in (*folder.glob("*.c3d"), folder / APPLIED, folder / "session.toml"):
            path.unlink(missing_ok=True)
    folder.mkdir(exist_ok=True)
    written, refused = [], []
    for trial in session.trials:
        try:
            write_trial(corrected_trial(trial, accepted), folder / f"{trial.name}.c3d")
            written.append(trial.name)
        except BiodanceError as error:
            refused.append(f"Trial {trial.name} was not written corrected. {error}")
    (folder / "session.toml").write_text(_session_toml(session), encoding="utf-8", newline="\n")
    text = corrections_text(joined_corrections(earlier, accepted))
    (folder / APPLIED).write_text(text, encoding="utf-8", newline="\n")
    return tuple(written), tuple(refused)


def _session_toml(session: Session) -> str:
    """Return what is known of the subject (nothing guessed), a marker set of the user's own and the roles, as a
    session.toml says them.
    """
    subject = session.subject
    said = {"mass_kg": subject.mass, "height_m": subject.stature, "age": subject.age}
    guessed = {{"mass": "mass_kg", "stature": "height_m"}.get(what, what) for what in subject.guessed}
    lines = ["[subject]", *(f"{key} = {float(x)}" for key, x in said.items() if np.isfinite(x) and key not in guessed)]
    lines += [f'sex = "{subject.sex}"'] * (subject.sex in ("F", "M") and "sex" not in guessed)
    own = {trial.marker_set for trial in session.trials if trial.marker_set.endswith(".toml")}
    for file in own:
        lines += ["", "[markers]", f"file = {json.dumps(str(Path(file).resolve()))}"]
    feet = {f"plate{n}": plate.foot for trial in session.trials for n, plate in enumerate(trial.plates, start=1)}
    for name, foot in feet.items():
        lines += ["", f"[plates.{name}]", f'foot = "{foot}"'] * bool(foot)
    for trial in session.trials:
        lines += ["", f"[trials.{json.dumps(trial.name)}]", f'role = "{trial.role}"']
    return "\n".join(lines) + "\n"


def with_right_labels(
    result: SessionResult, *, tell: Callable[[str], None]
) -> tuple[SessionResult, tuple[QualityCheck, ...]]:
    """Return the session examined again with its labels exchanged, until no two carry each other's names, and the
    checks that named them; the same result and no check where none do.
    """
    checks = check_quality(
        result.session, cases_of(result.body, all_windows(result.trials)), chosen=("labels_swapped",)
    )
    for _ in range(_ROUNDS):
        found = exchanges(Recorded(result.session, cases_of(result.body, all_windows(result.trials))))
        if not found:
            break
        tell("examining a copy with the labels exchanged")
        trials = tuple(
            renamed(trial, found[trial.name]) if trial.name in found else trial for trial in result.session.trials
        )
        result = examine(replace(result.session, trials=trials))
    return result, tuple(quality for quality in checks if not quality.ok)


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

"""What one session gives to the next: an accepted body, accepted corrections of the force plates, corrected trials,
and a copy in which exchanged labels are put right.
"""

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.body.body_file import read_body
from biodance.cycles.curves import NormalCurve, normal_of
from biodance.diagnosis.diagnosis import Finding
from biodance.effects import Gate, Recorded, gates
from biodance.effects.labels_swapped import exchanges, renamed
from biodance.errors import BiodanceError, FileRefused
from biodance.lab.c3d.ezc3d_object import write_trial
from biodance.lab.c3d.results import write_relabelled
from biodance.lab.corrections import (
    APPLIED,
    LASTING,
    PARAMETER_OF,
    PlateCorrection,
    corrected_session,
    corrected_trial,
    corrections_text,
    joined_corrections,
    read_corrections,
)
from biodance.library import read_toml
from biodance.pipeline.looked_at import all_looks, cases_of
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine
from biodance.records import Session
from biodance.uncertainty.tolerances import Tolerances, tolerances_of

LAB, CORRECTED = "lab.toml", "corrected"
"""File with the accepted corrections of a laboratory, and folder with the trials that were corrected."""


@dataclass(frozen=True, eq=False)
class LabFile:
    """What a lab.toml says: ``corrections`` of the plates, ``tolerances`` of the laboratory's own or None, and the
    ``normal`` bands of its people.
    """

    corrections: tuple[PlateCorrection, ...] = ()
    tolerances: Tolerances | None = None
    normal: tuple[NormalCurve, ...] = ()

    def corrected(self, session: Session) -> Session:
        """Return a session as read, corrected."""
        return corrected_session(session, self.corrections) if self.corrections else session


NO_LAB = LabFile()


def read_lab(path: str | Path | None) -> LabFile:
    """Return what the file of a laboratory says; nothing without a file.

    Raises
    ------
    FileRefused
        It cannot be read, or says what cannot be corrected.
    """
    if path is None:
        return NO_LAB
    corrections = read_corrections(path)
    whole = read_toml(Path(path))
    raw, where = whole.get("tolerances"), "norms"
    try:
        norms = {name: (float(one["value"]), float(one["sd"])) for name, one in whole.get("norms", {}).items()}
        where = "tolerances"
        known, where = replace(tolerances_of(raw), norms=norms) if raw else None, "normal"
        return LabFile(corrections, known, normal_of(whole.get("normal", {})))
    except (KeyError, TypeError, ValueError, BiodanceError) as error:
        raise FileRefused(f"{path}: [{where}] is not what `biodance learn` writes ({error}).") from error


def known_body(body: Body | str | Path | None) -> Body | None:
    """Return an earlier body: as given, or of a body.json or the folder that holds one; None without one.

    Raises
    ------
    FileRefused
        The file is no body.
    """
    if body is None or isinstance(body, Body):
        return body
    path = Path(body)
    return read_body(path / "body.json" if path.is_dir() else path)[0]


def accepted_corrections(findings: Iterable[Finding], source: str) -> tuple[PlateCorrection, ...]:
    """Return the ``findings`` that can be corrected in recordings, found in ``source``."""
    out = []
    for one in findings:
        size = {p.name: p for p in one.parameters}.get(PARAMETER_OF.get(one.effect, ""))
        if size is not None and np.isfinite(size.value):
            out.append(PlateCorrection(one.effect, one.target, size.value, size.sd, source))
    return tuple(out)


def lab_text(earlier: tuple[PlateCorrection, ...], accepted: tuple[PlateCorrection, ...]) -> str:
    """Return the lab.toml that holds what was corrected ``earlier`` and what lasts of what was ``accepted``; "" for
    nothing.
    """
    lasting = tuple(one for one in accepted if one.effect in LASTING)
    return corrections_text(joined_corrections(earlier, lasting))


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
    """Return subject and roles of a session as its session.toml says them."""
    subject = session.subject
    said = {"mass_kg": subject.mass, "height_m": subject.stature, "age": subject.age}
    lines = ["[subject]", *(f"{key} = {float(x)}" for key, x in said.items() if np.isfinite(x))]
    lines += [f'sex = "{subject.sex}"'] * (subject.sex in ("F", "M"))
    for trial in session.trials:
        lines += ["", f"[trials.{json.dumps(trial.name)}]", f'role = "{trial.role}"']
    return "\n".join(lines) + "\n"


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

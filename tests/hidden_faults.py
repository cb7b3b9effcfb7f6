"""Sessions of the virtual laboratory with something hidden in them, and what the diagnosis of their files finds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shared_markers import examined_beside, markers_asked_once

from biodance.diagnosis.diagnosis import Diagnosis
from biodance.effects import discrete_effects, effects
from biodance.lab.session.read import read_session
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.results import SessionResult
from biodance.records import Array, Plate, Subject
from biodance.virtual_lab.causes import parse_cause
from biodance.virtual_lab.movement import read_protocol
from biodance.virtual_lab.simulate import simulate_session
from biodance.virtual_lab.visit import LabVisit

SUBJECT = Subject(64.0, 1.72, "F", 30.0)
TRIALS = ("static", "move_1", "move_5")
MORE = (*TRIALS, "move_3")
"""What a small load, or a cause that hides behind others, needs."""


def hidden(
    folder: Path,
    *texts: str,
    seed: int = 41,
    visit: int = 0,
    trials: tuple[str, ...] = TRIALS,
    person: Subject = SUBJECT,
) -> Path:
    """Write a session of few ``trials`` with something hidden in it; ``visit`` another day of the same person."""
    plan = read_protocol("diagnosis")
    plan = replace(plan, trials=tuple(trial for trial in plan.trials if trial.name in trials))
    causes = tuple(parse_cause(text) for text in texts)
    return simulate_session(person, plan, folder, seed=seed, hidden=causes, visit=LabVisit(visit))


def examined(folder: Path, monkeypatch: pytest.MonkeyPatch) -> SessionResult:
    """Read and track a session; what it says about the body is not needed here."""
    monkeypatch.setattr("biodance.pipeline.session.can_identify", lambda _: False)
    return examined_beside(read_session(folder))


def found(folder: Path, monkeypatch: pytest.MonkeyPatch, *, without: tuple[str, ...] = ()) -> Diagnosis:
    """Diagnose the session of a folder, with all effects but those ``without``."""
    chosen = tuple(name for name in (*effects(), *discrete_effects()) if name not in without) if without else None
    with markers_asked_once():
        return diagnose_session(examined(folder, monkeypatch), effects=chosen).diagnosis


def standing_recording(folder: Path, *texts: str, visit: LabVisit) -> Path:
    """Write a session of somebody who stands, with something hidden in it; return the file of the fitted trial."""
    plan, person = read_protocol("standing"), Subject(60.0, 1.70, "F", 30.0)
    simulate_session(person, plan, folder, seed=4, hidden=tuple(parse_cause(text) for text in texts), visit=visit)
    return next(path for path in sorted(folder.glob("*.c3d")) if "static" not in path.name)


def about_centre(plate: Plate, centre: Array) -> Array:
    """Return the wrench (T, 6) of a plate about a point."""
    force, moment = plate.wrench.force, plate.wrench.moment
    return np.concatenate([force, moment - np.cross(centre, force)], axis=1)

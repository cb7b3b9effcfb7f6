"""What a hidden fault does to the body that is identified from the session, and what is left of that once the named
cause is accepted.
"""

import json
from dataclasses import replace
from typing import Any

import numpy as np
from hidden_sessions import Scenario, examined, session_folder

from biodance.diagnosis.accept import residuals_of
from biodance.identification.statistics import standing_point
from biodance.pipeline.diagnosis import SessionDiagnosis
from biodance.pipeline.identification import KEPT_ROLES
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import trial_fit
from biodance.records import Array


def fault_free(scenario: Scenario) -> Scenario:
    """Return the same person, movement and instruments without the hidden fault."""
    return replace(scenario, hidden=())


def contamination(scenario: Scenario, result: SessionResult, found: SessionDiagnosis) -> dict[str, Any]:
    """Return ``masses`` (12) kg: ``true``, of the ``table``, identified with the fault in the data (``sip_alone``),
    with the findings ``accepted``, and in the same person's session without fault (``fault_free``); and ``table`` (6)
    N, N·m, what the table's body leaves of the kept trials.
    """
    clean = examined(fault_free(scenario)).identification
    bodies = {
        "table": result.body.sip if result.body else None,
        "sip_alone": found.before.sip if found.before else None,
        "accepted": found.accepted.sip if found.accepted else None,
        "fault_free": clean.identification.sip if clean else None,
    }
    masses = {name: list(map(float, sip.mass)) for name, sip in bodies.items() if sip is not None}
    return {"masses": {"true": list(map(float, _true_masses(scenario)))} | masses, "table": _left_by_table(result)}


def _true_masses(scenario: Scenario) -> Array:
    """Return (12,) kg of the person without any load, as the virtual laboratory wrote it down."""
    document = json.loads((session_folder(fault_free(scenario)) / "truth" / "truth.json").read_text())
    return np.array([segment["mass_kg"] for segment in document["segments_12"]])


def _left_by_table(result: SessionResult) -> list[float]:
    """Return (6,) N, N·m: root mean square of what the table's body leaves of the trials that were kept."""
    fits = tuple(fit for one in result.trials if one.trial.role in KEPT_ROLES and (fit := trial_fit(one)) is not None)
    if result.body is None or not fits:
        return []
    left = residuals_of(result.body, fits, standing_point(fits))
    pooled = np.concatenate([values[use] for values, use in zip(left.left, left.use, strict=True)])
    return [float(value) for value in np.sqrt(np.mean(pooled**2, axis=0))]

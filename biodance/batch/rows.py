"""What the table of an archive says of each trial."""

from typing import Any

ROW_TYPES: dict[str, str] = {
    "session": "string",
    "trial": "string",
    "role": "string",
    "status": "string",
    "reason": "string",
    "session_status": "string",
    "verdict": "string",
    "findings": "string",
    "first": "string",
    "declared_mass_kg": "float64",
    "mass_on_plates_kg": "float64",
    "mass_difference_percent": "float64",
    "frames": "Int64",
    "rate_hz": "float64",
    "gaps_percent": "float64",
    "marker_rms_m": "float64",
    "marker_max_m": "float64",
    "fz_rms_table_n": "float64",
    "fz_rms_identified_n": "float64",
    "warnings": "Int64",
    "seconds": "float64",
    "memory_mb": "float64",
}
"""Every column of summary.parquet and summary.csv, and its type."""
_OF_TRIAL = ("role", "status", "reason", "frames", "rate_hz", "gaps_percent", "marker_rms_m", "marker_max_m")


def rows_of(document: dict[str, Any]) -> tuple[dict[str, Any], ...]:
    """Return one row for each trial of a session (results.json): what it is, how well it was followed, what its plates
    say; trials that were refused have a row, too.
    """
    mass, diagnosis = document["mass_check"] or {}, document["diagnosis"] or {}
    shared = {
        "verdict": diagnosis.get("verdict") or "not judged",
        "findings": "; ".join(f"{one['effect']} {one['target']}".strip() for one in diagnosis.get("findings", ())),
        "first": document["attention"][0]["text"] if document["attention"] else "",
        "declared_mass_kg": document["subject"]["mass_kg"],
        "mass_on_plates_kg": mass.get("mass_on_plates_kg"),
        "mass_difference_percent": mass.get("difference_percent"),
    }
    rows = [
        {
            "trial": trial["name"],
            **{name: trial[name] for name in _OF_TRIAL},
            **{f"fz_rms_{body}_n": _vertical(trial["wrench"], body) for body in ("table", "identified")},
            "warnings": len(trial["warnings"]),
            **shared,
        }
        for trial in document["trials"]
    ]
    refused = (
        {"trial": name, "status": "refused", "reason": why, **shared} for name, why in document["refused"].items()
    )
    return (*rows, *refused)


def _vertical(wrench: dict[str, Any] | None, body: str) -> float | None:
    """Return the RMS of vertical force between plates and the simulation with one ``body``, N; None where unknown."""
    found = wrench.get(body) if wrench else None
    return float(found["rms"][2]) if found and found["rms"][2] is not None else None

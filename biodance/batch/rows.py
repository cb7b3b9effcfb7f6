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
    "gait_cycles": "Int64",
    "squats": "Int64",
    "rises": "Int64",
    "foot_events": "Int64",
    "speed_m_per_s": "float64",
    "hip_flexion_max_deg": "float64",
    "knee_flexion_max_deg": "float64",
    "ankle_dorsiflexion_max_deg": "float64",
    "warnings": "Int64",
    "seconds": "float64",
    "memory_mb": "float64",
}
"""Every column of summary.parquet and summary.csv, and its type."""
_KINDS = {"gait": "gait_cycles", "squat": "squats", "sit_to_stand": "rises"}
_ANGLES = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")
_OF_TRIAL = ("role", "status", "reason", "frames", "rate_hz", "gaps_percent", "marker_rms_m", "marker_max_m")


def rows_of(document: dict[str, Any]) -> tuple[dict[str, Any], ...]:
    """Return one row for each trial of a session (results.json): what it is, how well it was followed, what its plates
    say, what moved; trials that were refused have a row, too.
    """
    moved = {one["trial"]: one for one in (document["movement"] or {"trials": ()})["trials"]}
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
            **(_moved(moved[trial["name"]]) if trial["name"] in moved else {}),
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


def _moved(one: dict[str, Any]) -> dict[str, Any]:
    """Return what moved in a trial: how many repetitions and events, speed, and the largest angle of the mean curves of
    both sides.
    """
    kinds = [cycle["kind"] for cycle in one["cycles"]]
    speeds = [row["mean"] for row in one["spatiotemporal"] if (row["quantity"], row["side"]) == ("speed", "both")]
    row: dict[str, Any] = {column: kinds.count(kind) for kind, column in _KINDS.items()}
    row |= {"foot_events": len(one["events"]), "speed_m_per_s": speeds[0] if speeds else None}
    for angle in _ANGLES:
        most = [curve["max"] for curve in one["curves"] if curve["quantity"] == angle and "max" in curve]
        row[f"{angle}_max_deg"] = max(most) if most else None
    return row

"""The subject's measures that joint centres need: typed ones from the file, otherwise from the markers or from
proportions.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from biodance.body.human.standing import StaticPosture
from biodance.body.tables.anthropometry import proportion
from biodance.records import Array, Subject, Trial

MARKER_DIAMETER = 0.014
"""m, where the file does not say: the usual marker of plug-in gait."""
ASIS_TOLERANCE, LEG_TOLERANCE = 0.020, 0.040
"""m: larger differences between a typed measure and the markers are warned about."""
LETTER = {"right": "R", "left": "L"}


@dataclass(frozen=True)
class Measures:
    """``marker_radius``; ``pelvis_width`` (inter-ASIS) and ``pelvis_depth`` (mid ASIS to mid PSIS) between marker
    centres; by side: ``leg_length``, ``asis_to_trochanter``, ``shoulder_offset``; ``widths`` of <side>_knee, _ankle,
    _elbow, _wrist. All m.

    ``typed`` are the names of widths and offsets that were typed by the lab; ``notes`` say what was taken from where
    and contradictions.
    """

    marker_radius: float
    pelvis_width: float
    pelvis_depth: float
    leg_length: Mapping[str, float]
    asis_to_trochanter: Mapping[str, float]
    shoulder_offset: Mapping[str, float]
    widths: Mapping[str, float]
    typed: frozenset[str]
    notes: tuple[str, ...]


def measures(posture: StaticPosture, static: Trial, subject: Subject) -> Measures:
    """Return the measures of a subject; what the static trial's file says comes before what the subject record says."""
    given = {
        name.lower(): value
        for source in (subject.measurements, static.measurements)
        for name, value in source.items()
        if value > 0
    }
    place = posture.landmarks
    middle = (place["right_asis"] + place["left_asis"]) / 2
    width = float(np.linalg.norm(place["right_asis"] - place["left_asis"]))
    notes, typed = _contradictions(given, width, place), set()
    diameter = given.get("markerdiameter")
    if diameter is None:
        notes.append(f"Marker diameter is not in the file: {1e3 * MARKER_DIAMETER:.0f} mm taken.")
    legs = {side: given.get(f"{LETTER[side]}leglength".lower(), marker_leg(place, side)) for side in LETTER}
    widths, offsets = {}, {}
    for side, letter in LETTER.items():
        for joint in ("knee", "ankle", "elbow", "wrist"):
            default = proportion(f"{joint}_width", subject.sex) * subject.stature
            widths[f"{side}_{joint}"] = given.get(f"{letter}{joint}width".lower(), default)
            typed |= {f"{side}_{joint}"} if f"{letter}{joint}width".lower() in given else set()
        acromia = float(np.linalg.norm(place["right_acromion"] - place["left_acromion"]))
        offsets[side] = given.get(
            f"{letter}shoulderoffset".lower(), proportion("shoulder_offset", subject.sex) * acromia
        )
    guessed = sorted(set(widths) - typed)
    if guessed:
        notes.append(
            f"Joint widths not in the file, taken from stature where a medial marker is missing: {', '.join(guessed)}."
        )
    return Measures(
        marker_radius=(diameter or MARKER_DIAMETER) / 2,
        pelvis_width=width,
        pelvis_depth=float(np.linalg.norm(middle - place["mid_psis"])),
        leg_length=legs,
        asis_to_trochanter={
            s: given.get(f"{LETTER[s]}asistrocanterdistance".lower(), 0.1288 * legs[s] - 0.04856) for s in LETTER
        },
        shoulder_offset=offsets,
        widths=widths,
        typed=frozenset(typed),
        notes=tuple(notes),
    )


def marker_leg(place: Mapping[str, Array], side: str) -> float:
    """Return the leg length between markers, m: ASIS to knee to ankle."""
    asis, knee, ankle = (place[f"{side}_{name}"] for name in ("asis", "knee_lateral", "ankle_lateral"))
    return float(np.linalg.norm(asis - knee) + np.linalg.norm(knee - ankle))


def _contradictions(given: Mapping[str, float], width: float, place: Mapping[str, Array]) -> list[str]:
    """Return a warning for every typed measure that the markers contradict."""
    checks = [("InterAsisDistance", given.get("interasisdistance"), width, ASIS_TOLERANCE)]
    for side, letter in LETTER.items():
        checks.append(
            (f"{letter}LegLength", given.get(f"{letter}leglength".lower()), marker_leg(place, side), LEG_TOLERANCE)
        )
    return [
        f"Warning: {name} was typed as {1e3 * typed:.0f} mm but the markers are {1e3 * seen:.0f} mm apart; measure "
        f"again or check them."
        for name, typed, seen, tolerance in checks
        if typed is not None and abs(typed - seen) > tolerance
    ]

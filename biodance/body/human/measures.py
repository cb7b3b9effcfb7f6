"""The subject's measures that joint centres need: typed ones from the file, else from markers or proportions."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from biodance.body.human.standing import StaticPosture
from biodance.body.tables.anthropometry import proportion
from biodance.records import Array, Subject, Trial

_MM = 1e-3


def unit(vector: Array) -> Array:
    """Return the vector (3,) with length 1."""
    return np.asarray(vector / np.linalg.norm(vector))


def pelvis_frame(right_asis: Array, left_asis: Array, mid_psis: Array) -> tuple[Array, Array]:
    """Return lab_R_pelvis (3, 3) and the middle of the ASIS (3,) m: z to the right ASIS, x forwards in the plane of
    ASIS and PSIS (ISB).
    """
    middle = (right_asis + left_asis) / 2
    z = unit(right_asis - left_asis)
    y = unit(np.cross(z, middle - mid_psis))
    return np.stack([np.cross(y, z), y, z], axis=1), middle


def davis_hip(pelvis_width: float, leg_length: float, asis_to_trochanter: float, marker_radius: float) -> Array:
    """Return the RIGHT hip centre (3,) m from the middle of the ASIS in the pelvis frame (left: z negated).

    Davis et al. 1991, doi:10.1016/0167-9457(91)90046-Z, as in Vicon plug-in gait: C = 0.115 leg - 15.3 mm, theta = 0.5
    rad, beta = 0.314 rad. ``leg_length`` is the mean of both legs, ``asis_to_trochanter`` (0.1288 leg - 48.56 mm) of
    this side; all m.
    """
    theta, beta = 0.5, 0.314
    c, depth = 0.115 * leg_length - 15.3 * _MM, asis_to_trochanter + marker_radius
    forward = c * np.cos(theta) * np.sin(beta) - depth * np.cos(beta)
    up = -c * np.cos(theta) * np.cos(beta) - depth * np.sin(beta)
    return np.array([forward, up, pelvis_width / 2 - c * np.sin(theta)])


def harrington_hip(pelvis_width: float, pelvis_depth: float) -> Array:
    """Return the RIGHT hip centre (3,) m from the middle of the ASIS in the pelvis frame (left: z negated).

    Harrington et al. 2007, doi:10.1016/j.jbiomech.2006.02.003, the regressions on inter-ASIS width and depth (mid ASIS
    to mid PSIS), m.
    """
    return np.array(
        [-0.24 * pelvis_depth - 9.9 * _MM, -0.30 * pelvis_width - 10.9 * _MM, 0.33 * pelvis_width + 7.3 * _MM]
    )


def chord(proximal: Array, marker: Array, distance: float, away_from: Array) -> Array:
    """Return the joint centre (3,) m at ``distance`` m from a lateral marker, with a right angle between marker and
    proximal centre.

    It lies in the plane of the proximal centre, the marker and the point ``away_from`` (a wand marker), on the side
    away from that point (Kadaba et al. 1990, doi:10.1002/jor.1100080310; plug-in gait). ``distance`` = (joint width +
    marker diameter) / 2.
    """
    arm = proximal - marker
    reach = float(np.linalg.norm(arm))
    along = arm / reach
    side = unit(np.cross(np.cross(along, away_from - marker), along))
    cosine = min(distance / reach, 1.0)
    return np.asarray(marker + distance * (cosine * along - np.sqrt(1 - cosine**2) * side))


def shoulder(trunk_origin: Array, forward: Array, acromion: Array, offset: float, *, side: float) -> Array:
    """Return the shoulder centre (3,) m under the acromion marker: chord from the trunk's origin, in the plane that is
    square to the trunk.

    ``forward`` (3,) is the trunk's unit x axis in the lab frame, ``offset`` m marker centre to joint centre, ``side``
    +1 right, -1 left.
    """
    up = side * np.cross(unit(acromion - trunk_origin), forward)
    return chord(trunk_origin, acromion, offset, acromion + up)


def elbow(shoulder_centre: Array, lateral: Array, mid_wrist: Array, distance: float, *, side: float) -> Array:
    """Return the elbow centre (3,) m from the lateral epicondyle alone: its axis is square to the plane of shoulder,
    marker and wrist.

    As in plug-in gait; wrong by centimetres where the arm hangs straight. With a medial marker use the middle instead.
    """
    normal = side * np.cross(mid_wrist - lateral, shoulder_centre - lateral)
    return chord(shoulder_centre, lateral, distance, lateral + unit(normal))


def wrist(elbow_centre: Array, radial: Array, ulnar: Array, distance: float, *, side: float) -> Array:
    """Return the wrist centre (3,) m under a bar on its back: square to the bar and to the forearm (plug-in gait)."""
    middle = (radial + ulnar) / 2
    back = side * np.cross(radial - ulnar, elbow_centre - middle)
    return np.asarray(middle - distance * unit(back))


MARKER_DIAMETER = 0.014
"""m, where the file does not say: the usual marker of plug-in gait."""
ASIS_BETWEEN, LEG_BETWEEN = (-0.024, 0.054), (-0.040, 0.040)
"""m: how much farther apart markers are than a typed measure without a warning. The distance of the spines is typed of
bone and marked on skin, which lies outside of it: 15 mm (sd 13) in 15 persons of 6 public laboratories, here with three
standard deviations; of legs 0 mm (sd 15) in 16.
"""
LETTER = {"right": "R", "left": "L"}


@dataclass(frozen=True)
class Measures:
    """``marker_radius``; ``pelvis_width`` (inter-ASIS) and ``pelvis_depth`` (mid ASIS to mid PSIS) between marker
    centres; by side: ``leg_length``, ``asis_to_trochanter``, ``shoulder_offset``; ``widths`` of <side>_knee, _ankle,
    _elbow, _wrist. All m.

    ``notes`` say what was taken from where, and contradictions.
    """

    marker_radius: float
    pelvis_width: float
    pelvis_depth: float
    leg_length: Mapping[str, float]
    asis_to_trochanter: Mapping[str, float]
    shoulder_offset: Mapping[str, float]
    widths: Mapping[str, float]
    notes: tuple[str, ...]


def measures(posture: StaticPosture, static: Trial, subject: Subject) -> Measures:
    """Return the measures of a subject; what the static trial's file says comes before what the subject record says."""
    typed_in = {**subject.measurements, **static.measurements}
    given = {name.lower(): value for name, value in typed_in.items() if value > 0}
    place = posture.landmarks
    middle = (place["right_asis"] + place["left_asis"]) / 2
    width = float(np.linalg.norm(place["right_asis"] - place["left_asis"]))
    notes, guessed = _contradictions(given, width, place), list[str]()
    diameter = given.get("markerdiameter")
    if diameter is None:
        notes.append(f"Marker diameter is not in the file: {1e3 * MARKER_DIAMETER:.0f} mm taken.")
    legs = {side: given.get(f"{LETTER[side]}leglength".lower(), marker_leg(place, side)) for side in LETTER}
    widths, offsets = {}, {}
    for side, letter in LETTER.items():
        for joint in ("knee", "ankle", "elbow", "wrist"):
            default = proportion(f"{joint}_width", subject.sex) * subject.stature
            widths[f"{side}_{joint}"] = given.get(f"{letter}{joint}width".lower(), default)
            guessed += [] if f"{letter}{joint}width".lower() in given else [f"{side}_{joint}"]
        acromia = float(np.linalg.norm(place["right_acromion"] - place["left_acromion"]))
        offsets[side] = given.get(
            f"{letter}shoulderoffset".lower(), proportion("shoulder_offset", subject.sex) * acromia
        )
    if guessed:
        notes.append(
            f"Joint widths not in the file, taken from stature where a medial marker is missing: "
            f"{', '.join(sorted(guessed)).replace('_', ' ')}."
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
        notes=tuple(notes),
    )


def marker_leg(place: Mapping[str, Array], side: str) -> float:
    """Return the leg length between markers, m: ASIS to knee to ankle."""
    asis, knee, ankle = (place[f"{side}_{name}"] for name in ("asis", "knee_lateral", "ankle_lateral"))
    return float(np.linalg.norm(asis - knee) + np.linalg.norm(knee - ankle))


def _contradictions(given: Mapping[str, float], width: float, place: Mapping[str, Array]) -> list[str]:
    """Return a warning for every typed measure that the markers contradict."""
    checks = [("InterAsisDistance", given.get("interasisdistance"), width, ASIS_BETWEEN)]
    for side, letter in LETTER.items():
        checks.append(
            (f"{letter}LegLength", given.get(f"{letter}leglength".lower()), marker_leg(place, side), LEG_BETWEEN)
        )
    return [
        f"Warning: {name} was typed as {1e3 * typed:.0f} mm, the markers are {1e3 * seen:.0f} mm apart: check "
        f"both, measure again."
        for name, typed, seen, (low, high) in checks
        if typed is not None and not low <= seen - typed <= high
    ]

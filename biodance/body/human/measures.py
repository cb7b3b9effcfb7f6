"""The subject's measures that joint centres need: typed ones from the file, else from markers or proportions."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from biodance.body.tables.anthropometry import proportion
from biodance.errors import TrialRefused
from biodance.lab.markers.sets import LANDMARKS, MarkerSet, canonical, landmark, read_marker_set
from biodance.lab.markers.upright import WINDOW, posture_frames
from biodance.records import SIDES, Array, Markers, Subject, Trial
from biodance.records.attention import Doubt, NotUsed

_NEEDED = (
    *("right_asis", "left_asis", "mid_psis"),
    *(f"{side}_{place}" for side in SIDES for place in ("knee_lateral", "ankle_lateral", "heel", "toe")),
)
"""Landmarks without which no body can be placed: pelvis and legs. The rest may stand by proportion (`unseen`)."""


@dataclass(frozen=True, eq=False)
class StaticPosture:
    """Markers of the set (canonical labels) in one standing posture: ``points`` label -> (3,) m, lab frame;
    ``landmarks`` name -> (3,) m.

    ``unseen`` the anatomical joints that no marker shows, whose landmarks were put by proportion; ``notes`` say which
    frames were averaged and which markers come from elsewhere in the trial or are missing. ``still`` is False where the
    person moves and one frame was taken: then the feet need not be flat.
    """

    marker_set: MarkerSet
    points: Mapping[str, Array]
    landmarks: Mapping[str, Array]
    notes: tuple[str, ...]
    unseen: tuple[str, ...] = ()
    still: bool = True


def standing(static: Trial) -> StaticPosture:
    """Return the posture of a static trial: the median over its quietest half second, or over all frames for a marker
    not seen then.

    Raises
    ------
    TrialRefused
        There are no markers, no recognised marker set, or a landmark that the body needs is missing in every frame; all
        are named.
    """
    where = f"{'Static trial' if static.role == 'static' else 'Trial'} {static.name}"
    if static.markers is None:
        raise TrialRefused(
            f"{where}: it has no markers, so no body can be scaled on it. Record the person standing still."
        )
    if not static.marker_set:
        raise TrialRefused(
            f"{where}: its {len(static.markers.names)} labels are of no known marker set. Label them as in "
            "anthropometry/marker_sets, or describe your own set in a TOML file of that form and give it with "
            "--markers FILE, or say [markers] file or map in session.toml."
        )
    marker_set = read_marker_set(static.marker_set)
    markers = canonical(static.markers, marker_set)
    chosen, still = posture_frames(markers)
    points = {}
    elsewhere: list[str] = []
    missing: list[str] = []
    for label in markers.names:
        track, near = markers[label], markers[label][chosen]
        near, track = near[np.isfinite(near).all(axis=1)], track[np.isfinite(track).all(axis=1)]
        if len(track):
            points[label] = np.median(near if len(near) else track, axis=0)
        (missing if not len(track) else elsewhere if not len(near) else []).append(label)
    corners = _corners(points, marker_set)
    seen = points | corners
    one = Markers(tuple(seen), np.zeros(1), np.array(list(seen.values())).reshape(1, -1, 3))
    tracks = {name: landmark(one, marker_set, name) for name in LANDMARKS}
    landmarks = {name: track[0] for name, track in tracks.items() if track is not None}
    if not corners:
        landmarks = {name: place for name, place in landmarks.items() if not name.endswith("_knee_axis")}
    points |= corners
    _refuse_missing(landmarks, marker_set, where)
    first, last = (static.source.first_frame + int(i) for i in np.flatnonzero(chosen)[[0, -1]])
    at = f"frames {first} to {last}, the quietest {WINDOW} s" if last > first else f"its only frame, {first}"
    notes = [f"{where}: posture from {at}."]
    if not still:
        notes = [Doubt(f"{where}: nobody stands still in it; its frame {first} was taken for the posture", mended=True)]
    notes += [f"{where}: {', '.join(elsewhere)} not seen then, taken from the rest of the trial."] if elsewhere else []
    notes += [f"{where}: {', '.join(missing)} never seen, so not on the body."] if missing else []
    return StaticPosture(marker_set, points, landmarks, tuple(notes), still=still)


def _corners(points: Mapping[str, Array], marker_set: MarkerSet) -> dict[str, Array]:
    """Return the markers that a knee alignment device stood in for, label -> (3,) m: where its arms meet."""
    found = {}
    for marker in marker_set.markers:
        if marker.label in points or not set(marker.corner_of) or not set(marker.corner_of) <= points.keys():
            continue
        ends = np.array([points[label] for label in marker.corner_of])
        middle = ends.mean(axis=0)
        square = np.cross(ends[1] - ends[0], ends[2] - ends[0])
        # Three equal arms at right angles: their ends lie R = sqrt(2/3) arm from their middle, the corner R / sqrt(2).
        reach = float(np.mean(np.linalg.norm(ends - middle, axis=1))) / np.sqrt(2.0)
        body = np.mean(list(points.values()), axis=0)
        step = reach * square / np.linalg.norm(square)
        # The corner lies on the side of the body.
        found[marker.label] = middle + (step if step @ (body - middle) > 0 else -step)
    return found


def _refuse_missing(landmarks: Mapping[str, Array], marker_set: MarkerSet, where: str) -> None:
    absent = [name for name in _NEEDED if name not in landmarks]
    if absent:
        labels = [
            " or ".join("+".join(labels) for labels in marker_set.landmarks.get(name, ())) or "none in this set"
            for name in absent
        ]
        listed = ", ".join(f"{name.replace('_', ' ')} ({label})" for name, label in zip(absent, labels, strict=True))
        raise TrialRefused(
            f"{where}: no frame shows these landmarks of the set {marker_set.title}: {listed}. "
            "Choose or record a static trial that shows them, or fill the gaps."
        )


_MM = 1e-3


def unit(vector: Array) -> Array:
    """Return vectors (..., 3) with length 1."""
    return np.asarray(vector / np.sqrt(np.vecdot(vector, vector))[..., None])


def pelvis_frame(right_asis: Array, left_asis: Array, mid_psis: Array) -> tuple[Array, Array]:
    """Return lab_R_pelvis (..., 3, 3) (z to the right ASIS, x forwards; ISB) and the middle of the ASIS (..., 3) m."""
    middle = (right_asis + left_asis) / 2
    z = unit(right_asis - left_asis)
    y = unit(np.cross(z, middle - mid_psis))
    # y square to z and to the sacral line: up; x = y x z forwards.
    return np.stack([np.cross(y, z), y, z], axis=-1), middle


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
    """Return joint centres (..., 3) m at ``distance`` m from a lateral marker, with a right angle between marker and
    proximal centre.

    It lies in the plane of the proximal centre, the marker and the point ``away_from`` (a wand marker), on the side
    away from that point (Kadaba et al. 1990, doi:10.1002/jor.1100080310; plug-in gait). ``distance`` = (joint width +
    marker diameter) / 2.
    """
    arm = proximal - marker
    reach = np.sqrt(np.vecdot(arm, arm))[..., None]
    along = arm / reach
    side = unit(np.cross(np.cross(along, away_from - marker), along))
    cosine = np.minimum(distance / reach, 1.0)
    # Right angle at the centre: at the marker cos = distance / reach.
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


_MARKER_DIAMETER = 0.014  # m, where the file does not say: the usual marker of plug-in gait
_ASIS_BETWEEN, _LEG_BETWEEN = (-0.024, 0.054), (-0.040, 0.040)
"""m: how much farther apart markers are than a typed measure that is used. The distance of the spines is typed of
bone and marked on skin, which lies outside of it: 15 mm (sd 13) in 15 persons of 6 public laboratories, here with three
standard deviations; of legs 0 mm (sd 15) in 16.
"""
_LETTER = {"right": "R", "left": "L"}


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
    (contradicted, doubt), guessed = _contradicted(given, width, place), list[str]()
    notes = [*filter(None, [doubt]), *contradicted.values()]
    given = {name: value for name, value in given.items() if name not in contradicted}
    if (diameter := given.get("markerdiameter")) is None:
        notes.append(f"Marker diameter is not in the file: {1e3 * _MARKER_DIAMETER:.0f} mm taken.")
    legs = {side: given.get(f"{_LETTER[side]}leglength".lower(), _marker_leg(place, side)) for side in _LETTER}
    widths, offsets = {}, {}
    for side, letter in _LETTER.items():
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
        marker_radius=(diameter or _MARKER_DIAMETER) / 2,
        pelvis_width=width,
        pelvis_depth=float(np.linalg.norm(middle - place["mid_psis"])),
        leg_length=legs,
        asis_to_trochanter={
            s: given.get(f"{_LETTER[s]}asistrocanterdistance".lower(), 0.1288 * legs[s] - 0.04856) for s in _LETTER
        },
        shoulder_offset=offsets,
        widths=widths,
        notes=tuple(notes),
    )


def _marker_leg(place: Mapping[str, Array], side: str) -> float:
    """Return the leg length between markers, m: ASIS to knee to ankle."""
    asis, knee, ankle = (place[f"{side}_{name}"] for name in ("asis", "knee_lateral", "ankle_lateral"))
    return float(np.linalg.norm(asis - knee) + np.linalg.norm(knee - ankle))


def _contradicted(
    given: Mapping[str, float], width: float, place: Mapping[str, Array]
) -> tuple[dict[str, NotUsed], str]:
    """Return the typed lengths of legs that the markers contradict, by their name in ``given``, and what to do; and a
    warning where they contradict the typed width of the pelvis, of which the markers' is used anyway ("" if not).
    """
    # whoever sits has a leg that goes ahead farther than down from the pelvis to the knee
    thigh = {side: place[f"{side}_knee_lateral"] - place[f"{side}_asis"] for side in SIDES}
    seated = {side: bool(np.hypot(*along[:2]) > -along[2]) for side, along in thigh.items()}
    legs = {
        name.lower(): NotUsed(f"Not used: {said}")
        for side, name in ((side, f"{letter}LegLength") for side, letter in _LETTER.items())
        if not seated[side] and (said := _unlike(name, given.get(name.lower()), _marker_leg(place, side), _LEG_BETWEEN))
    }
    said = _unlike("InterAsisDistance", given.get("interasisdistance"), width, _ASIS_BETWEEN)
    return legs, Doubt(said.rstrip("."), mended=True) if said else ""


def _unlike(name: str, typed: float | None, seen: float, between: tuple[float, float]) -> str:
    """Return in words that markers contradict a measure; "" if they do not."""
    if typed is None or between[0] <= seen - typed <= between[1]:
        return ""
    apart = f"the markers are {1e3 * seen:.0f} mm apart"
    return f"{name} was typed as {1e3 * typed:.0f} mm, {apart}: check both, measure again."

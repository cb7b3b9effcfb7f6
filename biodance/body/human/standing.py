"""The standing posture of a static trial: one place per marker, and the landmarks on it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from biodance.errors import TrialRefused
from biodance.lab.markers.set_file import LANDMARKS
from biodance.lab.markers.sets import MarkerSet, canonical, landmark, read_marker_set
from biodance.lab.markers.still import WINDOW, posture_frames
from biodance.records import SIDES, Array, Markers, Trial

NEEDED = (
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
    where = f"Static trial {static.name}"
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
    notes = [f"{where}: posture from frames {first} to {last}, the quietest {WINDOW} s."]
    if not still:
        notes = [f"Warning: {where}: nobody stands still in it; its frame {first} was taken for the posture."]
    notes += [f"{where}: {', '.join(elsewhere)} not seen then, taken from the rest of the trial."] if elsewhere else []
    notes += [f"{where}: {', '.join(missing)} never seen, so not on the body."] if missing else []
    return StaticPosture(marker_set, points, landmarks, tuple(notes), still=still)


def _corners(points: Mapping[str, Array], marker_set: MarkerSet) -> dict[str, Array]:
    """Return the markers that a knee alignment device stood in for, label -> (3,) m: where its three arms meet, square
    to each other and equally long, on the side of the body.
    """
    found = {}
    for marker in marker_set.markers:
        if marker.label in points or not set(marker.corner_of) or not set(marker.corner_of) <= points.keys():
            continue
        ends = np.array([points[label] for label in marker.corner_of])
        middle = ends.mean(axis=0)
        square = np.cross(ends[1] - ends[0], ends[2] - ends[0])
        reach = float(np.mean(np.linalg.norm(ends - middle, axis=1))) / np.sqrt(2.0)
        body = np.mean(list(points.values()), axis=0)
        step = reach * square / np.linalg.norm(square)
        found[marker.label] = middle + (step if step @ (body - middle) > 0 else -step)
    return found


def _refuse_missing(landmarks: Mapping[str, Array], marker_set: MarkerSet, where: str) -> None:
    absent = [name for name in NEEDED if name not in landmarks]
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

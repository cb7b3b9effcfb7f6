"""Groups of markers that keep their shape: those of one segment and of the joint above it. How far a recording is from
the shape of the static trial, frame by frame, under the names it has and under others.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from biodance.lab.markers.sets import MarkerSet
from biodance.records import Array, Index, Markers
from biodance.spatial import rigid_fit

_ABOVE = {"forearm_hand": "elbow", "shank": "knee", "foot": "ankle"}
"""The joint above a segment: markers on its axis keep their distances to those of the segment, too. A shoulder is none:
its marker rides on the collar bone.
"""
_OFTEN = 0.5
"""Share of the frames in which a marker must be seen to belong to a group."""
_SOME = 40
"""Frames of the static trial of which the median shape is taken."""


@dataclass(frozen=True, eq=False)
class RigidGroup:
    """Labels in the file that keep their ``shape`` (K, 3) m, from the static trial."""

    labels: tuple[str, ...]
    shape: Array

    def columns(self, names: Sequence[str], other: Mapping[str, str]) -> list[int]:
        """Return where its labels (K,) stand among ``names``, with the ``other`` names of some."""
        return [names.index(other.get(label, label)) for label in self.labels]

    def least_misfit(self, apart: Array, columns: list[int]) -> Array:
        """Return (n,) m² below which no `misfit` of the markers ``columns`` (K,) lies, by how far all markers are
        ``apart`` (n, M, M) m: two that are d nearer or farther than in the shape miss it by d at least, together, and
        (a + b)² <= 2 a² + 2 b².
        """
        shape = np.linalg.norm(self.shape[:, None] - self.shape, axis=2)
        # Both ends of a distance may share the error: (a + b)² <= 2 (a² + b²), hence a half.
        return np.asarray(0.5 * np.max((apart[:, columns][:, :, columns] - shape) ** 2, axis=(1, 2)))

    def misfit(self, markers: Markers, other: Mapping[str, str], frames: Index) -> Array:
        """Return (n,) m² the sum of squared distances to the shape in some ``frames``, laid on each as well as a rigid
        body can be (Kabsch 1976, doi:10.1107/S0567739476001873: turned and moved, never mirrored), with the ``other``
        names of some labels; NaN where one is not seen.
        """
        points = markers.xyz[frames][:, self.columns(markers.names, other)]
        seen = np.isfinite(points).all(axis=(1, 2))
        here = points[seen] - points[seen].mean(axis=1, keepdims=True)
        product = np.einsum("tki,kj->tij", here, self.shape)
        # Kabsch: the best turn's trace is the sum of the singular values, the last one negative for a mirror image.
        along = np.linalg.svd(product, compute_uv=False)
        along[:, 2] *= np.where(np.linalg.det(product) < 0, -1.0, 1.0)
        found = np.full(len(points), np.nan)
        # |x|² + |y|² - 2 tr: squares left after the best turn, without forming it.
        found[seen] = np.maximum((here**2).sum(axis=(1, 2)) + (self.shape**2).sum() - 2 * along.sum(axis=1), 0.0)
        return found


def rigid_groups(markers: Markers, reference: Markers, marker_set: MarkerSet) -> tuple[RigidGroup, ...]:
    """Return the groups of at least two markers that are seen in half of the frames of a recording and of its
    ``reference``, with the median shape of the latter.
    """
    match = marker_set.match(markers.names)
    often = {label for label in match.values() if _often_seen(markers, label) and _often_seen(reference, label)}
    found = []
    for wanted in _members(marker_set):
        labels = tuple(match[label] for label in wanted if match.get(label) in often)
        shape = _median_shape(reference.select(labels).xyz) if len(labels) > 1 else None
        if shape is not None:
            found.append(RigidGroup(labels, shape))
    return tuple(found)


def _members(marker_set: MarkerSet) -> Iterator[tuple[str, ...]]:
    """Yield the labels of each rigid group: a limb's segment with the joint above it, hand, pelvis, head."""
    on: dict[str, list[str]] = {}
    for marker in marker_set.markers:
        on.setdefault(marker.segment, []).append(marker.label)
    yield tuple(on.get("pelvis", ()))
    yield marking(marker_set, ("head_front", "head_back"))
    for segment, labels in on.items():
        side, _, part = segment.partition("_")
        if side not in ("left", "right"):
            continue
        joint = _ABOVE.get(part, "")
        above = marking(marker_set, (f"{side}_{joint}_lateral", f"{side}_{joint}_medial")) if joint else ()
        hand, wrist = (
            marking(marker_set, [f"{side}_{place}" for place in places])
            for places in (("hand",), ("wrist_radial", "wrist_ulnar"))
        )
        yield tuple(dict.fromkeys((*above, *(label for label in labels if label not in hand))))
        yield (*hand, *wrist) if part == "forearm_hand" and hand else ()


def marking(marker_set: MarkerSet, places: Iterable[str]) -> tuple[str, ...]:
    """Return the labels that mark some landmarks of a set."""
    return tuple(
        dict.fromkeys(label for place in places for way in marker_set.landmarks.get(place, ()) for label in way)
    )


def _often_seen(markers: Markers, label: str) -> bool:
    return label in markers and bool(markers.seen[:, markers.names.index(label)].mean() > _OFTEN)


def _median_shape(points: Array) -> Array | None:
    """Return the median (K, 3) m of ``points`` (T, K, 3), all frames laid on one; None if never seen together."""
    points = points[np.isfinite(points).all(axis=(1, 2))]
    if not len(points):
        return None
    points = points[np.unique(np.linspace(0, len(points) - 1, _SOME).astype(int))]
    # All frames laid on one in the middle, so that medians are of one posture.
    turn, place = rigid_fit(points, np.broadcast_to(points[len(points) // 2], points.shape))
    shape = np.median(np.einsum("tij,tkj->tki", turn, points) + place[:, None], axis=0)
    return np.asarray(shape - shape.mean(axis=0))

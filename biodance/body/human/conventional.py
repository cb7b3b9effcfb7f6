"""The conventional gait model of the legs, as plug-in gait has it: the angles that clinics compare, from the same
markers, frame by frame and without a body that follows them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from biodance.body.human.measures import Measures, chord, unit
from biodance.body.human.scaling import measure_static
from biodance.body.human.static_centres import frame_yz, hip_centres
from biodance.errors import TrialRefused
from biodance.lab.markers.sets import canonical, landmark, read_marker_set
from biodance.lab.markers.upright import OUTWARDS
from biodance.records import SIDES, Array, Subject, Trial
from biodance.spatial import elementary_rotation, zxy_angles

_PELVIS = ("right_asis", "left_asis", "mid_psis")
_LEG = ("thigh_wand", "knee_lateral", "shank_wand", "ankle_lateral", "toe")
_Marks = Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class _Leg:
    """What the static trial says of a leg: by how much the wands of ``thigh`` and ``shank`` are turned about the bone
    from the axes of knee and ankle, rad; ``torsion`` rad from the ankle's axis to the knee's; ``foot`` (3, 3) from the
    axes that ankle and toe marker span to those along the sole.
    """

    thigh: float
    shank: float
    torsion: float
    foot: Array


@dataclass(frozen=True, eq=False)
class ConventionalModel:
    """The conventional gait model of one person: ``sizes``, and both ``legs`` by side; ``mark`` landmark -> (T, 3) m of
    a trial (`of`).

    References
    ----------
    Kadaba et al. 1990, doi:10.1002/jor.1100080310; Davis et al. 1991, doi:10.1016/0167-9457(91)90046-Z.
    """

    sizes: Measures
    legs: Mapping[str, _Leg]
    mark: _Marks = field(default_factory=dict)

    def angles(self, side: str, ahead: Array, part: slice = slice(None)) -> dict[str, Array]:
        """Return the angles (T,) deg of a leg and of the pelvis by our names, NaN where a marker is not seen.

        ``ahead`` (2,) the axis of the laboratory along which the person walks; ``part`` of the trial's frames. Pelvis
        and foot against the laboratory are told in the order tilt, obliquity, rotation, as plug-in gait does (Baker
        2001 and `cycles.curves.lab_curves` turn it round).
        """
        pelvis, thigh, shank, ankle, foot = self._segments(
            {name: track[part] for name, track in self.mark.items()}, side
        )
        foot, sign, (x, y) = foot @ self.legs[side].foot, OUTWARDS[side], ahead
        lab = np.array([[x, y, 0.0], [0.0, 0.0, 1.0], [y, -x, 0.0]])
        tilt, over, turn = zxy_angles(lab @ pelvis)
        flexion, adduction, rotation = zxy_angles(np.swapaxes(pelvis, -1, -2) @ thigh)
        found = {
            "pelvis_tilt": -tilt,
            "pelvis_obliquity": -sign * over,
            "pelvis_rotation": sign * turn,
            "hip_flexion": flexion,
            "hip_adduction": sign * adduction,
            "hip_rotation": sign * rotation,
            "knee_flexion": -zxy_angles(np.swapaxes(thigh, -1, -2) @ shank)[0],
            "ankle_dorsiflexion": zxy_angles(np.swapaxes(ankle, -1, -2) @ foot)[0],
            "foot_progression": sign * zxy_angles(lab @ foot)[2],
        }
        return {name: np.degrees(angle) for name, angle in found.items()}

    def of(self, trial: Trial) -> "ConventionalModel | None":
        """Return the model with the markers of a ``trial``; None where one that it needs is missing."""
        if trial.markers is None or not trial.marker_set:
            return None
        marker_set = read_marker_set(trial.marker_set)
        markers = canonical(trial.markers, marker_set)
        names = (*_PELVIS, *(name for side in SIDES for name in _of_leg(side)))
        found = {name: track for name in names if (track := landmark(markers, marker_set, name)) is not None}
        return replace(self, mark=found) if len(found) == len(names) else None

    def _segments(self, mark: _Marks, side: str) -> tuple[Array, ...]:
        """Return lab_R (T, 3, 3) of pelvis, thigh, shank with the knee's axis, shank with the ankle's, and foot as its
        ankle and toe marker span it.
        """
        pelvis, hips = hip_centres(mark, self.sizes, hip="davis")
        wand, knee_at, other, ankle_at, toe = (mark[f"{side}_{name}"] for name in _LEG)
        hip, leg, radius = hips[side], self.legs[side], self.sizes.marker_radius
        knee = _turned_chord(hip, knee_at, self.sizes.widths[f"{side}_knee"] / 2 + radius, wand, leg.thigh)
        ankle = _turned_chord(knee, ankle_at, self.sizes.widths[f"{side}_ankle"] / 2 + radius, other, leg.shank)
        thigh = frame_yz(hip - knee, OUTWARDS[side] * (knee_at - knee))
        shank = frame_yz(knee - ankle, OUTWARDS[side] * (ankle_at - ankle))
        return pelvis, thigh, shank @ elementary_rotation("y", leg.torsion), shank, _along(toe - ankle, shank)


def _along(forward: Array, shank: Array) -> Array:
    """Return (..., 3, 3) with x ``forward`` along a foot and z as near to that of its ``shank`` as it can be."""
    x = unit(forward)
    y = unit(np.cross(shank[..., 2], x))
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _turned_chord(proximal: Array, marker: Array, distance: float, wand: Array, turn: float) -> Array:
    """Return joint centres (..., 3) m as `chord`, with the wand first turned by ``turn`` rad about the bone."""
    centre = chord(proximal, marker, distance, wand)
    # The turned wand and the centre that it gives settle: each round leaves a tenth of the error at most.
    for _ in range(8 if turn else 0):
        bone, arm = unit(proximal - centre), wand - centre
        # Rodrigues: the part of the arm along the bone stays.
        along = np.vecdot(bone, arm)[..., None] * bone
        turned = along + np.cos(turn) * (arm - along) + np.sin(turn) * np.cross(bone, arm)
        centre = chord(proximal, marker, distance, centre + turned)
    return centre


def _turn_of_wand(proximal: Array, centre: Array, marker: Array, wand: Array) -> float:
    """Return the angle, rad, about the bone from a ``wand`` to the joint's axis, which ends at the lateral marker."""
    bone = unit(proximal - centre)
    # The signed angle about the bone, between what of both is square to it.
    arm, axis = np.cross(bone, wand - centre), np.cross(bone, marker - centre)
    return float(np.arctan2(np.cross(arm, axis) @ bone, arm @ axis))


def conventional_model(subject: Subject, static: Trial) -> ConventionalModel:
    """Return the model of a subject from its static trial.

    The knee's axis is that of a knee alignment device or of a medial marker, else the thigh's wand tells it, wherever
    it sits; only with the former a medial malleolus tells the ankle's. Medial markers show where an axis points, the
    typed widths how far in a centre lies. The feet stand flat. The distance of the spines is the typed one, if any.

    Raises
    ------
    TrialRefused
        As `measure_static`; or a wand is missing.
    """
    scaled = measure_static(subject, static)
    mark, sizes = scaled.posture.landmarks, scaled.sizes
    typed = {name.lower(): value for name, value in {**subject.measurements, **static.measurements}.items()}
    sizes = replace(sizes, pelvis_width=typed.get("interasisdistance", sizes.pelvis_width))
    missing = [name for side in SIDES for name in _of_leg(side) if name not in mark]
    if missing:
        raise TrialRefused(f"Static trial {static.name}: the conventional gait model needs {', '.join(missing)}.")
    hips = hip_centres(mark, sizes, hip="davis")[1]
    return ConventionalModel(sizes, {side: _calibrated(mark, sizes, hips[side], side) for side in SIDES})


def _calibrated(mark: _Marks, sizes: Measures, hip: Array, side: str) -> _Leg:
    """Return what the static trial says of a leg whose ``hip`` centre (3,) m is known."""
    wand, lateral, shank_wand, ankle_lateral, toe = (mark[f"{side}_{name}"] for name in _LEG)
    outside, marked = wand, False
    if f"{side}_knee_axis" in mark:
        outside, marked = mark[f"{side}_knee_axis"], True
    elif f"{side}_knee_medial" in mark:
        outside, marked = 2 * lateral - mark[f"{side}_knee_medial"], True
    malleoli = marked and f"{side}_ankle_medial" in mark
    outside_ankle = 2 * ankle_lateral - mark[f"{side}_ankle_medial"] if malleoli else shank_wand
    knee = chord(hip, lateral, sizes.widths[f"{side}_knee"] / 2 + sizes.marker_radius, outside)
    ankle = chord(knee, ankle_lateral, sizes.widths[f"{side}_ankle"] / 2 + sizes.marker_radius, outside_ankle)
    shank = frame_yz(knee - ankle, OUTWARDS[side] * (ankle_lateral - ankle))
    # The knee's axis in the shank's frame, turned about its y: (sin, 0, cos).
    axis = shank.T @ frame_yz(knee - ankle, OUTWARDS[side] * (lateral - knee))[:, 2]
    sole = (toe - mark[f"{side}_heel"]) * [1.0, 1.0, 0.0]
    return _Leg(
        _turn_of_wand(hip, knee, lateral, wand) if marked else 0.0,
        _turn_of_wand(knee, ankle, ankle_lateral, shank_wand) if malleoli else 0.0,
        float(np.arctan2(axis[0], axis[2])) if malleoli else 0.0,
        _along(toe - ankle, shank).T @ _along(sole, shank),
    )


def _of_leg(side: str) -> tuple[str, ...]:
    return tuple(f"{side}_{name}" for name in _LEG)

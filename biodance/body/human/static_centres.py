"""Joint centres and segment frames of a standing person: the answer of the static trial alone."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from biodance.body.human import measures
from biodance.body.parts import JointError
from biodance.body.tables.error_sizes import error_size, joint_size
from biodance.lab.markers.upright import OUTWARDS
from biodance.records import Array
from biodance.records.attention import Doubt
from biodance.settings import Hip
from biodance.spatial import elementary_rotation

UP = np.array([0.0, 0.0, 1.0])
_AXIS_TOLERANCE = 30.0
"""deg: a thigh marker that turns the knee's axis further, seen from above, is not believed."""
LIMB_ENDS = {
    "thigh": ("hip", "knee"),
    "shank": ("knee", "ankle"),
    "upper_arm": ("shoulder", "elbow"),
    "forearm_hand": ("elbow", "wrist"),
}
"""The joints at both ends of the limbs that people have as long on the right as on the left."""
_Places = Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Centres:
    """Where the joints of a standing person are, lab frame.

    ``place`` joint -> (3,) m: hips, knees, ankles, trunk, shoulders, elbows, and the wrists, where the forearms end.
    ``right`` of knees and elbows -> (3,) m, along the flexion axis to the person's right; ``axis_sd`` -> rad, how far
    that axis may be turned about the bone; ``lateral`` -> (3,) m, the lateral marker. ``pelvis`` (3, 3) lab_R_pelvis;
    ``across`` side -> (3,) m, horizontal, to the right of the foot; ``sole`` side -> (3,), upwards, square to the
    sole, the vertical without it; ``cut``: at which fraction of the way from mid hip to mid shoulder the table cuts
    pelvis from trunk; ``notes`` what was assumed; ``errors`` of the joints that a movement placed; ``contradicted``
    the joints whose place here the movement contradicts, ``unshown`` those that a movement was asked for and does not
    show. ``mid_hip`` (3,) m, where pelvis and trunk are taken to begin, None for the middle of the hip centres: one hip
    alone that lies elsewhere does not move the matter of the pelvis.
    """

    place: _Places
    right: _Places
    axis_sd: Mapping[str, float]
    lateral: _Places
    pelvis: Array
    across: _Places
    cut: float
    notes: tuple[str, ...]
    errors: tuple[JointError, ...] = ()
    contradicted: tuple[str, ...] = ()
    unshown: tuple[str, ...] = ()
    mid_hip: Array | None = None
    sole: _Places = field(default_factory=dict)

    def sd(self, joint: str) -> float:
        """Return the standard deviation (m per axis) of a joint's centre, after a movement has placed it or before."""
        return next((one.centre for one in self.errors if one.joint == joint), static_sd(joint))

    def sides_sd(self, limb: str) -> float:
        """Return the sd (m) of how much longer a ``limb`` is on the right: of people, and of joint centres."""
        ends = (self.sd(f"{side}_{joint}") for side in OUTWARDS for joint in LIMB_ENDS[limb])
        # Differences of lengths: people, and the four ends' centres, independent.
        return float(np.linalg.norm([error_size("side_length", "limb"), *ends]))


def static_sd(joint: str) -> float:
    """Return the standard deviation (m per axis) of a ``joint``'s centre as the static trial places it; of a hinge
    about the place that its lateral marker and its axis give it.
    """
    hinge = joint.endswith(("knee", "elbow"))
    return error_size("hinge_centre", "hinge", state="before") if hinge else joint_size("joint_centre", joint)


def static_centres(mark: _Places, sizes: measures.Measures, *, hip: Hip, trunk_fraction: float, flat: bool) -> Centres:
    """Return the joint centres from the landmarks ``mark`` name -> (3,) m.

    Hip: regressions. Knee, ankle, elbow: middle of lateral and medial marker, or the constructions of plug-in gait.
    Trunk: on the line from mid hip to mid shoulder, at ``trunk_fraction`` of it, where the table cuts the trunk.
    ``flat``: the feet stand flat; otherwise each lies as its heel and toe markers do.
    """
    pelvis, hips = hip_centres(mark, sizes, hip=hip)
    middle = (hips["right"] + hips["left"]) / 2
    shoulders = _shoulder_centres(mark, sizes, middle)
    place = {"trunk": middle + trunk_fraction * ((shoulders["right"] + shoulders["left"]) / 2 - middle)}
    right, axis_sd, lateral, across, sole = {}, {}, {}, {}, {}
    notes: list[str] = []
    for side, sign in OUTWARDS.items():
        knee, note = knee_centre(mark, sizes, hips[side], pelvis[:, 2], side)
        notes += [note] if note else []
        place |= {
            f"{side}_hip": hips[side],
            f"{side}_knee": knee,
            f"{side}_ankle": _ankle_centre(mark, sizes, knee, side),
        }
        place[f"{side}_shoulder"] = shoulders[side]
        place[f"{side}_elbow"], place[f"{side}_wrist"] = arm_centres(mark, sizes, shoulders[side], side)
        for joint, otherwise in (("knee", "line of march" if note else "thigh marker"), ("elbow", "straight arm")):
            name = f"{side}_{joint}"
            lateral[name] = mark[f"{name}_lateral"]
            right[name] = sign * (lateral[name] - place[name])
            way = "medial marker" if f"{name}_medial" in mark else otherwise
            axis_sd[name] = error_size("axis_turn", f"{joint} {way}", state="before")
        along = mark[f"{side}_toe"] - mark[f"{side}_heel"]
        across[side] = np.cross(along, UP)
        sole[side] = UP if flat else np.cross(across[side], along)
    return Centres(place, right, axis_sd, lateral, pelvis, across, trunk_fraction, tuple(notes), sole=sole)


def hip_centres(place: _Places, sizes: measures.Measures, *, hip: Hip) -> tuple[Array, dict[str, Array]]:
    """Return lab_R_pelvis (..., 3, 3) and the hip centres by side, (..., 3) m, from landmarks (..., 3) m."""
    rotation, middle = measures.pelvis_frame(place["right_asis"], place["left_asis"], place["mid_psis"])
    legs = float(np.mean(list(sizes.leg_length.values())))
    centres = {}
    for side, sign in OUTWARDS.items():
        local = (
            measures.harrington_hip(sizes.pelvis_width, sizes.pelvis_depth)
            if hip == "harrington"
            else measures.davis_hip(sizes.pelvis_width, legs, sizes.asis_to_trochanter[side], sizes.marker_radius)
        )
        centres[side] = middle + rotation @ (local * [1.0, 1.0, sign])
    return rotation, centres


def _shoulder_centres(place: _Places, sizes: measures.Measures, mid_hip: Array) -> dict[str, Array]:
    """Return the shoulder centres by side, m: chord from the jugular notch, or straight under the acromion."""
    right, left = place["right_acromion"], place["left_acromion"]
    if all(name in place for name in ("c7", "t10", "jugular_notch", "xiphoid")):
        up = (place["c7"] + place["jugular_notch"]) - (place["t10"] + place["xiphoid"])
        ahead = (place["jugular_notch"] + place["xiphoid"]) - (place["c7"] + place["t10"])
        # Part of ahead across up.
        forward = measures.unit(np.cross(np.cross(up, ahead), up))
    else:
        up = (right + left) / 2 - mid_hip
        forward = measures.unit(np.cross(up, right - left))
    offset = {side: sizes.shoulder_offset[side] + sizes.marker_radius for side in OUTWARDS}
    if "jugular_notch" not in place:
        return {side: place[f"{side}_acromion"] - offset[side] * measures.unit(up) for side in OUTWARDS}
    base = place["jugular_notch"] - sizes.marker_radius * forward
    return {
        side: measures.shoulder(base, forward, place[f"{side}_acromion"], offset[side], side=OUTWARDS[side])
        for side in OUTWARDS
    }


def knee_centre(
    place: _Places, sizes: measures.Measures, hip: Array, pelvis_right: Array, side: str
) -> tuple[Array, str]:
    """Return the knee centre, m, and what had to be assumed: the middle of the epicondyles, or a chord with the thigh
    marker.

    A thigh marker that would turn the knee's axis further than ``_AXIS_TOLERANCE`` from square to the line of march
    (mean of pelvis and foot) was not placed for plug-in gait: the axis is then taken square to that line.
    """
    lateral = place[f"{side}_knee_lateral"]
    if f"{side}_knee_medial" in place:
        return (lateral + place[f"{side}_knee_medial"]) / 2, ""
    distance = sizes.widths[f"{side}_knee"] / 2 + sizes.marker_radius
    foot_right = measures.unit(np.cross(place[f"{side}_toe"] - place[f"{side}_heel"], UP))
    across = measures.unit(pelvis_right + foot_right)
    if f"{side}_knee_axis" in place:
        return measures.chord(hip, lateral, distance, place[f"{side}_knee_axis"]), ""
    usual = measures.chord(hip, lateral, distance, lateral + 0.1 * OUTWARDS[side] * across)
    if f"{side}_thigh_wand" not in place:
        return usual, f"{side.capitalize()} knee: no medial or thigh marker, axis taken square to the line of march."
    centre = measures.chord(hip, lateral, distance, place[f"{side}_thigh_wand"])
    axis = OUTWARDS[side] * (lateral - centre)
    # Signed angle about the vertical between the horizontal parts of both axes.
    angle = float(np.degrees(np.arctan2(UP @ np.cross(across, axis), across @ axis - (across @ UP) * (axis @ UP))))
    if abs(angle) <= _AXIS_TOLERANCE:
        return centre, ""
    return usual, Doubt(
        f"the {side} thigh marker would turn the knee's axis {abs(angle):.0f} deg from square to the line of march, so "
        "the axis is taken as square",
        "Place the marker in the frontal plane of the thigh, or add a medial knee marker.",
        mended=True,
    )


def _ankle_centre(place: _Places, sizes: measures.Measures, knee: Array, side: str) -> Array:
    """Return the ankle centre, m: middle of the malleoli, or chord with the shank marker, or with the knee's axis."""
    lateral = place[f"{side}_ankle_lateral"]
    if f"{side}_ankle_medial" in place:
        return np.asarray((lateral + place[f"{side}_ankle_medial"]) / 2)
    outside = place.get(f"{side}_shank_wand", lateral + place[f"{side}_knee_lateral"] - knee)
    return measures.chord(knee, lateral, sizes.widths[f"{side}_ankle"] / 2 + sizes.marker_radius, outside)


def arm_centres(place: _Places, sizes: measures.Measures, shoulder_at: Array, side: str) -> tuple[Array, Array]:
    """Return elbow and wrist centre, m: the elbow in the middle of its epicondyle markers, or by the plug-in-gait
    construction.

    The wrist is the middle of its two markers, unless they are so much farther apart than the wrist is wide that they
    sit on a bar behind it; then the plug-in-gait construction. (Mean plug-in-gait static of 9 adults: with a bar, the
    finger marker would be 5 cm behind the hand; with markers on the styloids, 2 cm, as thick as a hand is.)
    """
    lateral, radial, ulnar = (place[f"{side}_{name}"] for name in ("elbow_lateral", "wrist_radial", "wrist_ulnar"))
    middle = (radial + ulnar) / 2
    if f"{side}_elbow_medial" in place:
        return (lateral + place[f"{side}_elbow_medial"]) / 2, middle
    at = measures.elbow(
        shoulder_at, lateral, middle, sizes.widths[f"{side}_elbow"] / 2 + sizes.marker_radius, side=OUTWARDS[side]
    )
    reach = sizes.widths[f"{side}_wrist"] / 2 + sizes.marker_radius
    if np.linalg.norm(radial - ulnar) < 2 * reach + 0.03:
        return at, middle
    return at, measures.wrist(at, radial, ulnar, reach, side=OUTWARDS[side])


@dataclass(frozen=True, eq=False)
class SegmentFrames:
    """Segment frames in the lab: ``rotation`` segment -> (3, 3) lab_R_segment, ``origin`` segment -> (3,) m (the
    proximal joint centre); ``ends`` side_wrist -> (3,) m; ``cut`` (3,) m where the table cuts pelvis from trunk.
    """

    rotation: _Places
    origin: _Places
    ends: _Places
    cut: Array


def segment_frames(centres: Centres) -> SegmentFrames:
    """Return the 12 segment frames.

    Pelvis: ISB axes, origin in the middle of the hip centres (``centres.mid_hip`` where given). trunk_head: y along the
    line from mid hip to mid shoulder. Thigh, upper arm: y to the proximal joint, z in the plane of the flexion axis.
    Shank, forearm: y to the proximal joint, flexed about the parent's z and tilted by a constant varus. Foot: flat on
    the ground, x from heel to toe.
    """
    at = centres.place
    hips, shoulders = ((at[f"right_{joint}"] + at[f"left_{joint}"]) / 2 for joint in ("hip", "shoulder"))
    hips = hips if centres.mid_hip is None else centres.mid_hip
    axis = shoulders - hips
    rotation = {"pelvis": centres.pelvis, "trunk_head": frame_yz(axis, at["right_shoulder"] - at["left_shoulder"])}
    origin = {"pelvis": hips, "trunk_head": at["trunk"]}
    for side in OUTWARDS:
        for names, joints in (
            (("thigh", "shank"), ("hip", "knee", "ankle")),
            (("upper_arm", "forearm_hand"), ("shoulder", "elbow", "wrist")),
        ):
            upper, lower = (f"{side}_{name}" for name in names)
            top, middle, end = (at[f"{side}_{joint}"] for joint in joints)
            origin[upper], origin[lower] = top, middle
            # The second segment flexes about z of the first, tilted about its own x (varus).
            rotation[upper] = frame_yz(top - middle, centres.right[f"{side}_{joints[1]}"])
            direction = rotation[upper].T @ measures.unit(middle - end)
            # y of the lower segment: Rz(f) Rx(v) e_y = (-sin f cos v, cos f cos v, sin v).
            flexion, varus = np.arctan2(-direction[0], direction[1]), np.arcsin(direction[2])
            rotation[lower] = rotation[upper] @ elementary_rotation("z", flexion) @ elementary_rotation("x", varus)
        origin[f"{side}_foot"] = at[f"{side}_ankle"]
        rotation[f"{side}_foot"] = frame_yz(centres.sole.get(side, UP), centres.across[side])
    ends = {f"{side}_wrist": at[f"{side}_wrist"] for side in OUTWARDS}
    return SegmentFrames(rotation, origin, ends, hips + centres.cut * axis)


def frame_yz(up: Array, right: Array) -> Array:
    """Return (..., 3, 3) with y along ``up``, z as near to ``right`` as it can be, x forwards."""
    y = measures.unit(up)
    x = measures.unit(np.cross(y, right))
    return np.stack([x, y, np.cross(x, y)], axis=-1)

"""Segment masses, centres and inertias of a scanned body: its closed surface cut at the joints of the scaled skeleton,
volume times density.

Hips, knees, ankles, shoulders and elbows lie where the skeleton's lengths put them in the standing person: legs from
the soles up, arms from the shoulder towards the finger tips. Planes: across the limb at knee and elbow, level at ankle,
hip and at the tables' cut between pelvis and trunk, the median plane between the legs, and at the shoulder the
plane that cuts the least flesh: through its centre or up to a hand's breadth inside, between arm and trunk.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from biodance.body.human.scan import Scan, clip_surface, cut_section
from biodance.body.human.skeleton import SEGMENTS, Skeleton, kind_of, side_of, upright_to
from biodance.body.inertia import RigidInertia, combine_inertias, turn_inertia
from biodance.body.tables.anthropometry import read_table
from biodance.errors import SessionRefused
from biodance.records import SIDES, Array

_UP = np.array([0.0, 1.0, 0.0])
_NECK = 0.16
"""Of the stature: from the vertex down to the middle of the neck, where the density changes."""
_APART = np.radians(8.0)
"""Least angle between a straight arm and the vertical."""
_TILTS, _STEEPEST = 8, np.radians(35.0)
"""Planes tried at a shoulder, up to this angle from the vertical."""
_INSIDE, _PLACES = 0.04, 5
"""Of the stature: how far inside the shoulder centre a plane may lie; how many places are tried."""
_SHOULDER = 0.013
"""Of the stature squared: a larger section through a shoulder cuts the trunk as well."""
_THICK = 0.05
"""Of the stature: flesh farther from the arm's axis towards the body is no arm: a broad hip."""
_REACH = 0.15
"""Share by which shoulder to finger tips may differ from the skeleton's arm."""
_HAND = 0.108
"""Of the stature: wrist to finger tips (Winter 2009)."""


@dataclass(frozen=True, eq=False)
class ScannedBody:
    """The segments of a scan: ``lumps``, each in its segment frame, and ``cuts`` by joint: kg that a metre of the
    cut along the limb takes from the segment behind it and gives to the one before;
    ``surfaces`` by segment: kg that a surface a metre farther out would add.
    """

    lumps: Mapping[str, RigidInertia]
    cuts: Mapping[str, float]
    surfaces: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class _Cut:
    """A joint in the scan: ``place`` (3,) m, ``normal`` (3,) of its plane towards the proximal side, ``area`` m²."""

    place: Array
    normal: Array
    area: float


def cut_scan(scan: Scan, skeleton: Skeleton) -> ScannedBody:
    """Return masses, CoM and inertias of the segments of a scanned person.

    Raises
    ------
    SessionRefused
        An arm hangs against the trunk or is bent, so that it cannot be told from it.
    """
    rest = scan.triangles
    lumps: dict[str, RigidInertia] = {}
    cuts: dict[str, float] = {}
    hips = {side: _hip(scan, skeleton, side) for side in SIDES}
    middle = np.mean([hip for _, hip in hips.values()], axis=0) * [1, 1, 0]
    for side in SIDES:
        arm, rest, shoulder, elbow = _arm(scan, rest, skeleton, side, middle)
        upper, fore = (clip_surface(arm, elbow.place, sign * elbow.normal) for sign in (1, -1))
        lumps[f"{side}_upper_arm"] = _lump(upper, "upper_arm", shoulder.place, elbow.normal)
        lumps[f"{side}_forearm_hand"] = _lump(fore, "forearm_hand", elbow.place, elbow.normal)
        cuts |= {f"{side}_shoulder": _slope(shoulder, "upper_arm"), f"{side}_elbow": _slope(elbow, "upper_arm")}
    low, high = (clip_surface(rest, middle, sign * _UP) for sign in (-1, 1))
    for side, (ankle, hip) in hips.items():
        leg = clip_surface(low, np.zeros(3), np.array([0.0, 0.0, 1.0 if side == "right" else -1.0]))
        cuts[f"{side}_hip"] = _density("thigh") * cut_section(leg, middle - 1e-3 * _UP, _UP).area
        lumps |= _leg(leg, skeleton, side, ankle, hip, cuts)
    lumps |= _trunk(high, scan, skeleton, middle, cuts)
    lengths = {**skeleton.lengths, "trunk_head": scan.height - middle[1] - skeleton.lengths["pelvis"]}
    return ScannedBody(lumps, cuts, {name: _surface(lumps[name], name, lengths[name]) for name in SEGMENTS})


def _surface(lump: RigidInertia, segment: str, length: float) -> float:
    """Return kg/m that a cylinder of this mass gains with its radius."""
    part = {"pelvis": "lower_trunk", "trunk_head": "upper_trunk"}.get(segment, kind_of(segment))
    return 2.0 * float(np.sqrt(np.pi * lump.mass * _density(part) * length))


def _hip(scan: Scan, skeleton: Skeleton, side: str) -> tuple[Array, Array]:
    """Return ankle and hip centre (3,) m of one leg, straight, over the place where the ankle stands."""
    sign = side_of(f"{side}_thigh")
    leg = clip_surface(scan.triangles, np.zeros(3), np.array([0.0, 0.0, sign]))
    up = skeleton.ankle_height[side]
    section = cut_section(leg, np.array([0.0, up, 0.0]), _UP)
    if section.area <= 0:
        raise SessionRefused(
            f"[subject] scan: no flesh is found at the {side} ankle's height. Scan the whole person, upright, both "
            "feet flat on the floor."
        )
    ankle = section.middle
    length = skeleton.lengths[f"{side}_thigh"] + skeleton.lengths[f"{side}_shank"]
    across = abs(skeleton.origins[f"{side}_hip"][2])
    rise = np.sqrt(max(length**2 - (abs(ankle[2]) - across) ** 2, 0.5 * length**2))
    ahead = cut_section(scan.triangles, np.array([0.0, up + rise, 0.0]), _UP).middle[0]
    return ankle, np.array([ahead, up + rise, sign * across])


def _leg(
    leg: Array, skeleton: Skeleton, side: str, ankle: Array, hip: Array, cuts: dict[str, float]
) -> dict[str, RigidInertia]:
    along = (hip - ankle) / np.linalg.norm(hip - ankle)
    knee = _joint(leg, ankle + skeleton.lengths[f"{side}_shank"] * along, along)
    low = _joint(leg, ankle, _UP)
    thigh, below = (clip_surface(leg, knee.place, sign * along) for sign in (1, -1))
    shank, foot = (clip_surface(below, ankle, sign * _UP) for sign in (1, -1))
    cuts |= {f"{side}_knee": _slope(knee, "thigh"), f"{side}_ankle": _slope(low, "shank")}
    return {
        f"{side}_thigh": _lump(thigh, "thigh", hip, hip - knee.place),
        f"{side}_shank": _lump(shank, "shank", knee.place, knee.place - ankle),
        f"{side}_foot": _toes_ahead(_lump(foot, "foot", ankle, _UP)),
    }


def _joint(part: Array, place: Array, normal: Array) -> _Cut:
    """Return the joint in the middle of the section through ``place`` (3,) m."""
    section = cut_section(part, place, normal)
    return _Cut(section.middle, normal, section.area)


def _toes_ahead(foot: RigidInertia) -> RigidInertia:
    """Return the foot turned about the vertical so that its long axis points ahead."""
    spread = np.linalg.eigh(foot.inertia[np.ix_([0, 2], [0, 2])])[1][:, 0]
    c, s = spread * np.sign(spread[0] or 1.0)
    return turn_inertia(foot, np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]))


def _arm(scan: Scan, rest: Array, skeleton: Skeleton, side: str, middle: Array) -> tuple[Array, Array, _Cut, _Cut]:
    """Return the closed arm, the body without it, and its shoulder and elbow."""
    sign = side_of(f"{side}_thigh")
    up = np.array([0.0, middle[1] + skeleton.lengths["trunk_head"], 0.0])
    centre = cut_section(scan.triangles, up, _UP).middle
    shoulder = np.array([centre[0], up[1], sign * abs(skeleton.origins[f"{side}_shoulder"][2])])
    corners = scan.triangles.reshape(-1, 3)
    tip = corners[np.argmax(sign * corners[:, 2])]
    way = tip - shoulder
    along = way / np.linalg.norm(way)
    angle = float(np.arctan2(sign * along[2], -along[1]))
    _refuse_arm(side, skeleton, float(np.linalg.norm(way)), angle)
    tilts = np.linspace(0.0, min(0.8 * angle, _STEEPEST), _TILTS)
    places = shoulder - sign * np.linspace(0, _INSIDE * skeleton.stature, _PLACES)[:, None] * [0.0, 0.0, 1.0]
    planes = [(place, np.array([0.0, np.sin(tilt), sign * np.cos(tilt)])) for place in places for tilt in tilts]
    above = scan.triangles[scan.triangles[..., 1].max(axis=1) > middle[1]]
    areas = [cut_section(above, *plane).area for plane in planes]
    best = int(np.argmin(areas))
    if areas[best] > _SHOULDER * skeleton.stature**2:
        raise SessionRefused(_touching(side, f"the best cut at its shoulder is {1e4 * areas[best]:.0f} cm²"))
    place, plane = planes[best]
    beyond, body = (clip_surface(rest, place, turn * plane) for turn in (1, -1))
    outwards = np.array([0.0, np.sin(angle), sign * np.cos(angle)])
    beside = shoulder - _THICK * skeleton.stature * outwards
    arm, hip = (clip_surface(beyond, beside, turn * outwards) for turn in (1, -1))
    body = np.concatenate([body, hip])
    elbow = _joint(arm, shoulder + skeleton.lengths[f"{side}_upper_arm"] * along, -along)
    return arm, body, _Cut(shoulder, -plane, max(areas[best], 1e-4)), elbow


def _refuse_arm(side: str, skeleton: Skeleton, reach: float, angle: float) -> None:
    arm = skeleton.lengths[f"{side}_upper_arm"] + skeleton.lengths[f"{side}_forearm_hand"] + _HAND * skeleton.stature
    if angle < _APART:
        raise SessionRefused(_touching(side, f"it hangs {np.degrees(angle):.0f} degrees from the vertical"))
    if abs(reach / arm - 1) > _REACH:
        raise SessionRefused(
            f"[subject] scan: from the {side} shoulder to the farthest point sideways it is {reach:.2f} m, the "
            f"person's arm is {arm:.2f} m long. Scan with straight arms, 30 degrees away from the trunk."
        )


def _touching(side: str, why: str) -> str:
    return (
        f"[subject] scan: the {side} arm cannot be told from the trunk ({why}). Scan with straight arms, 30 degrees "
        "away from the trunk, so that daylight is seen between them."
    )


def _trunk(
    high: Array, scan: Scan, skeleton: Skeleton, middle: Array, cuts: dict[str, float]
) -> dict[str, RigidInertia]:
    """Return pelvis and trunk: cut level where the tables cut, or at the joint where there is no such place."""
    to_cut = skeleton.cut.get("pelvis", skeleton.origins["trunk"])
    cut = _joint(high, middle + skeleton.lengths["pelvis"] * _UP, _UP)
    pelvis, trunk = (clip_surface(high, cut.place, sign * _UP) for sign in (-1, 1))
    cuts["trunk"] = _slope(cut, "lower_trunk")
    neck = np.array([0.0, scan.height - _NECK * skeleton.stature, 0.0])
    joint = middle + np.linalg.norm(skeleton.origins["trunk"]) * _UP
    parts = [
        _lump(clip_surface(trunk, neck, sign * _UP), name, joint, _UP)
        for name, sign in (("upper_trunk", -1), ("head", 1))
    ]
    upright = _lump(pelvis, "lower_trunk", middle, _UP)
    return {"pelvis": turn_inertia(upright, upright_to(to_cut)), "trunk_head": combine_inertias(*parts)}


def _density(part: str) -> float:
    return float(read_table("human", "densities").row(part=part)["density"])


def _slope(cut: _Cut, part: str) -> float:
    return cut.area * _density(part)


def _lump(part: Array, kind: str, origin: Array, up: Array) -> RigidInertia:
    """Return a closed part with its kind's density in the frame at ``origin`` (3,) m whose y axis is ``up`` (3,)."""
    from trimesh.triangles import mass_properties

    y = up / np.linalg.norm(up)
    x = np.cross(y, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    frame = np.stack([x, y, np.cross(x, y)])
    found = mass_properties(part - origin, density=_density(kind)) if len(part) else None
    if found is None or found.volume <= 0:
        raise SessionRefused(
            f"[subject] scan: no flesh is found where the skeleton has its {kind.replace('_', ' ')}. Scan the whole "
            "person, upright, legs straight, arms straight and away from the trunk."
        )
    return turn_inertia(RigidInertia(found.mass, found.center_mass, found.inertia), frame)

"""A scanned standing person: the mesh of a file, checked, turned into the axes of the segments."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from biodance.body.human.skeleton import SEGMENTS, Skeleton, upright_to
from biodance.body.parts import RigidInertia, combine_inertias, turn_inertia
from biodance.body.solids import read_mesh
from biodance.body.tables.anthropometry import read_table
from biodance.errors import FileRefused, SessionRefused
from biodance.lab.markers.sets import part_of
from biodance.lab.markers.upright import OUTWARDS
from biodance.records import SIDES, Array

if TYPE_CHECKING:
    from trimesh import Trimesh


class _Section(NamedTuple):
    """The section of a body with a plane: ``middle`` (3,) m its centroid, ``normal`` (3,) of the plane, ``area`` m²; at
    a joint the normal points towards the proximal side.
    """

    middle: Array
    normal: Array
    area: float


def clip_surface(triangles: Array, point: Array, normal: Array) -> Array:
    """Return the part of a closed surface on the side of a plane to which its normal points, closed in the plane.

    Parameters
    ----------
    triangles : array_like
        (n, 3, 3) m, corners counter-clockwise from outside.
    point, normal : array_like
        (3,) a point of the plane, m, and its normal of length one.

    Returns
    -------
    Array
        (m, 3, 3) m. Pieces that close the cut may overlap with opposite signs: sums over them are exact.
    """
    height = _heights(triangles, point, normal)
    above = height > 0
    count = above.sum(axis=1)
    edges = _crossing_edges(triangles, point, normal)
    # Triangles by corners above the plane: 3 stay whole, 1 leaves a tip, 2 a quadrilateral (two triangles).
    whole, tips, roofs = (triangles[count == n] for n in (3, 1, 2))
    apex, roof = (_first(part, above[count == n] == (n == 1)) for part, n in ((tips, 1), (roofs, 2)))
    one, two = (edges[count[(count == 1) | (count == 2)] == n] for n in (1, 2))
    tip = np.stack([apex[:, 0], one[:, 1], one[:, 0]], axis=1)
    left = np.stack([roof[:, 1], roof[:, 2], two[:, 1]], axis=1)
    right = np.stack([roof[:, 1], two[:, 1], two[:, 0]], axis=1)
    # A fan of triangles from `point` closes the cut: signed areas make any outline right.
    lid = np.stack([np.broadcast_to(point, (len(edges), 3)), edges[:, 0], edges[:, 1]], axis=1)
    return np.concatenate([whole, tip, left, right, lid])


def _crossing_edges(triangles: Array, point: Array, normal: Array) -> Array:
    """Return where a plane cuts triangles: (c, 2, 3) m, one edge a triangle, the lid above."""
    height = _heights(triangles, point, normal)
    count = (height > 0).sum(axis=1)
    crossed = (count == 1) | (count == 2)
    triangles, height, single = triangles[crossed], height[crossed], count[crossed] == 1
    alone = (height > 0) == single[:, None]
    corner, level = _first(triangles, alone), _first(height[..., None], alone)[..., 0]
    # Linear along the edge: zero of the height between its ends.
    share = (level[:, :1] / (level[:, :1] - level[:, 1:]))[..., None]
    ends = corner[:, :1] + share * (corner[:, 1:] - corner[:, :1])
    return np.asarray(np.where(single[:, None, None], ends[:, ::-1], ends))


def cut_section(triangles: Array, point: Array, normal: Array) -> _Section:
    """Return the section of a closed surface (n, 3, 3) m with the plane through ``point`` (3,) m.

    An empty section has area 0 and its middle at ``point``.
    """
    arm = _crossing_edges(triangles, point, normal) - point
    # Twice the signed area of each triangle of the fan, seen along the normal.
    twice = np.cross(arm[:, 0], arm[:, 1]) @ -normal
    area = float(twice.sum()) / 2
    # Centroid of a triangle at a third of its corners' sum (one is the origin): area times / 3, twice / 6.
    first = (twice @ arm.sum(axis=1)) / 6 if len(arm) else np.zeros(3)
    return _Section(point + (first / area if area > 0 else 0.0), normal, area)


def _heights(triangles: Array, point: Array, normal: Array) -> Array:
    """Return the heights (n, 3) m of the corners over a plane (sums: a matrix product rounds by place)."""
    arm = triangles - point
    height = arm[..., 0] * normal[0] + arm[..., 1] * normal[1] + arm[..., 2] * normal[2]
    return np.where(np.abs(height) < 1e-12, 0.0, height)


def _first(values: Array, marked: Array) -> Array:
    """Return the corners of every triangle turned round so that the marked one is the first."""
    index = (np.argmax(marked, axis=1)[:, None] + np.arange(3)) % 3
    return np.take_along_axis(values, index[..., None], axis=1)


_TALL = 0.06  # Share by which a scan may be taller or smaller than the person: shoes, hair, a bent knee
_FOOT, _ANKLE = 0.02, 0.07  # Of the stature: heights through the feet, and over them
_AHEAD = 0.01  # Of the stature: the feet reach ahead of the ankles by at least this much on average


@dataclass(frozen=True, eq=False)
class _Scan:
    """A standing person's surface: ``triangles`` (n, 3, 3) m, closed; x ahead, y up, z to the person's right; the soles
    at y = 0, the middle of the body at z = 0. ``height`` m.
    """

    triangles: Array
    height: float


@functools.lru_cache(maxsize=4)
def read_scan(path: str, stature: float, up: str = "z") -> _Scan:
    """Return the scan of a person who stands upright with the arms away from the trunk.

    Parameters
    ----------
    path : str
        OBJ, STL or PLY, in m.
    stature : float
        Of the person, m.
    up : {"z", "y", "x"}
        Axis of the file that points up.

    Raises
    ------
    SessionRefused
        The file is missing or no mesh; the surface is not closed; it is not in m, lies, has no feet or is of somebody
        else's stature.
    """
    try:
        mesh = read_mesh(Path(path))
    except FileRefused as error:
        raise SessionRefused(f"[subject] scan: {error}") from error
    _refuse_open(path, mesh)
    # Axes of the file in the order ahead or sideways, ahead or sideways, up.
    order = ["xyz".index(axis) for axis in {"z": "xyz", "y": "zxy", "x": "yzx"}[up]]
    corners = np.asarray(mesh.triangles)[:, :, order]
    corners = corners if mesh.volume > 0 else corners[:, ::-1]
    _refuse_height(path, np.ptp(corners.reshape(-1, 3), axis=0), stature, up, order)
    return _turned(path, corners - [0, 0, corners[..., 2].min()], stature)


def _refuse_open(path: str, mesh: "Trimesh") -> None:
    if mesh.is_watertight and mesh.is_winding_consistent:
        return
    edges, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    loose = int(np.sum(count != 2))
    said = f"{loose} of {len(edges)} edges have one triangle only" if loose else "its triangles face in and out"
    raise SessionRefused(
        f"[subject] scan: the surface in {path} is not closed ({said}), so it has no volume. Close the holes in the "
        "scanning program (soles and crown are the usual ones) and export again."
    )


def _refuse_height(path: str, extent: Array, stature: float, up: str, order: list[int]) -> None:
    """Refuse a scan (extents (3,) along horizontal, horizontal and up) that is not as tall as the person."""
    if abs(extent[2] / stature - 1) <= _TALL:
        return
    start = f"[subject] scan: {path} is {extent[2]:.3g} m tall along its axis {up}, the person {stature:.2f} m."
    for unit, size in {"millimetres": 1e-3, "centimetres": 1e-2, "inches": 0.0254}.items():
        if abs(extent[2] * size / stature - 1) <= _TALL:
            raise SessionRefused(f"{start} It looks like {unit}: export it in metres.")
    for k in (0, 1):
        if abs(extent[k] / stature - 1) <= _TALL:
            axis = "xyz"[order[k]]
            raise SessionRefused(
                f"{start} Along {axis} it is {extent[k]:.2f} m: a person who lies, or a file whose axis {axis} points "
                f'up: then write scan_up = "{axis}".'
            )
    raise SessionRefused(
        f"{start} At most {100 * _TALL:.0f} % between them are believed. Is it the same person, upright, with head and "
        "feet, and is height_m right?"
    )


def _turned(path: str, corners: Array, stature: float) -> _Scan:
    """Return the scan in x ahead, y up, z right: sideways is where the body is widest, ahead where the feet point."""
    surface = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flat = corners.mean(axis=1)[:, :2]
    away = flat - surface @ flat / surface.sum()
    # Largest principal axis of the surface seen from above.
    wide = np.linalg.eigh((away * surface[:, None]).T @ away)[1][:, 1]
    deep = np.array([-wide[1], wide[0]])
    z = np.array([0.0, 0.0, 1.0])
    low, high = (cut_section(corners, share * stature * z, z) for share in (_FOOT, _ANKLE))
    ahead = float((low.middle - high.middle)[:2] @ deep)
    if min(low.area, high.area) <= 0 or abs(ahead) < _AHEAD * stature:
        raise SessionRefused(
            f"[subject] scan: {path} has no feet: {100 * _FOOT:.0f} % of the stature over its lowest point the body "
            f"reaches {1000 * abs(ahead):.0f} mm ahead of the ankles (least {1000 * _AHEAD * stature:.0f}). Scan the "
            "feet as well, both flat on the floor, side by side, toes ahead."
        )
    forward = np.append(np.sign(ahead) * deep, 0.0)
    turned = corners @ np.stack([forward, z, np.cross(forward, z)]).T
    middle = cut_section(turned, np.array([0.0, 0.5 * stature, 0.0]) + turned[0, 0] * [1, 0, 1], np.array([0, 1.0, 0]))
    return _Scan(turned - [0.0, 0.0, middle.middle[2]], float(corners[..., 2].max()))


_UP = np.array([0.0, 1.0, 0.0])
TO_NECK = 0.16
"""Of the stature: from the vertex down to the middle of the neck, where the density changes."""


@dataclass(frozen=True, eq=False)
class ScannedBody:
    """The segments of a scan: ``lumps``, each in its segment frame, and ``cuts`` by joint: kg that a metre of the
    cut along the limb takes from the segment behind it and gives to the one before;
    ``surfaces`` by segment: kg that a surface a metre farther out would add.
    """

    lumps: Mapping[str, RigidInertia]
    cuts: Mapping[str, float]
    surfaces: Mapping[str, float]


def cut_scan(scan: _Scan, skeleton: Skeleton) -> ScannedBody:
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
        upper, fore = (clip_surface(arm, elbow.middle, sign * elbow.normal) for sign in (1, -1))
        lumps[f"{side}_upper_arm"] = _lump(upper, "upper_arm", shoulder.middle, elbow.normal)
        lumps[f"{side}_forearm_hand"] = _lump(fore, "forearm_hand", elbow.middle, elbow.normal)
        cuts |= {f"{side}_shoulder": _slope(shoulder, "upper_arm"), f"{side}_elbow": _slope(elbow, "upper_arm")}
    low, high = (clip_surface(rest, middle, sign * _UP) for sign in (-1, 1))
    for side, (ankle, hip) in hips.items():
        leg = clip_surface(low, np.zeros(3), np.array([0.0, 0.0, 1.0 if side == "right" else -1.0]))
        cuts[f"{side}_hip"] = _density("thigh") * cut_section(leg, middle - 1e-3 * _UP, _UP).area
        lumps |= _leg(leg, skeleton, side, ankle, hip, cuts)
    lumps |= _trunk(high, scan, skeleton, middle, cuts)
    lengths = {**skeleton.lengths, "trunk_head": scan.height - middle[1] - skeleton.lengths["pelvis"]}
    surfaces = {}
    for name in SEGMENTS:
        # a cylinder of mass m = rho pi r² l gains dm/dr = 2 rho pi r l = 2 sqrt(pi m rho l)
        part = {"pelvis": "lower_trunk", "trunk_head": "upper_trunk"}.get(name, part_of(name))
        surfaces[name] = 2.0 * float(np.sqrt(np.pi * lumps[name].mass * _density(part) * lengths[name]))
    return ScannedBody(lumps, cuts, surfaces)


def _hip(scan: _Scan, skeleton: Skeleton, side: str) -> tuple[Array, Array]:
    """Return ankle and hip centre (3,) m of one leg, straight, over the place where the ankle stands."""
    sign = OUTWARDS[side]
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
    # Pythagoras in the frontal plane: leg length and the difference of the widths of ankle and hip.
    rise = np.sqrt(max(length**2 - (abs(ankle[2]) - across) ** 2, 0.5 * length**2))
    ahead = cut_section(scan.triangles, np.array([0.0, up + rise, 0.0]), _UP).middle[0]
    return ankle, np.array([ahead, up + rise, sign * across])


def _leg(
    leg: Array, skeleton: Skeleton, side: str, ankle: Array, hip: Array, cuts: dict[str, float]
) -> dict[str, RigidInertia]:
    along = (hip - ankle) / np.linalg.norm(hip - ankle)
    knee = cut_section(leg, ankle + skeleton.lengths[f"{side}_shank"] * along, along)
    low = cut_section(leg, ankle, _UP)
    thigh, below = (clip_surface(leg, knee.middle, sign * along) for sign in (1, -1))
    shank, foot = (clip_surface(below, ankle, sign * _UP) for sign in (1, -1))
    cuts |= {f"{side}_knee": _slope(knee, "thigh"), f"{side}_ankle": _slope(low, "shank")}
    whole = _lump(foot, "foot", ankle, _UP)
    # the foot's long axis, about which it has least inertia, is turned about the vertical so that it points ahead
    # Least eigenvalue of the horizontal inertia: the foot's long axis.
    spread = np.linalg.eigh(whole.inertia[np.ix_([0, 2], [0, 2])])[1][:, 0]
    c, s = spread * np.sign(spread[0] or 1.0)
    return {
        f"{side}_thigh": _lump(thigh, "thigh", hip, hip - knee.middle),
        f"{side}_shank": _lump(shank, "shank", knee.middle, knee.middle - ankle),
        f"{side}_foot": turn_inertia(whole, np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])),
    }


def _arm(
    scan: _Scan, rest: Array, skeleton: Skeleton, side: str, middle: Array
) -> tuple[Array, Array, _Section, _Section]:
    """Return the closed arm, the body without it, and its shoulder and elbow."""
    sign = OUTWARDS[side]
    up = np.array([0.0, middle[1] + skeleton.lengths["trunk_head"], 0.0])
    centre = cut_section(scan.triangles, up, _UP).middle
    shoulder = np.array([centre[0], up[1], sign * abs(skeleton.origins[f"{side}_shoulder"][2])])
    corners = scan.triangles.reshape(-1, 3)
    tip = corners[np.argmax(sign * corners[:, 2])]
    way = tip - shoulder
    along = way / np.linalg.norm(way)
    angle = float(np.arctan2(sign * along[2], -along[1]))
    # A straight arm hangs at least 8 degrees from the vertical, clear of the trunk.
    if angle < np.radians(8.0):
        raise SessionRefused(_touching(side, f"it hangs {np.degrees(angle):.0f} degrees from the vertical"))
    reach = float(np.linalg.norm(way))
    # From wrist to finger tips it is 0.108 of the stature (Winter 2009).
    whole = skeleton.lengths[f"{side}_upper_arm"] + skeleton.lengths[f"{side}_forearm_hand"] + 0.108 * skeleton.stature
    if abs(reach / whole - 1) > 0.15:
        raise SessionRefused(
            f"[subject] scan: from the {side} shoulder to the farthest point sideways it is {reach:.2f} m, the "
            f"person's arm is {whole:.2f} m long. Scan with straight arms, 30 degrees away from the trunk."
        )
    # Planes up to 35 degrees from the vertical, up to 0.04 of the stature inside the shoulder centre.
    tilts = np.linspace(0.0, min(0.8 * angle, np.radians(35.0)), 8)
    places = shoulder - sign * np.linspace(0, 0.04 * skeleton.stature, 5)[:, None] * [0.0, 0.0, 1.0]
    # Normal between straight sideways and tilted up by at most the steepest plane.
    planes = [(place, np.array([0.0, np.sin(tilt), sign * np.cos(tilt)])) for place in places for tilt in tilts]
    above = scan.triangles[scan.triangles[..., 1].max(axis=1) > middle[1]]
    areas = [cut_section(above, *plane).area for plane in planes]
    best = int(np.argmin(areas))
    if areas[best] > 0.013 * skeleton.stature**2:  # a larger section cuts the trunk as well
        raise SessionRefused(_touching(side, f"the best cut at its shoulder is {1e4 * areas[best]:.0f} cm²"))
    place, plane = planes[best]
    beyond, body = (clip_surface(rest, place, turn * plane) for turn in (1, -1))
    outwards = np.array([0.0, np.sin(angle), sign * np.cos(angle)])
    # Flesh farther from the arm's axis towards the body is no arm: a broad hip.
    beside = shoulder - 0.05 * skeleton.stature * outwards
    arm, hip = (clip_surface(beyond, beside, turn * outwards) for turn in (1, -1))
    body = np.concatenate([body, hip])
    elbow = cut_section(arm, shoulder + skeleton.lengths[f"{side}_upper_arm"] * along, -along)
    return arm, body, _Section(shoulder, -plane, max(areas[best], 1e-4)), elbow


def _touching(side: str, why: str) -> str:
    return (
        f"[subject] scan: the {side} arm cannot be told from the trunk ({why}). Scan with straight arms, 30 degrees "
        "away from the trunk, so that daylight is seen between them."
    )


def _trunk(
    high: Array, scan: _Scan, skeleton: Skeleton, middle: Array, cuts: dict[str, float]
) -> dict[str, RigidInertia]:
    """Return pelvis and trunk: cut level where the tables cut, or at the joint where there is no such place."""
    to_cut = skeleton.cut.get("pelvis", skeleton.origins["trunk"])
    cut = cut_section(high, middle + skeleton.lengths["pelvis"] * _UP, _UP)
    pelvis, trunk = (clip_surface(high, cut.middle, sign * _UP) for sign in (-1, 1))
    cuts["trunk"] = _slope(cut, "lower_trunk")
    neck = np.array([0.0, scan.height - TO_NECK * skeleton.stature, 0.0])
    joint = middle + np.linalg.norm(skeleton.origins["trunk"]) * _UP
    parts = [
        _lump(clip_surface(trunk, neck, sign * _UP), name, joint, _UP)
        for name, sign in (("upper_trunk", -1), ("head", 1))
    ]
    upright = _lump(pelvis, "lower_trunk", middle, _UP)
    return {"pelvis": turn_inertia(upright, upright_to(to_cut)), "trunk_head": combine_inertias(*parts)}


def _density(part: str) -> float:
    return float(read_table("human", "densities").row(part=part)["density"])


def _slope(cut: _Section, part: str) -> float:
    return cut.area * _density(part)


def _lump(part: Array, kind: str, origin: Array, up: Array) -> RigidInertia:
    """Return a closed part with its kind's density in the frame at ``origin`` (3,) m whose y axis is ``up`` (3,)."""
    from trimesh.triangles import mass_properties

    y = up / np.linalg.norm(up)
    x = np.cross(y, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    # Rows are the axes: frame is own_R_scan.
    frame = np.stack([x, y, np.cross(x, y)])
    found = mass_properties(part - origin, density=_density(kind)) if len(part) else None
    if found is None or found.volume <= 0:
        raise SessionRefused(
            f"[subject] scan: no flesh is found where the skeleton has its {kind.replace('_', ' ')}. Scan the whole "
            "person, upright, legs straight, arms straight and away from the trunk."
        )
    return turn_inertia(RigidInertia(found.mass, found.center_mass, found.inertia), frame)

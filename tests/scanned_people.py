"""Scans of people whose shapes vary: the superelliptic people of `generated_people.py` as closed triangle surfaces.

Every part is a tube lofted through 40 sections, closed by fans; parts touch and do not overlap, so that mass and CoM of
every segment are known by themselves (trimesh, part by part). Nothing here cuts a surface. Arms hang straight, 20 to 45
degrees away from the trunk; a leg stands a little apart; hands and feet are drawn by themselves. The scanner adds
clothes or smoothing (all surfaces 1.5 mm out or in), and the person faces anywhere.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from generated_people import GeneratedPerson, generate_person, measured_lengths

from biodance.body.human.skeleton import Skeleton, generic_skeleton
from biodance.body.tables.choice import reference
from biodance.records import SIDES, Subject
from biodance.settings import Settings

_RING, _RINGS = 48, 40
_UP = np.array([0.0, 1.0, 0.0])
_ANKLE, HIP = 0.042, 0.055
"""Of the stature: height of the ankles; a hip from the middle."""


@dataclass(frozen=True, eq=False)
class ScannedPerson:
    """``person`` with the masses of the solids, ``com`` (3,) m by segment from its proximal joint along its axes (x
    ahead, y up along the segment, z right), ``mesh`` in m with z up, and the feet's ``feet`` (length, breadth, heel
    breadth) m; ``ankle`` m height of the ankles, ``shoulder`` m
    from the middle to a shoulder.
    """

    person: GeneratedPerson
    com: dict[str, np.ndarray]
    ankle: float
    shoulder: float
    mesh: trimesh.Trimesh
    feet: tuple[float, float, float]


def tube(centres: np.ndarray, radii: np.ndarray, aspect: float, power: float, frame: np.ndarray) -> trimesh.Trimesh:
    """Return a closed tube through superellipses with the areas of circles of ``radii`` (n,) m round ``centres`` (n, 3)
    m, deep along frame[0], broad (``aspect``) along frame[2].
    """
    angle = 2 * np.pi * np.arange(_RING) / _RING
    x, z = (np.sign(f(angle)) * np.abs(f(angle)) ** (2 / power) for f in (np.cos, np.sin))
    area = 0.5 * abs(np.sum(x * np.roll(z, -1) - z * np.roll(x, -1))) * aspect
    edge = np.sqrt(np.pi / area) * (np.outer(x, frame[0]) + aspect * np.outer(z, frame[2]))
    rings = centres[:, None] + radii[:, None, None] * edge
    return _closed(np.concatenate([rings.reshape(-1, 3), centres[[0, -1]]]))


def _closed(points: np.ndarray) -> trimesh.Trimesh:
    """Return the closed surface of rings of points and the middles of the first and last."""
    n, j = (len(points) - 2) // _RING, np.arange(_RING)
    k = (j + 1) % _RING
    faces = []
    for r in _RING * np.arange(n - 1):
        faces += [np.stack([r + j, r + k, r + j + _RING], 1), np.stack([r + k, r + k + _RING, r + j + _RING], 1)]
    end = _RING * (n - 1)
    faces += [np.stack([0 * j + n * _RING, k, j], 1), np.stack([0 * j + n * _RING + 1, end + j, end + k], 1)]
    mesh = trimesh.Trimesh(points, np.concatenate(faces), process=False)
    if mesh.volume < 0:
        mesh.invert()
    return mesh


def scanned_person(seed: int) -> ScannedPerson:
    """Return the person of a seed, scanned; stature and masses are those of the solids."""
    base, rng = generate_person(seed), np.random.default_rng([seed, 7])
    lengths, skin = base.lengths, float(rng.normal(0, 0.0015))
    tall = sum(lengths[part] for part in ("thigh", "shank", "lower_trunk", "upper_trunk", "head"))
    stature = tall / (1 - _ANKLE)
    ankle = _ANKLE * stature
    parts: dict[str, list[Part]] = {"pelvis": [], "trunk_head": []}
    hip = np.array([0.0, ankle + lengths["shank"] + lengths["thigh"], 0.0])
    waist = hip + lengths["lower_trunk"] * _UP
    neck = waist + lengths["upper_trunk"] * _UP
    parts["pelvis"] = [_part(base, "lower_trunk", hip, _UP, 1.0, skin)]
    parts["trunk_head"] = [_part(base, "upper_trunk", waist, _UP, 1.0, skin), _part(base, "head", neck, _UP, 1.0, skin)]
    feet = np.array([0.152 * stature, 0.056 * stature, 0.04 * stature]) * np.exp(rng.normal(0, 0.04, 3))
    hand, hang = _hand(base, rng), rng.uniform(np.radians(20), np.radians(45))
    out = _shoulder(base, hang)
    moved = rng.normal(0, 0.025) * lengths["thigh"]
    joints = {"pelvis": hip, "trunk_head": waist}
    for side, sign in (("right", 1.0), ("left", -1.0)):
        size = float(np.exp(rng.normal(0, 0.005)))
        top = hip + np.array([0.0, 0.0, sign * HIP * stature])
        knee, heel = top - lengths["thigh"] * _UP, top - (lengths["thigh"] + lengths["shank"]) * _UP
        down = np.array([0.0, -np.cos(hang), sign * np.sin(hang)])
        arm = neck + np.array([0.0, -0.012 * stature, sign * out])
        elbow = arm + lengths["upper_arm"] * down
        wrist = elbow + lengths["forearm"] * down
        parts |= {
            f"{side}_thigh": [_part(base, "thigh", top, -_UP, size, skin)],
            f"{side}_shank": [_part(base, "shank", knee, -_UP, size, skin)],
            f"{side}_foot": [_foot(heel, feet, rng, skin)],
            f"{side}_upper_arm": [_part(base, "upper_arm", arm, down, size, skin)],
            f"{side}_forearm_hand": [_part(base, "forearm", elbow, down, size, skin), hand(wrist, down, skin)],
        }
        joints |= {f"{side}_thigh": top, f"{side}_shank": knee, f"{side}_foot": heel}
        joints |= {f"{side}_upper_arm": arm, f"{side}_forearm_hand": elbow}
    return _whole(replace(base, stature=stature), parts, joints, moved, feet, rng)


def _shoulder(base: GeneratedPerson, hang: float) -> float:
    """Return how far sideways an arm of this angle begins so that it touches the trunk and does not enter it."""
    radius, aspect, power = base.sections["upper_trunk"]
    place = np.linspace(0.3, 1.0, 200)
    below = np.maximum((1 - place) * base.lengths["upper_trunk"] - 0.012 * base.stature, 0.0)
    broad = radius(place) * aspect * np.sqrt(np.pi / (aspect * _area(power)))
    arm, _, power = base.sections["upper_arm"]
    thick = 1.03 * float(arm(0.0)) * np.sqrt(np.pi / _area(power))
    return float(np.max(broad - below * np.tan(hang)) + thick / np.cos(hang) + 0.004)


def _area(power: float) -> float:
    """Return the area of the superellipse |x|^p + |z|^p = 1."""
    x = np.linspace(0, 1, 4001)
    return float(4 * np.trapezoid((1 - x**power) ** (1 / power), x))


def _whole(
    base: GeneratedPerson,
    parts: dict[str, list["Part"]],
    joints: dict[str, np.ndarray],
    moved: float,
    feet: np.ndarray,
    rng: np.random.Generator,
) -> ScannedPerson:
    """Return the person of the solids; the true hip lies ``moved`` m below the top of the thighs' tubes, which
    belongs to the pelvis then.
    """
    masses = {name: sum(one.density * one.solid.volume for one in some) for name, some in parts.items()}
    com = {
        name: sum(one.density * one.solid.volume * one.solid.center_mass for one in some) / masses[name] - joints[name]
        for name, some in parts.items()
    }
    for name in com:
        if "arm" in name:
            com[name] = np.array([com[name][0], -np.linalg.norm(com[name]), 0.0])
    for name in ("right_thigh", "left_thigh"):
        slice_kg = moved * np.pi * float(base.sections["thigh"][0](0.0)) ** 2 * base.densities["thigh"]
        masses[name], masses["pelvis"] = masses[name] - slice_kg, masses["pelvis"] + slice_kg
    mesh = trimesh.util.concatenate([one.seen for some in parts.values() for one in some])
    person = replace(base, masses=masses, mass=sum(masses.values()))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(rng.uniform(-np.pi, np.pi), [0, 0, 1]))
    mesh.apply_translation(rng.uniform(-1, 1, 3))
    return ScannedPerson(person, com, _ANKLE * base.stature, float(joints["right_upper_arm"][2]), mesh, tuple(feet))


@dataclass(frozen=True, eq=False)
class Part:
    """A ``solid`` with its ``density`` kg/m³ and its surface as ``seen`` by the scanner."""

    solid: trimesh.Trimesh
    density: float
    seen: trimesh.Trimesh


def _part(base: GeneratedPerson, part: str, start: np.ndarray, way: np.ndarray, size: float, skin: float) -> Part:
    radius, aspect, power = base.sections[part]
    place = (1 - np.cos(np.linspace(0, np.pi, _RINGS))) / 2
    side = np.array([0.0, 0.0, 1.0]) - way[2] * way
    side /= np.linalg.norm(side)
    frame = np.stack([np.cross(way, side), way, side])
    centres = start + base.lengths[part] * place[:, None] * way
    made = [tube(centres, size * radius(place) + more, aspect, power, frame) for more in (0.0, skin)]
    return Part(made[0], base.densities[part], made[1])


def _hand(base: GeneratedPerson, rng: np.random.Generator) -> Callable[[np.ndarray, np.ndarray, float], Part]:
    kg, length = 0.42 * (base.stature / 1.70) ** 3 * np.exp(rng.normal(0, 0.1)), 0.108 * base.stature
    density = 1150 * np.exp(rng.normal(0, 0.02))
    place = (1 - np.cos(np.linspace(0, np.pi, _RINGS))) / 2
    thick = np.sqrt(np.interp(place, [0, 0.3, 0.6, 1], [0.8, 1.0, 0.8, 0.15]))
    thick *= np.sqrt(kg / density / (length * np.pi * np.trapezoid(thick**2, place)))

    def at(wrist: np.ndarray, way: np.ndarray, skin: float) -> Part:
        side = np.cross([1.0, 0.0, 0.0], way)
        frame = np.stack([np.array([1.0, 0.0, 0.0]), way, side])
        centres = wrist + length * place[:, None] * way
        made = [tube(centres, thick + more, 0.4, 2.2, frame) for more in (0.0, skin)]
        return Part(made[0], density, made[1])

    return at


def _foot(ankle: np.ndarray, size: np.ndarray, rng: np.random.Generator, skin: float) -> Part:
    """Return a foot lofted from heel to toes between the floor and the height of the ankle."""
    length, breadth, heel = size
    place = np.linspace(0, 1, _RINGS)
    wide = np.interp(place, [0, 0.1, 0.3, 0.74, 1], [0.7 * heel, heel, heel, breadth, 0.5 * breadth]) / 2
    high = ankle[1] * np.interp(place, [0, 0.1, 0.35, 0.7, 1], [0.95, 1.0, 1.0, 0.5, 0.3]) / 2
    angle = 2 * np.pi * np.arange(_RING) / _RING
    up, side = (np.sign(f(angle)) * np.abs(f(angle)) ** (2 / 3.0) for f in (np.cos, np.sin))
    turn = rng.normal(0, 0.1)
    made = []
    for more in (0.0, skin):
        x = (place - 0.25) * length
        rings = np.stack(
            [np.repeat(x[:, None], _RING, 1), np.outer(high, up) + high[:, None], np.outer(wide + more, side)], -1
        )
        ends = [rings[0].mean(axis=0), rings[-1].mean(axis=0)]
        points = (
            np.concatenate([rings.reshape(-1, 3), ends]) @ trimesh.transformations.rotation_matrix(turn, _UP)[:3, :3]
        )
        made.append(_closed(points + ankle * [1, 0, 1]))
    return Part(made[0], 1100 * np.exp(rng.normal(0, 0.02)), made[1])


def measured_skeleton(scanned: ScannedPerson, subject: Subject, rng: np.random.Generator) -> Skeleton:
    """Return the generic skeleton with the person's own lengths and widths, each wrong by 5 mm."""
    found = measured_lengths(scanned.person, generic_skeleton(reference(Settings.table, subject), subject), rng)
    origins = {name: np.array(place) for name, place in found.origins.items()}
    origins["trunk"] = np.array([0.0, found.lengths["pelvis"], 0.0])
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        origins[f"{side}_shoulder"][2] = sign * (scanned.shoulder + rng.normal(0, 0.005))
        origins[f"{side}_hip"][2] = sign * (HIP * scanned.person.stature + rng.normal(0, 0.005))
    ankle = {side: scanned.ankle + rng.normal(0, 0.005) for side in SIDES}
    return replace(found, origins=origins, ankle_height=ankle)

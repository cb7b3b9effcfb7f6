"""People whose shapes vary, to measure a prior that they are not made from: stacks of 80 superelliptic slices.

Nothing here comes from the tables or the stadium solids of biodance: radii are splines through knots at other places
than those of the tape, sections |x/a|^p + |z/b|^p = 1 with a drawn exponent and aspect, densities drawn. A tape is the
length of the section's edge, at a place missed by a centimetre, read with 1 %.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from biodance.body.human.skeleton import Skeleton
from biodance.lab.markers.sets import part_of

_KNOTS = {
    "thigh": ((0, 0.2, 0.4, 0.6, 0.8, 1), (94, 89, 83, 74, 63, 57)),
    "shank": ((0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1), (56, 55, 57, 51, 42, 35.5, 33, 35)),
    "upper_arm": ((0, 0.3, 0.6, 0.8, 1), (52, 49, 46, 42, 40)),
    "forearm": ((0, 0.15, 0.4, 0.7, 1), (40, 42, 36.5, 28.5, 26.5)),
    "lower_trunk": ((0, 0.4, 0.7, 1), (148, 146, 138, 132)),
    "upper_trunk": ((0, 0.3, 0.5, 0.7, 0.85, 1), (132, 138, 149, 152, 145, 95)),
    "head": ((0, 0.25, 0.4, 0.65, 0.85, 1), (59, 58, 78, 90, 80, 25)),
}
"""Places along the part and radii (mm) of circles of the same area, of somebody of 1.70 m and usual build: chosen so
that the mean masses lie within 7 % of the means of published studies, whatever the girths."""
_SEX = {
    "F": {"thigh": 1.02, "lower_trunk": 1.02, "upper_arm": 0.95, "forearm": 0.94, "upper_trunk": 0.96, "head": 0.98},
    "M": {"thigh": 0.99, "lower_trunk": 0.98, "upper_arm": 1.05, "forearm": 1.05, "upper_trunk": 1.04, "head": 1.02},
}
_LENGTH = {"thigh": 0.24, "shank": 0.245, "upper_arm": 0.165, "forearm": 0.152, "lower_trunk": 0.083}
_LENGTH |= {"upper_trunk": 0.21, "head": 0.165}
"""Of the stature."""
_ASPECT = {"lower_trunk": 1.45, "upper_trunk": 1.4, "head": 0.8}
_DENSITY = {"thigh": 1045, "shank": 1080, "upper_arm": 1060, "forearm": 1100, "lower_trunk": 1020, "upper_trunk": 930}
_DENSITY |= {"head": 1090}
_TAPES = {
    "upper_thigh": ("thigh", 0.18),
    "thigh": ("thigh", 0.5),
    "knee": ("thigh", 1.0),
    "shank": ("shank", 0.3),
    "ankle": ("shank", 0.92),
    "upper_arm": ("upper_arm", 0.5),
    "elbow": ("upper_arm", 1.0),
    "forearm": ("forearm", 0.2),
    "wrist": ("forearm", 0.97),
    "hip": ("lower_trunk", 0.0),
    "waist": ("lower_trunk", 1.0),
    "chest": ("upper_trunk", 0.55),
    "neck": ("head", 0.1),
    "head": ("head", 0.6),
}
_LIMBS = ("thigh", "shank", "upper_arm", "forearm")
_SLICES = 80


@dataclass(frozen=True)
class GeneratedPerson:
    """``mass`` kg and ``stature`` m; ``lengths`` m by part; ``masses`` kg by segment of biodance; ``girths`` m; by part
    ``sections`` (radius m of a circle of the same area as a function of the place from 0 to 1, aspect, exponent) and
    ``densities`` kg/m³.
    """

    sex: Literal["F", "M"]
    mass: float
    stature: float
    lengths: dict[str, float]
    masses: dict[str, float]
    girths: dict[str, float]
    sections: dict[str, Any]
    densities: dict[str, float]


def section_edge(radius: float, aspect: float, power: float) -> float:
    """Return the length of the edge of a superellipse with the area of a circle of this radius."""
    angle = np.linspace(0, 2 * np.pi, 721)
    x, z = (np.sign(f(angle)) * np.abs(f(angle)) ** (2 / power) for f in (np.cos, np.sin))
    edge = np.stack([x, aspect * z])
    area = 0.5 * np.abs(np.sum(edge[0, :-1] * edge[1, 1:] - edge[0, 1:] * edge[1, :-1]))
    return float(np.sum(np.linalg.norm(np.diff(edge, axis=1), axis=0)) * radius * np.sqrt(np.pi / area))


def generate_person(seed: int) -> GeneratedPerson:
    """Return a person: build common to all parts, of each part by itself (7 % of its mass, the spread between people of
    one mass and stature that Zatsiorsky 2002 prints) and along it; the sides are nearly alike.
    """
    from scipy.interpolate import PchipInterpolator

    rng = np.random.default_rng(seed)
    sex: Literal["F", "M"] = "F" if seed % 2 else "M"
    stature = rng.normal(1.65 if sex == "F" else 1.78, 0.07)
    build = rng.normal(0.0, 0.07)
    lengths = {part: share * stature * np.exp(rng.normal(0, 0.03)) for part, share in _LENGTH.items()}
    masses, girths, sections, densities = {}, {}, {}, {}
    for part, (places, radii) in _KNOTS.items():
        size = stature / 1.70 * _SEX[sex].get(part, 1.0)
        size *= np.exp((0.3 if part == "head" else 1.0) * build + rng.normal(0, 0.02 if part == "head" else 0.035))
        knots = np.log(1e-3 * size * np.array(radii)) + rng.normal(0, 0.02, len(radii))
        shape = PchipInterpolator(places, knots)
        aspect = _ASPECT.get(part, 1.0) * np.exp(rng.normal(0, 0.08))
        sections[part] = shape, aspect, rng.uniform(1.9, 2.6)
        where = (np.arange(_SLICES) + 0.5) / _SLICES
        volume = float(np.mean(np.pi * np.exp(2 * shape(where)))) * lengths[part]
        densities[part] = _DENSITY[part] * np.exp(rng.normal(-0.1 * build, 0.02))
        masses[part] = volume * densities[part]
        sections[part] = (lambda place, knots=shape: np.exp(knots(place))), *sections[part][1:]
    for girth, (part, place) in _TAPES.items():
        radius, aspect, power = sections[part]
        put = np.clip(place + rng.normal(0, 0.01) / lengths[part], 0, 1)
        girths[girth] = section_edge(float(radius(put)), aspect, power) * np.exp(rng.normal(0, 0.01))
    person = _assembled(sex, stature, lengths, masses, girths, rng)
    return replace(person, sections=sections, densities=densities)


def _assembled(
    sex: Literal["F", "M"],
    stature: float,
    lengths: dict[str, float],
    masses: dict[str, float],
    girths: dict[str, float],
    rng: np.random.Generator,
) -> GeneratedPerson:
    """Return the person with hands and feet, which no tape goes round, sides that differ by 2 %, and a hip that parts
    thigh from pelvis higher or lower (2.5 % of the thigh).
    """
    moved = masses["thigh"] * rng.normal(0, 0.025)
    masses |= {"thigh": masses["thigh"] - moved, "lower_trunk": masses["lower_trunk"] + 2 * moved}
    whole = {"pelvis": masses["lower_trunk"], "trunk_head": masses["upper_trunk"] + masses["head"]}
    hand, foot = (kg * (stature / 1.70) ** 3 * np.exp(rng.normal(0, 0.1)) for kg in (0.42, 0.95))
    both = {part: masses[part] for part in _LIMBS} | {"foot": foot}
    both["forearm_hand"] = both.pop("forearm") + hand
    for part, kg in both.items():
        apart = rng.normal(0, 0.01)
        whole[f"right_{part}"], whole[f"left_{part}"] = kg * np.exp(apart), kg * np.exp(-apart)
    return GeneratedPerson(sex, sum(whole.values()), stature, lengths, whole, girths, {}, {})


def measured_lengths(person: GeneratedPerson, generic: Skeleton, rng: np.random.Generator) -> Skeleton:
    """Return a generic skeleton with the person's lengths, each wrong by 5 mm."""
    own = person.lengths | {"forearm_hand": person.lengths["forearm"]}
    own |= {"pelvis": own["lower_trunk"], "trunk_head": own["lower_trunk"] + own["upper_trunk"]}
    lengths = {
        segment: own[part_of(segment)] + rng.normal(0, 0.005) if part_of(segment) in own else length
        for segment, length in generic.lengths.items()
    }
    return replace(generic, lengths=lengths)

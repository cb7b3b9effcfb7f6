"""People: lengths, masses, centres of mass and inertia of 22 segments, drawn between published studies."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.third_lab.faults import Array
from benchmarks.third_lab.skeleton import PARENTS, SIDES

# Shares of body mass, %: head and neck, thorax and abdomen, pelvis, upper arm, forearm, hand, thigh, shank, foot.
# Dempster 1955 (WADC-TR-55-159, as in Winter 2009, table 4.1); Clauser et al. 1969 (AMRL-TR-69-70; its trunk less
# Dempster's pelvis); Zatsiorsky and Seluyanov 1983; McConville et al. 1980 and Young et al. 1983 as adjusted by Dumas
# et al. 2007 (J Biomech 40:543); Plagenhoef et al. 1983 (RQES 54:169).
STUDIES = {
    "dempster": {"M": (8.1, 35.5, 14.2, 2.8, 1.6, 0.6, 10.0, 4.65, 1.45)},
    "clauser": {"M": (7.3, 36.5, 14.2, 2.6, 1.6, 0.7, 10.3, 4.3, 1.5)},
    "zatsiorsky": {
        "M": (6.94, 32.29, 11.17, 2.71, 1.62, 0.61, 14.16, 4.33, 1.37),
        "F": (6.68, 30.10, 12.47, 2.55, 1.38, 0.56, 14.78, 4.81, 1.29),
    },
    "mcconville": {
        "M": (6.7, 33.3, 14.2, 2.4, 1.7, 0.6, 12.3, 4.8, 1.2),
        "F": (6.7, 30.4, 14.6, 2.3, 1.4, 0.5, 14.6, 4.5, 1.0),
    },
    "plagenhoef": {
        "M": (8.26, 33.16, 13.66, 3.25, 1.87, 0.65, 10.5, 4.75, 1.43),
        "F": (8.2, 29.26, 15.96, 2.9, 1.57, 0.5, 11.75, 5.35, 1.33),
    },
}
# Centre of mass from the proximal joint, share of the length, lowest and highest of the same studies.
ALONG = {"upper_arm": (0.436, 0.513), "forearm": (0.39, 0.434), "thigh": (0.372, 0.433), "shank": (0.371, 0.434)}
# Centre of mass ahead of and (right) outside the joint line, share of the length (Dumas et al. 2007, means).
BESIDE = {"upper_arm": (0.017, 0.026), "forearm": (0.010, -0.014), "thigh": (-0.041, -0.033), "shank": (-0.048, -0.007)}
# Radii of gyration across and along, share of the length (Dumas et al. 2007).
RADII = {"upper_arm": (0.32, 0.14), "forearm": (0.28, 0.11), "thigh": (0.30, 0.15), "shank": (0.28, 0.10)}


@dataclass(frozen=True)
class Person:
    """One person.

    Attributes
    ----------
    sex : {"M", "F"}
    mass : float
        Body mass, kg.
    height : float
        Stature, m.
    offsets : dict of str to array, shape (3,)
        Joint of each segment in its parent's frame, m.
    masses : dict of str to float
        kg.
    coms : dict of str to array, shape (3,)
        Centre of mass in the segment's frame, m.
    inertias : dict of str to array, shape (3, 3)
        About the centre of mass, axes of the segment, kg m².
    sizes : dict of str to float
        ankle (height of the ankle joint), foot (length), asis (breadth), cut (height of the lowest spinal joint over
        the hips), neck, depth, breadth: m.
    """

    sex: str
    mass: float
    height: float
    offsets: dict[str, Array]
    masses: dict[str, float]
    coms: dict[str, Array]
    inertias: dict[str, Array]
    sizes: dict[str, float]


def draw_person(rng: np.random.Generator) -> Person:
    """Draw a person of 1.52 to 1.95 m, body mass index 18 to 29, with a pelvis of 11 to 20 % of the body.

    The studies' shares are mixed at random; what the pelvis gains or loses is taken from thighs (60 %) and lower trunk.
    Lengths after Drillis and Contini 1966 with 2.5 % of spread; right and left differ by 0.4 % in length, 1.5 % in
    mass.
    """
    sex = str(rng.choice(["M", "F"]))
    height = float(np.clip(rng.normal(1.77, 0.07) if sex == "M" else rng.normal(1.65, 0.065), 1.52, 1.95))
    mass = float(np.clip(rng.normal(23.3, 2.6), 18, 29) * height**2)
    pelvis_share = rng.uniform(0.11, 0.20)
    sizes, offsets = _draw_lengths(rng, height, pelvis_share)
    masses = _draw_masses(rng, sex, mass, pelvis_share)
    coms, inertias = {}, {}
    for name in PARENTS:
        coms[name], inertias[name] = _draw_distribution(rng, name, masses[name], offsets, sizes)
    return Person(sex, mass, height, offsets, masses, coms, inertias, sizes)


def _draw_lengths(
    rng: np.random.Generator, height: float, pelvis_share: float
) -> tuple[dict[str, float], dict[str, Array]]:
    """Return sizes (m) and joint offsets in the parents' frames (m)."""

    def share(mean: float, spread: float = 0.025) -> float:
        return height * mean * (1 + rng.normal(0, spread))

    cut = height * (0.035 + 0.05 * (pelvis_share - 0.11) / 0.09 + rng.normal(0, 0.003))
    asis = share(0.142, 0.05)
    sizes = {
        "ankle": share(0.039, 0.05),
        "foot": share(0.152),
        "asis": asis,
        "cut": cut,
        "neck": share(0.055, 0.05),
        "head": share(0.125),
        "breadth": share(0.088, 0.05),
        "depth": share(0.062, 0.06),
        "hip": asis * (0.36 + rng.normal(0, 0.012)),
        "shoulder": share(0.107, 0.04),
        "thigh": share(0.245),
        "shank": share(0.246),
        "upper_arm": share(0.182),
        "forearm": share(0.146),
        "hand": share(0.108),
        "spine": share(0.288, 0.015),
    }
    rest = sizes["spine"] - cut
    ahead = rng.normal(-0.008, 0.006, 5)  # the spine is no straight line over the hips
    offsets: dict[str, Array] = {
        "pelvis": np.zeros(3),
        "lumbar": np.array([-0.02 + ahead[0], 0, cut]),
        "waist": np.array([ahead[1], 0, 0.26 * rest]),
        "thorax": np.array([ahead[2], 0, 0.26 * rest]),
        "neck": np.array([0.008 + ahead[3], 0, 0.48 * rest]),
        "head": np.array([0.012 + ahead[4], 0, sizes["neck"]]),
    }
    for side, sign in SIDES.items():

        def limb(name: str) -> float:
            return sizes[name] * (1 + rng.normal(0, 0.004))

        offsets |= {
            f"{side}_clavicle": np.array([0.035, 0.02 * sign, 0.46 * rest]),
            f"{side}_upper_arm": np.array([-0.03 + rng.normal(0, 0.006), sign * (sizes["shoulder"] - 0.02), 0.012]),
            f"{side}_forearm": np.array([0, 0, -limb("upper_arm")]),
            f"{side}_hand": np.array([0, 0, -limb("forearm")]),
            f"{side}_thigh": np.array([0, sign * sizes["hip"], 0]),
            f"{side}_shank": np.array([0, 0, -limb("thigh")]),
            f"{side}_foot": np.array([0, 0, -limb("shank")]),
            f"{side}_toes": np.array([0.46 * sizes["foot"], 0, -0.72 * sizes["ankle"]]),
        }
    return sizes, offsets


def _draw_masses(rng: np.random.Generator, sex: str, mass: float, pelvis_share: float) -> dict[str, float]:
    """Mix the studies and move the pelvis to its share; returns kg that sum up to the body's mass."""
    rows = np.array([study[sex if sex in study else "M"] for study in STUDIES.values()]) / 100
    likely = np.array([3.0 if "F" in study else 0.6 if sex == "F" else 1.5 for study in STUDIES.values()])
    head, trunk, pelvis, upper_arm, forearm, hand, thigh, shank, foot = (
        rng.dirichlet(likely) @ rows * np.exp(rng.normal(0, 0.04, 9))
    )
    gained = pelvis_share - pelvis
    thigh, trunk = thigh - 0.3 * gained, trunk - 0.4 * gained
    abdomen = trunk * rng.uniform(0.38, 0.48) - 0.2 * gained
    shares = {
        "pelvis": pelvis_share,
        "lumbar": 0.5 * abdomen,
        "waist": 0.5 * abdomen,
        "thorax": trunk - abdomen - 0.022,
        "neck": 0.19 * head,
        "head": 0.81 * head,
    }
    for side in SIDES:
        limb = {"clavicle": 0.011, "upper_arm": upper_arm, "forearm": forearm, "hand": hand, "thigh": thigh,
                "shank": shank, "foot": 0.82 * foot, "toes": 0.18 * foot}  # fmt: skip
        shares |= {f"{side}_{name}": value * (1 + rng.normal(0, 0.015)) for name, value in limb.items()}
    others = sum(shares.values()) - pelvis_share
    scale = (1 - pelvis_share) / others
    return {name: mass * (value if name == "pelvis" else value * scale) for name, value in shares.items()}


def _draw_distribution(
    rng: np.random.Generator, name: str, mass: float, offsets: dict[str, Array], sizes: dict[str, float]
) -> tuple[Array, Array]:
    """Draw centre of mass (m) and inertia about it (kg m²) of one segment, axes of the segment."""
    side, kind = name.split("_", 1) if name.startswith(("right_", "left_")) else ("", name)
    sign = SIDES.get(side, 0)
    if kind in ALONG:
        distal = {"upper_arm": "forearm", "forearm": "hand", "thigh": "shank", "shank": "foot"}[kind]
        length = float(-offsets[f"{side}_{distal}"][2])
        ahead, outside = BESIDE[kind]
        com = length * np.array([
            ahead + rng.normal(0, 0.012), sign * (outside + rng.normal(0, 0.012)),
            -rng.uniform(*ALONG[kind]) + rng.normal(0, 0.006),
        ])  # fmt: skip
        across, along = np.array(RADII[kind]) * length * np.exp(rng.normal(0, [0.04, 0.06]))
        moments = mass * np.array([across**2, (0.99 * across) ** 2, along**2])
    else:
        com, half = _solid(kind, sign, offsets, sizes)
        com = com + rng.normal(0, [0.006, 0.002, 0.006]) * (0.5 if sign else 1.0)
        moments = (
            mass / 5 * np.array([half[1] ** 2 + half[2] ** 2, half[0] ** 2 + half[2] ** 2, half[0] ** 2 + half[1] ** 2])
        )
        moments *= 1.1 * np.exp(rng.normal(0, 0.05))  # flesh lies a little farther out than in an ellipsoid
    turned = Rotation.from_rotvec(rng.normal(0, np.radians(4), 3)).as_matrix()
    return com, turned @ np.diag(moments) @ turned.T


def _solid(kind: str, sign: int, offsets: dict[str, Array], sizes: dict[str, float]) -> tuple[Array, Array]:
    """Return centre and half axes (m) of the ellipsoid that stands for a segment of the trunk, a hand or a foot.

    Centres of pelvis and trunk as in Dumas et al. 2007: 0.6 to 0.7 of the pelvis' height, 0.58 of the trunk's.
    """
    wide, deep, foot = sizes["breadth"], sizes["depth"], sizes["foot"]
    up = {name: float(offsets[name][2]) for name in ("lumbar", "waist", "thorax", "neck")}
    solids = {
        "pelvis": ((-0.01, 0, 0.58 * up["lumbar"]), (deep, wide, 0.5 * up["lumbar"] + 0.05)),
        "lumbar": ((0.025, 0, 0.5 * up["waist"]), (0.95 * deep, 0.9 * wide, 0.75 * up["waist"])),
        "waist": ((0.022, 0, 0.5 * up["thorax"]), (0.95 * deep, 0.9 * wide, 0.75 * up["thorax"])),
        "thorax": ((0.015, 0, 0.52 * up["neck"]), (deep, 0.95 * wide, 0.62 * up["neck"])),
        "neck": ((0.005, 0, 0.5 * sizes["neck"]), (0.055, 0.055, 0.8 * sizes["neck"])),
        "head": ((0.018, 0, 0.42 * sizes["head"]), (0.095, 0.075, 0.62 * sizes["head"])),
        "clavicle": ((-0.045, sign * 0.55 * sizes["shoulder"], -0.02), (0.045, 0.09, 0.05)),
        "hand": ((0.008, 0, -0.45 * sizes["hand"]), (0.045, 0.02, 0.55 * sizes["hand"])),
        "foot": ((0.17 * foot, 0, -0.5 * sizes["ankle"]), (0.38 * foot, 0.038, 0.6 * sizes["ankle"])),
        "toes": ((0.12 * foot, 0, 0.0), (0.15 * foot, 0.042, 0.016)),
    }
    centre, half = solids[kind]
    return np.array(centre), np.array(half)

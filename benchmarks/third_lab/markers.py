"""Markers: where landmarks lie on this person, three sets of labels, and what cameras make of them."""

import numpy as np

from benchmarks.third_lab.faults import Array
from benchmarks.third_lab.people import Person
from benchmarks.third_lab.skeleton import SIDES, pose_segments

Places = dict[str, tuple[str, Array]]  # landmark: segment, and place in its frame, m
_ARM = {
    "acromion": "SHO",
    "upper_arm_wand": "UPA",
    "elbow_lateral": "ELB",
    "forearm_wand": "FRM",
    "wrist_radial": "WRA",
    "wrist_ulnar": "WRB",
    "hand": "FIN",
}
_LEG = {
    "asis": "ASI",
    "psis": "PSI",
    "thigh_wand": "THI",
    "knee_lateral": "KNE",
    "shank_wand": "TIB",
    "ankle_lateral": "ANK",
    "heel": "HEE",
    "toe": "TOE",
    "head_front": "FHD",
    "head_back": "BHD",
}
_PIG_MIDDLE = {"c7": "C7", "t10": "T10", "jugular_notch": "CLAV", "xiphoid": "STRN", "right_scapula": "RBAK"}
_MORE = {
    "thigh_upper": "THAP",
    "thigh_lower": "THAD",
    "shank_upper": "TIAP",
    "shank_lower": "TIAD",
    "knee_medial": "KNM",
    "ankle_medial": "MED",
    "toe_medial": "FMH",
    "toe_lateral": "VMH",
}
_OWN = {
    "asis": "ias",
    "psis": "ips",
    "knee_lateral": "lat_knee",
    "knee_medial": "med_knee",
    "ankle_lateral": "lat_mall",
    "ankle_medial": "med_mall",
    "heel": "heel",
    "toe_medial": "mt1",
    "toe_lateral": "mt5",
    "acromion": "acromion",
    "elbow_lateral": "lat_elbow",
    "elbow_medial": "med_elbow",
    "wrist_radial": "rad_wrist",
    "wrist_ulnar": "uln_wrist",
    "hand": "mc3",
    "thigh_upper": "th1",
    "thigh_front": "th2",
    "thigh_lower": "th3",
    "thigh_wand": "th4",
    "shank_upper": "sh1",
    "shank_front": "sh2",
    "shank_lower": "sh3",
    "shank_wand": "sh4",
    "head_front": "temple",
    "head_back": "occiput",
    "upper_arm_wand": "ua1",
    "upper_arm_upper": "ua2",
    "forearm_wand": "fa1",
}


def name_markers(marker_set: str) -> dict[str, str]:
    """Label each landmark of a set: "pig" (plug-in gait), "cgm2" (CGM 2.4's) or "isb" (clusters, names of its own).

    Raises
    ------
    ValueError
        For another set.
    """
    if marker_set in ("pig", "cgm2"):
        sided = _LEG | _ARM | (_MORE if marker_set == "cgm2" else {})
        return {
            f"{side}_{place}": side[0].upper() + label for side in SIDES for place, label in sided.items()
        } | _PIG_MIDDLE
    if marker_set == "isb":
        middle = {"c7": "c7", "t10": "t8", "jugular_notch": "ij", "xiphoid": "px"}
        return {f"{side}_{place}": f"{side[0]}_{label}" for side in SIDES for place, label in _OWN.items()} | middle
    raise ValueError(f"There is no marker set {marker_set!r}; there are pig, cgm2 and isb.")


def place_markers(rng: np.random.Generator, person: Person, error: float = 0.005) -> Places:
    """Where every landmark's marker really sits.

    Bones vary: hip joint centres lie 22 ± 4 % of the pelvis' breadth behind, 32 ± 5 % below the spines. Examiners err.

    Parameters
    ----------
    rng : numpy.random.Generator
    person : Person
    error : float
        Standard deviation of placement along each axis, m (half of it on wrists, ankles, feet).

    Returns
    -------
    where : dict of str to (str, array)
        Segment, and place in its frame, m.
    """
    s, h, o = person.sizes, person.height, person.offsets
    asis, foot, ankle, knee = s["asis"], s["foot"], s["ankle"], 0.031 * h
    up, ahead, depth = asis * rng.normal([0.32, 0.22, 0.62], [0.05, 0.04, 0.04])
    top, rib = o["neck"][2], o["neck"][0]
    where: dict[str, tuple[str, list[float]]] = {
        "c7": ("thorax", [rib - 0.062, 0, top + 0.025]),
        "t10": ("thorax", [-0.085, 0, 0.15 * top]),
        "jugular_notch": ("thorax", [rib + 0.065, 0, 0.93 * top]),
        "xiphoid": ("thorax", [0.115, 0, 0.36 * top]),
        "right_scapula": ("thorax", [-0.10, -0.09, 0.55 * top]),
    }
    for side, y in SIDES.items():
        thigh, shank = -o[f"{side}_shank"][2], -o[f"{side}_foot"][2]
        upper, fore, hand = -o[f"{side}_forearm"][2], -o[f"{side}_hand"][2], s["hand"]
        tip = o[f"{side}_upper_arm"]
        places: dict[str, tuple[str, list[float]]] = {
            "asis": ("pelvis", [ahead + 0.012, y * asis / 2, up]),
            "psis": ("pelvis", [ahead - depth - 0.01, y * 0.19 * asis, up + rng.normal(0, 0.008)]),
            "thigh_wand": ("thigh", [0.0, y * 0.085, -0.62 * thigh]),
            "thigh_upper": ("thigh", [0.085, y * 0.02, -0.35 * thigh]),
            "thigh_front": ("thigh", [0.05, y * 0.075, -0.42 * thigh]),
            "thigh_lower": ("thigh", [0.055, 0.0, -0.80 * thigh]),
            "knee_lateral": ("thigh", [0.0, y * (knee + 0.010), -thigh]),
            "knee_medial": ("thigh", [0.0, -y * (knee + 0.010), -thigh]),
            "shank_wand": ("shank", [0.01, y * 0.055, -0.5 * shank]),
            "shank_upper": ("shank", [0.05, 0.0, -0.2 * shank]),
            "shank_front": ("shank", [0.045, y * 0.03, -0.42 * shank]),
            "shank_lower": ("shank", [0.035, -y * 0.01, -0.75 * shank]),
            "ankle_lateral": ("shank", [-0.008, y * 0.046, -shank - 0.008]),
            "ankle_medial": ("shank", [0.006, -y * 0.044, -shank + 0.006]),
            "heel": ("foot", [-0.26 * foot - 0.008, 0.0, -0.62 * ankle]),
            "toe": ("foot", [0.44 * foot, y * -0.008, -0.35 * ankle]),
            "toe_medial": ("foot", [0.44 * foot, -y * 0.045, -0.55 * ankle]),
            "toe_lateral": ("foot", [0.36 * foot, y * 0.052, -0.68 * ankle]),
            "head_front": ("head", [0.095, y * 0.07, 0.58 * s["head"]]),
            "head_back": ("head", [-0.075, y * 0.065, 0.56 * s["head"]]),
            "acromion": ("clavicle", [tip[0], tip[1] + y * 0.004, tip[2] + 0.052]),
            "upper_arm_wand": ("upper_arm", [0.0, y * 0.055, -rng.uniform(0.5, 0.65) * upper]),
            "upper_arm_upper": ("upper_arm", [0.03, y * 0.05, -0.35 * upper]),
            "elbow_lateral": ("upper_arm", [0.0, y * 0.042, -upper]),
            "elbow_medial": ("upper_arm", [0.0, -y * 0.042, -upper]),
            "forearm_wand": ("forearm", [0.01, y * 0.042, -rng.uniform(0.4, 0.55) * fore]),
            "wrist_radial": ("forearm", [0.036, y * 0.003, -fore]),
            "wrist_ulnar": ("forearm", [-0.036, y * 0.003, -fore]),
            "hand": ("hand", [0.006, y * 0.022, -0.45 * hand]),
        }
        for name, (segment, place) in places.items():
            where[f"{side}_{name}"] = segment if segment in ("pelvis", "head") else f"{side}_{segment}", place
    fine = ("wrist", "ankle", "heel", "toe", "head", "hand")
    return {
        name: (
            segment,
            np.array(place) + rng.normal(0, error * (0.5 if any(word in name for word in fine) else 1.0), 3),
        )
        for name, (segment, place) in where.items()
    }


def film(person: Person, q: Array, where: Places, slid: dict[str, Array]) -> dict[str, Array]:
    """Move the markers with the body: places in the world, m, each of shape (n, 3)."""
    rotations, places = pose_segments(person, q)
    return {
        name: places[segment] + np.einsum("nij,nj->ni", rotations[segment], place + slid[name])
        for name, (segment, place) in where.items()
    }


def see(rng: np.random.Generator, seen: dict[str, Array], noise: float, gaps: float) -> dict[str, Array]:
    """Let cameras look: noise that is larger along one direction, and gaps (nan).

    Parameters
    ----------
    noise : float
        Standard deviation, m.
    gaps : float
        Gaps of 8 to 50 frames expected in each marker; hands, wrists and the pelvis' front are hidden most.
    """
    out = {}
    for name, places in seen.items():
        places = places + rng.normal(0, noise, places.shape) * [1.0, 1.0, 0.7]
        often = 2.5 if any(word in name for word in ("hand", "wrist", "asis")) else 1.0
        for _ in range(rng.poisson(gaps * often)):
            start = rng.integers(20, max(21, len(places) - 80))
            places[start : start + rng.integers(8, 50)] = np.nan
        out[name] = places
    return out

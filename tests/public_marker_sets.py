"""Marker sets of other laboratories (public_marker_sets.toml) on real persons.

The points are the landmarks of real recordings. What these lack (second heels, clusters, computed points) is put beside
them; a subject's name before the labels and unlabelled points are added as real files have them.
"""

import zlib
from functools import cache
from pathlib import Path

import numpy as np

from biodance.lab.markers.sets import LANDMARKS, MarkerSet, landmark, read_marker_set, segment_of
from biodance.lab.readers import read_trial
from biodance.library import read_toml
from biodance.records import Array, Markers, Trial

SETS = read_toml(Path(__file__).with_name("public_marker_sets.toml"))
SIDES = {"R": "right", "L": "left"}
CHILDREN = ("030", "031", "032", "038", "044", "050", "055")
PREFIXES = ("Subject01:", "", "P07_", "")
SPREAD = 0.01
"""m: a second marker at one landmark is glued so far from the first (normal)."""
_LIMBS = {
    "thigh": ("hip", "knee", 0.075),
    "shank": ("knee", "ankle", 0.055),
    "foot": ("ankle", "toe", 0.03),
    "upper_arm": ("shoulder", "elbow", 0.045),
    "forearm_hand": ("elbow", "wrist", 0.035),
}
"""Segment -> its ends and how far its surface lies outside, m."""
_MIDDLES = {
    "knee": ("knee_lateral", "knee_medial"),
    "ankle": ("ankle_lateral", "ankle_medial"),
    "elbow": ("elbow_lateral", "elbow_medial"),
    "wrist": ("wrist_radial", "wrist_ulnar"),
}
_CORNERS = {
    "pelvis": ("R.asis", "L.asis", "mid_psis"),
    "trunk_head": ("R.acromion", "L.acromion", "xiphoid"),
    "thigh": ("hip_centre", "knee_lateral", "knee_medial"),
    "shank": ("knee_centre", "ankle_lateral", "ankle_medial"),
    "foot": ("heel", "toe", "ankle_lateral"),
    "upper_arm": ("acromion", "elbow_lateral", "elbow_medial"),
    "forearm_hand": ("elbow_centre", "wrist_radial", "wrist_ulnar"),
}
"""Segment -> three places that ride on it."""


def landmark_path(markers: Markers, worn: MarkerSet, place: str, side: str) -> np.ndarray | None:
    """Return the path of a landmark; iliac spines and medial markers that this recording lacks are put beside what it
    has: 45 mm from the sacral marker, 100 mm (knee), 70 mm (ankle, elbow) inside the lateral one.
    """
    found = landmark(markers, worn, f"{side}_{place}" if side else place)
    spines = [landmark(markers, worn, f"{one}_asis") for one in ("right", "left")]
    inside = {
        "psis": ("mid_psis", -0.045),
        "knee_medial": ("knee_lateral", 0.1),
        "ankle_medial": ("ankle_lateral", 0.07),
        "elbow_medial": ("elbow_lateral", 0.07),
    }
    if found is not None or place not in inside or spines[0] is None or spines[1] is None:
        return found
    beside, width = inside[place]
    base = landmark(markers, worn, beside if beside == "mid_psis" else f"{side}_{beside}")
    right = (spines[0] - spines[1]) / np.linalg.norm(spines[0] - spines[1], axis=1, keepdims=True)
    return None if base is None else base - (1.0 if side == "right" else -1.0) * width * right


class Person:
    """A recorded person: the paths of places by their names in public_marker_sets.toml."""

    def __init__(self, trial: Trial) -> None:
        assert trial.markers is not None
        self.markers, self.worn = trial.markers, read_marker_set(trial.marker_set)
        across = self.landmark("right", "asis") - self.landmark("left", "asis")
        self.width = np.linalg.norm(across, axis=1, keepdims=True)
        self.right = across / self.width
        self.ahead = np.cross([0.0, 0.0, 1.0], self.right)

    @cache  # noqa: B019 - nine persons, as long as the tests run
    def landmark(self, side: str, place: str) -> Array:
        """Return the path of a landmark, (T, 3) m; what this person lacks is put beside what there is."""
        found = landmark_path(self.markers, self.worn, place, side)
        if found is not None:
            return found
        out = self.right * (1.0 if side == "right" else -1.0)
        if place in ("toe_lateral", "toe_medial"):
            return self.landmark(side, "toe") + (0.03 if place == "toe_lateral" else -0.03) * out - 0.02 * self.ahead
        if place in ("head_front", "head_back"):
            middle = (self.landmark("right", "acromion") + self.landmark("left", "acromion")) / 2
            return middle + [0.0, 0.0, 0.25] + (0.09 if place == "head_front" else -0.08) * self.ahead
        if place == "thigh_wand":
            return 0.45 * self.joint(side, "hip") + 0.55 * self.landmark(side, "knee_lateral") + 0.07 * out
        if place == "shank_wand":
            middle = self.landmark(side, "knee_lateral") + self.landmark(side, "ankle_lateral")
            return middle / 2 + 0.03 * out
        raise KeyError(place)

    def joint(self, side: str, name: str) -> Array:
        """Return the path of about the middle of a joint, (T, 3) m."""
        if name in _MIDDLES:
            return sum(self.landmark(side, one) for one in _MIDDLES[name]) / 2
        if name == "hip":
            spines = (self.landmark("right", "asis") + self.landmark("left", "asis")) / 2
            out = self.right * (1.0 if side == "right" else -1.0)
            return spines + self.width * (0.34 * out - 0.2 * self.ahead - [0.0, 0.0, 0.32])
        return self.landmark(side, "toe") if name == "toe" else self.landmark(side, "acromion") - [0.0, 0.0, 0.04]

    def surface(self, code: str, rng: np.random.Generator) -> Array:
        """Return the path of some point on a segment, (T, 3) m."""
        if code == "pelvis":
            spine = self.landmark(str(rng.choice(["right", "left"])), "asis")
            return 0.6 * spine + 0.4 * self.landmark("", "mid_psis") + [0.0, 0.0, 0.07]
        if code == "trunk_head":
            over, ahead, high = rng.normal(0, 0.05, 3)
            middle = (self.landmark("", "c7") + self.landmark("", "xiphoid")) / 2
            return middle + over * self.right + ahead * self.ahead + [0.0, 0.0, high]
        side = SIDES[code[0]]
        upper, lower, thick = _LIMBS[code[2:]]
        share, turn = rng.uniform(0.25, 0.75), rng.uniform(-0.8, 0.8)
        out = self.right * (1.0 if side == "right" else -1.0)
        middle = (1 - share) * self.joint(side, upper) + share * self.joint(side, lower)
        return middle + thick * (np.sin(turn) * self.ahead + np.cos(turn) * out)

    def path(self, code: str, rng: np.random.Generator) -> Array:
        """Return the path of a marker, (T, 3) m: ``code`` the first of what its label may be."""
        code = code.rpartition("@")[2]
        if code == "object":
            return np.tile([0.4, 0.9, 0.7], (len(self.markers.time), 1))
        if code == "virtual":
            return self.joint("right", "hip")
        if code.endswith("_centre"):
            return self.joint(SIDES[code[0]], code[2:].removesuffix("_centre"))
        if code[1:2] == ":" or code in ("pelvis", "trunk_head"):
            return self.surface(code, rng)
        return self.landmark(SIDES[code[0]], code[2:]) if code[1:2] == "." else self.landmark("", code)

    def wears(self, place: str) -> bool:
        """Return whether this person was recorded with a marker at a landmark."""
        return place in LANDMARKS and landmark(self.markers, self.worn, place) is not None

    def frame(self, segment: str) -> tuple[Array, Array]:
        """Return a point (T, 3) m of a segment and axes (T, 3, 3) that turn with it, from three places on it."""
        side, _, limb = segment.rpartition("_") if segment in ("pelvis", "trunk_head") else segment.partition("_")
        kind = segment if segment in _CORNERS else limb
        start = "" if segment in _CORNERS else f"{side[0].upper()}."
        a, b, c = (self.path(f"{start}{place}", np.random.default_rng(0)) for place in _CORNERS[kind])
        along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
        across = np.cross(along, c - a)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        return a, np.stack([along, across, np.cross(along, across)], axis=2)


def carried(still: Person, moving: Person, place: str, path: Array) -> Array:
    """Return the path (T, 3) m of a point that a standing person was given (``path``), riding on its segment where the
    person moves.
    """
    segment = segment_of(place) if place in LANDMARKS else place
    (at, turn), (then, turned) = still.frame(segment), moving.frame(segment)
    local = np.einsum("tji,tj->ti", turn, path - at).mean(axis=0)
    return np.asarray(then + turned @ local)


def people_of(data: Path) -> dict[str, Person]:
    """Return the nine persons of BIODANCE_DATA who stand, by the name of the trial."""
    files = [
        *(data / f"biomechzoo/HC{n}A/HC{n}A01.c3d" for n in CHILDREN),
        data / "pycgm/Static_trial.c3d",
        data / "adl_gait/2014001_ST.c3d",
    ]
    return {file.stem: Person(read_trial(file)) for file in files}


@cache
def labelled(person: Person, name: str, still: Person | None = None) -> tuple[Markers, dict[str, str]]:
    """Return the recording under the labels of a set, and label -> what it may be; what was not recorded rides on its
    segment as the ``still`` person got it.
    """
    before = labelled(still, name)[0].xyz if still else None
    truth = dict(line.split(" = ") for line in SETS[name]["labels"])
    prefix = PREFIXES[zlib.crc32(name.encode()) % len(PREFIXES)]
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    columns = []
    taken: set[str] = set()
    for code in truth.values():
        place = code.split("|")[0]
        aside = rng.normal(0, SPREAD, 2) if place in taken else np.zeros(2)
        path = person.path(place, rng) + aside[0] * person.ahead + [0.0, 0.0, aside[1]]
        if still and before is not None and "virtual" not in place and place != "object":
            made_up = place in taken or not person.wears(_place(place))
            path = carried(still, person, _place(place), before[:, len(columns)]) if made_up else path
        columns.append(path)
        taken.add(place)
    junk = np.full((len(person.markers.time), 2, 3), np.nan)
    junk[: max(len(junk) // 10, 1)] = [[0.3, 0.8, 1.9], [-0.7, 0.1, 0.4]]
    xyz = np.concatenate([np.stack(columns, axis=1), junk], axis=1)
    names = tuple(prefix + label for label in truth)
    return Markers((*names, "*13", "Unlabeled 7"), person.markers.time, xyz), dict(
        zip(names, truth.values(), strict=True)
    )


def judged(code: str, got: str | None) -> str:
    """Return right, wrong or unknown for a label that marks a landmark; "" or wrong for another one."""
    may = {_place(one) for one in code.split("|")}
    is_landmark = "virtual" not in code and _place(code.split("|")[0]) in LANDMARKS
    if got is None:
        return "unknown" if is_landmark else ""
    if got in may:
        return "right" if is_landmark else ""
    on = {segment_of(one) if one in LANDMARKS else one for one in may}
    if got in on or (got.endswith("_wand") and got.removesuffix("_wand") in on):
        return "unknown" if is_landmark else ""
    return "wrong"


def _place(code: str) -> str:
    """Return the place of a code: R.asis is right_asis, R:thigh right_thigh, virtual@pelvis pelvis."""
    code = code.rpartition("@")[2]
    return f"{SIDES[code[0]]}_{code[2:]}" if code[1:2] in (".", ":") else code

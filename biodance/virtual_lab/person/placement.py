"""Where the 39 plug-in-gait markers are glued on a virtual person: on the true 16 segments, with an error per session.

Places: means of the static trials of nine adults in public recordings, moved from the 12 segments of the reading model
to the true ones. Wands (THI, TIB, UPA, FRM) sit at a different height on each side, as the guide of the marker set
asks.
"""

import numpy as np

from biodance.body.parts import SegmentMarkers
from biodance.records import Array
from biodance.virtual_lab.person.skeleton import TRUE_SEGMENTS, Proportions, on_side
from biodance.virtual_lab.tolerances import stream

MARKER_RADIUS = 0.007
"""m; 14 mm markers, the plug-in-gait default."""
SKIN_PLANE = np.array([1.0, 1.0, 0.35])
"""Placement errors are along the skin; through it (z for the lateral markers of the limbs) the bone holds the
marker.
"""

Place = tuple[str, tuple[float, float, float]]


def _paired(size: Proportions) -> dict[str, Place]:
    """Return the places (segment, (3,) m) of the markers that exist on both sides, for the right side."""
    s = size["stature"]
    shoulder = size["thorax"] - size["shoulder_drop"]
    r = MARKER_RADIUS
    return {
        "ASI": ("pelvis", (0.026 * s, 0.054 * s, size["asis"] / 2)),
        "PSI": ("pelvis", (-0.073 * s, 0.053 * s, 0.0294 * s)),
        "THI": ("thigh", (0.0, -0.66 * size["thigh"], 0.048 * s)),
        "KNE": ("thigh", (0.0, -size["thigh"], size["knee_width"] / 2 + r)),
        "TIB": ("shank", (0.0, -0.50 * size["shank"], 0.036 * s)),
        "ANK": ("shank", (0.0, -size["shank"], size["ankle_width"] / 2 + r)),
        "HEE": ("foot", (-0.0308 * s, -0.0191 * s, 0.0027 * s)),
        "TOE": ("foot", (0.0902 * s, -0.0200 * s, 0.0027 * s)),
        "FHD": ("head", (0.070 * s, 0.102 * s, 0.0315 * s)),
        "BHD": ("head", (-0.015 * s, 0.090 * s, 0.0400 * s)),
        "SHO": ("thorax", (-0.005 * s, shoulder + 0.0335 * s, size["shoulders"] / 2 - 0.004 * s)),
        "UPA": ("upper_arm", (-0.004 * s, -0.60 * size["upper_arm"], 0.029 * s)),
        "ELB": ("upper_arm", (0.0, -size["upper_arm"], size["elbow_width"] / 2 + r)),
        "FRM": ("forearm", (-0.022 * s, -0.50 * size["forearm"], 0.012 * s)),
        "WRA": ("forearm", (-0.012 * s, -0.99 * size["forearm"], 0.021 * s)),
        "WRB": ("forearm", (-0.012 * s, -0.98 * size["forearm"], -0.021 * s)),
        "FIN": ("hand", (-0.016 * s, -0.95 * size["hand"], 0.004 * s)),
    }


def _single(size: Proportions) -> dict[str, Place]:
    """Return the places of the markers on the midline and of RBAK."""
    s = size["stature"]
    shoulder = size["thorax"] - size["shoulder_drop"]
    return {
        "C7": ("thorax", (-0.034 * s, shoulder + 0.046 * s, 0.0)),
        "T10": ("thorax", (-0.058 * s, shoulder - 0.106 * s, 0.0)),
        "CLAV": ("thorax", (0.041 * s, shoulder + 0.004 * s, 0.0)),
        "STRN": ("thorax", (0.066 * s, shoulder - 0.088 * s, 0.0)),
        "RBAK": ("thorax", (-0.064 * s, shoulder - 0.022 * s, 0.060 * s)),
    }


WAND_RISE = {"THI": 0.06, "TIB": 0.05, "UPA": 0.04, "FRM": 0.03}
"""Right wands higher, left wands lower than the mean by this fraction of the segment's length."""


def ideal_places(size: Proportions) -> tuple[tuple[str, ...], tuple[int, ...], Array]:
    """Return the labels (39), their true segments (39) and their ideal places (39, 3) m in the segment frames."""
    names: list[str] = []
    segments: list[int] = []
    places: list[Array] = []
    for side, letter in (("right", "R"), ("left", "L")):
        for stem, (kind, place) in _paired(size).items():
            point = np.array(place)
            if stem in WAND_RISE:
                point[1] += WAND_RISE[stem] * size[kind] * (1.0 if side == "right" else -1.0)
            names.append(letter + stem)
            segments.append(TRUE_SEGMENTS.index(kind if kind in TRUE_SEGMENTS else f"{side}_{kind}"))
            places.append(on_side(point, side))
    for name, (kind, place) in _single(size).items():
        names.append(name)
        segments.append(TRUE_SEGMENTS.index(kind))
        places.append(np.array(place))
    return tuple(names), tuple(segments), np.array(places)


def glue_markers(size: Proportions, person_seed: int, session_seed: int, *, error: float) -> SegmentMarkers:
    """Return the markers as glued in one session.

    ``error`` m per axis: half of the variance belongs to the person (bony landmarks differ), half to the day.
    """
    names, segments, places = ideal_places(size)
    person, day = stream(person_seed, "anatomy of landmarks"), stream(person_seed, "placement", str(session_seed))
    shift = np.sqrt(0.5) * (person.normal(size=places.shape) + day.normal(size=places.shape))
    return SegmentMarkers(names, segments, places + error * SKIN_PLANE * shift, np.ones(len(names)))

"""The subject's measures that recording software writes into a C3D file: groups PROCESSING, SUBJECTS and SUBJECT, in
m and kg.
"""

import math

from biodance.lab.c3d.layout import parameter_numbers, texts
from biodance.lab.c3d.raw import RawC3d

LENGTHS = (
    *("Height", "MarkerDiameter", "InterAsisDistance", "PelvisLength"),
    *(
        side + name
        for side in "LR"
        for name in ("LegLength", "KneeWidth", "AnkleWidth", "ShoulderOffset", "ElbowWidth", "WristWidth")
    ),
    *(
        side + name
        for side in "LR"
        for name in ("HandThickness", "AsisTrocanterDistance", "FemurLength", "TibiaLength", "FootLength", "SoleDelta")
    ),
)
OTHER_NAMES = {"WEIGHT": "BODYMASS", "MASS": "BODYMASS", "STATURE": "HEIGHT", "SEX": "GENDER"}
PLAIN = ("Bodymass", "age", "gender")
_LEGAL = {"Bodymass": (2.0, 400.0), "age": (0.0, 120.0), "gender": (0.0, 1.0)}
STATURE, _LEG = (0.4, 2.6), (0.2, 1.4)
_SCALES = (1e-3, 1.0, 1e-2)
_NAMES = {"".join(name.upper()): name for name in (*LENGTHS, *PLAIN)}


def measurements_of(raw: RawC3d) -> tuple[dict[str, float], tuple[str, ...], tuple[str, ...]]:
    """Return the measures by name (lengths m, Bodymass kg, age years, gender 0 woman 1 man), history and warnings.

    Lengths are stored in mm by Vicon, in m or cm by others: the one unit in which stature and leg length are those of a
    person is taken for all of them. Zeros mean "not measured" and are left out, as is everything that a person cannot
    have.
    """
    written = {
        _NAMES[name]: value
        for name, value in _written(raw).items()
        if name in _NAMES and math.isfinite(value) and value != 0
    }
    scale = _scale(written)
    warnings: list[str] = []
    measures: dict[str, float] = {}
    for name, value in written.items():
        low, high = _LEGAL.get(name, (-0.1, STATURE[1]))
        value = value if name in PLAIN else value * scale
        if name == "Height":
            low, high = STATURE
        if low <= value <= high:
            measures[name] = value
        else:
            warnings.append(f"The file says {name} = {written[name]:g}, which a person cannot have; it was left out.")
    lengths = [name for name in measures if name not in PLAIN]
    unit = {1e-3: "mm", 1e-2: "cm", 1.0: "m"}[scale]
    history = (
        (f"{len(measures)} measures of the subject read from the file" + (f", lengths in {unit}." if lengths else "."),)
        if measures
        else ()
    )
    return measures, history, tuple(warnings)


def _written(raw: RawC3d) -> dict[str, float]:
    """Return all single numbers of the groups by upper-case name, as written."""
    found: dict[str, float] = {}
    for group in ("PROCESSING", "SUBJECTS", "SUBJECT"):
        listed = zip(
            texts(raw.parameters, group, "LABELS"), parameter_numbers(raw.parameters, group, "VALUES"), strict=False
        )
        direct = ((name, parameter_numbers(raw.parameters, group, name)) for name in raw.parameters.get(group, {}))
        pairs = [*listed, *((name, values[0]) for name, values in direct if values.size == 1)]
        for name, value in pairs:
            key = name.upper().replace("_", "").replace(" ", "").lstrip("$")
            found.setdefault(OTHER_NAMES.get(key, key), float(value))
    return found


def _scale(written: dict[str, float]) -> float:
    """Return metres per unit of the lengths: the unit that makes stature, else leg length, a person's; mm if neither
    is there.
    """
    for name, (low, high) in (("Height", STATURE), ("LLegLength", _LEG), ("RLegLength", _LEG)):
        if name in written:
            fitting = [scale for scale in _SCALES if low <= written[name] * scale <= high]
            if fitting:
                return fitting[0]
    return _SCALES[0]

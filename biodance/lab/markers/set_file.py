"""Read and check one marker-set file: every entry is legal or the file is refused with the entry's name."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from biodance.errors import BiodanceError
from biodance.library import read_toml
from biodance.records import SIDES

MARKED_SEGMENTS = (
    "pelvis",
    *(f"{side}_{part}" for side in SIDES for part in ("thigh", "shank", "foot")),
    "trunk_head",
    *(f"{side}_{part}" for side in SIDES for part in ("upper_arm", "forearm_hand")),
)
"""The 12 segments that a marker can sit on."""

_SIDED = (
    "asis psis hip_centre knee_lateral knee_medial ankle_lateral ankle_medial thigh_wand shank_wand knee_axis heel toe "
    "toe_lateral toe_medial acromion elbow_lateral elbow_medial wrist_radial wrist_ulnar hand"
)
LANDMARKS = (
    *(f"{side}_{name}" for side in SIDES for name in _SIDED.split()),
    *("mid_psis", "c7", "t10", "jugular_notch", "xiphoid", "head_front", "head_back"),
)
"""The anatomical landmarks that joint centres, scaling and contact ask for."""
MIDLINE = ("mid_psis", "head_front", "head_back")
"""Landmarks that may be the mean of several markers in a map."""

_MARKED = {
    "pelvis": "asis psis hip_centre mid_psis",
    "thigh": "knee_lateral knee_medial thigh_wand knee_axis",
    "shank": "ankle_lateral ankle_medial shank_wand",
    "foot": "heel toe toe_lateral toe_medial",
    "trunk_head": "acromion c7 t10 jugular_notch xiphoid head_front head_back",
    "upper_arm": "elbow_lateral elbow_medial",
    "forearm_hand": "wrist_radial wrist_ulnar hand",
}
_SEGMENT_OF = {landmark: segment for segment, some in _MARKED.items() for landmark in some.split()}
"""The segment that a marker on a landmark sits on, without its side."""

_NORMALISERS = "asis_width foot_length thigh_length shank_length upper_arm_length forearm_length trunk_length stature"
"""Body measures in m: joint centre to joint centre for the limbs, heel to toe tip for the foot, mid shoulder to mid
hip for the trunk.
"""
_ORIGINS = ("segment", "mid_shoulder")
_MARKER_KEYS = ("segment", "weight", "offset", "normaliser", "origin", "corner_of")
_FILE_KEYS = ("name", "description", "source", "required", "aliases", "markers", "landmarks", "map")


@dataclass(frozen=True)
class SetMarker:
    """One marker of a set.

    ``weight`` >= 0 multiplies its squared residual; ``offset`` (3,) times the body measure ``normaliser`` (m) is its
    place in the segment frame (x anterior, y up, z right) relative to ``origin``: "segment" (the segment's own origin)
    or "mid_shoulder" (the middle of the two shoulder joint centres). ``offset`` is None where no generic place is
    known: such a marker exists only once a static trial places it. ``corner_of``: the three markers of a knee alignment
    device that stands in for this one in the static trial.
    """

    label: str
    segment: str
    weight: float = 1.0
    offset: tuple[float, float, float] | None = None
    normaliser: str = ""
    origin: str = "segment"
    corner_of: tuple[str, ...] = ()


@dataclass(frozen=True)
class Contents:
    """The checked contents of a file; ``markers`` by label."""

    description: str
    source: str
    required: tuple[str, ...]
    aliases: dict[str, str]
    markers: dict[str, SetMarker]
    landmarks: dict[str, tuple[tuple[str, ...], ...]]


def parse_marker_set(path: Path) -> Contents:
    """Read and check a marker-set file; a ``[map]`` of labels to landmarks or segments (`parse_map`) is the short form
    of ``[markers]`` and ``[landmarks]``.

    Raises
    ------
    BiodanceError
        The file is missing, is not TOML or breaks a rule: unknown key, segment, landmark, normaliser or label, a marker
        without segment, an offset without normaliser, a negative weight.
    """
    table = read_toml(path)
    _legal(path, "key", tuple(table), _FILE_KEYS)
    for name in ("aliases", "markers", "landmarks", "map"):
        if not isinstance(table.get(name, {}), dict):
            raise BiodanceError(f"{path}: [{name}] must be a table. Write [{name}] and one line per entry below it.")
    short = parse_map(table["map"], str(path)) if table.get("map") else None
    markers = {label: _marker(path, label, fields) for label, fields in table.get("markers", {}).items()}
    markers |= short.markers if short else {}
    if not markers:
        raise BiodanceError(f"{path}: the set has no marker. Write one line per marker under [markers].")
    required = tuple(_labels(path, "required", table.get("required", []), markers))
    if not required:
        raise BiodanceError(
            f"{path}: 'required' is empty, so every file would be taken for this set. List the labels that must be "
            f"there."
        )
    aliases = table.get("aliases", {})
    _labels(path, "[aliases]", list(aliases.values()), markers)
    twice = [alias for alias in aliases if alias in markers]
    if twice:
        raise BiodanceError(
            f"{path}: {', '.join(twice)} stands under [aliases] and under [markers]. Keep one of the two."
        )
    landmarks = table.get("landmarks", {})
    _legal(path, "landmark", tuple(landmarks), LANDMARKS)
    chosen = short.landmarks if short else {}
    chosen |= {name: _alternatives(path, name, value, markers) for name, value in landmarks.items()}
    description, source = (str(table.get(key, "")) for key in ("description", "source"))
    return Contents(description, source, required, dict(aliases), markers, chosen)


def read_map(path: Path) -> Contents:
    """Read ``[markers] map`` of a session.toml; see `parse_map`.

    Raises
    ------
    BiodanceError
        There is no map, or it names a landmark or segment that does not exist.
    """
    table = read_toml(path).get("markers")
    given = table.get("map") if isinstance(table, dict) else None
    if not isinstance(given, dict) or not given:
        raise BiodanceError(
            f'{path}: [markers] has no map. Write map = {{LABEL = "left_asis", ...}}, one label per landmark.'
        )
    return parse_map(given, str(path))


def parse_map(given: Mapping[str, Any], path: str) -> Contents:
    """Return the marker set of a map: which label of the recordings is which landmark, or merely sits on which
    segment; ``path`` names where it stands.

    Several labels on a landmark of the midline are its mean, and both posterior iliac spines together are ``mid_psis``.
    Landmarks of the pelvis must be in a recording (the first label, without one); the others may be left out.

    Raises
    ------
    BiodanceError
        It names a landmark or segment that does not exist.
    """
    markers: dict[str, SetMarker] = {}
    landmarks: dict[str, tuple[tuple[str, ...], ...]] = {}
    for label, place in given.items():
        if place not in (*LANDMARKS, *MARKED_SEGMENTS):
            legal = f"landmarks {', '.join(LANDMARKS)}; segments {', '.join(MARKED_SEGMENTS)}"
            raise BiodanceError(
                f"{path}: [markers] map says {label} = {place!r}, which is no landmark and no segment. Legal are "
                f"{legal}."
            )
        if place in landmarks and place not in MIDLINE:
            raise BiodanceError(
                f"{path}: [markers] map gives {place} to {landmarks[place][0][0]} and to {label}. Keep one of the two."
            )
        markers[label] = SetMarker(label, place if place in MARKED_SEGMENTS else segment_of(place))
        if place in LANDMARKS:
            landmarks[place] = ((*landmarks.get(place, ((),))[0], label),)
    if "mid_psis" not in landmarks and {"left_psis", "right_psis"} <= landmarks.keys():
        landmarks["mid_psis"] = ((*landmarks["left_psis"][0], *landmarks["right_psis"][0]),)
    pelvis = tuple(names[0][0] for place, names in landmarks.items() if segment_of(place) == "pelvis")
    required = pelvis or tuple(markers)[:1]
    return Contents("labels of the session's own", path, required, {}, markers, landmarks)


def segment_of(landmark: str) -> str:
    """Return the segment that a marker on a landmark sits on."""
    side, _, part = landmark.rpartition("_") if landmark.startswith("mid") else landmark.partition("_")
    segment = _SEGMENT_OF.get(landmark) or _SEGMENT_OF[part]
    return f"{side}_{segment}" if f"{side}_{segment}" in MARKED_SEGMENTS else segment


def part_of(landmark: str) -> str:
    """Return a landmark without its side."""
    return landmark.partition("_")[2] if landmark.startswith(SIDES) else landmark


def other_side(name: str) -> str:
    """Return the same landmark or segment of the other side."""
    side, _, part = name.partition("_")
    return f"{'left' if side == 'right' else 'right'}_{part}"


def other_end(landmark: str) -> str | None:
    """Return the landmark at the other end of the joint; None for a landmark that is not one of two ends."""
    joint, _, end = landmark.rpartition("_")
    return {"lateral": f"{joint}_medial", "medial": f"{joint}_lateral"}.get(end)


def _legal(path: Path, kind: str, found: tuple[str, ...], legal: tuple[str, ...]) -> None:
    wrong = [name for name in found if name not in legal]
    if wrong:
        raise BiodanceError(f"{path}: {wrong[0]!r} is not a {kind} of a marker set. Legal: {', '.join(legal)}.")


def _labels(path: Path, where: str, value: Any, markers: Collection[str]) -> list[str]:
    """Check that ``value`` is a list of labels of this set."""
    if not isinstance(value, list) or not all(isinstance(label, str) for label in value):
        raise BiodanceError(f"{path}: {where} is {value!r}, expected a list of marker labels.")
    unknown = [label for label in value if label not in markers]
    if unknown:
        raise BiodanceError(
            f"{path}: {where} names {unknown[0]!r}, which is not under [markers]. Add the marker or correct the label."
        )
    return value


def _alternatives(path: Path, name: str, value: Any, markers: Collection[str]) -> tuple[tuple[str, ...], ...]:
    if not isinstance(value, list) or not value or not all(isinstance(labels, list) and labels for labels in value):
        raise BiodanceError(
            f'{path}: landmark {name} is {value!r}, expected lists of labels, for example [["LPSI", "RPSI"], ["SACR"]].'
        )
    return tuple(tuple(_labels(path, f"landmark {name}", labels, markers)) for labels in value)


def _marker(path: Path, label: str, fields: Any) -> SetMarker:
    """Return one marker after checking its entry."""
    where = f"{path}: marker {label}"
    if not isinstance(fields, dict) or "segment" not in fields:
        raise BiodanceError(f"{where} has no segment. Write segment = one of {', '.join(MARKED_SEGMENTS)}.")
    for key, legal in (("segment", MARKED_SEGMENTS), ("normaliser", _NORMALISERS.split()), ("origin", _ORIGINS)):
        if key in fields and fields[key] not in legal:
            raise BiodanceError(f"{where} has the {key} {fields[key]!r}. Legal: {', '.join(legal)}.")
    unknown = [key for key in fields if key not in _MARKER_KEYS]
    if unknown:
        raise BiodanceError(f"{where} has the unknown key {unknown[0]!r}. Legal: {', '.join(_MARKER_KEYS)}.")
    weight = fields.get("weight", 1.0)
    if not _number(weight) or weight < 0:
        raise BiodanceError(f"{where} has the weight {weight!r}, expected a number >= 0.")
    if ("offset" in fields) != ("normaliser" in fields):
        raise BiodanceError(
            f"{where} has an offset without normaliser or a normaliser without offset. Give both or neither."
        )
    corner_of = fields.get("corner_of", [])
    if corner_of and not (isinstance(corner_of, list) and len(corner_of) == 3):
        raise BiodanceError(f"{where} has corner_of {corner_of!r}, expected the three labels of an alignment device.")
    offset = fields.get("offset")
    if offset is not None and not (isinstance(offset, list) and len(offset) == 3 and all(_number(x) for x in offset)):
        raise BiodanceError(
            f"{where} has the offset {offset!r}, expected three numbers [x, y, z] (anterior, up, right)."
        )
    place = None if offset is None else tuple(float(x) for x in offset)
    said = {"offset": place, "corner_of": tuple(map(str, corner_of)), "weight": float(weight)}
    return SetMarker(label, **{**fields, **said})


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e6

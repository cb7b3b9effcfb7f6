"""What Vicon Nexus knows beside the recording: measurements (.mp), skeleton (.vsk), Eclipse notes on a trial (.enf).

Lengths come in millimetres and masses in kilograms; here they leave in metres and kilograms, under the names of the C3D
PROCESSING group (``Bodymass``, ``Height``, ``LLegLength`` ...). Angles are left out: they are results of the static
trial, not measures of the person.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree

from biodance.errors import FileRefused
from biodance.lab.plain_text import decode, parse_number, read_bytes, read_text

_MILLIMETRE = 1e-3
_MASSES = ("bodymass",)
ANGLES = re.compile(r"torsion|rotation|plantflex|rotoff|abadd|headoffset|^theta$|^beta$|angle", flags=re.IGNORECASE)
_NOT_MEASURES = re.compile(r"usefloorff|hindfootflat|^(?:subject)?(?:name|id)$", flags=re.IGNORECASE)
_SIDE = re.compile(r"^(Left|Right)(?=[A-Z])")


def read_mp(path: str | Path) -> dict[str, float]:
    """Return the measurements of an .mp file, rows such as ``$Bodymass = 66.2``: by name, in m and kg.

    Rows that hold no number (a name, a comment) are passed over; zeros mean "not measured" and are left out.

    Raises
    ------
    FileRefused
        Missing, empty, binary, or without a single ``$Name = number``.
    """
    path = Path(path)
    rows = re.findall(r"^\s*\$(\w+)\s*=\s*([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*$", read_text(path), flags=re.MULTILINE)
    if not rows:
        raise FileRefused(
            f"{path}: holds no row such as '$Bodymass = 66.2'. Save the subject's measurements again in Nexus."
        )
    return _in_si({name: parse_number(value.replace(",", "."), f"{path}, {name}") for name, value in rows})


def read_vsk(path: str | Path) -> dict[str, float]:
    """Return the measurements that were typed into a .vsk skeleton (its static parameters with a value): by name, in m
    and kg.

    ``LeftLegLength`` is called ``LLegLength`` here, as in .mp and C3D files. Values that Nexus computes (read-only) are
    left out.

    Raises
    ------
    FileRefused
        Missing, empty, no XML, or no Vicon skeleton.
    """
    path = Path(path)
    text = decode(read_bytes(path), path)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise FileRefused(f"{path}: declares XML entities, which no Vicon skeleton does. Export it again from Nexus.")
    try:
        root = ElementTree.fromstring(re.sub(r"^\s*<\?xml.*?\?>", "", text, flags=re.DOTALL))
    except ElementTree.ParseError as error:
        raise FileRefused(f"{path}: is not valid XML ({error}). Export the skeleton again from Nexus.") from error
    if root.tag != "KinematicModel":
        raise FileRefused(
            f"{path}: its root is <{root.tag}>, a Vicon skeleton begins with <KinematicModel>. Export it again from "
            f"Nexus."
        )
    typed: dict[str, float] = {}
    for parameter in root.iter("StaticParameter"):
        name, value = parameter.get("NAME", ""), parameter.get("VALUE", "")
        computed = parameter.get("READONLY", "").lower() in ("1", "true")
        if name and value and not computed and parameter.get("QUANTITY", "length") in ("length", "mass"):
            typed[name] = parse_number(value, f"{path}, {name}")
    return _in_si(typed)


@dataclass(frozen=True)
class EclipseNotes:
    """What the operator noted on a trial in Vicon Eclipse.

    ``trial`` name without ending; ``type`` such as "Static" or "Dynamic" ("" = not said); ``description`` the
    condition; ``notes`` free text; ``plates`` what the operator found of each plate, ``FP1`` -> "Auto", "Left", "Right"
    or "Invalid"; ``fields`` everything else.
    """

    trial: str
    type: str = ""
    description: str = ""
    notes: str = ""
    plates: Mapping[str, str] = field(default_factory=dict)
    fields: Mapping[str, str] = field(default_factory=dict)


def read_enf(path: str | Path) -> EclipseNotes:
    """Return the notes of one ``<trial>.Trial.enf`` (or ``<trial>.Trial12.enf``) file; a file without any entry gives
    empty notes.

    The rows are taken as they come (a note may hold any character), the encoding is found by itself, keys count without
    case.

    Raises
    ------
    FileRefused
        Missing, empty or binary.
    """
    path = Path(path)
    fields: dict[str, str] = {}
    node_type = ""
    section = ""
    for row in read_text(path).splitlines():
        if found := re.match(r"\s*\[(.*)\]\s*$", row):
            section = found[1].strip().upper()
        elif "=" in row:
            key, value = (part.strip() for part in row.split("=", 1))
            if section == "NODE INFORMATION" and key.upper() == "TYPE":
                node_type = value  # the kind of the node (TRIAL, SESSION), not of the trial
            else:
                fields[key.upper()] = value
    plates = {key: fields.pop(key) for key in sorted(fields) if re.fullmatch(r"FP\d+", key)}
    kind = fields.pop("TYPE", "") or fields.pop("TRIAL_TYPE", "")
    if not kind and node_type.upper() not in ("TRIAL", "SESSION", "SUBJECT", "PROJECT", "PATIENT"):
        kind = node_type
    trial = re.sub(r"(?:\.Trial\d*)?\.enf$", "", path.name, flags=re.IGNORECASE)
    said = (fields.pop("DESCRIPTION", ""), fields.pop("NOTES", ""))
    return EclipseNotes(trial, kind, *said, MappingProxyType(plates), MappingProxyType(fields))


def _in_si(values: dict[str, float]) -> dict[str, float]:
    """Return lengths (m) and masses (kg) by the names of the PROCESSING group, no angles, flags and zeros."""
    measures: dict[str, float] = {}
    for name, value in values.items():
        short = _SIDE.sub(lambda side: side[1][0], name)
        if value == 0 or ANGLES.search(short) or _NOT_MEASURES.search(short):
            continue
        measures[short] = value if short.lower() in _MASSES else value * _MILLIMETRE
    return measures

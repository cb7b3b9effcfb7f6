"""Which points of a C3D file are no markers: results of a model in the recording software (Vicon stores angles and forces as points)."""

import re
from collections import Counter
from collections.abc import Sequence

from biodance.lab.c3d_layout import texts
from biodance.lab.c3d_parameters import Parameters

GROUPS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS", "MODELED_MARKERS")
"""Parameters of POINT in which the results are listed; POINT:TYPE_GROUPS may name more."""

RESULT = re.compile(r"(Angles?|Forces?|Moments?|Powers?|GRF|Cent(re|er)OfMass(Floor)?)$")
BONE = re.compile(r"(?P<bone>.{3,})[OALP]$")
UNLABELLED = re.compile(r"^(\*\d*|[Uu]\d+|[Uu]nlabell?ed.*|[Uu]ncertain.*)?$")


def split_label(label: str) -> tuple[str, str]:
    """Return prefix ("" = none) and name of a label such as ``Subject:LASI``."""
    prefix, colon, name = label.rpartition(":")
    return (prefix.strip(), name.strip()) if colon else ("", label.strip())


def model_outputs(labels: Sequence[str], parameters: Parameters) -> tuple[int, ...]:
    """Return the columns that hold results of a model: listed in a group of POINT, named like one (``LKneeAngles``), or bone axes.

    The axes of a bone are four points whose names differ in the last letter: origin, anterior, lateral, proximal (``PELO``, ``PELA`` ...).
    """
    declared = {group.upper() for group in texts(parameters, "POINT", "TYPE_GROUPS")[::2]} - {"MARKERS", "LABELS"}
    listed = {label for group in declared | set(GROUPS) for label in texts(parameters, "POINT", group)}
    listed |= {split_label(label)[1] for label in listed}
    bones = Counter(match["bone"] for label in set(labels) if (match := BONE.match(label)))
    found = []
    for column, label in enumerate(labels):
        name, bone = split_label(label)[1], BONE.match(label)
        if {label, name} & listed or RESULT.search(name) or (bone and bones[bone["bone"]] == 4):
            found.append(column)
    return tuple(found)


def unlabelled(labels: Sequence[str]) -> tuple[int, ...]:
    """Return the columns without a name, or with the name that software gives to unlabelled trajectories (``*115``)."""
    return tuple(column for column, label in enumerate(labels) if UNLABELLED.match(split_label(label)[1]))

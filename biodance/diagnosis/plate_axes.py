"""Findings dressed for the reader: with the effects themselves, and channels in the axes of their plate, as the
amplifier and the maker's software call them.
"""

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from biodance.diagnosis.diagnosis import Diagnosis, Finding
from biodance.effects import Cause
from biodance.records import Plate

_CHANNEL = re.compile(r"(?:(?P<plate>plate\w*):)?(?P<first>[FM][xyz])(?:->(?P<second>[FM][xyz]))?$")
_ALONG = np.cos(np.radians(20.0))
"""Cosine from which on an axis of the laboratory is one of the plate's."""


def of_family(one: Diagnosis, family: Mapping[str, Cause]) -> Diagnosis:
    """Return the diagnosis whose findings hold their effects of the ``family`` that was asked: what is known of one
    that was given as an object stands nowhere else.
    """

    def known(finding: Finding) -> Finding:
        alike = tuple(replace(alias, kind=family.get(alias.effect)) for alias in finding.set)
        return replace(finding, kind=family.get(finding.effect), set=alike)

    return replace(one, findings=tuple(map(known, one.findings)), resembles=tuple(map(known, one.resembles)))


def in_plate_axes(target: str, plates: tuple[Plate, ...]) -> str:
    """Return in words what the channels of a ``target`` (``Fx``, ``plate2:Fz->My``) are in their plate's own axes; ""
    where they have the same names there, or the target has no channel.

    A plate's x axis points from its second corner to its first, y from the fourth to the first (C3D manual).
    """
    found = _CHANNEL.match(target)
    plate = next((one for one in plates if found and found["plate"] in (None, one.name)), None)
    if found is None or plate is None:
        return ""
    names = [name for name in (found["first"], found["second"]) if name]
    own = [_own(name, plate) for name in names]
    if own == names:
        return ""
    return f"In the axes of {plate.name} itself: {' into '.join(own)}."


def with_plate_axes(findings: tuple[Finding, ...], plates: tuple[Plate, ...]) -> tuple[Finding, ...]:
    """Return findings whose advice says their channels in the plate's own axes, too, whoever found them."""
    said = [in_plate_axes(one.target, plates) for one in findings]
    return tuple(
        replace(one, advice=f"{one.advice} {text}".strip()) if text and text not in one.advice else one
        for one, text in zip(findings, said, strict=True)
    )


def _own(channel: str, plate: Plate) -> str:
    """Return a channel of the laboratory by the plate's axes, with its sign; both where it lies between two."""
    x, y = plate.corners[0] - plate.corners[1], plate.corners[0] - plate.corners[3]
    axes = np.stack([x / np.linalg.norm(x), y / np.linalg.norm(y)])
    axes = np.vstack([axes, np.cross(*axes)])
    along = axes @ np.eye(3)["xyz".index(channel[1])]
    order = np.argsort(-np.abs(along).round(6), kind="stable")  # half-way between two, x comes first
    kept = order[:1] if abs(along[order[0]]) >= _ALONG else order[:2]
    parts = [f"{'-' if along[k] < 0 else ''}{channel[0]}{'xyz'[k]}" for k in kept]
    return " and ".join(parts)

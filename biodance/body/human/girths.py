"""What girths say about masses: the mean person of a survey reshaped to the tape, one more opinion beside the table.

A part's mass is what all tables and studies give the mean person of a survey of girths, times the volume of the part's
stack of stadium solids over that of the mean person's: density and the place of cuts enter only by how they differ
between people. Its standard deviation: that of the mean of the tables, of the solid, of the tape.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from biodance.body.human.fractions import MAN, WOMAN, mean_fraction
from biodance.body.human.skeleton import SEGMENTS, Skeleton, kind_of
from biodance.body.stadium import stadium_stack
from biodance.body.tables.anthropometry import read_table, row_numbers
from biodance.body.tables.de_leva import PARTS
from biodance.body.tables.de_leva import parts as table_parts
from biodance.body.tables.error_sizes import error_size
from biodance.body.tables.reference import Reference, Sex
from biodance.errors import SessionRefused
from biodance.lab.girths import legal_girths, usual_girths
from biodance.records import Subject

_CONTRADICTION = 0.15
"""Share of the body mass by which the girths may miss it."""
_TRUNK = ("pelvis", "trunk_head")
_HEAD = 0.16
"""Of the stature: from the middle of the neck to the vertex."""
_STEP = 0.01
"""Of a girth: the step of a difference quotient."""


@dataclass(frozen=True, eq=False)
class PartSolid:
    """One part of a person: ``ratio`` of its volume to the mean person's, ``sd`` relative, of what the tape leaves
    uncertain in it, ``said`` by which girths.
    """

    ratio: float
    sd: float
    said: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class SegmentOpinion:
    """What girths say about one segment: ``mass`` kg with ``mass_sd``, ``said`` by which of them."""

    mass: float
    mass_sd: float
    said: tuple[str, ...]


def girth_opinions(reference: Reference, skeleton: Skeleton, subject: Subject) -> dict[str, SegmentOpinion]:
    """Return what the subject's girths say, by segment; segments of which no girth was measured are not in it.

    Raises
    ------
    SessionRefused
        A girth is not known or impossible, or all together miss the body mass by more than 15 %.
    """
    girths = legal_girths(subject.girths)
    found = {segment: _opinion(segment, reference, skeleton, subject, girths) for segment in SEGMENTS}
    opinions = {segment: one for segment, one in found.items() if one.said}
    total = sum(one.mass for one in found.values())
    if abs(total / subject.mass - 1) > _CONTRADICTION:
        raise SessionRefused(_contradiction(total, found, reference, subject))
    return opinions


def _contradiction(total: float, found: Mapping[str, SegmentOpinion], reference: Reference, subject: Subject) -> str:
    over = {
        segment: one.mass - reference.segments[kind_of(segment)].mass * subject.mass
        for segment, one in found.items()
        if one.said
    }
    worst = max(over, key=lambda segment: abs(over[segment]))
    return (
        f"[subject] girths_cm: the girths make a body of {total:.1f} kg, but the body mass is {subject.mass:.1f} kg "
        f"({100 * (total / subject.mass - 1):+.0f} %, at most {100 * _CONTRADICTION:.0f} % is believed). Farthest from "
        f"the table: {worst} by {over[worst]:+.1f} kg ({', '.join(found[worst].said)}). Measure these girths again, or "
        f"correct mass_kg."
    )


def _opinion(
    segment: str, reference: Reference, skeleton: Skeleton, subject: Subject, girths: Mapping[str, float]
) -> SegmentOpinion:
    kind, side = kind_of(segment), segment.removesuffix(kind_of(segment))
    mine = {name: girths.get(f"{side}{name}", girths.get(name)) for name in usual_girths()}
    person = {kind_of(one): length for one, length in skeleton.lengths.items() if one.startswith(side)}
    survey = read_table("human", "girths").provenance["people"]["mass_kg"][subject.sex]
    mean, mean_sd = mean_fraction(kind, MAN if subject.sex == "M" else WOMAN)
    shape, survey_sd = (error_size("solid_mass", what) for what in ("trunk" if kind in _TRUNK else "limb", "survey"))
    own = np.linalg.norm([mean_sd, shape, survey_sd])
    mass = variance = 0.0
    said: tuple[str, ...] = ()
    for part, share in _shares(kind, subject.sex).items():
        solid = _part_solid(part, reference, subject, person | {"stature": skeleton.stature}, mine)
        if solid is None:
            one, sd = share * reference.segments[kind].mass * subject.mass, error_size("solid_mass", "untold part")
        else:
            one, sd = share * mean * survey * solid.ratio, np.hypot(own, solid.sd)
            said += tuple(name for name in solid.said if name not in said)
        mass, variance = mass + one, variance + (one * sd) ** 2
    return SegmentOpinion(mass, float(np.sqrt(variance)), said)


def _shares(kind: str, sex: Sex) -> dict[str, float]:
    """Return the parts of a segment that tapes go round, with their shares in its mass (de Leva 1996); from navel to
    neck is one.
    """
    masses = {part: lump.mass for part, lump in table_parts(sex).items()}
    shares: dict[str, float] = {}
    for part in PARTS[kind]:
        name = "upper_trunk" if part == "middle_trunk" else part
        shares[name] = shares.get(name, 0.0) + masses[part] / sum(masses[one] for one in PARTS[kind])
    return shares


def _part_length(part: str, reference: Reference, sizes: Mapping[str, float]) -> float:
    """Return the length of a part, m, of somebody of these lengths (by kind of segment) and ``stature``."""
    cut = reference.lengths["pelvis"] / reference.lengths["trunk_head"]
    trunk = {"lower_trunk": cut, "upper_trunk": 1 - cut}
    if part in trunk:
        return trunk[part] * sizes["trunk_head"]
    return _HEAD * sizes["stature"] if part == "head" else sizes["forearm_hand" if part == "forearm" else part]


def _part_solid(
    part: str, reference: Reference, subject: Subject, sizes: Mapping[str, float], girths: Mapping[str, float | None]
) -> PartSolid | None:
    """Return a part's stacks; None where no girth of it was measured or no tape goes round it.

    A girth that was not measured is the mean person's times the geometric mean of the measured ones' ratios.
    """
    table = read_table("human", "girths")
    rows = table.where(part=part)
    given = np.array([girths[row["girth"]] is not None for row in rows])
    if not given.any():
        return None
    level, aspect, usual = np.array([row_numbers(row, f"level aspect {subject.sex}") for row in rows]).T
    measured = np.array([girths[row["girth"]] or one for row, one in zip(rows, usual, strict=True)])
    predict = np.where(given[:, None], np.eye(len(rows)), given / given.sum())
    girth = usual * np.exp(predict @ np.log(measured / usual))
    grown = table.provenance["people"]["stature_m"][subject.sex] / reference.stature
    people = {kind: grown * length for kind, length in reference.lengths.items()}
    length = _part_length(part, reference, sizes)
    usual_length = _part_length(part, reference, people | {"stature": grown * reference.stature})
    volume = stadium_stack(level, girth, aspect, length=length).mass
    mean = stadium_stack(level, usual, aspect, length=usual_length).mass
    more = [girth * np.exp(_STEP * one) for one in np.eye(len(rows))]
    slope = np.array([np.log(stadium_stack(level, one, aspect, length=length).mass / volume) / _STEP for one in more])
    tape, untold = error_size("girth", "tape"), error_size("girth", "untold")
    covariance = predict @ np.diag(given * tape**2) @ predict.T + np.diag(~given * untold**2)
    said = tuple(row["girth"] for row, is_given in zip(rows, given, strict=True) if is_given)
    return PartSolid(volume / mean, float(np.sqrt(slope @ covariance @ slope)), said)

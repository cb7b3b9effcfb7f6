"""The frozen records that every stage of biodance speaks.

Conventions, everywhere behind the reader: SI units (m, kg, s, N, N·m, rad); lab frame with z up; wrenches are the
ground's action ON the subject, about the lab origin, force first; time is the first axis; NaN means "not seen". Arrays
are copied, checked for shape at birth and read-only afterwards; change a record with ``dataclasses.replace``.
"""

from biodance.records.arrays import (
    CHANNEL_TITLES,
    CHANNELS,
    Array,
    Index,
    Mask,
    any_coordinate,
    assign,
    by_name,
    freeze,
    frozen_array,
    grouped,
    lengths_of,
    longest_run,
    runs,
    spread_frames,
)
from biodance.records.attention import LeftOut
from biodance.records.motion import AngleSpan, AngleState, Motion
from biodance.records.session import ROLES, SIDES, FootSizes, Role, Session, Sip, Subject, Trial, side_in_name
from biodance.records.wrench import Defect, FootEvent, LeftOutSpan, Markers, Plate, Source, Wrench

__all__ = [
    "CHANNELS",
    "CHANNEL_TITLES",
    "ROLES",
    "SIDES",
    "AngleSpan",
    "AngleState",
    "Array",
    "Defect",
    "FootEvent",
    "FootSizes",
    "Index",
    "LeftOut",
    "LeftOutSpan",
    "Markers",
    "Mask",
    "Motion",
    "Plate",
    "Role",
    "Session",
    "Sip",
    "Source",
    "Subject",
    "Trial",
    "Wrench",
    "any_coordinate",
    "assign",
    "by_name",
    "freeze",
    "frozen_array",
    "grouped",
    "lengths_of",
    "longest_run",
    "runs",
    "side_in_name",
    "spread_frames",
]

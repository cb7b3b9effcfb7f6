"""What an analyst may choose: one frozen record, checked at birth, that travels with every trial and stands whole in
every result.

A setting is said in ``[settings]`` of session.toml, by ``--set filter.cutoff=6``, or when a session is read; it has a
unit, a meaning and a legal range, which ``biodance settings`` prints. What the readers decide by (signs, zeros, units
of plates) is no choice: see `COP_FORCE` and `TOUCH_FORCE`. This is also the one place of standard gravity.
"""

from biodance.settings.groups import (
    COP_FORCE,
    STANDARD_GRAVITY,
    TOUCH_FORCE,
    CheckLimits,
    ContactRules,
    FilterKind,
    FilterSettings,
    GapSettings,
    Hip,
    Setting,
    StandingRules,
    Value,
)
from biodance.settings.settings import USUAL, Settings, assignments

__all__ = [
    "COP_FORCE",
    "STANDARD_GRAVITY",
    "TOUCH_FORCE",
    "USUAL",
    "CheckLimits",
    "ContactRules",
    "FilterKind",
    "FilterSettings",
    "GapSettings",
    "Hip",
    "Setting",
    "Settings",
    "StandingRules",
    "Value",
    "assignments",
]

"""What is said of a cause: what it is for the analyst's page, and how a person is told of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum


@dataclass(frozen=True)
class About:
    """``what`` a cause is, its ``signature``, its ``look_alikes`` and what it is ``settled_by``, each a few sentences
    of the analyst's page.
    """

    what: str = ""
    signature: str = ""
    look_alikes: str = ""
    settled_by: str = ""


class SessionEntry(StrEnum):
    """What of session.toml takes a cause off."""

    EXCHANGE = "exchange"
    """Labels exchanged, in the trials and spans where they are."""
    CHANNELS = "channels"
    """Channels of two plates exchanged, in all trials."""
    MASS = "mass_kg"
    """The mass as weighed."""


@dataclass(frozen=True)
class CauseWords:
    """How a cause is told: the ``fact`` about {it} with its {size} and the interval {between}, {more} where it is
    positive, {opposite} the other side; what to ``do``; its name as an ``alternative``; the two words of {more};
    ``signs`` what a positive and a negative size mean where the number stands alone; ``places`` what {it} is called by
    the end of its target, where that is not its name; what of session.toml takes it off (``entry``; None = nothing).
    """

    fact: str
    do: str
    alternative: str
    more: tuple[str, str] = ("", "")
    signs: tuple[str, str] = ("", "")
    places: Mapping[str, str] = field(default_factory=dict)
    entry: SessionEntry | None = None

    def called(self, target: str) -> str:
        """Return the target as it is told: ``left leg below the knee``; unchanged where it has no name of its own."""
        side, _, end = target.partition("_")
        return f"{side} {self.places[end]}" if end in self.places else target


class CheckKind(StrEnum):
    """Checks of a session that a cause may explain, by the beginning of their names."""

    WEIGHT = "mass on the plates"
    PRESSURE = "centre of mass off the centre of pressure"
    MARKERS = "marker distance"
    FORCES = "force difference"


ACCEPT = "{accept}."
"""Ends what to do where the correction may be accepted instead, once it is proven."""
CALIBRATE = f"Calibrate the plate{ACCEPT}"
MEASURE_CORNERS = f"Measure its corners{ACCEPT}"
RECORD_AGAIN = "Correct it, and run this again."
TOO_MUCH = ("much", "little")

"""What somebody wears for good or for the day, as session.toml says it: a prosthesis by the segment that it begins
with, devices in kg by the segment that carries them.
"""

from collections.abc import Mapping

from biodance.errors import SessionRefused, UnknownName
from biodance.lab.markers.sets import MARKED_SEGMENTS

_LIMBS = tuple(name for name in MARKED_SEGMENTS if name.startswith(("right_", "left_")))
_HEAVIEST = 30.0
"""kg that a device may weigh: more is in grams, or no device."""


def legal_prosthesis(segment: str | None) -> str:
    """Return the segment that a prosthesis begins with, "" for None.

    Raises
    ------
    SessionRefused
        It is no segment of an arm or leg; the message lists them.
    """
    if segment and segment not in _LIMBS:
        told = UnknownName.of("segment of an arm or leg, below whose joint the prosthesis is", segment, _LIMBS)
        raise SessionRefused(f"[subject] prosthesis: {told}")
    return segment or ""


def legal_devices(given: Mapping[str, float]) -> dict[str, float]:
    """Return what is worn, kg by segment.

    Raises
    ------
    SessionRefused
        There is no such segment, or the mass is none of a device.
    """
    for segment, mass in given.items():
        if segment not in MARKED_SEGMENTS:
            raise SessionRefused(f"[devices] {UnknownName.of('segment', segment, MARKED_SEGMENTS)}")
        if not 0 < mass <= _HEAVIEST:
            raise SessionRefused(
                f"[devices] {segment} = {mass:g} kg is no device. Legal: above 0 and at most {_HEAVIEST:g} kg."
            )
    return dict(given)

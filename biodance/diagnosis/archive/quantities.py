"""What one recording says of a plate, in numbers that need no body model, and which quantities there are."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from biodance.errors import UnknownName


@dataclass(frozen=True)
class Quantity:
    """One thing about a plate that is followed over time.

    Parameters
    ----------
    name, unit : str
        ``place_x`` and its unit.
    effect, target : str
        Name in `biodance.effects` of the cause of a wrong value, and where on the plate.
    typical : float
        Usual standard deviation from visit to visit in a laboratory without fault: where an archive of few visits
        starts from.
    matters : float
        Smaller changes are listed, but are no finding.
    norm : float
        Standard deviation of what is expected of a plate without fault, the same in all visits of a laboratory (where
        it puts its toe marker): it blurs the level, not a change.
    """

    name: str
    unit: str
    effect: str
    target: str
    typical: float
    matters: float
    norm: float = 0.0

    def __post_init__(self) -> None:
        if not self.typical > 0:
            raise ValueError(f"Quantity {self.name}: typical = {self.typical} must be positive.")


QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        one.name: one
        for one in (
            Quantity("place_x", "m", "plate_position", "x", 0.003, 0.003, 0.004),
            Quantity("place_y", "m", "plate_position", "y", 0.003, 0.003, 0.004),
            Quantity("gain", "1", "plate_gain", "Fz", 0.003, 0.01),
            Quantity("offset_x", "N", "plate_offset", "Fx", 0.5, 2.0),
            Quantity("offset_y", "N", "plate_offset", "Fy", 0.5, 2.0),
            Quantity("offset_z", "N", "plate_offset", "Fz", 0.5, 2.0),
            Quantity("delay", "s", "time_delay", "", 0.002, 0.004, 0.003),
        )
    }
)
"""By name; typical sizes from docs/benchmarks/plates.md (seven real visits of one laboratory) and the re-zeroing rules of
laboratory guides (+-5 N).
"""


@dataclass(frozen=True)
class LabVisit:
    """One visit of one person: its ``name``, the ``person``, and the ``date`` (ISO 8601, "" = not known)."""

    name: str
    person: str
    date: str = ""


@dataclass(frozen=True)
class PlateEvidence:
    """What one trial says of one quantity.

    Parameters
    ----------
    quantity : str
        Of `QUANTITIES`.
    plates : mapping
        Which plates read it, and with which share: a person who stands with one foot on each of two plates says half of
        each gain. Usually ``{"plate1": 1.0}``.
    value, sd : float
        In the quantity's unit; ``sd`` is what another trial of the same visit may differ by.
    visit : LabVisit
        Whose.
    trial : str
        Its name.
    conditions : mapping
        What the trial was (``surface`` -> ``Foam``), where trials of one visit differ in it.
    witness : str
        What saw it.
    taken_off : bool
        The reader saw it on the empty plate and subtracted it: results do not suffer.
    """

    quantity: str
    plates: Mapping[str, float]
    value: float
    sd: float
    visit: LabVisit
    trial: str
    conditions: Mapping[str, str] = field(default_factory=dict)
    witness: str = ""
    taken_off: bool = False

    def __post_init__(self) -> None:
        if self.quantity not in QUANTITIES:
            raise UnknownName.of("quantity of a plate", self.quantity, QUANTITIES)
        if not self.sd > 0:
            raise ValueError(f"PlateEvidence {self.quantity} of {self.trial}: sd = {self.sd} must be positive.")


def in_order(observations: Iterable[PlateEvidence]) -> tuple[LabVisit, ...]:
    """Return the visits, each once, by date where all have one, else by name."""
    visits = set(one.visit for one in observations)
    dated = all(visit.date for visit in visits)
    return tuple(sorted(visits, key=lambda visit: (visit.date if dated else "", visit.name)))

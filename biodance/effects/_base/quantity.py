"""What of a cause is followed from visit to visit in an archive of recordings."""

from dataclasses import dataclass


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
    share : float
        Of the alarms that chance may raise: more where evidence is thin.
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
    share: float
    norm: float = 0.0

    def __post_init__(self) -> None:
        if self.typical <= 0:
            raise ValueError(f"Quantity {self.name}: typical = {self.typical} must be positive.")

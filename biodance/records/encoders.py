"""What the encoders of a robot recorded."""

from dataclasses import dataclass

from biodance.records.arrays import Array, assign, check_time, frozen_array, rate_of


@dataclass(frozen=True, eq=False)
class Encoders:
    """Joint angles over time, on the robot's own clock.

    Parameters
    ----------
    time : array_like
        (T,) s.
    joints : tuple of str
        (n) names.
    angle : array_like
        (T, n) rad.
    notes : tuple of str
        What was decided on reading.
    """

    time: Array
    joints: tuple[str, ...]
    angle: Array
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        time = check_time(self.time, "Encoders")
        angle = frozen_array(self.angle, (time.size, len(self.joints)), "Encoders.angle")
        assign(self, time=time, joints=tuple(self.joints), angle=angle, notes=tuple(self.notes))

    @property
    def rate(self) -> float:
        """Hz, mean."""
        return rate_of(self.time)

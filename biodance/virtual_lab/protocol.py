"""What the subject is asked to do: postures, steps and trials (the file format is explained in ``protocol_file``)."""

from dataclasses import dataclass, field

from biodance.records import Role

FIELDS: dict[str, tuple[float, ...]] = {
    "pelvis": (0.0, 0.0, 0.0),
    "trunk": (0.0, 0.0, 0.0),
    "head": (0.0, 0.0, 0.0),
    "right_arm": (0.0, -14.0, 10.0, 15.0),
    "left_arm": (0.0, -14.0, 10.0, 15.0),
    "right_leg": (0.0, 0.0, 0.0, 0.0, 0.0),
    "left_leg": (0.0, 0.0, 0.0, 0.0, 0.0),
    "depth": (0.0,),
    "lean": (0.0, 0.0),
    "shift": (0.5,),
}
"""Every field of a posture with its value in "stand"."""
STANCES = ("parallel", "right_forward")


@dataclass(frozen=True)
class Posture:
    """One posture: ``values`` by field (degrees; depth as a fraction, lean in m, shift as a share); ``raised`` feet ("right", "left")."""

    name: str
    values: dict[str, tuple[float, ...]]
    raised: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Step:
    """Go to a posture in ``move`` s and hold it for ``hold`` s, or go there and back ``cycles`` times, ``period`` s each."""

    to: Posture
    move: float = 1.0
    hold: float = 0.5
    cycles: int = 0
    period: float = 1.0

    @property
    def duration(self) -> float:
        """Seconds of the whole step; cycles start up over one period and end over another."""
        return (self.cycles + 1) * self.period + self.hold if self.cycles else self.move + self.hold


@dataclass(frozen=True)
class TrialPlan:
    """One trial of a protocol: ``lead`` seconds of standing before and after the ``steps``."""

    name: str
    role: Role
    stance: str
    steps: tuple[Step, ...]
    lead: float = 1.0

    @property
    def duration(self) -> float:
        """Planned length of the recording, s."""
        return 2 * self.lead + sum(step.duration for step in self.steps)


@dataclass(frozen=True)
class Protocol:
    """A named sequence of trials; ``postures`` by name includes "stand"."""

    name: str
    description: str
    trials: tuple[TrialPlan, ...]
    postures: dict[str, Posture] = field(default_factory=dict)


STAND = Posture("stand", dict(FIELDS))
"""Upright, knees nearly straight, arms slightly away from the body."""

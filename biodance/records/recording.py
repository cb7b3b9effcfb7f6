"""What is known of a recording beside its samples: where it came from, what was wrong in it, what is left out of it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True)
class Source:
    """Where a trial came from.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    sha256 : str
        Of its bytes.
    format : str
        What it was read as.
    rate, analog_rate : float
        Hz; NaN = none.
    first_frame : int
        Its number in the file.
    """

    path: Path
    sha256: str
    format: str
    rate: float = float("nan")
    analog_rate: float = float("nan")
    first_frame: int = 1


@dataclass(frozen=True)
class Defect:
    """What was wrong in a recording and was left out when it was read.

    Parameters
    ----------
    effect : str
        The cause, by its name among the effects (``dead_plate``).
    target : str
        Where: a plate (``plate1``); "" for the whole recording.
    text : str
        What was seen and done, one plain sentence.
    size : float
        Of it, NaN = none.
    unit : str
        Of the size.
    """

    effect: str
    target: str
    text: str
    size: float = float("nan")
    unit: str = ""


@dataclass(frozen=True)
class LeftOutSpan:
    """Seconds ``start`` to ``end`` of a trial that the analyst leaves out: of one ``side`` its cycles, of "" all cycles
    and the forces.
    """

    start: float
    end: float
    side: str = ""

    def __str__(self) -> str:
        return f"{self.start:g} to {self.end:g} s{f' ({self.side})' if self.side else ''}"


@dataclass(frozen=True)
class FootEvent:
    """``time`` s on the clock of the trial; ``side`` "right" or "left"; ``down`` True where the foot comes down (a
    strike), False where it leaves (an off); ``source`` "force" where a plate saw it, "markers" where the movement of
    the feet tells it, "hand" where session.toml says it.
    """

    time: float
    side: str
    down: bool
    source: Literal["force", "markers", "hand"] = "force"

"""The log of a visit that the page of a dance saved (``report/templates/visit.js``): which postures were danced, how
often, how long they were held, which were left out or made easier, and how far the joints went for the camera.
"""

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from biodance.dance.dance import MOST_POSTURES, Dance
from biodance.errors import FileRefused
from biodance.library import parse_json, refuse_large, refuse_special

PATTERN = "dance_log*.json"
"""Names of logs beside the recordings of a visit."""
_Percent = Annotated[float, Field(ge=0, le=100)]
_Degrees = Annotated[float, Field(ge=-360, le=360)]


class LoggedPosture(BaseModel):
    """A posture of a visit: its ``number`` on the cards, how many ``times`` it was danced, ``held_s`` s in all, whether
    it was ``skipped`` or made ``easier`` (half of the way), what of its information the camera saw (percent) and how
    far the joints went (degrees by name); None where no camera saw it.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    number: int = Field(ge=1, le=MOST_POSTURES)
    times: int = Field(ge=0, le=1000)
    held_s: float = Field(ge=0, le=36000)
    skipped: bool
    easier: bool
    told_percent: _Percent | None
    reached_deg: dict[str, _Degrees] | None


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    biodance_dance_log: Literal[1]
    dance: str = Field(max_length=200)
    mark: str = Field(max_length=8)
    begun: datetime
    camera: bool
    speed: float = Field(gt=0, le=2)
    postures: tuple[LoggedPosture, ...] = Field(max_length=MOST_POSTURES)
    known_percent: dict[str, _Percent] | None


@dataclass(frozen=True)
class VisitLog:
    """One log: its ``file``, when it was ``begun``, whether a ``camera`` looked on, whether it is of the ``same`` dance
    as was asked for, and its ``postures``.
    """

    file: str
    begun: datetime
    camera: bool
    same: bool
    postures: tuple[LoggedPosture, ...]

    def numbers(self, what: Literal["skipped", "easier", "repeated"]) -> tuple[int, ...]:
        """Return the numbers of the postures that were left out, made easier or danced more than once."""
        found = {
            "skipped": [one.skipped for one in self.postures],
            "easier": [one.easier for one in self.postures],
            "repeated": [one.times > 1 for one in self.postures],
        }[what]
        return tuple(one.number for one, yes in zip(self.postures, found, strict=True) if yes)


def read_visit_logs(folder: Path, dance: Dance) -> tuple[VisitLog, ...]:
    """Return the logs of a visit's ``folder`` (`PATTERN`), oldest first.

    Raises
    ------
    FileRefused
        A file of that name is no log; the message says what in it is not legal.
    """
    logs = []
    for path in sorted(Path(folder).glob(PATTERN)):
        refuse_special(path)
        refuse_large(path, 2**22)  # bytes: a hundred times a log of forty postures
        try:
            found = _File.model_validate(parse_json(path.read_text(encoding="utf-8")))
        except (ValueError, ValidationError) as error:
            why = " ".join(str(error).split())[:300]
            raise FileRefused(
                f"{path}: is no log of a dance ({why}). Keep only files that the page of a dance saved, or rename it."
            ) from error
        logs.append(VisitLog(path.name, found.begun, found.camera, found.mark == dance.mark, found.postures))
    return tuple(sorted(logs, key=lambda log: log.begun.timestamp()))

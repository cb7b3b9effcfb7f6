"""The file of a laboratory, lab.toml: its accepted corrections, its own tolerances, the bands of its people."""

from dataclasses import dataclass, replace
from pathlib import Path

from biodance.cycles.curves import NormalCurve, normal_of
from biodance.errors import BiodanceError, FileRefused
from biodance.lab.corrections import (
    PlateCorrection,
    corrected_session,
    corrections_text,
    joined_corrections,
    read_corrections,
)
from biodance.library import read_toml
from biodance.records import Session
from biodance.uncertainty.tolerances import Tolerances, tolerances_of

LAB = "lab.toml"
"""Name under which it is written."""


@dataclass(frozen=True, eq=False)
class LabFile:
    """What a lab.toml says: ``corrections`` of the plates, ``tolerances`` of the laboratory's own or None, and the
    ``normal`` bands of its people.
    """

    corrections: tuple[PlateCorrection, ...] = ()
    tolerances: Tolerances | None = None
    normal: tuple[NormalCurve, ...] = ()

    def corrected(self, session: Session) -> Session:
        """Return a session as read, corrected."""
        return corrected_session(session, self.corrections) if self.corrections else session


NO_LAB = LabFile()


def read_lab(path: str | Path | None) -> LabFile:
    """Return what the file of a laboratory says; nothing without a file.

    Raises
    ------
    FileRefused
        It cannot be read, or says what cannot be corrected.
    """
    if path is None:
        return NO_LAB
    corrections = read_corrections(path)
    whole = read_toml(Path(path))
    raw, where = whole.get("tolerances"), "norms"
    try:
        norms = {name: (float(one["value"]), float(one["sd"])) for name, one in whole.get("norms", {}).items()}
        where = "tolerances"
        known, where = replace(tolerances_of(raw), norms=norms) if raw else None, "normal"
        return LabFile(corrections, known, normal_of(whole.get("normal", {})))
    except (KeyError, TypeError, ValueError, BiodanceError) as error:
        raise FileRefused(f"{path}: [{where}] is not what `biodance learn` writes ({error}).") from error


def lab_text(earlier: tuple[PlateCorrection, ...], accepted: tuple[PlateCorrection, ...]) -> str:
    """Return the lab.toml that holds what was corrected ``earlier`` and what lasts of what was ``accepted``; "" for
    nothing.
    """
    lasting = tuple(one for one in accepted if one.fault.lasting)
    return corrections_text(joined_corrections(earlier, lasting))

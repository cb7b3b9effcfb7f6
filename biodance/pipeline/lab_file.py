"""lab.toml: accepted corrections, tolerances, bands of people; nothing out of range is believed of a stranger's."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from biodance.cycles.scores import DeviationReference, NormalCurve, deviation_of, normal_of
from biodance.effects import FAMILY
from biodance.errors import BiodanceError, FileRefused
from biodance.lab.plates import faults
from biodance.library import read_toml
from biodance.records import Session
from biodance.uncertainty.tolerances import Tolerances, shipped, tolerances_of

LAB = "lab.toml"
"""Name under which it is written."""
PLUG_IN_GAIT = "normal_plug_in_gait"
"""Its table of the bands of plug-in gait's own angles."""


@dataclass(frozen=True, eq=False)
class HealthyReference:
    """Bands (``normal``; plug-in gait's ``beside``), and ``deviation`` of the index, None if too few tell it."""

    normal: tuple[NormalCurve, ...] = ()
    beside: tuple[NormalCurve, ...] = ()
    deviation: DeviationReference | None = None


@dataclass(frozen=True, eq=False)
class LabFile(HealthyReference):
    """What a lab.toml says: ``corrections`` of the plates, own ``tolerances`` or None, and the reference."""

    corrections: tuple[faults.PlateCorrection, ...] = ()
    tolerances: Tolerances | None = None

    def corrected(self, session: Session) -> Session:
        """Return a session as read, corrected."""
        return faults.corrected_session(session, self.corrections) if self.corrections else session


NO_LAB = LabFile()


def read_lab(path: str | Path | None) -> LabFile:
    """Return what the file of a laboratory says; nothing without a file. Raises FileRefused: it cannot be read, or says
    what cannot be corrected.
    """
    if path is None:
        return NO_LAB
    corrections = faults.read_corrections(path)
    whole = read_toml(Path(path))
    if fault := lab_fault(whole):
        raise FileRefused(f"{path}: {fault}. Give a lab.toml that biodance learn or diagnose --accept wrote.")
    raw, where = whole.get("tolerances"), "norms"
    try:
        norms = {name: (float(one["value"]), float(one["sd"])) for name, one in whole.get("norms", {}).items()}
        where = "tolerances"
        known, where = replace(tolerances_of(raw), norms=norms) if raw else None, "normal"
        normal, where = normal_of(whole.get("normal", {})), PLUG_IN_GAIT
        beside, where = normal_of(whole.get(PLUG_IN_GAIT, {})), "gait_deviation_index"
        return LabFile(normal, beside, deviation_of(whole.get("gait_deviation_index")), corrections, known)
    except (KeyError, TypeError, ValueError, BiodanceError) as error:
        raise FileRefused(f"{path}: [{where}] is not what `biodance learn` writes ({error}).") from error


def lab_text(earlier: tuple[faults.PlateCorrection, ...], accepted: tuple[faults.PlateCorrection, ...]) -> str:
    """Return the lab.toml of ``earlier`` corrections and of those ``accepted`` that last; "" for nothing."""
    lasting = tuple(one for one in accepted if one.fault.lasting)
    return faults.corrections_text(faults.joined_corrections(earlier, lasting))


Positive = Annotated[float, Field(gt=0, le=1e6)]
Finite = Annotated[float, Field(ge=-1e12, le=1e12)]
_Row = Annotated[list[Finite], Field(min_length=6, max_length=6)]
_Squares = Annotated[list[Annotated[float, Field(gt=0, le=1e12)]], Field(min_length=6, max_length=6)]
_PerCent = Annotated[list[float], Field(min_length=2, max_length=101)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Instruments(_Table):
    camera_m: Positive | None = None
    plate_n_per_root_hz: Annotated[list[Positive], Field(max_length=6)] = []
    marker_distance_m: Positive | None = None
    skin_m: Annotated[list[Positive], Field(max_length=100)] = []
    swing_m: Annotated[list[Positive], Field(max_length=100)] = []


class _Tolerances(_Table):
    origin: Annotated[str, Field(max_length=10_000)]
    movement: list[_Squares] = Field(max_length=100)
    noise: list[Annotated[list[_Row], Field(min_length=6, max_length=6)]] = Field(max_length=100)
    sizes: dict[str, Annotated[float, Field(ge=0, le=1e6)]] = {}
    means: dict[str, Finite] = {}
    # Written until 2026-11-29, of no use since:
    threshold: Annotated[float, Field(ge=0, le=1e4)] = 0.0
    accuracy: dict[str, Annotated[float, Field(ge=0, le=10)]] = {}
    instruments: _Instruments = _Instruments()


class _Norm(_Table):
    value: Finite
    sd: Positive
    between_sessions_sd: Annotated[float, Field(ge=0, le=1e12)] = 0.0
    unit: str = ""
    sessions: int = Field(1, ge=0)
    observations: int = Field(1, ge=0)


class _Band(_Table):
    """NaN where less than two people are known."""

    unit: str
    people: int = Field(ge=1)
    mean: _PerCent
    sd: _PerCent


class _Deviation(_Table):
    """Of the gait deviation index: features (k, 459), the healthy (k,), mean and sd of their distance's logarithm."""

    basis: Annotated[list[Annotated[list[Finite], Field(min_length=459, max_length=459)]], Field(max_length=459)]
    control: Annotated[list[Finite], Field(max_length=459)]
    mean: Finite
    sd: Positive


class _Laboratory(_Table):
    learned_utc: Any = None
    archive: str = ""
    sessions: list[str] = []


class LabContents(_Table):
    """The tables of a lab.toml; ``corrections`` are checked where they are made (`lab.plates.faults`)."""

    laboratory: _Laboratory = _Laboratory()
    corrections: dict[str, Any] = {}
    tolerances: _Tolerances | None = None
    norms: dict[str, _Norm] = {}
    normal: dict[str, _Band] = {}
    normal_plug_in_gait: dict[str, _Band] = {}
    gait_deviation_index: _Deviation | None = None


def lab_fault(raw: dict[str, Any]) -> str:
    """Return the first thing in a lab.toml that is not legal, in words: where, value and what is legal; "" for none."""
    try:
        LabContents.model_validate(raw)
    except ValidationError as error:
        one = error.errors()[0]
        place = ".".join(str(part) for part in one["loc"])
        if one["type"] == "extra_forbidden":
            return f"[{place}] is nothing that biodance learn writes"
        return f"{place} = {repr(one['input'])[:60]}: {one['msg'][0].lower()}{one['msg'][1:]}"
    known = {*(key.split()[0] for key in shipped().sizes), *FAMILY.members()}
    sizes = raw.get("tolerances", {}).get("sizes", {})
    strange = next((key for key in sizes if not {*key.split()[:1]} & known), None)
    return "" if strange is None else f"tolerances.sizes: {strange[:60]!r} is the size of nothing that is known"

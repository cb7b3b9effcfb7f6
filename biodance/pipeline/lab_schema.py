"""What a lab.toml may say, with the range of every number: nothing else of a stranger's file is believed."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

Positive = Annotated[float, Field(gt=0, le=1e6)]
Finite = Annotated[float, Field(ge=-1e12, le=1e12)]
_Row = Annotated[list[Finite], Field(min_length=6, max_length=6)]
_Squares = Annotated[list[Annotated[float, Field(ge=0, le=1e12)]], Field(min_length=6, max_length=6)]
_Words = Annotated[str, Field(max_length=10_000)]
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
    origin: _Words
    threshold: Annotated[float, Field(ge=0, le=1e4)]
    energy: list[_Squares] = Field(max_length=100)
    energy_sd: list[_Squares] = Field(max_length=100)
    noise: list[Annotated[list[_Row], Field(min_length=6, max_length=6)]] = Field(max_length=100)
    sizes: dict[str, Annotated[float, Field(ge=0, le=1e6)]] = {}
    means: dict[str, Finite] = {}
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


class _Laboratory(_Table):
    learned_utc: Any = None
    archive: str = ""
    sessions: list[str] = []


class LabContents(_Table):
    """The tables of a lab.toml; ``corrections`` are checked where they are made (`lab.corrections`)."""

    laboratory: _Laboratory = _Laboratory()
    corrections: dict[str, Any] = {}
    tolerances: _Tolerances | None = None
    norms: dict[str, _Norm] = {}
    normal: dict[str, _Band] = {}


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
    return ""

"""What a dance.npz may say, with the range of everything: nothing else of a stranger's file is believed."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from biodance.library import parse_json
from biodance.records import Array

LARGEST = 2**26
"""Bytes of a dance.npz, unpacked: a thousand times a dance of forty postures."""
MOST_POSTURES, LONGEST = 1000, 3600.0
"""Postures of a dance, and s that it lasts: what nobody performs."""
_FAR = 10.0
"""m: nothing of a dance is farther from the lab origin."""
Metres = Annotated[float, Field(ge=-_FAR, le=_FAR, allow_inf_nan=False)]
_Grip = Annotated[float, Field(allow_inf_nan=True)]
"""m, NaN = a free hand."""
_Foot = Annotated[int, Field(ge=0, le=1)]


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class StanceWords(_Entry):
    """A `Stance`."""

    name: str = Field(max_length=200)
    ankle: list[list[Metres]]
    planted: list[_Foot] = Field(max_length=2)
    soles: list[list[list[Metres]]]
    share: float = Field(1.0, gt=0, le=1, allow_inf_nan=False)
    props: list[list[Metres]] = []
    seat: float = Field(0.0, ge=0, le=3, allow_inf_nan=False)
    over: _Foot | None = None
    hands: list[list[_Grip]]
    hanging: list[_Foot] = Field(default_factory=list, max_length=2)


class PersonWords(_Entry):
    """A `Subject`, of whom a dance knows no more; what is not known is left out."""

    mass: float = Field(float("nan"), gt=0, le=1000)
    stature: float = Field(float("nan"), gt=0, le=3)
    sex: Literal["F", "M"]
    age: float = Field(float("nan"), ge=0, le=120)


class MarginWords(_Entry):
    """A `Margin`."""

    limit: str = Field(max_length=200)
    worst: float = Field(allow_inf_nan=False)
    where_s: float = Field(allow_inf_nan=True)
    unit: str = Field(max_length=20)
    what: str = Field("", max_length=200)


class DanceWords(_Entry):
    """All of them."""

    biodance_dance: Literal[1]
    protocol: str = Field(max_length=200)
    seed: int
    notes: list[str] = []
    subject: PersonWords | None = None
    names: list[str] = Field([], max_length=MOST_POSTURES)
    mirrored: list[int] = Field([], max_length=MOST_POSTURES)
    plate: tuple[Annotated[float, Field(gt=0, le=_FAR)], Annotated[float, Field(gt=0, le=_FAR)]] | None = None
    unsafe: list[MarginWords] = Field([], max_length=MOST_POSTURES)
    stances: list[StanceWords] = Field(max_length=MOST_POSTURES)
    under: list[StanceWords] = Field(max_length=MOST_POSTURES)


def read_words(text: str) -> dict[str, Any]:
    """Return the words of a dance as `Dance` takes them.

    Raises
    ------
    ValueError
        They are no JSON, or something in them is out of its range: says which, its value and what is legal.
    """
    return DanceWords.model_validate(parse_json(text)).model_dump(exclude_unset=True)


def possible_array(name: str, array: Array) -> Array:
    """Return one of the arrays of a dance.

    Raises
    ------
    ValueError
        It is too long, or holds what is no number or no duration.
    """
    if array.ndim < 1 or len(array) > MOST_POSTURES or array.dtype != np.float64:
        raise ValueError(f"{name}: {array.shape} of {array.dtype}; legal are up to {MOST_POSTURES} rows of float64")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: {array[~np.isfinite(array)][0]} is no number")
    if name in ("hold", "move") and array.size and (array.min() < 0 or array.sum() > LONGEST):
        raise ValueError(f"{name}: {array.min():g} to {array.max():g} s; legal are 0 to {LONGEST:g} s in all")
    return array

"""The Dance: postures held for a while, moves between them, and where the feet stand meanwhile; its file, of which
nothing is believed that is out of range. Planted legs are not written but solved in closed form from the feet.
"""

import json
import zlib
from dataclasses import asdict, dataclass, fields
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from biodance import display
from biodance.body.body import Body, body_text, parse_body
from biodance.dance.limits import Margin
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.splines import Phase, path_in, phase_at
from biodance.dance.problem.stance import Stance
from biodance.dance.problem.state import State, close_legs
from biodance.errors import BiodanceError, FileRefused
from biodance.lab.plain_text import whole_file
from biodance.library import parse_json, refuse_large, refuse_special
from biodance.records import SIDES, Array, Motion, Subject, freeze
from biodance.threads import Sendable

if TYPE_CHECKING:
    import pandas as pd

MOST_POSTURES, LONGEST = 1000, 3600.0
"""Postures of a dance, and s that it lasts: what nobody performs."""
_FAR = 10.0  # m: nothing of a dance is farther from the lab origin
Metres = Annotated[float, Field(ge=-_FAR, le=_FAR, allow_inf_nan=False)]
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
    hands: list[list[Annotated[float, Field(allow_inf_nan=True)]]]  # m, NaN = a free hand
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
    care: list[str] = Field([], max_length=MOST_POSTURES)
    rest: float | None = Field(None, gt=0, allow_inf_nan=False)
    stances: list[StanceWords] = Field(max_length=MOST_POSTURES)
    under: list[StanceWords] = Field(max_length=MOST_POSTURES)


def _stance_words(stance: Stance) -> dict[str, Any]:
    """Return a stance in words that JSON knows."""
    found = {one.name: getattr(stance, one.name) for one in fields(stance)}
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in found.items()}


_ARRAYS = ("postures", "hold", "via", "move")


def possible_array(name: str, array: Array) -> Array:
    """Return one of the `_ARRAYS` of a dance; ValueError where it is too long, or holds no numbers or no durations."""
    if array.ndim < 1 or len(array) > MOST_POSTURES or array.dtype != np.float64:
        raise ValueError(f"{name}: {array.shape} of {array.dtype}; legal are up to {MOST_POSTURES} rows of float64")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: {array[~np.isfinite(array)][0]} is no number")
    if name in ("hold", "move") and array.size and (array.min() < 0 or array.sum() > LONGEST):
        raise ValueError(f"{name}: {array.min():g} to {array.max():g} s; legal are 0 to {LONGEST:g} s in all")
    return array


_GIVE = "Give the dance.npz that biodance dance wrote, or its folder."


_chain_of = lru_cache(maxsize=4)(Chain)


@dataclass(frozen=True, eq=False)
class Dance(Sendable):
    """One continuous movement: postures held for a while, and moves between them.

    Parameters
    ----------
    protocol : str
        Its name.
    body : Body
        Whose it is.
    postures : array_like
        (P, n) coordinates of the chain, m and rad.
    stances : tuple
        (P) the feet during each hold, with ``over`` set for postures that only carry the weight to the next feet.
    hold : array_like
        (P,) s.
    via : array_like
        (P - 1, 2, n) via points of the moves.
    move : array_like
        (P - 1,) s that each takes.
    under : tuple
        (P - 1) the feet meanwhile.
    seed : int
        Of the random numbers.
    notes : tuple of str
        What differs from the plan because a move was impossible.
    subject : Subject or None
        For whom it was designed; None for a robot.
    names : tuple of str
        (P) what each posture is called, where it is made of known ones; else empty.
    mirrored : tuple of int
        Postures that are the one before them with right and left exchanged.
    plate : tuple of float or None
        Force plate from side to side and ahead, m, on which all feet were set; None any.
    unsafe : tuple of Margin
        Limits of which people who copy it imprecisely leave too little; empty where it is safe, or nobody was asked.
    care : tuple of str
        Who stands beside, when to rest, when to stop, in sentences.
    rest : float or None
        s of dancing after which the person rests; None at no time.

    Examples
    --------
    >>> dance = biodance.Dance.load("dance.npz")
    >>> dance
    Dance('one_segment', 2 postures, 4 s)
    """

    protocol: str
    body: Body
    postures: Array
    stances: tuple[Stance, ...]
    hold: Array
    via: Array
    move: Array
    under: tuple[Stance, ...]
    seed: int
    notes: tuple[str, ...] = ()
    subject: Subject | None = None
    names: tuple[str, ...] = ()
    mirrored: tuple[int, ...] = ()
    plate: tuple[float, float] | None = None
    unsafe: tuple[Margin, ...] = ()
    care: tuple[str, ...] = ()
    rest: float | None = None

    def __post_init__(self) -> None:
        count, size = np.shape(self.postures)
        freeze(self, "Dance", postures=(count, size), hold=(count,), via=(count - 1, 2, size), move=(count - 1,))
        if not (len(self.stances) == len(self.under) + 1 == count) or size != self.chain.size:
            raise BiodanceError(
                f"Dance: {count} postures of {size} coordinates, {len(self.stances)} stances and {len(self.under)} "
                f"moves do not fit "
                f"together; expected as many stances as postures, one move less, and {self.chain.size} coordinates."
            )

    def __repr__(self) -> str:
        return f"Dance({self.protocol!r}, {len(self.postures)} postures, {self.duration:.0f} s)"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table(), self.notes)

    def table(self) -> "pd.DataFrame":
        """Return one row for each posture that is held.

        Returns
        -------
        pandas.DataFrame
            Index posture; start (s), hold (s), feet on the ground, then as `Motion.table`: root and joint angles (deg).

        Examples
        --------
        >>> dance.table()["start (s)"].to_list(), dance.table()["feet"].to_list()
        ([0.0, 3.0], ['right and left', 'right and left'])
        """
        import pandas as pd

        held = [phase for phase in self.phases if phase.kind == "hold"]
        x = np.concatenate([self.state(phase, np.array([phase.start])).x for phase in held])
        out = self.chain.motion(np.array([phase.start for phase in held]), x, *np.zeros((2, *x.shape))).table()
        out.insert(0, "start (s)", out.index.to_numpy())
        out.insert(1, "hold (s)", [phase.end - phase.start for phase in held])
        out.insert(2, "feet", [" and ".join(SIDES[foot] for foot in phase.stance.planted) or "none" for phase in held])
        return out.set_index(pd.Index([phase.posture for phase in held], name="posture"))

    @cached_property
    def chain(self) -> Chain:
        """The coordinates in which the dance is written."""
        return _chain_of(self.body)

    @property
    def mark(self) -> str:
        """By which a log of a visit knows this dance: eight digits that another dance hardly has."""
        parts = (self.postures, self.via, self.hold, self.move)
        return f"{zlib.crc32(b''.join(np.round(part, 6).tobytes() for part in parts)):08x}"

    @property
    def duration(self) -> float:
        """Duration of the whole dance, s."""
        return float(self.hold.sum() + self.move.sum())

    @property
    def counted(self) -> NDArray[np.bool_]:
        """(P,) bool, False for postures in between: weight over one foot of two, and stops not held as long."""
        return np.array([stance.over is None for stance in self.stances]) & (self.hold == self.hold.max())

    @cached_property
    def phases(self) -> tuple[Phase, ...]:
        """Holds and moves in turn; holds of no duration are left out."""
        out, now = [], 0.0
        for p, stance in enumerate(self.stances):
            if p:
                out.append(Phase(now, now := now + float(self.move[p - 1]), "move", self.under[p - 1], p))
            if self.hold[p] > 0:
                out.append(Phase(now, now := now + float(self.hold[p]), "hold", stance, p))
        return tuple(out)

    def state(self, phase: Phase, time: Array) -> State:
        """Return the coordinates at instants of one phase.

        Parameters
        ----------
        phase : Phase
            One of `phases`.
        time : numpy.ndarray
            (T,) s of the dance, within the phase.

        Returns
        -------
        State
            Coordinates of the chain with derivatives, (T, n).

        Examples
        --------
        >>> import numpy as np
        >>> dance.state(dance.phases[0], np.array([0.0, 0.5])).x.shape
        (2, 29)
        """
        return close_legs(self.chain, phase.stance, *path_in(phase, self.postures, self.via, time))

    def motion(self, rate: float) -> Motion:
        """Return the whole dance, holds included, from 0 to its end.

        Parameters
        ----------
        rate : float
            Samples per second, Hz.

        Returns
        -------
        Motion
            Of the body.

        Raises
        ------
        BiodanceError
            The rate is not positive.

        Examples
        --------
        >>> dance.motion(100.0)
        Motion(23 joint angles, 401 frames at 100 Hz, 4.00 s)
        """
        if not rate > 0:
            raise BiodanceError(f"A dance cannot be sampled at {rate:g} Hz; give a positive rate, for example 100.")
        time = np.arange(round(self.duration * rate) + 1) / rate
        x, v, a = np.empty((3, len(time), self.chain.size))
        owner = phase_at(self.phases, time)
        for k, phase in enumerate(self.phases):
            rows = owner == k
            if rows.any():
                state = self.state(phase, time[rows])
                x[rows], v[rows], a[rows] = state.x, state.v, state.a
        return self.chain.motion(time, x, v, a)

    def save(self, path: str | Path) -> None:
        """Write the dance, its body included, as an npz file.

        Parameters
        ----------
        path : str or pathlib.Path
            The file.

        Examples
        --------
        >>> dance.save("again.npz")
        """
        words = {"biodance_dance": 1, "protocol": self.protocol, "seed": self.seed, "notes": self.notes}
        if self.subject is not None:
            who = {name: getattr(self.subject, name) for name in ("mass", "stature", "sex", "age")}
            words["subject"] = {name: value for name, value in who.items() if value == value}
        words |= {"names": self.names, "mirrored": self.mirrored, "plate": self.plate}
        words |= {"care": self.care, "rest": self.rest}
        words["unsafe"] = [asdict(margin) for margin in self.unsafe]
        words |= {"stances": [_stance_words(s) for s in self.stances], "under": [_stance_words(s) for s in self.under]}
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        arrays |= {"words": json.dumps(words), "body": body_text(self.body, self.protocol)}
        with whole_file(Path(path), over=True) as part, part.open("wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, **arrays)

    @classmethod
    def load(cls, path: str | Path) -> "Dance":
        """Return the dance of a file that `save` made.

        Parameters
        ----------
        path : str or pathlib.Path
            The file, or the folder that holds it as dance.npz.

        Returns
        -------
        Dance
            With its body.

        Raises
        ------
        FileRefused
            The file cannot be read, is of another version, or is not such a file.

        Examples
        --------
        >>> biodance.Dance.load("dance.npz").duration
        4.0
        """
        path = Path(path) / "dance.npz" if Path(path).is_dir() else Path(path)
        refuse_special(path)
        try:
            # bytes, unpacked: a thousand times a dance of forty postures
            refuse_large(path, 2**26)
            with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as found:
                text = parse_json(str(found["words"]))
                words = DanceWords.model_validate(text).model_dump(exclude_unset=True)
                arrays: dict[str, Any] = {name: possible_array(name, found[name]) for name in _ARRAYS}
                body, _ = parse_body(str(found["body"]), str(path))
            feet: dict[str, Any] = {name: tuple(Stance(**s) for s in words[name]) for name in ("stances", "under")}
            who = Subject(**words["subject"]) if words.get("subject") else None
            more: dict[str, Any] = {name: tuple(words.get(name, ())) for name in ("notes", "names", "mirrored", "care")}
            more["unsafe"] = tuple(Margin(**margin) for margin in words.get("unsafe", ()))
            more |= {name: words.get(name) for name in ("plate", "rest")}
            return cls(words["protocol"], body, seed=words["seed"], subject=who, **more, **feet, **arrays)
        except OSError as error:
            raise FileRefused(f"{path}: cannot be read ({error.strerror or error}). {_GIVE}") from error
        except FileRefused:
            raise
        except (BadZipFile, EOFError, ValueError, KeyError, TypeError, MemoryError, zlib.error) as error:
            why = " ".join(str(error).split())[:300]
            raise FileRefused(
                f"{path}: is not a dance that biodance wrote ({why}). Run biodance dance again."
            ) from error

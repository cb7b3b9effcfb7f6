"""What a dance is asked to be: postures, feet, times, limits, weights; read from a protocol file. The person's limits
are in the Body.

A person's reduced range, strength or speed go into ``body.limits``, and what the person may not do is taken out of the
plan (`person.fit_to_person`): whoever designs needs the two records only. The file is TOML (``protocols/dances``):

    name = "short"
    description = "what it is for, one sentence"
    for = "for whom, in words"
    care = ["who stands beside", "when to stop"]   sentences on cards and page
    move_s = 2.0                 seconds from posture to posture
    hold_s = 1.5                 seconds of standing still in each
    forward_m = 0.2              how far the right foot stands in front in "right_forward"
    share_of_support = 0.6       short for the share under [limits.balance]
    instructions = 4             most that is called at once; known postures and a few free ones (protocols/vocabulary)
    free = false                 true: any posture, any number of instructions (the paper's); simplicity is 0 then
    simplicity = 1.0             the performer's term: 0 = excitation only; 1 = an instruction costs half a second
                                 (free: a simple dance is worth as much as an exciting one)
    rest_after_s = 25            of dancing after which the person rests
    patient_cards = 12           most cards, postures in between among them, of a person with limits of their own
    budget_s = 115               of free ones: those that inform most per second are danced until the time is used up
    gentle = false               true: only what people can do who tire or fear to fall
    deep = false                 true: deep squats and bows, one-leg squats, too
    lively = false               true: wider postures, too, for people who move easily
    wide = 1.35                  distance between the feet, times the usual one (free: 1)
    plate_m = [0.40, 0.60]       force plate from side to side and ahead: feet stand nearer where they would not fit
                                 (as here; robots: any)
    other_weight = 1.0           emphasis of the segments that [weights] does not name
    ranges = "comfortable"       what joints may use: what is reached without effort, or "anatomical": all that a
                                 healthy joint allows

    [postures]                   how many postures on which feet, in the order of the dance
    parallel = 15                both feet side by side
    right_forward = 15           right foot in front
    single_right = 15            on the right leg
    single_left = 15             on the left leg
    seated = 20                  on a stool

    [limits.friction]            numbers of the limits, each named as its file in biodance/dance/limits
    mu = 0.4

    [weights]                    emphasis of segments, on top of their masses
    trunk_head = 2.0

Only [postures] is needed; everything else has the value of the paper or none.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from biodance.body.human.skeleton import Range
from biodance.dance.limits import Limit, family, join_limits, limits_with
from biodance.dance.problem.stance import FEET, Stance
from biodance.errors import BiodanceError, refuse_unknown
from biodance.library import locate, read_toml
from biodance.records import SIDES, Array


def sentences(path: Path, raw: dict[str, Any]) -> tuple[str, ...]:
    """Return what a TOML file says under ``care``; BiodanceError if it is no list of sentences."""
    found = raw.get("care", [])
    if not isinstance(found, list) or not all(isinstance(one, str) and one.strip() for one in found):
        raise BiodanceError(f'{path}: care = {found!r}; expected sentences in a list, as ["A helper stands beside."].')
    return tuple(found)


def true_or_false(path: Path, key: str, value: object) -> bool:
    """Return ``value``; BiodanceError names its ``key`` if it is neither true nor false."""
    if not isinstance(value, bool):
        raise BiodanceError(f"{path}: {key} = {value!r}; expected true or false.")
    return value


def finite_number(path: Path, where: str, value: object) -> float:
    """Return ``value`` as a float; BiodanceError names ``where`` it is if it is no finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise BiodanceError(f"{path}: {where} = {value!r}; expected a finite number.")
    return float(value)


def table(path: Path, raw: dict[str, Any], key: str, *, of: str = "") -> dict[str, Any]:
    """Return a table of a TOML file, empty if it is missing; BiodanceError if it is something else."""
    value = raw.get(key, {})
    if not isinstance(value, dict):
        raise BiodanceError(f"{path}: [{of}{key}] must be a table, found {value!r}.")
    return value


LEAST_WIDE, LEAST_FORWARD = 0.8, 0.05
"""Times the usual distance between the feet, and m by which one is in front: the least that are legal."""
LEAST_REST = 10.0
"""s of dancing, at least, before a rest."""


@dataclass(frozen=True, eq=False)
class Plan:
    """A protocol of a dance.

    ``blocks``: (stance, number of postures) in the order in which they are danced, each stance of `FEET` at most
    once; ``move``, ``hold`` s of a transition and of a posture (the paper: 2 and 5); ``forward`` m by which the right
    foot stands in front; ``limits`` that all of it keeps, with their numbers; ``budget`` s: from the postures found,
    those that inform most per second are danced until the time is used up (inf: all); ``weights`` (segment, factor) in
    eq. 12 on top of the masses, ``other_weight`` the factor of all segments not named; ``simplicity`` >= 0 of the
    performer's term beside the excitation; ``alone`` the legs on which the person may stand alone, be it for a step;
    ``instructions`` most that is called at once (inf: free postures, no vocabulary); ``gentle`` only postures that
    people can take who tire or fear to fall; ``deep`` deep ones, too; ``lively`` wider ones, too, chosen also for what
    they tell of the joint centres; ``wide`` times the usual distance between the feet; ``whom`` for whom it is, in
    words; ``holds`` the hands that stay on the grips of a frame; ``ranges`` what joints may use: what is reached
    without effort, or all that a healthy joint allows (the paper); ``slower`` times that it takes as long as the
    protocol says, whose seconds must be legal: of robots; ``seat_height`` m of a person's own stool, 0 any; ``careful``
    of people with limits of their own: words that they can do nowhere are named; ``hanging`` arms; ``care`` sentences
    about helpers, rests and when to stop; ``rest`` s of dancing after which the person rests; ``cards`` most postures,
    those in between among them (inf: all of the blocks).
    """

    name: str
    blocks: tuple[tuple[str, int], ...]
    move: float = 2.0
    hold: float = 5.0
    forward: float = 0.2
    budget: float = float("inf")
    weights: tuple[tuple[str, float], ...] = ()
    other_weight: float = 1.0
    simplicity: float = 0.0
    instructions: float = float("inf")
    wide: float = 1.0
    plate: tuple[float, float] | None = None
    gentle: bool = False
    deep: bool = False
    lively: bool = False
    alone: tuple[str, ...] = SIDES
    holds: tuple[str, ...] = ()
    ranges: Range = "comfortable"
    whom: str = ""
    slower: float = 1.0
    seat_height: float = 0.0
    careful: bool = False
    hanging: tuple[str, ...] = ()
    care: tuple[str, ...] = ()
    rest: float = float("inf")
    cards: float = float("inf")
    limits: tuple[Limit, ...] = field(default_factory=family)

    def __post_init__(self) -> None:
        names = [name for name, _ in self.blocks]
        for name in names:
            refuse_unknown("stance", name, FEET)
        if not names or len(set(names)) < len(names) or any(count < 1 for _, count in self.blocks):
            raise BiodanceError(
                f"Plan {self.name}: blocks {self.blocks}; expected at least one, each stance once, with 1 posture or "
                f"more."
            )
        refuse_unknown(f"range of joints in plan {self.name}", self.ranges, get_args(Range))
        for name, low, high, unit in (
            ("move", 0.5 * self.slower, 20.0 * self.slower, "s"),
            ("hold", 0.0, 60.0 * self.slower, "s"),
            ("forward", LEAST_FORWARD, 0.4, "m"),
            ("simplicity", 0.0, 100.0, ""),
            ("instructions", 2.0, float("inf"), ""),
            ("rest", LEAST_REST * self.slower, float("inf"), "s"),
            ("cards", 2.0, float("inf"), ""),
            ("wide", LEAST_WIDE, 1.5, "times the usual distance"),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise BiodanceError(f"Plan {self.name}: {name} = {value:g} {unit}; legal are {low:g} to {high:g}.")
        low, high = 0.2, 3.0  # m
        if self.plate is not None and not all(low <= side <= high for side in self.plate):
            raise BiodanceError(
                f"Plan {self.name}: plate = {' by '.join(f'{side:g}' for side in self.plate)} m; legal are {low:g} to "
                f"{high:g} m from side to side and ahead (metres, for example 0.40 and 0.60)."
            )
        if not self.budget > 0:
            raise BiodanceError(f"Plan {self.name}: budget = {self.budget:g} s; it must be positive (inf: no limit).")
        factors = [self.other_weight, *(factor for _, factor in self.weights)]
        if not all(np.isfinite(f) and f >= 0 for f in factors) or not any(factors):
            raise BiodanceError(
                f"Plan {self.name}: weights {factors}; expected numbers >= 0, at least one of them positive."
            )

    @property
    def count(self) -> int:
        """Number of postures of all blocks."""
        return sum(count for _, count in self.blocks)

    @property
    def seated(self) -> bool:
        """True where the whole dance is on a stool."""
        return all(name == "seated" for name, _ in self.blocks)

    @property
    def share(self) -> float:
        """Share of every half width of the base of support that all limits leave: for it the feet are set."""
        return min((limit.support_share for limit in self.limits), default=1.0)

    def hold_on(self, stance: Stance) -> float:
        """Return for how long a posture is held on these feet, s: postures in between only shortly."""
        return self.hold if stance.over is None else min(1.0, self.hold)  # s, in between

    def with_limits(self, more: Iterable[Limit | type[Limit]]) -> "Plan":
        """Return the plan with ``more`` limits, objects or classes; one of a name that is there takes its place."""
        return replace(self, limits=join_limits(self.limits, more))

    def emphasis(self, segments: tuple[str, ...]) -> Array:
        """Return the factor (N,) of each of the ``segments`` in eq. 12; UnknownName if a weight names none of them."""
        named = dict(self.weights)
        for name in named:
            refuse_unknown(f"segment to weight in plan {self.name}", name, segments)
        return np.array([named.get(name, self.other_weight) for name in segments])


_NUMBERS = {
    "move_s": "move",
    "hold_s": "hold",
    "forward_m": "forward",
    "budget_s": "budget",
    "simplicity": "simplicity",
    "instructions": "instructions",
    "wide": "wide",
    "other_weight": "other_weight",
    "rest_after_s": "rest",
    "patient_cards": "cards",
}
"""Key of the file: field of the Plan."""
_SHARE = "share_of_support"  # Short for the ``share`` of ``[limits.balance]``
_FLAGS = ("free", "gentle", "deep", "lively")
_FOLLOWABLE = {"instructions": 4.0, "simplicity": 1.0, "wide": 1.35}
"""Of protocols that are not free, unless the file says otherwise."""
FOLLOWABLE_SHARE = 0.8
"""Share of the support that a followable dance may use: what imprecise people need is judged by performers."""
_WORDS = ("name", "description", "postures", "limits", "weights", "ranges", "for", "plate_m", "care")
_KEYS = (*_WORDS, *_NUMBERS, _SHARE, *_FLAGS)


def read_plan(name_or_path: str | Path) -> Plan:
    """Return a shipped protocol by name ("short", "easy", "patient", "chair", "full", "one_segment"), or one of the
    user's by the path of its TOML file.

    Raises
    ------
    UnknownName
        No shipped protocol has this name; a key of the file or a stance does not exist.
    BiodanceError
        The file cannot be read, or a value is not legal; the message names file, key, value and what would be legal.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = locate("protocols/dances", str(name_or_path))
    raw = read_toml(path)
    for key in raw:
        refuse_unknown(f"key of {path}", key, _KEYS)
    words = {key: str(raw[name]) for key, name in (("ranges", "ranges"), ("whom", "for")) if name in raw}
    flags = {name: true_or_false(path, name, raw[name]) for name in _FLAGS if name in raw}
    free = flags.pop("free", False)
    fields: dict[str, Any] = (
        ({} if free else dict(_FOLLOWABLE))
        # m: AMTI BP400600, Kistler 9281
        | {"plate": _plate(path, raw["plate_m"]) if "plate_m" in raw else (0.40, 0.60)}
        | flags
        | words
        | {"care": sentences(path, raw)}
        | {field: finite_number(path, key, raw[key]) for key, field in _NUMBERS.items() if key in raw}
    )
    counts = table(path, raw, "postures")
    for stance, count in counts.items():
        if not isinstance(count, int) or isinstance(count, bool):
            raise BiodanceError(f"{path}: postures.{stance} = {count!r}; expected a whole number of postures.")
    weights = {
        name: finite_number(path, f"weights.{name}", value) for name, value in table(path, raw, "weights").items()
    }
    plan = Plan(str(raw.get("name", path.stem)), tuple(counts.items()), weights=tuple(weights.items()))
    return replace(plan, limits=_limits(path, raw, {} if free else {"balance": {"share": FOLLOWABLE_SHARE}}), **fields)


def _plate(path: Path, value: object) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise BiodanceError(
            f"{path}: plate_m = {value!r}; expected two lengths in m, from side to side and ahead, as [0.40, 0.60]."
        )
    side, ahead = (finite_number(path, "plate_m", one) for one in value)
    return side, ahead


def _limits(path: Path, raw: dict[str, Any], usual: dict[str, dict[str, float]]) -> tuple[Limit, ...]:
    """Return all limits with the numbers that the file gives them, else the ``usual`` ones of its kind of dance."""
    given = table(path, raw, "limits")
    found = usual | {
        name: {
            key: finite_number(path, f"limits.{name}.{key}", value)
            for key, value in table(path, given, name, of="limits.").items()
        }
        for name in given
    }
    if _SHARE in raw:
        if "share" in given.get("balance", {}):
            raise BiodanceError(f"{path}: {_SHARE} and limits.balance.share say the same; keep one of them.")
        found.setdefault("balance", {})["share"] = finite_number(path, _SHARE, raw[_SHARE])
    return limits_with(found, where=str(path))

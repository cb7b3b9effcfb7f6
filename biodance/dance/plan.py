"""What a dance is asked to be: how many postures on which feet, how long, for which segments. The person's limits are in the Body.

A Plan comes from a protocol file (`protocol_file.read_dance`); a person's reduced range, strength or speed go into ``body.limits`` and a
person who may not stand on one leg takes blocks out of the plan (`person.fitted`), so that whoever designs needs the two records only.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import get_args

import numpy as np

from biodance.body.limits import Range
from biodance.dance.limits import Limit, family, joined
from biodance.errors import BiodanceError, UnknownName
from biodance.records import Array

STANCES = ("parallel", "right_forward", "single_right", "single_left", "seated")
"""Foot configurations: both feet side by side, right foot in front, on the right leg, on the left leg (paper Table I), on a stool."""


@dataclass(frozen=True, eq=False)
class Plan:
    """A protocol of a dance.

    ``blocks``: (stance, number of postures) in the order in which they are danced, each stance of ``STANCES`` at most once;
    ``move``, ``hold`` s of a transition and of a posture (the paper: 2 and 5); ``forward`` m by which the right foot stands
    in front; ``limits`` that all of it keeps, with their numbers; ``budget`` s: from the postures found, those that inform
    most per second are danced until the time is used up (inf: all); ``weights`` (segment, factor) in eq. 12 on top of the
    masses, ``other_weight`` the factor of all segments not named; ``simplicity`` >= 0 of the performer's term beside the
    excitation; ``alone`` the legs on which the person may stand alone, be it for a step; ``holds`` the hands that stay on
    the grips of a frame; ``ranges`` what joints may use: what is reached without effort, or all that a healthy joint allows
    (the paper).
    """

    name: str
    description: str
    blocks: tuple[tuple[str, int], ...]
    move: float = 2.0
    hold: float = 5.0
    forward: float = 0.2
    budget: float = float("inf")
    weights: tuple[tuple[str, float], ...] = ()
    other_weight: float = 1.0
    simplicity: float = 0.0
    alone: tuple[str, ...] = ("right", "left")
    holds: tuple[str, ...] = ()
    ranges: Range = "comfortable"
    limits: tuple[Limit, ...] = field(default_factory=family)

    def __post_init__(self) -> None:
        names = [name for name, _ in self.blocks]
        for name in names:
            if name not in STANCES:
                raise UnknownName.of("stance", name, STANCES)
        if not names or len(set(names)) < len(names) or any(count < 1 for _, count in self.blocks):
            raise BiodanceError(f"Plan {self.name}: blocks {self.blocks}; expected at least one, each stance once, with 1 posture or more.")
        if self.ranges not in get_args(Range):
            raise UnknownName.of(f"range of joints in plan {self.name}", self.ranges, get_args(Range))
        self._check()

    def _check(self) -> None:
        for name, low, high, unit in (
            ("move", 0.5, 20.0, "s"),
            ("hold", 0.0, 60.0, "s"),
            ("forward", 0.05, 0.4, "m"),
            ("simplicity", 0.0, 100.0, ""),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise BiodanceError(f"Plan {self.name}: {name} = {value:g} {unit}; legal are {low:g} to {high:g}.")
        if not self.budget > 0:
            raise BiodanceError(f"Plan {self.name}: budget = {self.budget:g} s; it must be positive (inf: no limit).")
        factors = [self.other_weight, *(factor for _, factor in self.weights)]
        if not all(np.isfinite(f) and f >= 0 for f in factors) or not any(factors):
            raise BiodanceError(f"Plan {self.name}: weights {factors}; expected numbers >= 0, at least one of them positive.")

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

    def with_limits(self, more: Iterable[Limit | type[Limit]]) -> "Plan":
        """Return the plan with ``more`` limits, objects or classes; one of a name that is there already takes its place."""
        return replace(self, limits=joined(self.limits, more))

    def emphasis(self, segments: tuple[str, ...]) -> Array:
        """Return the factor (N,) of each of the ``segments`` in eq. 12; UnknownName if a weight names none of them."""
        named = dict(self.weights)
        for name in named:
            if name not in segments:
                raise UnknownName.of(f"segment to weight in plan {self.name}", name, segments)
        return np.array([named.get(name, self.other_weight) for name in segments])

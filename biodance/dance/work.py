"""What all stages of one design share."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass

from biodance.dance.chain import Chain
from biodance.dance.excitation import Blocks
from biodance.dance.ledger import Ledger
from biodance.dance.plan import Plan
from biodance.dance.stance import Stance
from biodance.records import Array

Tell = Callable[[str, int, int], None]
"""Told what is being done, how many parts are finished and of how many."""


@dataclass(frozen=True, eq=False)
class Work:
    """One design: ``chain`` of the body, ``blocks`` that count, ``plan``, ``seed`` of all random numbers; ``ledger`` keeps what is
    finished, ``workers`` search side by side, ``tell`` is told the progress.
    """

    chain: Chain
    blocks: Blocks
    plan: Plan
    seed: int
    ledger: Ledger
    workers: Executor
    tell: Tell


@dataclass(frozen=True, eq=False)
class Course:
    """Postures ``x`` (P, n), those in between included, in the order of the dance, on the feet ``stances`` (P,)."""

    x: Array
    stances: tuple[Stance, ...]

"""What is left of a limit of a dance at its worst."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Margin:
    """What is left of one limit at its worst: ``worst`` in ``unit`` (negative: broken), at ``where_s`` s, of ``what``
    (a joint, a pair).
    """

    limit: str
    worst: float
    where_s: float
    unit: str
    what: str = ""

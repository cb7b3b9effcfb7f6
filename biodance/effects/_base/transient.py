"""A cause that comes and goes within a trial, at a point of a segment."""

from abc import ABC, abstractmethod

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect
from biodance.records import Array


class Transient(Effect, ABC):
    """A cause that may also have a course of its own in each trial."""

    @abstractmethod
    def local(self, case: Case) -> Array | None:
        """Return (T, 6, k): what one unit of each of k parameters of this trial alone adds; None where it does not come
        and go. The k parameters follow one another in time, as many for each of `parameters`.
        """

    @abstractmethod
    def beside(self, place: Array) -> "Transient":
        """Return the cause where it acts ``place`` (3,) m from its usual point, in the axes of its segment."""

    @abstractmethod
    def at_full_rate(self) -> "Transient":
        """Return the cause with the finest allowed time course (`local`)."""

"""The columns that may explain something of a series, never written out all at once.

A column c is the rows' share of a plate, or of all together, where it counts, and zero elsewhere: from a visit on (a
step), in one visit, or in all visits of one person. So c' u of all columns is what u sums to in every visit, these
summed from the last visit backwards, or over persons: of the order of the rows, not of rows times columns.
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from biodance.diagnosis.archive.covariance import Groups, Projection, RowCovariance
from biodance.diagnosis.archive.series import Series
from biodance.records import Array

_LEAST = 2
"""Visits on each side of a step."""
_IN_COLUMNS = 1e-9
"""Share of its own information below which a column is one of those in the model."""
ALL = "all plates"
_Number = TypeVar("_Number", bound=np.generic)


@dataclass(frozen=True)
class PlateCandidate:
    """A column that may explain something: of ``kind`` "step", "visit" or "person"; ``at`` the number of
    visit or person in the archive.
    """

    kind: str
    plate: str
    at: int


@dataclass(frozen=True, eq=False)
class Candidates:
    """All columns that are looked at in a ``series`` (n rows): steps with at least two visits on each side, visits,
    persons with several visits; of all plates where there are several, and of each plate; each column once.

    ``shares`` (n, A) of what each is about (``among``, A names); ``several`` (S,) the persons with several visits, by
    number in ``groups``; ``every`` column; those that are neither empty nor the same as an earlier one are ``kept``
    (m,) indices.
    """

    groups: Groups
    among: tuple[str, ...]
    shares: Array
    several: NDArray[np.intp]
    every: tuple[PlateCandidate, ...]
    kept: NDArray[np.intp]

    def column(self, one: PlateCandidate) -> Array:
        """Return (n,) the column of a candidate."""
        visits = self.groups.visits
        counts = {
            "step": visits >= one.at,
            "visit": visits == one.at,
            "person": self.groups.persons[self.groups.person] == one.at,
        }[one.kind]
        return np.asarray(self.shares[:, self.among.index(one.plate)] * counts[self.groups.visit])

    def where(self, *kinds: str, plate: str = "") -> NDArray[np.intp]:
        """Return the indices of columns kept that are of these kinds, and of ``plate`` if given."""
        some = [k for k in self.kept if self.every[k].kind in kinds and plate in ("", self.every[k].plate)]
        return np.array(some, dtype=np.intp)

    def sums(self, right: Array) -> Array:
        """Return c' ``right`` (M, m) of every column, for right (n, m)."""
        out = []
        for share in self.shares.T:
            at = self.groups.by_visit @ (share[:, None] * right)
            out += [_steps(at), at, self._persons(at)]
        return np.concatenate(out)

    def squares(self, rows: RowCovariance) -> Array:
        """Return c' V^-1 c (M,) of every column.

        q - h r^2 is that of a visit; that of a person has sums of q and of r over the visits. A step takes one visit
        after the other into the person's block, from the last on: each adds q - h ((R + r)^2 - R^2), R being the sum of
        the person's r so far.
        """
        less, person = rows.persons_less, self.groups.person
        out = []
        for own, ones in zip(*(part.T for part in rows.squares(self.shares)), strict=True):
            reached, added = np.zeros(less.size), np.empty(own.size)
            for v in reversed(range(own.size)):
                p = person[v]
                # (R + r)² - R² = (2 R + r) r.
                added[v] = own[v] - less[p] * (2 * reached[p] + ones[v]) * ones[v]
                reached[p] += ones[v]
            # All visits of a person: sum q - h (sum r)².
            whole = self._persons(own) - (less * reached**2)[self.several]
            out += [_steps(added), own - less[person] * ones**2, whole]
        return np.concatenate(out)

    def free(self, known: Projection) -> Array:
        """Return c' P c (M,) of every column, what the model's columns do not hold of it; 0 where they hold all."""
        own = self.squares(known.rows)
        along = self.sums(known.solved)
        # c'V^-1 c less what the model's columns hold of it (`solved` = V^-1 X).
        left = own - np.einsum("ij,jk,ik->i", along, known.covariance, along)
        return np.where(left > _IN_COLUMNS * own, left, 0.0)

    def _persons(self, visits: Array) -> Array:
        """Return (S, ...) sums over the visits (V, ...) of each person with several."""
        return np.asarray((self.groups.by_person @ visits)[self.several])


def _steps(visits: NDArray[_Number]) -> NDArray[_Number]:
    """Return sums over visits (V, ...) from each on that may be the first after a step."""
    return visits[::-1].cumsum(axis=0)[::-1][_LEAST : len(visits) - _LEAST + 1]


def candidates_of(series: Series) -> Candidates:
    """Return the columns that are looked at in a series."""
    groups, among, shares = series.groups, series.plates, series.design
    if len(among) > 1:
        among, shares = (ALL, *among), np.column_stack([shares.sum(axis=1), shares])
    several = np.flatnonzero(np.bincount(groups.person) > 1)
    kinds = {"step": groups.visits[_LEAST : groups.visits.size - _LEAST + 1], "visit": groups.visits}
    kinds["person"] = groups.persons[several]
    every = tuple(
        PlateCandidate(kind, plate, int(at)) for plate in among for kind, numbers in kinds.items() for at in numbers
    )
    found = Candidates(groups, among, shares, several, every, np.empty(0, dtype=np.intp))
    return replace(found, kept=_distinct(found))


def _distinct(found: Candidates) -> NDArray[np.intp]:
    """Return the indices of the columns that are neither empty nor, by random sums, the same as an earlier one."""
    groups, out = found.groups, []
    marks = np.random.default_rng(0).integers(2**64, size=groups.visit.size, dtype=np.uint64)
    for share in found.shares.T:
        at, whole = np.zeros(groups.visits.size, np.uint64), np.zeros(groups.persons.size, np.uint64)
        np.add.at(at, groups.visit, marks * np.rint(1e6 * share).astype(np.uint64))
        np.add.at(whole, groups.person, at)
        out += [_steps(at), at, whole[found.several]]
    sums = np.concatenate(out)
    first = np.unique(sums, return_index=True)[1]
    return np.sort(first[sums[first] != 0])

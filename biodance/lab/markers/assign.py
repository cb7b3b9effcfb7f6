"""Which label is which landmark in a marker set that nobody described: ONE assignment, the cheapest by what the labels
say and by where the markers are on a standing person.

The cost of (label -> landmark) is minus the logarithm of how likely it is, in nats: how usual the spelling is, and half
the squared distance, in standard deviations, from where this person has the landmark. That place is what a Gaussian of
all landmarks (means, spreads and correlations in ``anthropometry/standing.toml``) expects beside the other landmarks of
this person. `scipy.optimize.linear_sum_assignment` takes the cheapest one-to-one assignment; a label without a name is
believed only if the next best assignment is clearly worse. What is certain places the rest, until nothing changes.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from biodance.lab.markers.names import Meaning, sides_of
from biodance.lab.markers.set_file import LANDMARKS
from biodance.lab.markers.spelling import plain_labels
from biodance.lab.markers.upright import NEAR, OUTWARDS, Standing, part_of, usual_standing
from biodance.records import SIDES, Array

_TOES = ("toe", "toe_lateral", "toe_medial")
NEEDS = {one: (one,) for one in ("asis", "knee_lateral", "ankle_lateral", "heel")} | {"toe": _TOES}
"""Landmarks that a body needs on each side, and what stands in for them."""
_USEFUL = ("knee_medial", "ankle_medial", "acromion")
"""Landmarks that posture tells as well, for labels that say nothing."""
_GAINS = (*NEEDS, "psis", "mid_psis")
"""Landmarks by whose marker a body gains: those, and one behind the pelvis."""
_FREE = (*(f"{side}_{part}" for side in SIDES for part in (*NEEDS, *_TOES[1:], "psis", *_USEFUL)), "mid_psis")
"""Landmarks that a label may be taken for that does not name them."""
_AT = {place: j for j, place in enumerate(LANDMARKS)}
_ENDS = {"lateral": "medial", "medial": "lateral"}
_NAMED, _NEED = 30.0, 30.0
"""nats: gain of a landmark by a label that names it, or that a body needs; above all that a place can cost."""
_MUTE = 8.0
"""nats: gain of a landmark by a label that does not name it: a marker at the limit of `NEAR` still pays."""
_RANK = 10.0
"""A spelling so far down its list is half as usual (Zipf: 1 / (1 + rank / 10))."""
_OTHER_SIDE, _OTHER_END, _SEGMENT = 8.0, 3.0, 3.0
"""nats: a label means the other side's, the other end of its joint, or names no more than the segment."""
_FARTHEST = 8.0
"""nats: most that its place can cost a landmark that is named: people stand as they like."""
_OUTER = 2.5
"""nats: most that lying outside or inside the others of a joint without usual places tells which end a marker is."""
_MARGIN = 3.0
"""nats: by so much (odds of 20) the next best assignment must be worse where no label names a landmark."""
_SAME = 0.012
"""Share of the stature within which two markers mark one landmark, or one of the middle lies from it."""
_GLUED = 0.006
"""Share of the stature: standard deviation with which a marker is glued on its landmark."""
BELIEVED = 0.85
"""Share of the named landmarks that the person must confirm, and of the sides, or words mean something else here."""
_Said = Mapping[str, tuple[Meaning, ...]]
_BALL = 0.036
"""Share of the stature by which markers at the big and the little toe are at least apart."""
def spelled(rank: int) -> float:
    """Return the cost of a spelling, nats."""
    return float(np.log1p(rank / _RANK))


def by_names(said: _Said, stand: Standing | None = None) -> dict[str, str]:
    """Return landmark -> label by the names, and by the heights of a person whose places are not known yet."""
    cost = np.full((len(said), len(LANDMARKS)), np.inf)
    for i, (label, ways) in enumerate(said.items()):
        for one in ways:
            if one.place in LANDMARKS:
                high = _high(stand, one.place, label) if stand else 0.0
                cost[i, _AT[one.place]] = spelled(one.rank) + high - _NAMED
    return {LANDMARKS[j]: list(said)[i] for i, j in _cheapest(cost)[0]}


def _high(stand: Standing, place: str, label: str) -> float:
    """Return the cost of a height, nats: 2 at the limit where it is believed, none within half of it."""
    return 2 * max(stand.misfit(place, label) - 0.5, 0.0)


def _cheapest(cost: Array) -> tuple[list[tuple[int, int]], float]:
    """Return (row, column) of the cheapest one-to-one assignment of ``cost`` (N, P), and its sum: every row may also go
    nowhere, at no cost; inf where it must not go.
    """
    some, places = cost.shape
    whole = np.full((some, places + some), 1e6)
    whole[:, :places] = np.minimum(cost, 1e6)
    np.fill_diagonal(whole[:, places:], 0.0)
    rows, columns = linear_sum_assignment(whole)
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return [(i, j) for i, j in pairs if j < places and cost[i, j] < 0], float(whole[rows, columns].sum())


@cache
def _template() -> tuple[tuple[str, ...], Array, Array]:
    """Return the landmarks with a usual place, it (P, 3), and the covariance (3, P, P) along each axis: out, ahead, up;
    in shares of the stature.

    Ends of one joint, parts of one leg and the two sides stand together: the correlations of pairs are products.
    """
    usual = usual_standing()
    parts = {part: ("",) if part in ("mid_psis", "c7") else SIDES for part in usual["places"]}
    places = tuple(f"{side}_{part}" if side else part for part, sides in parts.items() for side in sides)
    part, side = [part_of(place) for place in places], [place.startswith("left") for place in places]
    joint = [one.partition("_")[0] for one in part]
    leg = np.array([one in ("knee", "ankle", "heel", "toe") for one in joint])
    same, ends, across = (np.equal.outer(np.array(one), np.array(one)) for one in (part, joint, side))
    at, sd = (np.array([usual["places"][one][word] for one in part]) for word in ("at", "sd"))
    alike = [
        np.where(same, 1.0, np.where(ends, end, np.where(np.outer(leg, leg), limb, 0.0))) * np.where(across, 1.0, other)
        for end, limb, other in (usual["together"][axis] for axis in ("out", "ahead", "up"))
    ]
    return places, at, np.array([one * np.outer(sd[:, k], sd[:, k]) for k, one in enumerate(alike)])


def _squares(shares: Array, known: Mapping[str, int]) -> Array:
    """Return (N, P) squared distances, in standard deviations, of markers (N, 3) from where a person has the landmarks
    of `_template`, given the markers ``known`` (landmark -> row); a landmark that is known is expected by the others.

    Gaussian conditioning: mean + C K (x - mean), and leaving one out x - K(x - mean) / diag K, with K the inverse of
    the covariance of what is known (Rasmussen and Williams 2006, 5.10).
    """
    places, at, covariance = _template()
    sides = np.array([OUTWARDS.get(place.partition("_")[0], 1.0) for place in places])
    have = [k for k, place in enumerate(places) if place in known]
    total = np.zeros((len(shares), len(places)))
    for axis, cov in enumerate(covariance):
        x = shares[:, axis, None] * (sides if axis == 0 else np.ones(len(places)))
        mean, variance = at[:, axis].copy(), np.diag(cov).copy()
        if have:
            inverse = np.linalg.inv(cov[np.ix_(have, have)] + _GLUED**2 * np.eye(len(have)))
            off = x[[known[places[k]] for k in have], have] - mean[have]
            off = np.clip(off, *(sign * 3 * np.sqrt(variance[have]) for sign in (-1, 1)))  # one odd marker moves little
            left_out = off - inverse @ off / np.diag(inverse)
            mean += cov[:, have] @ inverse @ off
            variance -= np.einsum("ij,jk,ik->i", cov[:, have], inverse, cov[:, have])
            mean[have], variance[have] = at[have, axis] + left_out, 1 / np.diag(inverse)
        total += (x - mean) ** 2 / np.maximum(variance, _GLUED**2)
    return total


class PersonLabels:
    """The labels of a standing person, what they may mean (label -> meanings) and what each is (`assignment`).

    ``confirmed`` label -> what it may mean and stands where this person may have it; ``named`` landmark -> label by the
    names alone. ``words`` (N, P) nats: what the words cost every label for every landmark, inf where they do not name
    it; ``free`` (N, P): where it may be one that they do not name.
    """

    def __init__(self, stand: Standing, said: _Said) -> None:
        self.rows = {label: i for i, label in enumerate(plain_labels(stand.at))}
        self.said = {label: said.get(label, ()) for label in self.rows}
        self.named = by_names(self.said, stand)
        self._stand = stand = replace(stand, named=self.named)
        self.confirmed = {
            label: tuple(one for one in ways if stand.believed(one.place, label)) for label, ways in self.said.items()
        }
        self._sure = by_names(self.confirmed, stand)
        self._shares = stand.shares(self.rows)
        told = sides_of(stand.at)
        agree = [told[label] == SIDES[int(self._shares[i, 0] < 0)] for label, i in self.rows.items() if label in told]
        self._sides = told if agree and np.mean(agree) > BELIEVED else {}
        self.words = np.full((len(self.rows), len(LANDMARKS)), np.inf)
        self.free = np.zeros(self.words.shape, dtype=bool)
        for label, i in self.rows.items():
            for place, cost in self._wordings(label):
                self.words[i, _AT[place]] = cost
            self.free[i, [_AT[place] for place in self._open_to(label)]] = True
        self.free &= ~np.isfinite(self.words)
        self._unplaced = self._by_height_and_width()

    def _wordings(self, label: str) -> Iterator[tuple[str, float]]:
        """Yield the landmarks that a label names, and what its words cost, nats; first, if it stands there, the other
        end of its joint, and the other side where nobody has what it names.
        """
        ways = self.said[label]
        said = ways[0].place if ways else ""
        joint, _, end = said.rpartition("_")
        # A forearm turns: names of the two ends of an elbow are believed, unless both have the same.
        twice = sum(other[0].place == said for other in self.said.values() if other) > 1
        misread = []
        if end in _ENDS and joint.endswith(("knee", "ankle", "toe", *["elbow"] * twice)):
            misread.append((f"{joint}_{_ENDS[end]}", _OTHER_END))
        if said in LANDMARKS and said.startswith(SIDES) and not self._stand.believed(said, label):
            misread.append((other_side(said), _OTHER_SIDE))
        for place, more in misread:
            if self._stand.believed(place, label):
                yield place, spelled(ways[0].rank) + more
        for one in reversed(self.confirmed[label]):
            if one.place in LANDMARKS:
                yield one.place, spelled(one.rank)

    def _open_to(self, label: str) -> Iterator[str]:
        """Yield what a label may mark that does not name it: it says nothing, or no more than the segment."""
        ways, own = self.confirmed[label], self._sides.get(label)
        have, middle = {part_of(one) for one in self._sure}, abs(self._shares[self.rows[label], 0]) < _SAME
        for place in _FREE:
            side, part = place.partition("_")[0], part_of(place)
            segment = all(
                one.place not in LANDMARKS and (one.place.startswith(side) or part.endswith("sis")) for one in ways
            )
            behind = part.endswith("psis") and (
                middle != (part == "mid_psis") or "mid_psis" in have or (part == "mid_psis" and "psis" in have)
            )
            toes = part in _TOES and any(f"{side}_{toe}" in self._sure for toe in _TOES)
            if own in (None, side) and segment and not (behind or toes or (ways and part in _USEFUL)):
                yield place

    def _by_height_and_width(self) -> Array:
        """Return the cost (N, P), nats, of where labels are for what has no usual place: by its height; of the ends of
        an elbow or of toes the lateral one is outside.
        """
        cost = np.zeros(self.words.shape)
        for label, i in self.rows.items():
            for j in np.flatnonzero(np.isfinite(self.words[i])):
                if part_of(LANDMARKS[j]) not in usual_standing()["places"]:
                    cost[i, j] = _high(self._stand, LANDMARKS[j], label)
        for side, joint in product(SIDES, ("elbow", "toe")):
            lateral, medial = (_AT[f"{side}_{joint}_{end}"] for end in _ENDS)
            either = np.isfinite(self.words[:, [lateral, medial]]).any(axis=1)
            if either.any():
                out = OUTWARDS[side] * self._shares[:, 0]
                outside = _OUTER * np.clip((out - out[either].mean()) / _SAME, -1.0, 1.0)
                cost[:, lateral] -= outside
                cost[:, medial] += outside
        return cost

    def assignment(self) -> dict[str, str]:
        """Return landmark -> label: the cheapest assignment given what is certain, again until nothing more is."""
        labels, free = list(self.rows), self.free.copy()
        claims = Counter(ways[0].place for ways in self.confirmed.values() if ways)
        known = {
            place: label
            for place, label in self._sure.items()
            # Which end of its joint the only marker that names one is, is not known yet.
            if claims[place] < 2 and (place.rpartition("_")[2] not in _ENDS or self._sure.keys() >= {*_both_ends(place)})
        }
        fixed: dict[str, str] = {}
        while True:
            cost, rivals = self._costs(known, fixed, free)
            pairs, least = _cheapest(cost)
            new = dict(fixed)
            for i, j in pairs:
                if not free[i, j] or self._next_best(i, j, cost, rivals) - least >= _MARGIN:
                    new[LANDMARKS[j]] = labels[i]
            away = self._distances(new)
            for place, label in tuple(new.items()):
                i, j = self.rows[label], _AT[place]
                if free[i, j] and part_of(place) not in _TOES and away[i, j] > NEAR / 2:
                    free[i, j] = False  # what was taken with it says that it is elsewhere
                    del new[place]
            if new == fixed:
                return new
            known = fixed = new

    def _costs(
        self, known: Mapping[str, str], fixed: Mapping[str, str], free: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        """Return the costs (N, P) given the landmarks that are ``known``, and those of labels without the name as far
        away as they are rivals; what is ``fixed`` stays.
        """
        usual, away = self._distances({}), self._distances(known)
        gain = np.array([_NEED * (part_of(place) in _GAINS) for place in LANDMARKS])
        placed = np.where(np.isfinite(away), np.minimum(away, _FARTHEST), 0.0) + self._unplaced
        cost = self.words + placed - _NAMED - gain
        open_ = free & self._at_ends_of_feet(np.minimum(usual, away), free, set(known.values()))
        front = [_AT[f"{side}_{toe}"] for side in SIDES for toe in _TOES]
        away[:, front] = usual[:, front]  # it is not known which toe is there: the foot may turn
        away += np.array([[_SEGMENT * bool(ways)] for ways in self.confirmed.values()])
        rivals = np.where(open_ & (away < NEAR / 2 + _MARGIN), away - _MUTE - gain, np.inf)
        labels = list(self.rows)
        for i, j in np.argwhere(open_ & (away < NEAR / 2)):
            if self._stand.believed(LANDMARKS[j], labels[i]):
                cost[i, j] = rivals[i, j]
        for place, label in fixed.items():
            for one in (cost, rivals):
                one[self.rows[label]], one[:, _AT[place]] = np.inf, np.inf
            cost[self.rows[label], _AT[place]] = -_NAMED - _NEED
        return cost, rivals

    def _next_best(self, row: int, column: int, cost: Array, rivals: Array) -> float:
        """Return the sum of the next best assignment, in which no marker at this place is the landmark."""
        beside = np.linalg.norm(self._shares - self._shares[row], axis=1) <= _SAME
        other = cost.copy()
        other[:, column] = np.where(beside, np.inf, np.minimum(cost[:, column], rivals[:, column]))
        return _cheapest(other)[1]

    def _distances(self, known: Mapping[str, str]) -> Array:
        """Return (N, P) half the squared distances given landmarks that are known; inf for those without usual place.
        Any toe is expected at the front of the foot.
        """
        ahead = {place: self._shares[self.rows[label], 1] for place, label in known.items()}
        ankles, spines = ([ahead.get(f"{side}_{part}") for side in SIDES] for part in ("ankle_lateral", "asis"))
        origin = float(self._stand.middle @ self._stand.ahead / self._stand.stature)
        if None not in ankles:
            origin = float(np.mean(ankles))
        elif self.named and None not in spines:
            origin = float(np.mean(spines) - usual_standing()["places"]["asis"]["at"][1])
        away = np.full(self.words.shape, np.inf)
        rows = {place: self.rows[label] for place, label in known.items()}
        away[:, [_AT[place] for place in _template()[0]]] = _squares(self._shares - [0.0, origin, 0.0], rows) / 2
        for side, toe in product(SIDES, _TOES[1:]):
            away[:, _AT[f"{side}_{toe}"]] = away[:, _AT[f"{side}_toe"]]
        return away

    def _at_ends_of_feet(
        self, away: Array, free: NDArray[np.bool_], taken: Collection[str]
    ) -> NDArray[np.bool_]:
        """Return (N, P) whether a label may be a heel or toe by its place: the hindmost and foremost of a foot, or both
        markers at its ball where both feet have two.
        """
        may = np.ones(away.shape, dtype=bool)
        may[:, [j for j, place in enumerate(LANDMARKS) if part_of(place) in ("heel", *_TOES)]] = False
        balls: dict[str, int] = {}
        here = free & (away < NEAR / 2) & np.array([[label not in taken] for label in self.rows])
        for side in SIDES:
            out, ahead = OUTWARDS[side] * self._shares[:, 0], self._shares[:, 1]
            hind, front = (np.flatnonzero(here[:, _AT[f"{side}_{end}"]]) for end in ("heel", "toe"))
            if hind.size:
                may[hind[ahead[hind].argmin()], _AT[f"{side}_heel"]] = True
            if front.size:
                may[front[ahead[front].argmax()], _AT[f"{side}_toe"]] = True
                outer, inner = front[out[front].argmax()], front[out[front].argmin()]
                across, along = np.abs(self._shares[outer] - self._shares[inner])[:2]
                if along < across and np.hypot(across, along) > _BALL:
                    balls |= {f"{side}_toe_lateral": outer, f"{side}_toe_medial": inner}
        if len(balls) == 2 * len(SIDES):
            may[:, [_AT[f"{side}_toe"] for side in SIDES]] = False
            for place, row in balls.items():
                may[row, _AT[place]] = True
        return may


def _both_ends(place: str) -> tuple[str, ...]:
    """Return the lateral and the medial landmark of a joint."""
    return tuple(f"{place.rpartition('_')[0]}_{end}" for end in _ENDS)


def other_side(place: str) -> str:
    """Return the same landmark of the other side."""
    side, _, part = place.partition("_")
    return f"{'left' if side == 'right' else 'right'}_{part}"



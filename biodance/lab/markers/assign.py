"""Which label is which landmark in a marker set that nobody described: ONE assignment, the cheapest by what the labels
say and by where the markers are on a standing person.

The cost of (label -> landmark) is minus the logarithm of how likely it is, in nats: how usual the spelling is, and half
the squared distance, in standard deviations, from where this person has the landmark. That place is what a Gaussian of
all landmarks (means, spreads and correlations in ``anthropometry/standing.toml``) expects beside the other landmarks of
this person. `scipy.optimize.linear_sum_assignment` takes the cheapest one-to-one assignment; a label without a name is
believed only if the next best assignment is clearly worse. What is certain places the rest, until nothing changes.

A wrong map is worse than none: a landmark whose marker stands where no person has it is left out, and a guess that
lacks a landmark the body needs, or of which too much is contradicted, is none.
"""

import json
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np
from scipy.optimize import linear_sum_assignment

from biodance.lab.markers.names import Meaning, joints_from_video, meanings_of, sides_exchanged, sides_of
from biodance.lab.markers.set_file import LANDMARKS, MIDLINE, segment_of
from biodance.lab.markers.sets import GUESSED, MarkerSet, read_marker_set
from biodance.lab.markers.spelling import plain_labels, side_words
from biodance.lab.markers.still import median_places, posture_frames
from biodance.lab.markers.upright import (
    NEAR,
    OUTWARDS,
    Standing,
    mirror_images,
    part_of,
    standing_by_names,
    standing_by_points,
    usual_standing,
)
from biodance.records import SIDES, Array, Markers, Trial

_TOES = ("toe", "toe_lateral", "toe_medial")
_NEEDS = {one: (one,) for one in ("asis", "knee_lateral", "ankle_lateral", "heel")} | {"toe": _TOES}
"""Landmarks that a body needs on each side, and what stands in for them."""
_USEFUL = ("knee_medial", "ankle_medial", "acromion")
"""Landmarks that posture tells as well, for labels that say nothing."""
_GAINS = (*_NEEDS, "psis", "mid_psis")
"""Landmarks by whose marker a body gains: those, and one behind the pelvis."""
_FREE = (*(f"{side}_{part}" for side in SIDES for part in (*_NEEDS, *_TOES[1:], "psis", *_USEFUL)), "mid_psis")
"""Landmarks that a label may be taken for that does not name them."""
_EITHER = ("knee_lateral", "knee_medial", "ankle_lateral", "ankle_medial")
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
_BALL = 0.036
"""Share of the stature by which markers at the big and the little toe are at least apart."""
_BELIEVED = 0.85
"""Share of the named landmarks that the person must confirm, and of the sides, or words mean something else here."""
_USUAL = 30
"""Rank of a spelling below which it is a common one, whose word counts."""
_SHARED = 6
"""Labels of the session's set that a trial must have to be read with it: three markers on each of two segments."""
_FROM_VIDEO = (
    "These labels are joints, as software estimates them from video, not markers on the skin: {named}. A body is "
    "placed by markers on both iliac spines, at the side of knees and ankles, on heels and toes. Give positions of "
    "markers, for example the augmented markers (.trc) of the same software."
)
_Said = Mapping[str, tuple[Meaning, ...]]


@dataclass(frozen=True, eq=False)
class GuessedSet:
    """What was guessed: ``map`` label -> landmark or segment, "" ``name`` where it is not believed; ``doubts`` why
    markers were left out, or why nothing is guessed, in sentences.
    """

    map: Mapping[str, str]
    doubts: tuple[str, ...]
    name: str = ""


def guess_set(markers: Markers) -> GuessedSet:
    """Return the guessed map of a recording's labels, from their names and the posture of its quietest half second.

    Geometry needs z up; for a recording without anybody upright nothing is believed.
    """
    at = median_places(markers, posture_frames(markers)[0])
    found = _guessed(at)
    joints = () if found.name else joints_from_video(at)
    return replace(found, doubts=(_FROM_VIDEO.format(named=", ".join(joints)), *found.doubts)) if joints else found


def _guessed(at: Mapping[str, Array]) -> GuessedSet:
    """Return the guess for the person whom the names show, else for the one whom the points show."""
    said = meanings_of(at)
    stand = standing_by_names(at, _by_names(said))
    if isinstance(stand, Standing):
        stand = standing_by_names(at, _by_names(said, stand))
    if isinstance(stand, Standing):
        named = _guess_of(_Person(stand, said))
    else:
        named = GuessedSet({}, (stand or "Too few labels say which landmark they mark, so no marker set can be guessed.",))
    plain = plain_labels(at)
    person = None if named.name else standing_by_points({label: at[label] for label in plain})
    if person is None:
        return named
    words = side_words((plain[right], plain[left]) for right, left in mirror_images(person))
    if sides_exchanged(words):
        return named
    stood = _guess_of(_Person(replace(person, at=at), meanings_of(at, sides=words)))
    return stood if stood.name or len(stood.map) > len(named.map) else named


def _spelled(rank: int) -> float:
    """Return the cost of a spelling, nats."""
    return float(np.log1p(rank / _RANK))


def _by_names(said: _Said, stand: Standing | None = None) -> dict[str, str]:
    """Return landmark -> label by the names, and by the heights of a person whose places are not known yet."""
    cost = np.full((len(said), len(LANDMARKS)), np.inf)
    for i, (label, ways) in enumerate(said.items()):
        for one in ways:
            if one.place in LANDMARKS:
                high = _high(stand, one.place, label) if stand else 0.0
                cost[i, LANDMARKS.index(one.place)] = _spelled(one.rank) + high - _NAMED
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


def _distances(shares: Array, known: Mapping[str, int]) -> Array:
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


class _Person:
    """A standing person whose labels say something (label -> meanings): what every label (N) may be of all landmarks
    (P), and their assignment.
    """

    def __init__(self, stand: Standing, said: _Said) -> None:
        self.labels = list(plain_labels(stand.at))
        self.said = {label: said.get(label, ()) for label in self.labels}
        self.named = _by_names(self.said, stand)
        self.stand = stand = replace(stand, named=self.named)
        self.confirmed = {
            label: tuple(one for one in ways if stand.believed(one.place, label)) for label, ways in self.said.items()
        }
        self.sure = _by_names(self.confirmed, stand)
        self.shares = stand.shares(self.labels)
        told = sides_of(stand.at)
        lies = dict(zip(self.labels, np.where(self.shares[:, 0] > 0, *SIDES), strict=True))
        agree = [lies[label] == side for label, side in told.items()]
        self.sides = told if agree and np.mean(agree) > _BELIEVED else {}
        self.words = np.full((len(self.labels), len(LANDMARKS)), np.inf)
        self.high, self.free = np.zeros(self.words.shape), np.zeros(self.words.shape, dtype=bool)
        for i, label in enumerate(self.labels):
            for place, cost in self._named(label):
                self.words[i, LANDMARKS.index(place)] = cost
                known = part_of(place) in usual_standing()["places"]
                self.high[i, LANDMARKS.index(place)] = 0.0 if known else _high(stand, place, label)
            for place in _FREE:
                self.free[i, LANDMARKS.index(place)] = self._may_be(label, place)
        self.free &= ~np.isfinite(self.words)
        for side, joint in product(SIDES, ("elbow", "toe")):  # whose ends have no usual place: lateral is outside
            lateral, medial = (LANDMARKS.index(f"{side}_{joint}_{end}") for end in _ENDS)
            either = np.isfinite(self.words[:, [lateral, medial]]).any(axis=1)
            out = OUTWARDS[side] * self.shares[:, 0]
            outside = _OUTER * np.clip((out - out[either].mean()) / _SAME, -1.0, 1.0) if either.any() else 0.0
            self.high[:, lateral] -= outside
            self.high[:, medial] += outside

    def _named(self, label: str) -> Iterator[tuple[str, float]]:
        """Yield the landmarks that the words of a label mean, or which it is if they mean the other side or the other
        end of the joint and it stands there, with the cost of the words, nats.
        """
        for other in self._misread(self.said[label]):
            first = self.said[label][0]
            if self.stand.believed(other, label):
                more = _OTHER_END if other[0] == first.place[0] else _OTHER_SIDE
                yield other, _spelled(first.rank) + more
        for one in reversed(self.confirmed[label]):
            if one.place in LANDMARKS:
                yield one.place, _spelled(one.rank)

    def _misread(self, ways: tuple[Meaning, ...]) -> Iterator[str]:
        """Yield the same landmark of the other side for a label that does not stand on its own, and the other end."""
        said = ways[0].place if ways else ""
        if said not in LANDMARKS or not said.startswith(SIDES):
            return
        joint, _, end = said.rpartition("_")
        # A forearm turns: names of the two ends of an elbow are believed, unless both have the same.
        twice = sum(other[0].place == said for other in self.said.values() if other) > 1
        if end in _ENDS and joint.endswith(("knee", "ankle", "toe", "elbow" if twice else "toe")):
            yield f"{joint}_{_ENDS[end]}"
        if not any(self.stand.believed(said, label) for label, other in self.said.items() if other is ways):
            yield _other_side(said)

    def _may_be(self, label: str, place: str) -> bool:
        """Return whether a label that does not name a landmark may mark it: it says nothing, or the segment alone."""
        side, part, ways = place.partition("_")[0], part_of(place), self.confirmed[label]
        have, middle = {part_of(one) for one in self.sure}, abs(self.shares[self.labels.index(label), 0]) < _SAME
        if self.sides.get(label, side) != side:
            return False
        if part.endswith("psis") and (not have.isdisjoint({"mid_psis", part}) or middle != (part == "mid_psis")):
            return False
        if part == "mid_psis" and "psis" in have:
            return False
        if part in _TOES and any(f"{side}_{toe}" in self.sure for toe in _TOES):
            return False
        own = (one.place not in LANDMARKS and (one.place.startswith(side) or part.endswith("sis")) for one in ways)
        return not ways or (part not in _USEFUL and all(own))

    def assignment(self) -> dict[str, str]:
        """Return landmark -> label: the cheapest assignment given what is certain, again until nothing more is."""
        claims = Counter(ways[0].place for ways in self.confirmed.values() if ways)
        # Which end of its joint the only marker that names one is, is not known yet.
        known = {
            place: label
            for place, label in self.sure.items()
            if claims[place] < 2 and (part_of(place) not in _EITHER or self.sure.keys() >= {*_both_ends(place)})
        }
        fixed: dict[str, str] = {}
        while True:
            cost, loose = self._costs(known, fixed)
            pairs, least = _cheapest(cost)
            new = {
                LANDMARKS[j]: self.labels[i]
                for i, j in pairs
                if not self.free[i, j] or LANDMARKS[j] in fixed or self._margin(i, j, cost, loose) - least >= _MARGIN
            }
            away = self._distances(new)
            for place, label in tuple(new.items()):
                i, j = self.labels.index(label), LANDMARKS.index(place)
                if self.free[i, j] and part_of(place) not in _TOES and away[i, j] > NEAR / 2:  # what was taken with it says that it is elsewhere
                    self.free[i, j] = False
                    del new[place]
            if len(new) == len(fixed):
                return new
            known = fixed = new

    def _distances(self, known: Mapping[str, str]) -> Array:
        """Return (N, P) half the squared distances, given landmarks that are known; inf where none has a usual place."""
        away = np.full(self.words.shape, np.inf)
        shares = self.shares - [0.0, self._ankles(known), 0.0]
        rows = {place: self.labels.index(label) for place, label in known.items()}
        away[:, [LANDMARKS.index(place) for place in _template()[0]]] = _distances(shares, rows) / 2
        for side in SIDES:  # which marker of the front of a foot it is tells its place across, not how far it is
            for toe in _TOES[1:]:
                away[:, LANDMARKS.index(f"{side}_{toe}")] = away[:, LANDMARKS.index(f"{side}_toe")]
        return away

    def is_inferred(self, place: str, label: str) -> bool:
        """Return whether the words of a label do not name a landmark, not even by mistake."""
        return not np.isfinite(self.words[self.labels.index(label), LANDMARKS.index(place)])

    def _margin(self, row: int, column: int, cost: Array, loose: Array) -> float:
        """Return the sum of the next best assignment, in which no marker at this place is the landmark."""
        beside = np.linalg.norm(self.shares - self.shares[row], axis=1) <= _SAME
        other = cost.copy()
        other[:, column] = np.where(beside, np.inf, np.minimum(cost[:, column], loose[:, column]))
        return _cheapest(other)[1]

    def _costs(self, known: Mapping[str, str], fixed: Mapping[str, str]) -> tuple[Array, Array]:
        """Return the costs (N, P) given landmarks that are ``known``, and those of labels without the name as far away
        as they compete; what is ``fixed`` stays.
        """
        usual, away = self._distances({}), self._distances(known)
        gain = np.array([_NEED * (part_of(place) in _GAINS) for place in LANDMARKS])
        cost = self.words + np.where(np.isfinite(away), np.minimum(away, _FARTHEST), 0.0) + self.high - _NAMED - gain
        free = self.free & self._at_ends_of_feet(np.minimum(usual, away), set(known.values()))
        silent = np.array([_SEGMENT * bool(self.confirmed[label]) for label in self.labels])
        front = [LANDMARKS.index(f"{side}_{toe}") for side in SIDES for toe in _TOES]
        away[:, front] = usual[:, front]  # which of them is there is not known: the foot may turn about them
        away += silent[:, None]
        loose = np.where(free & (away < NEAR / 2 + _MARGIN), away - _MUTE - gain, np.inf)
        for i, j in np.argwhere(free & (away < NEAR / 2)):
            if self.stand.believed(LANDMARKS[j], self.labels[i]):
                cost[i, j] = loose[i, j]
        for place, label in fixed.items():
            i, j = self.labels.index(label), LANDMARKS.index(place)
            cost[i], cost[:, j], loose[i], loose[:, j] = np.inf, np.inf, np.inf, np.inf
            cost[i, j] = -_NAMED - _NEED
        return cost, loose

    def _ankles(self, known: Mapping[str, str]) -> float:
        """Return where the ankles are along the person's ahead, in shares of the stature."""
        ahead = {place: self.shares[self.labels.index(label), 1] for place, label in known.items()}
        ankles, spines = ([ahead.get(f"{side}_{part}") for side in SIDES] for part in ("ankle_lateral", "asis"))
        if None not in ankles:
            return float(np.mean(ankles))
        if self.named and None not in spines:
            return float(np.mean(spines) - usual_standing()["places"]["asis"]["at"][1])
        return float(self.stand.middle @ self.stand.ahead / self.stand.stature)

    def _at_ends_of_feet(self, usual: Array, taken: Collection[str]) -> Array:
        """Return (N, P) whether a label may be a heel or toe by its place: the hindmost and foremost of a foot, or both
        markers at its ball where both feet have two.
        """
        may = np.ones(usual.shape, dtype=bool)
        may[:, [j for j, place in enumerate(LANDMARKS) if part_of(place) in ("heel", *_TOES)]] = False
        balls: dict[str, int] = {}
        idle = np.array([label not in taken for label in self.labels])
        for side in SIDES:
            hind, front = (
                np.flatnonzero(idle & self.free[:, j] & (usual[:, j] < NEAR / 2))
                for j in (LANDMARKS.index(f"{side}_{end}") for end in ("heel", "toe"))
            )
            out = OUTWARDS[side] * self.shares[:, 0]
            if hind.size:
                may[hind[self.shares[hind, 1].argmin()], LANDMARKS.index(f"{side}_heel")] = True
            if front.size:
                may[front[self.shares[front, 1].argmax()], LANDMARKS.index(f"{side}_toe")] = True
                outer, inner = front[out[front].argmax()], front[out[front].argmin()]
                across, along = np.abs(self.shares[outer] - self.shares[inner])[:2]
                if along < across and np.hypot(across, along) > _BALL:
                    balls |= {f"{side}_toe_lateral": outer, f"{side}_toe_medial": inner}
        if len(balls) == 2 * len(SIDES):
            may[:, [LANDMARKS.index(f"{side}_toe") for side in SIDES]] = False
            for place, row in balls.items():
                may[row, LANDMARKS.index(place)] = True
        return may


def _both_ends(place: str) -> tuple[str, ...]:
    """Return the lateral and the medial landmark of a joint."""
    return tuple(f"{place.rpartition('_')[0]}_{end}" for end in _ENDS)


def _other_side(place: str) -> str:
    """Return the same landmark of the other side."""
    side, _, part = place.partition("_")
    return f"{'left' if side == 'right' else 'right'}_{part}"


def _words(place: str) -> str:
    return place.replace("_", " ")


def _guess_of(person: _Person) -> GuessedSet:
    """Return the guess: the assignment, if it has what a body needs and the person confirms what the labels name."""
    places = person.assignment()
    doubts = [*_contradictions(person, places), *_inferences(person, places)]
    absent = [
        f"{side} {_words(part)}"
        for side in SIDES
        for part, others in _NEEDS.items()
        if not any(f"{side}_{one}" in places for one in others)
    ]
    if "mid_psis" not in places and not {"left_psis", "right_psis"} <= places.keys():
        absent.append("the posterior iliac spines or the sacrum")
    reasons = [f"No marker could be taken for: {', '.join(absent)}."] if absent else []
    usual = [label for label in person.named.values() if person.said[label][0].rank < _USUAL]
    other = {places.get(_other_side(place)) for place, label in person.named.items() if not person.confirmed[label]}
    refuted = [label for label in usual if not person.confirmed[label] and label not in other]
    if len(usual) - len(refuted) < _BELIEVED * len(usual):
        reasons.append(
            f"Only {len(usual) - len(refuted)} of {len(usual)} landmarks that the labels name stand where a person has "
            f"them; elsewhere: {', '.join(refuted)}."
        )
    map_ = {label: place for place, label in places.items()} | _segments(person, set(places.values()))
    if reasons:
        return GuessedSet(map_, (" ".join(reasons), *doubts))
    return GuessedSet(map_, tuple(doubts), GUESSED + json.dumps(map_, separators=(",", ":")))


def _contradictions(person: _Person, places: Mapping[str, str]) -> Iterator[str]:
    """Yield, in sentences, what labels say and the person does not have."""
    landmarks = {label: place for place, label in places.items()}
    for place, label in person.named.items():
        if label not in landmarks and not person.confirmed[label]:
            yield f"{label} was not taken for the {_words(place)}: no standing person has it there."
    for place, label in places.items():
        if place in (one.place for one in person.confirmed[label]) or person.is_inferred(place, label):
            continue
        said, side, joint = person.said[label][0].place, place.partition("_")[0], place.rpartition("_")[0]
        other = places.get(said, "")
        if said == _other_side(place) and other:
            if side == "right":
                yield f"{label} and {other} lie on each other's sides: taken for the {_words(part_of(place))} of the side where they are."
        elif not other:
            yield f"{label} is the only marker there: taken for the {_words(place)}, against its name."
        elif place.endswith("lateral"):
            yield (
                f"{label} lies outside {other}, so it was taken for the lateral marker of the "
                f"{_words(joint)}, against its name."
            )


def _inferences(person: _Person, places: Mapping[str, str]) -> Iterator[str]:
    """Yield, in sentences, which labels were taken for landmarks that they do not name."""
    mute = {place: label for place, label in places.items() if person.is_inferred(place, label)}
    for place, label in mute.items():
        inner = places.get(place.replace("lateral", "medial"), label)
        mirror = places.get(_other_side(place))
        if place.endswith("lateral") and inner not in (label, *mute.values()):
            yield (
                f"{label} lies across the {_words(place.rpartition('_')[0])} from {inner}, outside: it was taken for the lateral "
                f"marker, {inner} for the medial one."
            )
        elif mirror and mirror not in mute.values():
            yield f"{label} lies where the mirror image of {mirror} is: taken for the {_words(place)}."
        else:
            yield f"{label} stands where people have the {_words(place)}, and no other marker does: taken for it."


def _segments(person: _Person, taken: Collection[str]) -> dict[str, str]:
    """Return label -> the segment that it names, or whose landmark another label has; the head's front or back."""
    found = {}
    for label, several in person.confirmed.items():
        if label in taken:
            continue
        whole = next((one.place for one in several if one.place in MIDLINE and one.place.startswith("head")), None)
        segment = next((one.place for one in several if one.place not in LANDMARKS), None)
        on = {segment_of(one.place) for one in several if one.place in LANDMARKS}
        if len(on) == 1 and (segment is None or several[0].place.endswith("_wand")):
            segment = on.pop()
        if whole or segment:
            found[label] = whole or segment or ""
    return found


def dress(trials: Sequence[Trial]) -> tuple[list[Trial], list[str]]:
    """Return the trials, all with one marker set where their labels allow it, and what was found in sentences.

    The set is that of the first static trial, else of the trial with most markers; where no known set fits that trial,
    it is guessed from its names and posture. A moving trial that lacks markers of the static one (medial markers, an
    alignment device) is read with the same set; a trial that a known set fits better keeps that.
    """
    worn = [trial for trial in trials if trial.markers is not None]
    if not worn:
        return list(trials), []
    order = sorted(worn, key=lambda trial: (trial.role != "static", -len(trial.markers.names if trial.markers else ())))
    if any(trial.marker_set for trial in order):
        leader = next(trial for trial in order if trial.marker_set)
        found, notes = read_marker_set(leader.marker_set), []
    else:
        guesses = [(trial, guess_set(trial.markers)) for trial in order if trial.markers is not None]
        leader, guess = next(((trial, one) for trial, one in guesses if one.name), guesses[0])
        notes = [said_of(guess, leader.name)]
        if not guess.name:
            return [_doubting(trial, guess) for trial in trials], notes
        found = read_marker_set(guess.name)
    return [_with(trial, found) for trial in trials], notes


def said_of(guess: GuessedSet, name: str) -> str:
    """Return what was guessed in ``name``, or why nothing was, as one sentence for a person."""
    if not guess.name:
        return (
            f"{name}: its labels are of no known marker set, and none could be guessed: {guess.doubts[0]} Name the set "
            f'with --markers FILE, or write [markers] map = {{LABEL = "left_asis", ...}} into session.toml.'
        )
    listed = ", ".join(f"{label} = {place}" for label, place in guess.map.items())
    doubts = f" Doubtful: {' '.join(guess.doubts)}" if guess.doubts else ""
    return (
        f"{name}: its labels are of no known marker set; the map was guessed from names and posture: {listed}.{doubts} "
        f"`biodance init` writes it into session.toml, to be confirmed or corrected."
    )


def _with(trial: Trial, found: MarkerSet) -> Trial:
    """Return a trial with the session's set, unless its own fits more of its labels."""
    if trial.markers is None or trial.marker_set == found.name:
        return trial
    matched = found.match(trial.markers.names)
    own = len(read_marker_set(trial.marker_set).match(trial.markers.names)) if trial.marker_set else 0
    if len(matched) < _SHARED or len(matched) < own:
        return trial
    return replace(trial, marker_set=found.name)


def _doubting(trial: Trial, guess: GuessedSet) -> Trial:
    """Return a trial of no known set with the reason why none was guessed."""
    if trial.markers is None:
        return trial
    return replace(trial, warnings=(*trial.warnings, f"No marker set could be guessed: {guess.doubts[0]}"))

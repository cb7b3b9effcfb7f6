"""A marker set that nobody described, guessed from what its labels say and from where the markers are on a standing
person: one assignment (`_PersonLabels`).
"""

import json
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np
from scipy.optimize import linear_sum_assignment

from biodance.display import spaced
from biodance.lab.markers import upright
from biodance.lab.markers.names import (
    Meaning,
    joints_from_video,
    meanings_of,
    plain_labels,
    side_words,
    sides_exchanged,
    sides_of,
)
from biodance.lab.markers.sets import (
    GUESSED,
    LANDMARKS,
    MIDLINE,
    other_end,
    other_side,
    part_of,
    segment_of,
)
from biodance.records import SIDES, Array, Markers, Mask

_TOES = ("toe", "toe_lateral", "toe_medial")
_NEEDS = {one: (one,) for one in ("asis", "knee_lateral", "ankle_lateral", "heel")} | {"toe": _TOES}
"""Landmarks that a body needs on each side, and what stands in for them."""
_USEFUL = ("knee_medial", "ankle_medial", "acromion")
"""Landmarks that posture tells as well, for labels that say nothing."""
_FREE = (*(f"{side}_{part}" for side in SIDES for part in (*_NEEDS, *_TOES[1:], "psis", *_USEFUL)), "mid_psis")
"""Landmarks that a label may be taken for that does not name them."""
_AT = {place: j for j, place in enumerate(LANDMARKS)}

_Said = Mapping[str, tuple[Meaning, ...]]


def _nats(name: str) -> float:
    return float(upright.usual_standing()["nats"][name])


def _spelled(rank: int) -> float:
    """Return the cost of a spelling, nats."""
    return float(np.log1p(rank / _nats("rank")))


def _by_names(said: _Said, stand: upright.Standing | None = None) -> dict[str, str]:
    """Return landmark -> label by the names, and by the heights of a person whose places are not known yet."""
    cost = np.full((len(said), len(LANDMARKS)), np.inf)
    for i, (label, ways) in enumerate(said.items()):
        for one in ways:
            if one.place in LANDMARKS:
                cost[i, _AT[one.place]] = _spelled(one.rank) - _nats("named")
                cost[i, _AT[one.place]] += _high(stand, one.place, label) if stand else 0.0
    return {LANDMARKS[j]: list(said)[i] for i, j in _cheapest(cost)[0]}


def _high(stand: upright.Standing, place: str, label: str) -> float:
    """Return the cost of a height, nats: 2 at the limit where it is believed, none within half of it."""
    return 2 * max(stand.misfit(place, label) - 0.5, 0.0)


def _cheapest(cost: Array) -> tuple[list[tuple[int, int]], float]:
    """Return (row, column) of the cheapest assignment of ``cost`` (N, P), in which rows may stay, and its sum."""
    some, places = cost.shape
    # One column more for each row: staying unassigned costs nothing; impossible pairs cost far more.
    whole = np.full((some, places + some), 1e6)
    whole[:, :places] = np.minimum(cost, 1e6)
    np.fill_diagonal(whole[:, places:], 0.0)
    rows, columns = linear_sum_assignment(whole)
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return [(i, j) for i, j in pairs if j < places and cost[i, j] < 0], float(whole[rows, columns].sum())


@cache
def _template() -> tuple[tuple[str, ...], Array, Array]:
    """Return the landmarks with a usual place, it (P, 3), and covariances (3, P, P): shares of the stature."""
    usual = upright.usual_standing()
    parts = {part: ("",) if part in ("mid_psis", "c7") else SIDES for part in usual["places"]}
    places = tuple(f"{side}_{part}" if side else part for part, sides in parts.items() for side in sides)
    part, side = [part_of(place) for place in places], [place.startswith("left") for place in places]
    joint = [one.partition("_")[0] for one in part]
    leg = np.array([one in ("knee", "ankle", "heel", "toe") for one in joint])
    same, ends, across = (np.equal.outer(np.array(one), np.array(one)) for one in (part, joint, side))
    at, sd = (np.array([usual["places"][one][word] for one in part]) for word in ("at", "sd"))
    # Products of what the places share: same landmark, two ends of a joint, both of a leg, and
    # one side with the other.
    alike = [
        np.where(same, 1.0, np.where(ends, end, np.where(np.outer(leg, leg), limb, 0.0))) * np.where(across, 1.0, other)
        for end, limb, other in (usual["together"][axis] for axis in ("out", "ahead", "up"))
    ]
    # Correlation times both standard deviations.
    return places, at, np.array([one * np.outer(sd[:, k], sd[:, k]) for k, one in enumerate(alike)])


def _squares(shares: Array, known: Mapping[str, int]) -> Array:
    """Return (N, P) squared distances, in sd, of markers (N, 3) from landmarks, given the ``known`` ones' rows."""
    places, at, covariance = _template()
    sides = np.array([upright.OUTWARDS.get(place.partition("_")[0], 1.0) for place in places])
    have = [k for k, place in enumerate(places) if place in known]
    total = np.zeros((len(shares), len(places)))
    for axis, cov in enumerate(covariance):
        # x is counted outwards on both sides.
        x = shares[:, axis, None] * (sides if axis == 0 else np.ones(len(places)))
        mean, variance = at[:, axis].copy(), np.diag(cov).copy()
        if have:
            # C_kk + g²: the known ones are glued with an error of their own.
            inverse = np.linalg.inv(cov[np.ix_(have, have)] + upright.bound("glued") ** 2 * np.eye(len(have)))
            off = x[[known[places[k]] for k in have], have] - mean[have]
            off = np.clip(off, *(sign * 3 * np.sqrt(variance[have]) for sign in (-1, 1)))  # one odd marker moves little
            # what all others tell of a known one: x_i - mu_i(others) = (C^-1 off)_i / (C^-1)_ii
            left_out = off - inverse @ off / np.diag(inverse)
            # conditional mean and variance of a Gaussian, given the known ones
            mean += cov[:, have] @ inverse @ off
            variance -= np.einsum("ij,jk,ik->i", cov[:, have], inverse, cov[:, have])
            mean[have], variance[have] = at[have, axis] + left_out, 1 / np.diag(inverse)
        # Squares over the axes add up; no variance below that of the gluing.
        total += (x - mean) ** 2 / np.maximum(variance, upright.bound("glued") ** 2)
    return total


class _PersonLabels:
    """The labels of a standing person, what they may mean (label -> meanings) and what each is (`assignment`).

    ``confirmed`` label -> what it may mean and stands where this person may have it; ``named`` landmark -> label by the
    names alone. ``words`` (N, P) nats: what the words cost every label for every landmark, inf where they do not name
    it; ``free`` (N, P): where it may be one that they do not name.
    """

    def __init__(self, stand: upright.Standing, said: _Said) -> None:
        self.rows = {label: i for i, label in enumerate(plain_labels(stand.at))}
        self.said = {label: said.get(label, ()) for label in self.rows}
        self.named = _by_names(self.said, stand)
        self._stand = stand = replace(stand, named=self.named)
        self.confirmed = {
            label: tuple(one for one in ways if stand.believed(one.place, label)) for label, ways in self.said.items()
        }
        self._sure = _by_names(self.confirmed, stand)
        self._shares = stand.shares(self.rows)
        told = sides_of(stand.at)
        agree = [told[label] == SIDES[int(self._shares[i, 0] < 0)] for label, i in self.rows.items() if label in told]
        self._sides = told if agree and np.mean(agree) > upright.bound("believed") else {}
        self.words = np.full((len(self.rows), len(LANDMARKS)), np.inf)
        self.free = np.zeros(self.words.shape, dtype=bool)
        for label, i in self.rows.items():
            for place, cost in self._wordings(label):
                self.words[i, _AT[place]] = cost
            self.free[i, [_AT[place] for place in self._open_to(label)]] = True
        self.free &= ~np.isfinite(self.words)
        self._unplaced = self._by_height_and_width()

    def _wordings(self, label: str) -> Iterator[tuple[str, float]]:
        """Yield the landmarks that a label names, or names by mistake, and what its words cost, nats."""
        ways = self.said[label]
        said = ways[0].place if ways else ""
        misread, end = [], other_end(said)
        # A forearm turns: names of the two ends of an elbow are believed, unless both have the same.
        twice = sum(other[0].place == said for other in self.said.values() if other) > 1
        if end and part_of(end).startswith(("knee", "ankle", *["elbow"] * twice, *["toe"] * (end in self.named))):
            misread.append((end, _nats("other_end")))
        if said in LANDMARKS and said.startswith(SIDES) and not self._stand.believed(said, label):
            misread.append((other_side(said), _nats("other_side")))
        for place, more in misread:
            if self._stand.believed(place, label):
                yield place, _spelled(ways[0].rank) + more
        for one in reversed(self.confirmed[label]):
            if one.place in LANDMARKS:
                yield one.place, _spelled(one.rank)

    def _open_to(self, label: str) -> Iterator[str]:
        """Yield what a label may mark that does not name it: it says nothing, or no more than the segment."""
        ways, own = self.confirmed[label], self._sides.get(label)
        have, middle = (
            {part_of(one) for one in self._sure},
            abs(self._shares[self.rows[label], 0]) < upright.bound("same"),
        )
        for place in _FREE:
            side, part = place.partition("_")[0], part_of(place)
            named = {"mid_psis"} if part == "psis" else {"mid_psis", "psis"} if part == "mid_psis" else set()
            there = part.endswith("psis") and middle != (part == "mid_psis")
            toes = part in _TOES and any(f"{side}_{toe}" in self._sure for toe in _TOES)
            if own not in (None, side) or named & have or there or toes or (ways and part in _USEFUL):
                continue
            if all(one.place not in LANDMARKS and (one.place.startswith(side) or part.endswith("sis")) for one in ways):
                yield place

    def _by_height_and_width(self) -> Array:
        """Return the cost (N, P), nats, of heights where there is no usual place, and of ends of elbows and toes."""
        cost, labels, usual = np.zeros(self.words.shape), list(self.rows), upright.usual_standing()["places"]
        for i, j in np.argwhere(np.isfinite(self.words)):
            if part_of(LANDMARKS[j]) not in usual:
                cost[i, j] = _high(self._stand, LANDMARKS[j], labels[i])
        for side, joint in product(SIDES, ("elbow", "toe")):
            lateral, medial = (_AT[f"{side}_{joint}_{end}"] for end in ("lateral", "medial"))
            either = np.isfinite(self.words[:, [lateral, medial]]).any(axis=1)
            out = upright.OUTWARDS[side] * self._shares[:, 0]
            middle = out[either].mean() if either.any() else 0.0
            outside = _nats("outer") * np.clip((out - middle) / upright.bound("same"), -1.0, 1.0)
            cost[:, [lateral, medial]] += np.stack([-outside, outside], axis=1)
        return cost

    def assignment(self) -> dict[str, str]:
        """Return landmark -> label: the cheapest assignment given what is certain, again until nothing more is."""
        labels, free = list(self.rows), self.free.copy()
        claims = Counter(ways[0].place for ways in self.confirmed.values() if ways)
        # Which end of its joint the only marker that names one is, is not known yet.
        alone = [place for place in self._sure if other_end(place) not in (None, *self._sure)]
        known = {place: one for place, one in self._sure.items() if claims[place] < 2 and place not in alone}
        fixed: dict[str, str] = {}
        while True:
            cost, rivals = self._costs(known, fixed, free)
            pairs, least = _cheapest(cost)
            new = dict(fixed)
            for i, j in pairs:
                # the next best assignment, in which no marker at this place is the landmark
                beside, other = np.linalg.norm(self._shares - self._shares[i], axis=1), cost.copy()
                column = np.minimum(cost[:, j], rivals[:, j])
                other[:, j] = np.where(beside <= upright.bound("same"), np.inf, column)
                if not free[i, j] or _cheapest(other)[1] - least >= _nats("margin"):
                    new[LANDMARKS[j]] = labels[i]
            away = self._distances(new)
            for place, label in tuple(new.items()):
                i, j = self.rows[label], _AT[place]
                if free[i, j] and part_of(place) not in _TOES and away[i, j] > upright.bound("near") / 2:
                    free[i, j] = False  # what was taken with it says that it is elsewhere
                    del new[place]
            if new == fixed:
                return new
            known = fixed = new

    def _costs(self, known: Mapping[str, str], fixed: Mapping[str, str], free: Mask) -> tuple[Array, Array]:
        """Return the costs (N, P) given the ``known`` landmarks, and those of rivals; what is ``fixed`` stays."""
        usual, away, labels = self._distances({}), self._distances(known), list(self.rows)
        # A body gains by a marker of what it needs, and by one behind the pelvis.
        gain = np.array([_nats("needed") * (part_of(place) in (*_NEEDS, "psis", "mid_psis")) for place in LANDMARKS])
        placed = np.where(np.isfinite(away), np.minimum(away, _nats("farthest")), 0.0) + self._unplaced
        cost = self.words + placed - _nats("named") - gain
        open_ = free & self._at_ends_of_feet(np.minimum(usual, away), free, set(known.values()))
        front = [_AT[f"{side}_{toe}"] for side in SIDES for toe in _TOES]
        away[:, front] = usual[:, front]  # it is not known which toe is there: the foot may turn
        away += np.array([[_nats("segment") * bool(ways)] for ways in self.confirmed.values()])
        rivals = np.where(
            open_ & (away < upright.bound("near") / 2 + _nats("margin")), away - _nats("mute") - gain, np.inf
        )
        for i, j in np.argwhere(open_ & (away < upright.bound("near") / 2)):
            if self._stand.believed(LANDMARKS[j], labels[i]):
                cost[i, j] = rivals[i, j]
        for place, label in fixed.items():
            cost[self.rows[label]] = rivals[self.rows[label]] = np.inf
            cost[:, _AT[place]] = rivals[:, _AT[place]] = np.inf
            cost[self.rows[label], _AT[place]] = -_nats("named") - _nats("needed")
        return cost, rivals

    def is_named(self, place: str, label: str) -> bool:
        """Return whether the words of a label name a landmark, or name it by mistake."""
        return bool(np.isfinite(self.words[self.rows[label], _AT[place]]))

    def _distances(self, known: Mapping[str, str]) -> Array:
        """Return (N, P) half the squared distances given ``known`` landmarks; inf for those without usual place."""
        away = np.full(self.words.shape, np.inf)
        rows = {place: self.rows[label] for place, label in known.items()}
        # -log of a Gaussian density but for constants: half the squared distance.
        away[:, [_AT[place] for place in _template()[0]]] = _squares(self._shares, rows) / 2
        for side, toe in product(SIDES, _TOES[1:]):
            away[:, _AT[f"{side}_{toe}"]] = away[:, _AT[f"{side}_toe"]]
        return away

    def _at_ends_of_feet(self, away: Array, free: Mask, taken: Collection[str]) -> Mask:
        """Return (N, P) whether a label may be a heel or toe: the hindmost and foremost of a foot, or its ball."""
        ends, balls = dict[str, int](), dict[str, int]()
        mute = np.array([not ways for ways in self.confirmed.values()])
        here = free & (away < upright.bound("near") / 2) & np.array([[label not in taken] for label in self.rows])
        for side in SIDES:
            out, ahead = upright.OUTWARDS[side] * self._shares[:, 0], self._shares[:, 1]
            hind, front = (np.flatnonzero(here[:, _AT[f"{side}_{end}"]]) for end in ("heel", "toe"))
            front = front[mute[front]] if mute[front].any() else front
            if hind.size:
                ends[f"{side}_heel"] = hind[ahead[hind].argmin()]
            if front.size:
                ends[f"{side}_toe"] = front[ahead[front].argmax()]
                outer, inner = front[out[front].argmax()], front[out[front].argmin()]
                across, along = np.abs(self._shares[outer] - self._shares[inner])[:2]
                if along < across and np.hypot(across, along) > upright.bound("ball"):
                    balls |= {f"{side}_toe_lateral": outer, f"{side}_toe_medial": inner}
        if len(balls) == 2 * len(SIDES):
            ends = balls | {place: row for place, row in ends.items() if part_of(place) == "heel"}
        may = np.tile([part_of(place) not in ("heel", *_TOES) for place in LANDMARKS], (len(self.rows), 1))
        for place, row in ends.items():
            may[row, _AT[place]] = True
        return may


@dataclass(frozen=True, eq=False)
class _GuessedSet:
    """What was guessed: ``map`` label -> landmark or segment, "" ``name`` where it is not believed; ``doubts`` why
    markers were left out, or why nothing is guessed, in sentences.
    """

    map: Mapping[str, str]
    doubts: tuple[str, ...]
    name: str = ""


def guess_set(markers: Markers) -> _GuessedSet:
    """Return the guessed map of a recording's labels, from their names and the posture of its quietest half second.

    Geometry needs z up; for a recording without anybody upright nothing is believed.
    """
    at = upright.median_places(markers, upright.posture_frames(markers)[0])
    found = _guessed(at)
    joints = () if found.name else joints_from_video(at)
    said = (
        "These labels are joints, as software estimates them from video, not markers on the skin: "
        f"{', '.join(joints)}. A body is placed by markers on both iliac spines, at the side of knees and ankles, on "
        "heels and toes. Give positions of markers, for example the augmented markers (.trc) of the same software."
    )
    return replace(found, doubts=(said, *found.doubts)) if joints else found


def _guessed(at: Mapping[str, Array]) -> _GuessedSet:
    """Return the guess for the person whom the names show, else for the one whom the points show."""
    said = meanings_of(at)
    stand = upright.standing_by_names(at, _by_names(said))
    if isinstance(stand, upright.Standing):
        stand = upright.standing_by_names(at, _by_names(said, stand))
    if isinstance(stand, upright.Standing):
        named = _guess_of(_PersonLabels(stand, said))
    else:
        named = _GuessedSet(
            {}, (stand or "Too few labels say which landmark they mark, so no marker set can be guessed.",)
        )
    plain = plain_labels(at)
    person = None if named.name else upright.standing_by_points({label: at[label] for label in plain})
    if person is None:
        return named
    words = side_words((plain[right], plain[left]) for right, left in upright.mirror_images(person))
    if sides_exchanged(words):
        return named
    stood = _guess_of(_PersonLabels(replace(person, at=at), meanings_of(at, sides=words)))
    return stood if stood.name or len(stood.map) > len(named.map) else named


def _guess_of(person: _PersonLabels) -> _GuessedSet:
    """Return the guess: the assignment, if it has what a body needs and the person confirms what the labels name."""
    places = person.assignment()
    doubts = [*_contradictions(person, places), *_inferences(person, places)]
    absent = [
        f"{side} {spaced(part)}"
        for side in SIDES
        for part, others in _NEEDS.items()
        if not any(f"{side}_{one}" in places for one in others)
    ]
    if "mid_psis" not in places and not {"left_psis", "right_psis"} <= places.keys():
        absent.append("the posterior iliac spines or the sacrum")
    reasons = [f"No marker could be taken for: {', '.join(absent)}."] if absent else []
    usual = [label for label in person.named.values() if person.said[label][0].rank < upright.bound("usual")]
    other = {places.get(other_side(place)) for place, label in person.named.items() if not person.confirmed[label]}
    refuted = [label for label in usual if not person.confirmed[label] and label not in other]
    if len(usual) - len(refuted) < upright.bound("believed") * len(usual):
        reasons.append(
            f"Only {len(usual) - len(refuted)} of {len(usual)} landmarks that the labels name stand where a person has "
            f"them; elsewhere: {', '.join(refuted)}."
        )
    map_ = {label: place for place, label in places.items()} | _segments(person, set(places.values()))
    if reasons:
        return _GuessedSet(map_, (" ".join(reasons), *doubts))
    return _GuessedSet(map_, tuple(doubts), GUESSED + json.dumps(map_, separators=(",", ":")))


def _contradictions(person: _PersonLabels, places: Mapping[str, str]) -> Iterator[str]:
    """Yield, in sentences, what labels say and the person does not have."""
    landmarks = {label: place for place, label in places.items()}
    for place, label in person.named.items():
        if label not in landmarks and not person.confirmed[label]:
            yield f"{label} was not taken for the {spaced(place)}: no standing person has it there."
    for place, label in places.items():
        if place in (one.place for one in person.confirmed[label]) or not person.is_named(place, label):
            continue
        said, side, joint = person.said[label][0].place, place.partition("_")[0], place.rpartition("_")[0]
        other = places.get(said, "")
        if said == other_side(place) and other:
            if side == "right":
                yield (
                    f"{label} and {other} lie on each other's sides: taken for the {spaced(part_of(place))} of the "
                    f"side where they are."
                )
        elif not other:
            yield f"{label} is the only marker there: taken for the {spaced(place)}, against its name."
        elif place.endswith("lateral"):
            yield (
                f"{label} lies outside {other}, so it was taken for the lateral marker of the "
                f"{spaced(joint)}, against its name."
            )


def _inferences(person: _PersonLabels, places: Mapping[str, str]) -> Iterator[str]:
    """Yield, in sentences, which labels were taken for landmarks that they do not name."""
    mute = {place: label for place, label in places.items() if not person.is_named(place, label)}
    for place, label in mute.items():
        inner = places.get(place.replace("lateral", "medial"), label)
        mirror = places.get(other_side(place))
        if place.endswith("lateral") and inner not in (label, *mute.values()):
            yield (
                f"{label} lies across the {spaced(place.rpartition('_')[0])} from {inner}, outside: it was taken for "
                f"the lateral marker, {inner} for the medial one."
            )
        elif mirror and mirror not in mute.values():
            yield f"{label} lies where the mirror image of {mirror} is: taken for the {spaced(place)}."
        else:
            yield f"{label} stands where people have the {spaced(place)}, and no other marker does: taken for it."


def _segments(person: _PersonLabels, taken: Collection[str]) -> dict[str, str]:
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


def said_of(guess: _GuessedSet, name: str) -> str:
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

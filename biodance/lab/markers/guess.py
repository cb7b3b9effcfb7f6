"""A marker set that nobody described, guessed from what its labels say and from where the markers are on a standing
person (`assign`), and worn by the whole session.

A wrong map is worse than none: a landmark whose marker stands where no person has it is left out, and a guess that
lacks a landmark the body needs, or of which too much is contradicted, is none.
"""

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from biodance.lab.markers.assign import NEEDS, PersonLabels, by_names
from biodance.lab.markers.names import joints_from_video, meanings_of, sides_exchanged
from biodance.lab.markers.set_file import LANDMARKS, MIDLINE, other_side, part_of, segment_of
from biodance.lab.markers.sets import GUESSED, MarkerSet, read_marker_set
from biodance.lab.markers.spelling import plain_labels, side_words
from biodance.lab.markers.still import median_places, posture_frames
from biodance.lab.markers.upright import (
    Standing,
    bound,
    mirror_images,
    standing_by_names,
    standing_by_points,
)
from biodance.records import SIDES, Array, Markers, Trial

_SHARED = 6
"""Labels of the session's set that a trial must have to be read with it: three markers on each of two segments."""
_FROM_VIDEO = (
    "These labels are joints, as software estimates them from video, not markers on the skin: {named}. A body is "
    "placed by markers on both iliac spines, at the side of knees and ankles, on heels and toes. Give positions of "
    "markers, for example the augmented markers (.trc) of the same software."
)


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
    stand = standing_by_names(at, by_names(said))
    if isinstance(stand, Standing):
        stand = standing_by_names(at, by_names(said, stand))
    if isinstance(stand, Standing):
        named = _guess_of(PersonLabels(stand, said))
    else:
        named = GuessedSet(
            {}, (stand or "Too few labels say which landmark they mark, so no marker set can be guessed.",)
        )
    plain = plain_labels(at)
    person = None if named.name else standing_by_points({label: at[label] for label in plain})
    if person is None:
        return named
    words = side_words((plain[right], plain[left]) for right, left in mirror_images(person))
    if sides_exchanged(words):
        return named
    stood = _guess_of(PersonLabels(replace(person, at=at), meanings_of(at, sides=words)))
    return stood if stood.name or len(stood.map) > len(named.map) else named


def _words(place: str) -> str:
    return place.replace("_", " ")


def _guess_of(person: PersonLabels) -> GuessedSet:
    """Return the guess: the assignment, if it has what a body needs and the person confirms what the labels name."""
    places = person.assignment()
    doubts = [*_contradictions(person, places), *_inferences(person, places)]
    absent = [
        f"{side} {_words(part)}"
        for side in SIDES
        for part, others in NEEDS.items()
        if not any(f"{side}_{one}" in places for one in others)
    ]
    if "mid_psis" not in places and not {"left_psis", "right_psis"} <= places.keys():
        absent.append("the posterior iliac spines or the sacrum")
    reasons = [f"No marker could be taken for: {', '.join(absent)}."] if absent else []
    usual = [label for label in person.named.values() if person.said[label][0].rank < bound("usual")]
    other = {places.get(other_side(place)) for place, label in person.named.items() if not person.confirmed[label]}
    refuted = [label for label in usual if not person.confirmed[label] and label not in other]
    if len(usual) - len(refuted) < bound("believed") * len(usual):
        reasons.append(
            f"Only {len(usual) - len(refuted)} of {len(usual)} landmarks that the labels name stand where a person has "
            f"them; elsewhere: {', '.join(refuted)}."
        )
    map_ = {label: place for place, label in places.items()} | _segments(person, set(places.values()))
    if reasons:
        return GuessedSet(map_, (" ".join(reasons), *doubts))
    return GuessedSet(map_, tuple(doubts), GUESSED + json.dumps(map_, separators=(",", ":")))


def _contradictions(person: PersonLabels, places: Mapping[str, str]) -> Iterator[str]:
    """Yield, in sentences, what labels say and the person does not have."""
    landmarks = {label: place for place, label in places.items()}
    for place, label in person.named.items():
        if label not in landmarks and not person.confirmed[label]:
            yield f"{label} was not taken for the {_words(place)}: no standing person has it there."
    for place, label in places.items():
        if place in (one.place for one in person.confirmed[label]) or not person.is_named(place, label):
            continue
        said, side, joint = person.said[label][0].place, place.partition("_")[0], place.rpartition("_")[0]
        other = places.get(said, "")
        if said == other_side(place) and other:
            if side == "right":
                yield (
                    f"{label} and {other} lie on each other's sides: taken for the {_words(part_of(place))} of the "
                    f"side where they are."
                )
        elif not other:
            yield f"{label} is the only marker there: taken for the {_words(place)}, against its name."
        elif place.endswith("lateral"):
            yield (
                f"{label} lies outside {other}, so it was taken for the lateral marker of the "
                f"{_words(joint)}, against its name."
            )


def _inferences(person: PersonLabels, places: Mapping[str, str]) -> Iterator[str]:
    """Yield, in sentences, which labels were taken for landmarks that they do not name."""
    mute = {place: label for place, label in places.items() if not person.is_named(place, label)}
    for place, label in mute.items():
        inner = places.get(place.replace("lateral", "medial"), label)
        mirror = places.get(other_side(place))
        if place.endswith("lateral") and inner not in (label, *mute.values()):
            yield (
                f"{label} lies across the {_words(place.rpartition('_')[0])} from {inner}, outside: it was taken for "
                f"the lateral marker, {inner} for the medial one."
            )
        elif mirror and mirror not in mute.values():
            yield f"{label} lies where the mirror image of {mirror} is: taken for the {_words(place)}."
        else:
            yield f"{label} stands where people have the {_words(place)}, and no other marker does: taken for it."


def _segments(person: PersonLabels, taken: Collection[str]) -> dict[str, str]:
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

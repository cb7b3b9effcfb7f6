"""Which marker set a whole session was worn with: one for all its trials, found by labels, else guessed on the static
trial.
"""

from collections.abc import Sequence
from dataclasses import replace

from biodance.lab.markers.guess import GuessedSet, guess_set
from biodance.lab.markers.sets import MarkerSet, read_marker_set
from biodance.records import Trial

_SHARED = 6
"""Labels of the session's set that a trial must have to be read with it: three markers on each of two segments."""


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

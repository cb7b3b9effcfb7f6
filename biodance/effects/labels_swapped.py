"""Two markers carry each other's names: left and right, front and back of the wrist, for a whole session or from one
trial on.

Signature: a left marker on the right side, a wrist that is no mirror image of the other or turns the finger's marker to
the palm, a head, pelvis or foot that points backwards, distances within the head that are those of the static trial
under other names (two pairs at once, too); else both markers are far from the model, each where the other one should
be. Look-alikes: a marker that fell off (one of the two is right then). Separated by
exchanging the two names: only then does the body fit.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.effects._base.case import Case
from biodance.effects._base.exchanged_labels import Pair, arms_hang, exchanged_pairs
from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded
from biodance.effects._base.wrists import partner
from biodance.errors import BiodanceError
from biodance.motion.ik.inverse_kinematics import solve_ik
from biodance.records import Array, Markers, Session, Trial

_FAR = 0.04
"""m: RMS distance from which on a marker is suspected."""
SUSPECTS = 4
_FRAMES = 8
CASES = 2
"""At most so many suspects of so many trials are exchanged, in so many frames: a body that does not fit is slow to
track.
"""
ROUGH = 1e-3
"""m, tolerance of the trial trackings."""
BETTER = 0.3
"""Share of the squared distances that the exchange must leave at most."""


class LabelsSwapped(DiscreteEffect):
    """Two labels whose exchange makes the markers fit the body, or a left marker on the right side of its partner."""

    name = "labels_swapped"
    separated_by = "Exchange the two names: the body fits, or it does not."
    advice = "Exchange the two labels in the recording software, in every trial named, and export again."

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the pairs that the markers of each trial show, and where they show none those whose exchange makes
        the body fit.
        """
        found = exchanges(recorded)
        where: dict[Pair, list[str]] = {}
        for name, pairs in found.items():
            for pair in sorted(pairs):
                where.setdefault(pair, []).append(name)
        check = "labels of the markers"
        if where:
            return tuple(
                QualityCheck(
                    check, False, f"{a} and {b} carry each other's names in {', '.join(names)}.", cls.name, f"{a}/{b}"
                )
                for (a, b), names in where.items()
            )
        looked = any(trial.markers is not None for trial in recorded.session.trials)
        return (QualityCheck(check, True, "No two markers seem to carry each other's names."),) if looked else ()


def exchanges(recorded: Recorded) -> dict[str, frozenset[Pair]]:
    """Return by trial the pairs of labels that carry each other's names: as the markers alone show them, with and
    without plates, else by the exchange that makes the body fit.
    """
    known, found = _exchanges(recorded.session)
    for case in recorded.cases:
        more = {pair for pair in known if _is_open(case.trial, pair) and not fits_better(case, pair)}
        if more:
            found[case.trial.name] = found.get(case.trial.name, frozenset()) | more
    if not known:
        rest = tuple(case for case in recorded.cases if case.trial.name not in found)
        found |= {case.trial.name: frozenset(pairs) for case in _worst(rest) if (pairs := exchanged(case))}
    return found


def _exchanges(session: Session) -> tuple[frozenset[Pair], dict[str, frozenset[Pair]]]:
    """Return the pairs of labels that carry each other's names in the static trial, and those by trial, as the markers
    alone show them; with and without plates.
    """
    static = next((trial for trial in session.trials if trial.role == "static" and trial.markers is not None), None)
    hang = [trial.markers for trial in session.trials if trial.markers is not None and arms_hang(trial)]
    known = exchanged_pairs(static, None, frozenset(), hang) if static else frozenset()
    found = {trial.name: exchanged_pairs(trial, static, known, hang) for trial in session.trials}
    return known, {name: pairs for name, pairs in found.items() if pairs}


def _is_open(trial: Trial, pair: Pair) -> bool:
    """Return whether a trial's markers alone do not tell if it has the exchange of the static trial: front and back of
    a wrist, while the arms do anything.
    """
    sides = partner(pair[0]) == pair[1]
    return trial.markers is not None and not sides and not arms_hang(trial)


def fits_better(case: Case, pair: Pair) -> bool:
    """Return whether a trial's own markers of a ``pair`` lie nearer to the body under each other's names."""
    if case.trial.markers is None or any(name not in case.motion.marker_names for name in pair):
        return False
    frames = np.unique(np.linspace(0, case.motion.time.size - 1, _FRAMES).astype(int))
    as_is, other = (
        _distances(case.body, markers, frames, pair)
        for markers in (case.trial.markers, _renamed(case.trial.markers, pair))
    )
    return other < BETTER * as_is


def _distances(body: Body, markers: Markers, frames: Array, pair: Pair) -> float:
    """Return the mean square distance (m²) of the markers of a ``pair`` to the body in some frames; infinite where they
    do not determine it.
    """
    try:
        found = solve_ik(body, Markers(markers.names, markers.time[frames], markers.xyz[frames]), tolerance=ROUGH)
    except BiodanceError:
        return float("inf")
    return float(np.nanmean(found.residual[:, [found.marker_names.index(name) for name in pair]] ** 2))


def renamed(trial: Trial, pairs: Iterable[Pair]) -> Trial:
    """Return the trial with the names of each of the ``pairs`` exchanged; its history says so."""
    markers = trial.markers
    if markers is None:
        return trial
    for pair in pairs:
        markers = _renamed(markers, pair)
    said = tuple(f"The labels {a} and {b} were exchanged: they carried each other's names." for a, b in sorted(pairs))
    return replace(trial, markers=markers, history=(*trial.history, *said))


def _worst(cases: tuple[Case, ...]) -> list[Case]:
    """Return the trials whose markers are farthest from the body, at most CASES."""
    return sorted(
        cases, key=lambda case: -float(np.nanmean(case.motion.residual**2)) if case.motion.residual.size else 0.0
    )[:CASES]


def exchanged(case: Case) -> tuple[tuple[str, str], ...]:
    """Return the pairs of far markers of a trial whose exchange makes the body fit."""
    squares = np.where(np.isfinite(case.motion.residual), case.motion.residual, 0.0) ** 2
    far = np.sqrt(squares.mean(axis=0)) if len(squares) else np.zeros(0)
    order = [int(k) for k in np.argsort(-far)[:SUSPECTS] if far[k] > _FAR]
    if len(order) < 2 or case.trial.markers is None:
        return ()
    frames = np.unique(np.linspace(0, case.motion.time.size - 1, _FRAMES).astype(int))
    names = [case.motion.marker_names[k] for k in order]
    pairs = sorted(
        ((a, b) for i, a in enumerate(names) for b in names[i + 1 :]), key=lambda pair: partner(pair[0]) != pair[1]
    )
    before = _misfit(case.body, case.trial.markers, frames)
    for pair in pairs:
        if _misfit(case.body, _renamed(case.trial.markers, pair), frames) < BETTER * before:
            return ((min(pair), max(pair)),)
    return ()


def _misfit(body: Body, markers: Markers, frames: Array) -> float:
    """Return the mean square distance (m²) of some frames' markers to the body; infinite where they do not determine
    it.
    """
    some = Markers(markers.names, markers.time[frames], markers.xyz[frames])
    try:
        return float(np.nanmean(solve_ik(body, some, tolerance=ROUGH).residual ** 2))
    except BiodanceError:
        return float("inf")


def _renamed(markers: Markers, pair: tuple[str, str]) -> Markers:
    """Return the markers with two names exchanged."""
    other = {pair[0]: pair[1], pair[1]: pair[0]}
    return Markers(tuple(other.get(name, name) for name in markers.names), markers.time, markers.xyz)


EFFECT = LabelsSwapped

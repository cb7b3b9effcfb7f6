"""Two markers carry each other's names, for a session, from one trial on, or for a part of a trial."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.effects._base.exchanged_labels import Pair, Spans, arms_hang, exchanged_labels, renamed_markers, set_of
from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded
from biodance.effects._base.words import ACCEPT, About, CauseWords, CheckKind, SessionEntry
from biodance.errors import BiodanceError
from biodance.lab.markers.sets import canonical
from biodance.motion.ik.inverse_kinematics import solve_ik
from biodance.records import Array, Index, Markers, Session, Trial

_CHECK = "labels of the markers"
WORSE = 1.25
"""Times the distance (RMS) of a trial's markers from the body by which other names are refused: the wrists of HC038A11,
exchanged beyond doubt, bend after their wrong names and leave 1.07; hands exchanged wrongly leave 9.
"""
_FRAMES = 8
"""In so many frames the body is tracked with other names."""
_ROUGH = 1e-3
"""m, tolerance of these trackings."""


class LabelsSwapped(DiscreteEffect):
    """Two labels whose exchange gives rigid distances their size, or puts a left marker on its side of the body."""

    name = "labels_swapped"
    separated_by = "Exchange the two names: the distances on the segment fit, or they do not."
    advice = "Exchange the two labels in the recording software, in every trial named, and export again."
    about = About(
        what=(
            "Two markers carry each other's names: left and right, front and back of the wrist, for a whole session, "
            "from one trial on, or for a part of a trial."
        ),
        signature=(
            "Distances within a segment, or to the joint above it, that are those of the static trial under other "
            "names; where they cannot tell it, a left marker on the right side of pelvis and trunk, a wrist that is "
            "no mirror image of the other or turns the finger's marker to the palm, a head, pelvis or foot that "
            "points backwards."
        ),
        look_alikes="A marker that fell off or jumps (one of the two is right then).",
        settled_by="Exchanging the two names: only then do the distances fit.",
    )
    words = CauseWords(
        "{pairs} carry each other's names",
        f"Exchange them{ACCEPT}",
        "exchanged labels",
        entry=SessionEntry.EXCHANGE,
    )
    explains = (CheckKind.PRESSURE, CheckKind.MARKERS)

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the pairs that the markers show, each with one sentence for all pairs that are exchanged alike."""
        found = named_exchanges(recorded.session, recorded.once(exchanges))
        looked = any(trial.markers is not None for trial in recorded.session.trials)
        return found or (
            (QualityCheck(_CHECK, True, "No two markers seem to carry each other's names."),) if looked else ()
        )


def named_exchanges(session: Session, found: Mapping[str, Mapping[Pair, Spans]]) -> tuple[QualityCheck, ...]:
    """Return a failed check for each pair ``found`` by trial, with one sentence for all that are exchanged alike."""
    places: dict[Pair, tuple[str, ...]] = {}
    names: dict[Pair, tuple[str, ...]] = {}
    for trial in session.trials:
        for pair, spans in found.get(trial.name, {}).items():
            when = _when(trial.markers.time, spans) if trial.markers is not None else ""
            places[pair] = (*places.get(pair, ()), trial.name + when)
            names[pair] = (*names.get(pair, ()), trial.name)
    looked = tuple(trial.name for trial in session.trials if trial.markers is not None)
    alike: dict[tuple[str, ...], list[Pair]] = {}
    for pair, where in sorted(places.items()):
        alike.setdefault(where, []).append(pair)
    checks = []
    for where, pairs in alike.items():
        each = " each" if len(pairs) > 1 else ""
        named = ", ".join(f"{a} and {b}" for a, b in pairs)
        text = f"{named}{each} carry each other's names in {', '.join(where)}."
        for pair in pairs:
            effect, advice = LabelsSwapped.name, LabelsSwapped.advice
            those = () if names[pair] == looked else names[pair]
            checks.append(QualityCheck(_CHECK, False, text, effect, "/".join(pair), advice=advice, trials=those))
    return tuple(checks)


def exchanges(recorded: Recorded) -> dict[str, dict[Pair, Spans]]:
    """Return by trial the pairs of labels that carry each other's names, and in which frames, with and without plates;
    trials without any are left out.
    """
    trials = recorded.session.trials
    static = next((trial for trial in trials if trial.role == "static" and trial.markers is not None), None)
    hang = [trial.markers for trial in trials if trial.markers is not None and arms_hang(trial)]
    if static is None:  # then the body was placed by these labels, and follows them whatever they are
        alone = ((trial.name, exchanged_labels(trial, None, {}, hang)) for trial in trials)
        return {name: pairs for name, pairs in alone if pairs}
    known = exchanged_labels(static, None, others=hang)
    right = renamed(static, known).markers
    bodies = {case.trial.name: case.body for case in recorded.cases}
    found = {}
    for trial in trials:
        pairs = known if trial is static else exchanged_labels(trial, right, known, hang)
        own = {pair: spans for pair, spans in pairs.items() if pair not in known}
        if pairs and not (own and trial.name in bodies and refuted(bodies[trial.name], trial, own)):
            found[trial.name] = pairs
    return found


def refuted(body: Body, trial: Trial, pairs: Mapping[Pair, Spans]) -> bool:
    """Return whether a ``body``, placed by a static trial in which these ``pairs`` are as here, follows a trial clearly
    worse with them exchanged.
    """
    markers, worn = trial.markers, set_of(trial)
    if markers is None or worn is None:
        return False
    inside = np.concatenate([np.arange(start, stop) for spans in pairs.values() for start, stop in spans])
    frames = np.unique(inside[np.linspace(0, inside.size - 1, _FRAMES).astype(int)])
    as_is, other = (_far(body, canonical(one, worn), frames) for one in (markers, renamed_markers(markers, pairs)))
    return other > WORSE**2 * as_is


def _far(body: Body, markers: Markers, frames: Index) -> float:
    """Return the mean square distance (m²) of some frames' markers to the body; infinite if they leave it open."""
    try:
        found = solve_ik(body, Markers(markers.names, markers.time[frames], markers.xyz[frames]), tolerance=_ROUGH)
    except BiodanceError:
        return float("inf")
    return float(np.nanmean(found.residual**2))


def renamed(trial: Trial, found: Mapping[Pair, Spans]) -> Trial:
    """Return the trial with the two markers of each pair ``found`` exchanged in its frames; its history says so."""
    if trial.markers is None or not found:
        return trial
    said = tuple(
        f"The labels {a} and {b} were exchanged{_when(trial.markers.time, spans)}: they carried each other's names."
        for (a, b), spans in sorted(found.items())
    )
    return replace(trial, markers=renamed_markers(trial.markers, found), history=(*trial.history, *said))


def _when(time: Array, spans: Spans) -> str:
    """Return when an exchange holds, in words; "" for the whole trial."""
    if spans == ((0, time.size),):
        return ""
    return " from " + " and ".join(f"{time[start]:.2f} to {time[stop - 1]:.2f} s" for start, stop in spans)


EFFECT = LabelsSwapped

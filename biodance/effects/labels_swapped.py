"""Two markers carry each other's names: left and right, front and back of the wrist, for a whole session, from one
trial on, or for a part of a trial.

Signature: distances within a segment, or to the joint above it, that are those of the static trial under other names;
where they cannot tell it, a left marker on the right side of pelvis and trunk, a wrist that is no mirror image of the
other or turns the finger's marker to the palm, a head, pelvis or foot that points backwards. Look-alikes: a marker that
fell off or jumps (one of the two is right then). Separated by exchanging the two names: only then do the distances fit.
"""

from collections.abc import Mapping
from dataclasses import replace

from biodance.effects._base.exchanged_labels import Pair, Spans, arms_hang, exchanged_labels, renamed_markers
from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded
from biodance.records import Array, Trial


class LabelsSwapped(DiscreteEffect):
    """Two labels whose exchange gives rigid distances their size, or puts a left marker on its side of the body."""

    name = "labels_swapped"
    separated_by = "Exchange the two names: the distances on the segment fit, or they do not."
    advice = "Exchange the two labels in the recording software, in every trial named, and export again."

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the pairs that the markers show, each with one sentence for all pairs that are exchanged alike."""
        if not any(trial.markers is not None for trial in recorded.session.trials):
            return ()
        check, where = "labels of the markers", _where(recorded)
        alike: dict[tuple[str, ...], list[Pair]] = {}
        for pair, places in sorted(where.items()):
            alike.setdefault(places, []).append(pair)
        return tuple(
            QualityCheck(check, False, _sentence(pairs, places), cls.name, "/".join(pair))
            for places, pairs in alike.items()
            for pair in pairs
        ) or (QualityCheck(check, True, "No two markers seem to carry each other's names."),)


def _where(recorded: Recorded) -> dict[Pair, tuple[str, ...]]:
    """Return by pair the trials in which it is exchanged, with the seconds where that is a part, in words."""
    places: dict[Pair, tuple[str, ...]] = {}
    markers = {trial.name: trial.markers for trial in recorded.session.trials}
    for name, found in exchanges(recorded).items():
        at = markers[name]
        for pair, spans in found.items():
            when = _when(at.time, spans) if at is not None else ""
            places[pair] = (*places.get(pair, ()), name + when)
    return places


def _sentence(pairs: list[Pair], places: tuple[str, ...]) -> str:
    """Return what is exchanged and where, as one sentence for all ``pairs``."""
    named = [f"{a} and {b}" for a, b in pairs]
    return f"{', '.join(named)}{' each' if len(pairs) > 1 else ''} carry each other's names in {', '.join(places)}."


def exchanges(recorded: Recorded) -> dict[str, dict[Pair, Spans]]:
    """Return by trial the pairs of labels that carry each other's names, and in which frames, with and without plates;
    trials without any are left out.
    """
    trials = recorded.session.trials
    static = next((trial for trial in trials if trial.role == "static" and trial.markers is not None), None)
    hang = [trial.markers for trial in trials if trial.markers is not None and arms_hang(trial)]
    known = exchanged_labels(static, None, others=hang) if static else {}
    right = renamed(static, known).markers if static else None
    found = {
        trial.name: known if trial is static else exchanged_labels(trial, right, known, hang) for trial in trials
    }
    return {name: pairs for name, pairs in found.items() if pairs}


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

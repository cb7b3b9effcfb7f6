"""Markers that do what nobody can, over all trials of a session, as checks."""

from dataclasses import replace

from biodance.effects._base.quality_check import QualityCheck, Recorded
from biodance.lab.markers.sets import canonical, read_marker_set
from biodance.lab.markers.signals import FaultyMarker, MarkerFault, faulty_markers
from biodance.records import Markers, Trial


def marker_checks(recorded: Recorded, fault: MarkerFault, effect: str) -> tuple[QualityCheck, ...]:
    """Return a failed check for each marker with this ``fault``, with the trials and seconds, or one that says none
    has it. Preparing a trial takes these frames out (`prepare`), so the rest is judged.
    """
    found: dict[str, list[tuple[FaultyMarker, str]]] = {}
    trials = recorded.once(_faulty)
    for trial, markers, faults in trials:
        for one in faults:
            if one.fault is fault:
                found.setdefault(one.label, []).append((one, f"{trial.name} {one.when(markers.time)}"))
    check = f"{fault.value} markers"
    if not found:
        return (QualityCheck(check, True, f"No marker shows a {fault.value} frame."),) if trials else ()
    return tuple(
        QualityCheck(check, False, _said(places), effect, label, mended=True) for label, places in found.items()
    )


def _faulty(recorded: Recorded) -> list[tuple[Trial, Markers, tuple[FaultyMarker, ...]]]:
    """Return the trials that have markers, with those of its set and their faults of every kind."""
    trials = [(trial, _worn(trial)) for trial in recorded.session.trials if trial.markers is not None]
    return [(trial, markers, faulty_markers(markers)) for trial, markers in trials]


def _worn(trial: Trial) -> Markers:
    """Return the markers of the trial's set, under the names that preparing gives them; all where no set is known."""
    assert trial.markers is not None
    return canonical(trial.markers, read_marker_set(trial.marker_set)) if trial.marker_set else trial.markers


def _said(places: list[tuple[FaultyMarker, str]]) -> str:
    """Return one sentence for a marker in several trials."""
    size = max(one.size for one, _ in places)
    return replace(places[0][0], size=size).sentence("; ".join(where for _, where in places))

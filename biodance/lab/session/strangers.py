"""Recordings that do not belong to a session: the same one twice, and those of another person."""

import math
from collections.abc import Sequence

from biodance.lab.session.file import SubjectEntry
from biodance.lab.session.subject import declared_mass, declared_stature
from biodance.records import Trial
from biodance.records.attention import WARNING

PEOPLE = ((declared_mass, "mass", "kg", 1.1), (declared_stature, "stature", "m", 1.04))
"""What files declare of a person: reader, name, unit, and from which ratio on it is somebody else's."""


def each_once(trials: Sequence[Trial], notes: list[str]) -> list[Trial]:
    """Return the trials without second copies of a file, which would count twice; ``notes`` says which were left aside.

    Of two copies the static trial stays, else the one of the shorter name. A reader of one's own need not say what
    bytes it read.
    """
    first: dict[str, Trial] = {}
    for trial in sorted(trials, key=lambda one: (one.role != "static", len(one.name), one.name)):
        kept = first.setdefault(_bytes_of(trial), trial)
        if kept is not trial:
            notes.append(
                f"{WARNING}{trial.source.path.name} holds the same bytes as {kept.source.path.name} and was left "
                f"aside, or it would count twice. Move one of the two away."
            )
    return [trial for trial in trials if first[_bytes_of(trial)] is trial]


def _bytes_of(trial: Trial) -> str:
    return trial.source.sha256 or f"{trial.source.path} {trial.name}"


def of_one_person(trials: Sequence[Trial], typed: SubjectEntry) -> tuple[list[Trial], dict[str, str]]:
    """Return the trials of the person of the static trial, and by file why others are refused: they declare another
    mass or stature. What was ``typed`` in session.toml is believed of all of them.
    """
    static = next((trial for trial in trials if trial.role == "static"), None)
    if static is None:
        return list(trials), {}
    strangers: dict[str, str] = {}
    for (said, of, unit, alike), known in zip(PEOPLE, (typed.mass_kg, typed.height_m), strict=True):
        right = said(static.measurements)
        if known is not None or not math.isfinite(right):
            continue
        for trial in trials:
            value = said(trial.measurements)
            if max(value / right, right / value) > alike:
                strangers.setdefault(
                    trial.source.path.name,
                    f"declares another person: {of} {value:.4g} {unit}, but {right:.4g} {unit} in the static trial "
                    f"{static.name}. Move it to that person's session; if it is the same one, write "
                    f"{'mass_kg' if unit == 'kg' else 'height_m'} in session.toml.",
                )
    return [trial for trial in trials if trial.source.path.name not in strangers], strangers

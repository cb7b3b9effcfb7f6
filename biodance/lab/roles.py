"""Which role does a trial play? By session.toml, by the operator's Eclipse notes, by its name, and for the static last by its content."""

import re
from collections.abc import Sequence

from biodance.lab.vicon import EclipseNotes
from biodance.lab.weight import is_still, movement
from biodance.records import Role, Trial

STATIC_WORDS = ("static", "cal", "calib", "calibration", "tpose", "npose")
VALIDATE_WORDS = ("squat", "squats")


def role_by_name(name: str) -> Role | None:
    """Return "static" for static* and cal*, "validate" for squat*, as a word anywhere in the name; None if the name says nothing.

    Words end where letters end and where upper case begins: ``CB_Static0001``, ``WalkSquat2``; ``calf_raise`` is no calibration.
    """
    words = [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]
    if any(word in STATIC_WORDS or word.startswith("static") for word in words):
        return "static"
    if any(word in VALIDATE_WORDS for word in words):
        return "validate"
    return None


def role_by_eclipse(notes: EclipseNotes) -> Role | None:
    """Return the role that the operator's notes tell: TYPE Static, else the words of the description as in a name."""
    return "static" if "static" in notes.type.lower() else role_by_name(notes.description)


def guess_static(trials: Sequence[Trial]) -> Trial | None:
    """Return the trial to take as static where nobody said which: of the still ones that with the most markers; None if all move.

    A single frame counts as still: some laboratories keep one frame of the static only.
    """
    still = [trial for trial in trials if is_still(trial)]
    return max(still, key=_static_quality, default=None)


def _static_quality(trial: Trial) -> tuple[int, float]:
    assert trial.markers is not None  # a still trial has markers
    return int(trial.markers.seen.any(axis=0).sum()), -movement(trial.markers)

"""Write a session, or what was identified from it, in the formats of other programs."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from biodance.body.body import Body
from biodance.body.body_file import read_body
from biodance.body.export import formats, write_model
from biodance.errors import SessionRefused, TrialRefused, UnknownName
from biodance.lab.mot import write_mot
from biodance.lab.session import read_session
from biodance.lab.trc import write_trc
from biodance.motion.opensim_coordinates import opensim_coordinates
from biodance.pipeline.results import SessionResult, TrialResult
from biodance.pipeline.session import examine
from biodance.pipeline.trial import prepared
from biodance.records import Session, Trial

BODY = "body.json"
"""File in which `biodance identify` keeps the identified body."""
MOTION_FORMATS = ("trc", "mot")


def legal_formats() -> tuple[str, ...]:
    """Return the names of all formats that can be exported to."""
    return (*sorted(formats()), *MOTION_FORMATS)


def export(
    source: Path,
    out: Path,
    *,
    format: str,
    trial: str | None = None,
    subject: str | None = None,
    markers: str | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[Path, str]:
    """Write ``source`` to the file ``out`` and return its path and one sentence on what it holds.

    ``source`` a session folder, or the results folder (or its body.json) of `biodance identify`. Model formats write the body with the
    identified parameters, where there are trials to identify from, else with the table's; ``trc`` writes the prepared markers and ``mot``
    the joint coordinates (of the model that ``osim`` writes) of one trial. ``subject`` names the person where files hold several;
    ``markers`` the marker set that was worn (a file or a name).

    Raises
    ------
    UnknownName
        No such format or trial.
    BiodanceError
        The body's inertia cannot exist, the session gives no body or motion, or the file exists.
    """
    if format not in legal_formats():
        raise UnknownName.of("format", format, legal_formats())
    kept = source if source.is_file() else source / BODY
    if kept.is_file():
        if format in MOTION_FORMATS:
            raise SessionRefused(f"{source}: holds a body and no trial. Give the session folder to export {format}.")
        body, words = read_body(kept)
        return write_model(body, out, format=format, source=words), words
    session = read_session(source, subject_name=subject, markers=markers, tell=tell)
    if format == "trc":
        return _markers(_chosen(session, trial), out)
    if format == "mot":
        one = _chosen(session, trial)
        session = Session(session.subject, tuple(t for t in session.trials if t.role == "static" or t is one), session.folder)
        return _motion(examine(session, tell=tell), one.name, out)
    body, words = body_of_result(examine(session, tell=tell))
    return write_model(body, out, format=format, source=words), words


def body_of_result(result: SessionResult) -> tuple[Body, str]:
    """Return the identified body, else the scaled one with the table's parameters, and where its parameters come from.

    Raises
    ------
    SessionRefused
        The session gives no body.
    """
    name = result.session.folder.name
    if result.body is None:
        raise SessionRefused(f"{result.session.folder}: {result.body_source}")
    found = result.identification
    if found is None:
        return result.body, f"Session {name}: nothing identified. {result.body_source}"
    trials = ", ".join(found.identification.trials)
    return found.identification.identified, f"Session {name}: inertial parameters identified from {trials}."


@contextmanager
def replaceable(out: Path, *, force: bool) -> Iterator[Path]:
    """Yield the path to write to: ``out``, or with ``force`` a path beside it that replaces an existing ``out`` once all is written."""
    if not (force and out.is_file()):
        yield out
        return
    part = out.with_name(f".{out.name}.part")
    part.unlink(missing_ok=True)
    try:
        yield part
        part.replace(out)
    finally:
        part.unlink(missing_ok=True)


def _chosen(session: Session, name: str | None) -> Trial:
    """Return the named trial; without a name the only one that moves."""
    named = {trial.name: trial for trial in session.trials}
    if name is not None:
        if name not in named:
            raise UnknownName.of("trial of this session", name, tuple(named))
        return named[name]
    moving = [trial for trial in session.trials if trial.role != "static"]
    if len(moving) != 1:
        raise TrialRefused(f"{session.folder}: holds the trials {', '.join(named)}. Choose one with --trial.")
    return moving[0]


def _markers(trial: Trial, out: Path) -> tuple[Path, str]:
    markers = prepared(trial).trial.markers
    if markers is None:
        raise TrialRefused(f"Trial {trial.name}: it has no markers to write.")
    return write_trc(out, markers), f"Markers of trial {trial.name}, gaps filled where they were short; mm, y up."


def _motion(result: SessionResult, name: str, out: Path) -> tuple[Path, str]:
    one: TrialResult = next(trial for trial in result.trials if trial.trial.name == name)
    if result.body is None or one.motion is None:
        raise TrialRefused(f"Trial {name}: it gives no motion. {one.reason or result.body_source}")
    table = opensim_coordinates(result.body, one.motion)
    return write_mot(out, table), f"Joint coordinates of trial {name}, rad and m, y up; the model is exported with --format osim."

"""A file as a stream: which body moves in it, and every frame in turn."""

import time as clock
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.watch import LiveWarning
from biodance.errors import SessionRefused, TrialRefused
from biodance.lab.markers.sets import canonical, read_marker_set
from biodance.lab.readers import read_trial
from biodance.lab.session.read import read_session
from biodance.pipeline.body import body_of
from biodance.pipeline.live import LiveResult, LiveSession, LiveState
from biodance.pipeline.trial import prepare_trial
from biodance.pipeline.trial_result import Step
from biodance.records import Subject, Trial
from biodance.threads import one_thread


@one_thread()
def body_and_stream(
    file: Path,
    *,
    static: Path | None = None,
    subject: str | None = None,
    markers: str | None = None,
    settings: Mapping[str, object] | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[Body, Trial]:
    """Return the body that moves in a recording, scaled on its ``static`` (by default that of its folder), and the
    recording with the markers of its set alone.

    Raises
    ------
    SessionRefused
        The recording is not there or was not read, or no static trial scales the body; the message says why.
    """
    if not file.is_file():
        what = "is a folder" if file.is_dir() else "there is no such file"
        raise SessionRefused(f"{file}: {what}. Give one recording of a session's folder.")
    session = read_session(file.parent, subject_name=subject, markers=markers, settings=settings, tell=tell)
    trial = next((one for one in session.trials if one.source.path.resolve() == file.resolve()), None)
    if trial is None:
        why = session.refused.get(file.name, "session.toml says skip, or it is no recording.")
        raise SessionRefused(f"{file}: cannot be streamed. {why}")
    worn = read_marker_set(markers or trial.marker_set) if markers or trial.marker_set else None
    statics = session.of_role("static")
    if static is not None:
        statics = (
            replace(read_trial(static, role="static", subject=subject, markers=worn), settings=session.settings),
        )
    if trial.markers is None:
        raise SessionRefused(
            f"{file}: has no markers, so no body can follow it. Give a recording of markers and plates."
        )
    if worn is None:
        raise SessionRefused(f"{file}: has no markers of a known set, so no body can follow it. Say --markers.")
    return _scaled(session.subject, statics, file), replace(trial, markers=canonical(trial.markers, worn))


def _scaled(subject: Subject, statics: tuple[Trial, ...], file: Path) -> Body:
    """Return the body scaled on a static trial, or refuse: a stream has no later to look at for a better body."""
    if not statics:
        raise SessionRefused(
            f"{file}: its folder has no static trial, so nobody knows who moves. Give one with --static FILE."
        )
    steps: list[Step] = []
    body, _ = body_of(subject, tuple(map(prepare_trial, statics)), statics[0].settings, steps)
    if body is None or not any(step.name == "scale" and step.status == "done" for step in steps):
        why = " ".join(step.text for step in steps if step.status != "done" and step.name in ("subject", "scale"))
        raise SessionRefused(f"{file}: no body can be scaled for it. {why}")
    return body


def stream_recording(
    file: Path | str,
    *,
    static: Path | str | None = None,
    subject: str | None = None,
    markers: str | None = None,
    tell: Callable[[LiveState], None] = lambda _: None,
) -> LiveResult:
    """Take a recording in frame by frame, as a laboratory would send it: track, watch for faults, identify.

    Parameters
    ----------
    file : path
        A recording with markers and force plates.
    static : path, optional
        The static trial; by default that of the folder in which the file lies.
    subject : str, optional
        The person, where C3D files hold several.
    markers : str, optional
        Marker set, where the file does not tell.
    tell : callable, optional
        Called with the `LiveState` after every second of the recording.

    Returns
    -------
    LiveResult
        What the stream told, and how long every frame took.

    Raises
    ------
    SessionRefused
        The recording is not there or was not read, or no static trial scales the body.
    TrialRefused
        The recording has no plates, or its first frame does not show the posture.

    Examples
    --------
    >>> streamed = biodance.stream_recording("visit/squat_1.c3d")
    >>> streamed.warnings
    ()
    """
    body, trial = body_and_stream(Path(file), static=Path(static) if static else None, subject=subject, markers=markers)
    return replay(body, trial, tell=tell)


@one_thread()
def replay(
    body: Body,
    trial: Trial,
    *,
    real_time: bool = False,
    tell: Callable[[LiveState], None] = lambda _: None,
    warn: Callable[[LiveWarning], None] = lambda _: None,
) -> LiveResult:
    """Return what a stream of the frames of ``trial`` (of which only its own set's markers are kept) tells of ``body``.

    ``real_time`` waits for the rate of the recording; ``tell`` is called once a second of the recording, ``warn`` as
    soon as something is noticed.

    Raises
    ------
    TrialRefused
        The trial has no plates, or its first frame does not show the posture.
    """
    if trial.markers is None or not trial.plates:
        raise TrialRefused(f"Trial {trial.name}: a stream needs markers and force plates, and one of them is missing.")
    session, count = LiveSession(body, trial), trial.markers.time.size
    spent, wall = np.zeros(count), np.zeros(count)
    started, second = clock.perf_counter(), max(1, round(trial.markers.rate))
    for frame in range(count):
        if real_time:
            clock.sleep(max(0.0, started + frame / trial.markers.rate - clock.perf_counter()))
        began, mine = clock.perf_counter(), clock.thread_time()
        found = session.push()
        spent[frame], wall[frame] = clock.thread_time() - mine, clock.perf_counter() - began
        for said in found:
            warn(said)
        if frame % second == second - 1:
            tell(session.state())
    return session.finish(spent, wall)

"""Markers and forces of one trial, recorded apart, made one session: read, track, align, refine, write."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from biodance.body.body import Body
from biodance.diagnosis.own_tolerances import own_tolerances
from biodance.diagnosis.problem import TrialWindow
from biodance.errors import SessionRefused, TrialRefused
from biodance.lab.read import read_trial
from biodance.lab.session.read import read_session
from biodance.lab.session.write import registered_folder, write_registered
from biodance.motion.contact.soles import soles_from_body
from biodance.motion.regressor import predict_wrench
from biodance.motion.track import track
from biodance.pipeline.body import body_of
from biodance.pipeline.trial import prepare_trial
from biodance.pipeline.trial_result import Step
from biodance.records import Motion, Session, Trial
from biodance.registration.alignment import Alignment, Forces, alignments, forces_of, registered_plates
from biodance.registration.refinement import floor_of, refined, with_height
from biodance.registration.registration import Limits, Registration, concluded, rival_delays
from biodance.threads import one_thread
from biodance.uncertainty.tolerances import Tolerances

_RAISED = 0.03
"""m by which the height found under the feet may differ from the floor before lags are searched again."""


@dataclass(frozen=True, eq=False)
class _Moving:
    """Who moved how: the ``session`` of the markers, its trial as ``recorded`` and ``trial`` prepared without plates,
    the ``body`` and its ``motion``.
    """

    session: Session
    recorded: Trial
    trial: Trial
    body: Body
    motion: Motion


@one_thread()
def register(
    markers: str | Path,
    forces: str | Path,
    out: str | Path | None = None,
    *,
    limits: Limits | None = None,
    rough: bool = False,
    force: bool = False,
    tell: Callable[[str], None] = lambda _: None,
) -> Registration:
    """Find where the plates of a force file lie in the room of a marker file, and how late its clock is, from the
    movement itself.

    Parameters
    ----------
    markers : str or pathlib.Path
        A marker file (a static trial and session.toml beside it are used), or the folder of such a session.
    forces : str or pathlib.Path
        A force file in its own frame and clock; of several plates the places relative to one another are kept.
    out : str or pathlib.Path, optional
        Where to write the session with markers and plates in one C3D file; nothing is written where it is refused.
    limits : Limits, optional
        How exact the pose must be; by default 5 mm, 10 mm, 0.5 degrees and 5 ms.
    rough : bool
        Also write what is known less exactly than that.
    force : bool
        Overwrite a session that this function wrote.
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    Registration
        FramePose of every plate and delay with standard deviations; `status` and `reason`.

    Raises
    ------
    FileRefused, SessionRefused, TrialRefused
        A file cannot be read, there is no body or no motion, or ``out`` may not be written.

    References
    ----------
    Procrustes alignment for every delay, then generalised least squares on the spectrum of the ground wrench and on the
    pressure in the feet; docs/derivations.md.

    Examples
    --------
    >>> registered = biodance.register("visit/dance_1.c3d", "visit/dance_1.c3d")
    >>> registered.status
    'registered'
    """
    folder = None if out is None else registered_folder(Path(out), force=force)
    tell("reading")
    recorded = read_trial(forces)
    moving = _moving(Path(markers), Path(forces), tell)
    measured = forces_of(recorded, moving.trial.settings)
    tell("looking for the delay")
    try:
        hypotheses = _hypotheses(moving, measured)
        tell("refining the pose")
        judge = partial(_tolerances, moving.body, recorded)
        refine = partial(refined, moving.body, moving.trial, moving.motion, measured, tolerances=judge)
        found = refine(hypotheses[0].pose)
        others = rival_delays(hypotheses, found, refine)
    except TrialRefused as why:
        return Registration("refused", str(why))
    registration = concluded(measured, hypotheses[0], found, others, limits=limits or Limits(), rough=rough)
    if folder is not None and registration.status != "refused":
        tell("writing the session")
        assert registration.pose is not None
        plates = registered_plates(recorded.plates, registration.pose)
        write_registered(folder, moving.session, moving.recorded, plates, said=registration.document())
    return registration


def _tolerances(body: Body, recorded: Trial, window: TrialWindow) -> Tolerances:
    """Return what is no fault in a look, with the noise of its own cameras and of the plates as recorded."""
    return own_tolerances(body, (window,), (replace(window.trial, plates=recorded.plates),)).tolerances


def _moving(markers: Path, forces: Path, tell: Callable[[str], None]) -> _Moving:
    """Return the body and its motion in the marker file, or in the one moving trial of a folder."""
    session = read_session(markers if markers.is_dir() else markers.parent, tell=tell)
    chosen = _chosen(session, markers, forces)
    statics = [trial for trial in session.of_role("static") if trial is not chosen]
    bare = [replace(trial, plates=()) for trial in (*statics, replace(chosen, role="fit"))]
    read = tuple(prepare_trial(trial) for trial in bare)
    for one in read:
        if not one.usable:
            raise TrialRefused(one.steps[-1].text)
    tell("tracking the body")
    steps: list[Step] = []
    body, source = body_of(session.subject, read, session.settings, steps)
    if body is None:
        raise SessionRefused(f"{markers}: {source} {' '.join(step.text for step in steps)}".strip())
    return _Moving(session, chosen, read[-1].trial, body, track(body, read[-1].trial))


def _chosen(session: Session, markers: Path, forces: Path) -> Trial:
    """Return the trial of a marker file; in a folder the moving trial that is called as the force file, else the only
    one.
    """
    if not markers.is_dir():
        same = [trial for trial in session if trial.source.path.resolve() == markers.resolve()]
        if not same:
            why = session.refused.get(markers.name, "it has the role skip, or another file of this name was read.")
            raise SessionRefused(f"{markers}: was not read: {why}")
        return same[0]
    moving = [trial for trial in session if trial.role != "static" and trial.markers is not None]
    alike = [trial for trial in moving if trial.name.lower() == forces.stem.lower()] or moving
    if len(alike) != 1:
        names = ", ".join(trial.name for trial in moving) or "none"
        raise SessionRefused(
            f"{markers}: holds {len(moving)} moving trials ({names}), and none is called {forces.stem}. Give the "
            "marker file that belongs to the forces."
        )
    return alike[0]


def _hypotheses(moving: _Moving, measured: Forces) -> tuple[Alignment, ...]:
    """Return the hypotheses with the height that the soles ask for."""
    needed, soles = predict_wrench(moving.body, moving.motion).value, soles_from_body(moving.body, moving.motion)
    floor = floor_of(soles)
    found = alignments(moving.motion, needed, measured, floor=floor)
    pose = with_height(found[0].pose, soles, measured)
    raised = float(pose.shift[2] - found[0].pose.shift[2])
    if abs(raised) > _RAISED:
        found = alignments(moving.motion, needed, measured, floor=floor + raised)
        pose = with_height(found[0].pose, soles, measured)
    return (replace(found[0], pose=pose), *found[1:])

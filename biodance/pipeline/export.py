"""Write a session, or what was identified from it, in the formats of other programs."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from biodance.body.body import Body
from biodance.body.export import formats, write_model
from biodance.body.robot.hoap3 import hoap3
from biodance.body.solids import SegmentSolids, segment_solids
from biodance.errors import BiodanceError, SessionRefused, TrialRefused, UnknownName
from biodance.lab.opensim_tables import write_mot
from biodance.lab.readers.trc import write_trc
from biodance.lab.session.read import read_session
from biodance.pipeline.program_folders import opensim_coordinates, state_notes, write_bids_folder, write_opensim_folder
from biodance.pipeline.results import SessionResult
from biodance.pipeline.saved_results import kept_body, kept_trials, read_kept, read_kept_body
from biodance.pipeline.session import examine
from biodance.pipeline.trial import prepare_trial
from biodance.pipeline.trial_files import results_into_c3d, write_rerun
from biodance.pipeline.trial_result import TrialResult
from biodance.records import Motion, Session, Trial

_SHIPPED = {"hoap3": hoap3}
"""Robots whose bodies are built from our own tables."""
_NO_TRIAL = (
    "--trial: a file of format {} holds one body, which belongs to the whole session and to no trial. Leave --trial "
    "away, or set the roles in session.toml to identify from that trial alone."
)
MOTION_FORMATS = ("trc", "mot", "c3d", "opensim", "bids", "rerun")
"""Formats that need a recording beside the body."""
FOLDERS = ("opensim", "bids")
"""Those of them that hold several trials."""


def legal_formats() -> tuple[str, ...]:
    """Return the names of all formats that can be exported to."""
    return (*sorted(formats()), *MOTION_FORMATS)


def export(
    source: Session | SessionResult | str | Path,
    out: str | Path,
    *,
    format: str,
    trial: str | None = None,
    subject: str | None = None,
    meshes: Path | None = None,
    markers: str | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[Path, str]:
    """Write a session, or what was identified from it, in the format of another program.

    Parameters
    ----------
    source : Session, SessionResult, str or pathlib.Path
        A visit, its folder, or the results folder (or its body.json) of ``biodance identify`` or ``report``, from which
        nothing is computed again; or ``"hoap3"``, the robot from our own tables.
    out : str or pathlib.Path
        The file to write; it must not exist.
    format : str
        ``osim``, ``urdf``, ``mjcf``, ``biomod``, ``csv``: the body with the identified parameters, where there are
        trials to identify from, else with the table's. ``trc``: the prepared markers of a trial, ``mot``: its joint
        coordinates, of the model that ``osim`` writes; ``c3d``: a copy of its recording with angles, moments, wrenches,
        centre of mass and events. ``opensim``: a folder with all that OpenSim needs to run its inverse dynamics;
        ``bids``: a BIDS motion dataset of the session, with its derivatives; ``rerun``: a trial with solids, forces and
        residual for the viewer Rerun (needs rerun-sdk).
    trial : str, optional
        Name of the trial for ``trc``, ``mot``, ``c3d`` and ``rerun``, by default the only one that moves; for
        ``opensim`` and ``bids`` by default all. The formats of a body have none.
    subject : str, optional
        The person where files hold several.
    meshes : pathlib.Path, optional
        Folder with a closed mesh a segment (``right_thigh.stl``, m, in the segment's axes), shown by glb and osim.
    markers : str, optional
        The marker set that was worn: a file or a name.
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    path : pathlib.Path
        Of the file written.
    sentence : str
        What it holds.

    Raises
    ------
    UnknownName
        No such format or trial; the legal names are listed.
    BiodanceError
        The body's inertia cannot exist, the session gives no body or motion, the file exists, or a ``trial`` is named
        for a body.

    Examples
    --------
    >>> path, sentence = biodance.export(result, "visit.osim", format="osim")
    >>> sentence
    'Session visit: inertial parameters identified from dance_1.'
    """
    if format not in legal_formats():
        raise UnknownName.of("format", format, legal_formats())
    if trial is not None and format not in MOTION_FORMATS:
        raise BiodanceError(_NO_TRIAL.format(format))
    target = _Target(Path(out), format, subject, meshes)
    if isinstance(source, str | Path) and str(source) in _SHIPPED and not Path(str(source)).exists():
        return _robot(str(source), target)
    if isinstance(source, SessionResult):
        return _of_result(source, trial, target)
    session = source if isinstance(source, Session) else None
    if session is None:
        folder = Path(source) if isinstance(source, str | Path) else Path()
        if kept_body(folder).is_file():
            return _of_kept(folder, trial, target)
        session = read_session(folder, subject_name=subject, markers=markers, tell=tell)
    if format == "trc":
        return target.markers(prepare_trial(_chosen(session, trial)).trial)
    if format == "mot":
        one = _chosen(session, trial)
        session = replace(session, trials=tuple(t for t in session.trials if t.role == "static" or t is one))
        trial = one.name
    return _of_result(examine(session, tell=tell), trial, target)


@dataclass(frozen=True)
class _Target:
    """What to write: a file or folder ``out`` of a ``format``; ``subject`` chooses the person of a C3D file, ``meshes``
    the folder with the solids of the segments. Every method returns the path and what it holds.
    """

    out: Path
    format: str
    subject: str | None = None
    meshes: Path | None = None

    def _solids(self, body: Body) -> SegmentSolids | None:
        return None if self.meshes is None else segment_solids(body, self.meshes)

    def body(self, body: Body, words: str) -> tuple[Path, str]:
        """Write a body; ``words`` say where its parameters come from."""
        return write_model(body, self.out, format=self.format, source=words, solids=self._solids(body)), words

    def markers(self, trial: Trial) -> tuple[Path, str]:
        """Write the markers of a prepared trial."""
        if trial.markers is None:
            raise TrialRefused(f"Trial {trial.name}: it has no markers to write.")
        said = f"Markers of trial {trial.name}, gaps filled where they were short; mm, y up."
        return write_trc(self.out, trial.markers), said

    def coordinates(self, body: Body, motion: Motion, name: str) -> tuple[Path, str]:
        """Write the joint coordinates of a trial."""
        written = write_mot(self.out, opensim_coordinates(body, motion), notes=state_notes(motion))
        return written, f"Joint coordinates of trial {name}, rad and m, y up; the model is exported with --format osim."

    def trials(self, session: Session, found: tuple[TrialResult, ...], body: Body, words: str) -> tuple[Path, str]:
        """Write what was found in some trials of a session, or in the only one."""
        one, out = found[0], self.out
        match self.format:
            case "trc":
                return self.markers(one.trial)
            case "c3d":
                return results_into_c3d(one, body, out, source=words, subject=self.subject)
            case "rerun":
                said = f"Trial {one.name} for the viewer: rerun {out.name}"
                return write_rerun(one, body, out, solids=self._solids(body)), said
            case "bids":
                moved = ", ".join(write_bids_folder(session, found, body, out)) or "no trial"
                return out, f"BIDS motion dataset of {session.folder.name}; angles and events of {moved}."
        written = write_opensim_folder(found, body, out, source=words, solids=self._solids(body))
        ready = [done.trial for done in written if done.dynamics]
        told = f"Inverse dynamics is set up for {', '.join(ready)}." if ready else "No plate measures all in any trial."
        return out, f"Model, markers, motions and forces of {', '.join(done.trial for done in written)}. {told} {words}"


def _of_kept(folder: Path, trial: str | None, target: _Target) -> tuple[Path, str]:
    """Write what a results folder keeps; nothing is tracked or identified again."""
    if target.format not in MOTION_FORMATS:
        return target.body(*read_kept_body(folder))
    if folder.is_file():
        raise SessionRefused(f"{folder}: holds a body and no trial. Give the session folder to export {target.format}.")
    kept = read_kept(folder)
    names = tuple(kept.motions)
    if trial is not None and trial not in names:
        raise UnknownName.of(f"trial in {folder}", trial, names)
    chosen = names if trial is None else (trial,)
    if target.format not in FOLDERS and len(chosen) != 1:
        raise TrialRefused(f"{folder}: holds the trials {', '.join(names)}. Choose one with --trial.")
    if target.format == "mot":
        return target.coordinates(kept.body, kept.motions[chosen[0]], chosen[0])
    session, found = kept_trials(kept, chosen, subject=target.subject)
    return target.trials(session, found, kept.body, kept.source)


def _of_result(result: SessionResult, trial: str | None, target: _Target) -> tuple[Path, str]:
    """Write what was found in a session, see `export`."""
    if target.format == "trc":
        return target.markers(prepare_trial(_chosen(result.session, trial)).trial)
    if target.format == "mot":
        one = result[_chosen(result.session, trial).name]
        if result.body is None or one.motion is None:
            raise TrialRefused(f"Trial {one.name}: it gives no motion. {one.reason or result.body_source}")
        return target.coordinates(result.body, one.motion, one.name)
    body, words = body_of_result(result)
    if target.format not in MOTION_FORMATS:
        return target.body(body, words)
    if target.format not in FOLDERS:
        trial = _chosen(result.session, trial).name
    chosen = result.trials if trial is None else (result[trial],)
    return target.trials(replace(result.session, trials=tuple(one.trial for one in chosen)), chosen, body, words)


def _robot(name: str, target: _Target) -> tuple[Path, str]:
    if target.format in MOTION_FORMATS:
        raise SessionRefused(f"{name}: is a robot and no trial. Give a session folder to export {target.format}.")
    body = _SHIPPED[name]()
    return target.body(body, " ".join(body.notes))


def body_of_result(result: SessionResult) -> tuple[Body, str]:
    """Return the identified body, else the scaled one with the table's parameters, and where its parameters come from.

    Raises
    ------
    SessionRefused
        The session gives no body.
    NotSolved
        The identification failed.
    """
    name = result.session.folder.name
    if result.body is None:
        raise SessionRefused(f"{result.session.folder}: {result.body_source}")
    found = result.identification
    if found is None:
        return result.body, f"Session {name}: nothing identified. {result.body_source}"
    trials = ", ".join(found.identification.trials)
    return found.identification.identified, f"Session {name}: inertial parameters identified from {trials}."


def _chosen(session: Session, name: str | None) -> Trial:
    """Return the named trial; without a name the only one that moves."""
    if name is not None:
        return session[name]
    moving = [trial for trial in session.trials if trial.role != "static"]
    if len(moving) != 1:
        raise TrialRefused(
            f"{session.folder}: holds the trials {', '.join(trial.name for trial in session)}. Choose one with --trial."
        )
    return moving[0]

"""A session, a trial of it, or its body, in the formats of other programs: models, C3D with results, Rerun."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.export import formats, write_model
from biodance.body.similarity import hoap3
from biodance.body.solids import SegmentSolids, segment_solids
from biodance.errors import BiodanceError, MissingLibrary, SessionRefused, TrialRefused, UnknownName
from biodance.lab.c3d.results import Event, Output, write_results_c3d
from biodance.lab.c3d.write import FileValue
from biodance.lab.plain_text import refuse_present, whole_file
from biodance.lab.program_tables import write_mot
from biodance.lab.readers.trc import write_trc
from biodance.lab.session.read import read_session
from biodance.motion.contact import Contact, foot_wrenches
from biodance.motion.dynamics import joint_torques, predict_wrench
from biodance.motion.kinematics import centre_of_mass, poses
from biodance.motion.soles import soles_from_body
from biodance.pipeline.program_folders import opensim_coordinates, state_notes, write_bids_folder, write_opensim_folder
from biodance.pipeline.results import SessionResult
from biodance.pipeline.saved_results import doubt_told, kept_body, kept_trials, read_kept, read_kept_body
from biodance.pipeline.session import examine
from biodance.pipeline.trial import TrialResult, WrenchComparison, contact_of, movement_of, prepare_trial
from biodance.records import SIDES, Array, Motion, Session, Trial
from biodance.settings import COP_FORCE
from biodance.version import __version__

if TYPE_CHECKING:
    from rerun import RecordingStream


_NEWTONS_PER_METRE = 1000.0


def write_rerun(one: TrialResult, body: Body, path: Path, *, solids: SegmentSolids | None = None) -> Path:
    """Write a trial as ``.rrd`` and return the path.

    Raises
    ------
    MissingLibrary
        rerun-sdk is not installed.
    TrialRefused
        The trial gives no motion.
    FileRefused
        The file exists.
    """
    motion = one.moved
    refuse_present(path)
    try:
        import rerun
    except ImportError as error:
        raise MissingLibrary(
            f"{path}: the format rerun needs the library rerun-sdk ({error}). Install it with pip install rerun-sdk."
        ) from error
    with whole_file(path) as part:
        stream = rerun.RecordingStream("biodance", recording_id=f"{body.name} {one.name}")
        stream.save(part)
        stream.log("lab", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        _body(rerun, stream, one, body, segment_solids(body) if solids is None else solids)
        if (markers := one.trial.markers) is not None:  # those that are seen in each frame
            points = rerun.Points3D.columns(positions=markers.xyz[markers.seen])
            lengths = markers.seen.sum(axis=1)
            _send(rerun, stream, "lab/markers", markers.time, points.partition(lengths=lengths))
        _forces(rerun, stream, one, body)
        for j, joint in enumerate(body.joints):
            angle = rerun.Scalars.columns(scalars=motion.known_angles[:, j])
            _send(rerun, stream, f"angles/{joint.name}", motion.time, angle)
        stream.flush()
    return path


def _send(rerun: Any, stream: "RecordingStream", place: str, time: Array, columns: Any) -> None:
    stream.send_columns(place, indexes=[rerun.TimeColumn("time", duration=time)], columns=columns)


def _body(rerun: Any, stream: "RecordingStream", one: TrialResult, body: Body, solids: SegmentSolids) -> None:
    """Send the solids, and how they move."""
    pose, time = poses(body, one.moved.q), one.moved.time
    for k, name in enumerate(body.segments):
        if name not in solids:
            continue
        mesh = solids[name]
        surface = {"vertex_positions": mesh.vertices, "triangle_indices": mesh.faces}
        shape = rerun.Mesh3D(**surface, vertex_normals=mesh.vertex_normals, albedo_factor=(180, 180, 190, 120))
        stream.log(f"lab/body/{name}", shape, static=True)
        turn = Rotation.from_matrix(pose.rotation[:, k]).as_quat()
        moved = rerun.Transform3D.columns(translation=pose.position[:, k], quaternion=turn)
        _send(rerun, stream, f"lab/body/{name}", time, moved)
    centre = centre_of_mass(body, one.moved)
    _send(rerun, stream, "lab/centre_of_mass", time, rerun.Points3D.columns(positions=centre, radii=[0.02] * len(time)))


def _forces(rerun: Any, stream: "RecordingStream", one: TrialResult, body: Body) -> None:
    """Send plates with their forces at the centres of pressure, and what is unexplained at the centre of mass."""
    arrows = []  # name, times, forces, where they act, colour
    for plate in one.trial.plates:
        corners = [np.vstack([plate.corners, plate.corners[:1]])]
        stream.log(f"lab/plates/{plate.name}", rerun.LineStrips3D(corners), static=True)
        cop = plate.wrench.cop(height=plate.height, threshold=COP_FORCE)
        arrows.append((plate.name, plate.wrench.time, plate.wrench.force, cop, (0, 158, 115)))
    if one.comparison is not None:
        found = one.comparison
        left = np.where(found.used[:, None], found.measured - predict_wrench(body, one.moved).value, np.nan)[:, :3]
        arrows.append(("residual", found.time, left, centre_of_mass(body, one.moved), (213, 94, 0)))
    for name, time, force, at, colour in arrows:
        known = np.isfinite(force).all(axis=1) & np.isfinite(at).all(axis=1)
        sized = {"vectors": force[known] / _NEWTONS_PER_METRE, "origins": at[known]}
        columns = rerun.Arrows3D.columns(**sized, colors=[colour] * int(known.sum()))
        _send(rerun, stream, f"lab/forces/{name}", time, columns.partition(lengths=known.astype(int)))


def results_into_c3d(
    one: TrialResult, body: Body, path: Path, *, source: str, subject: str | None = None
) -> tuple[Path, str]:
    """Write a copy of the C3D file of one trial with its results; return its path and one sentence on what it holds.

    ``body`` that moved, with the parameters to predict with, and ``source`` in words where they come from; ``subject``
    the person where the file holds several.

    Joint angles (deg), moments (N·m, what the muscles do) and powers (W), positive as the joints of the body; measured
    and predicted wrench about the lab origin (of the prepared, filtered trial); the centre of mass; foot strikes and
    offs, of the plates where they saw one, else of the markers; in the group BIODANCE the masses of all segments, and
    when which angle is filled or not determined (NOT_MEASURED).
    Wrenches only where the plates measure all that the ground does, a leg's moments and powers where they measure what
    it does to its foot.

    Raises
    ------
    TrialRefused
        The trial gives no motion, or comes from no C3D file.
    FileRefused
        The file cannot be copied, or ``path`` exists.
    """
    trial = one.trial.name
    if one.motion is None:
        raise TrialRefused(f"Trial {trial}: it gives no motion, so there are no results to write. {one.reason}")
    if one.trial.source.format != "C3D":
        raise TrialRefused(
            f"Trial {trial}: comes from a file of the format {one.trial.source.format}. Only a C3D file is copied as "
            f"one."
        )
    angle = np.radians(one.motion.known_angles)
    outputs = [
        Output(f"{name}Angles", "ANGLES", _three(angle[:, columns]), axes, turns=False)
        for name, columns, axes in _groups(body)
    ]
    centre = np.where(one.motion.determined[:, None], centre_of_mass(body, one.motion), np.nan)
    outputs.append(Output("BodyCentreOfMass", "MODELED_MARKERS", centre, "x, y, z"))
    contact = contact_of(one, body)
    if one.comparison is not None:
        outputs += _wrenches(body, one, one.comparison)
    if contact is not None:
        outputs += _loads(body, one, contact)
    names = {True: "Foot Strike", False: "Foot Off"}
    found = movement_of(one, body, None).events
    events = tuple(Event(event.time, event.side.title(), names[event.down]) for event in found)
    spans = [f"{s.joint} {s.state.words} {s.start:.3f} {s.end:.3f} s"[:255] for s in one.motion.spans()][:255]
    said: dict[str, FileValue] = {"VERSION": [__version__], "SOURCE": [source[:255]]}
    said |= {"SEGMENTS": list(body.segments), "MASS": body.sip.mass, "NOT_MEASURED": spans or ["none"]}
    write_results_c3d(path, one.trial.source.path, outputs=outputs, events=events, parameters=said, subject=subject)
    return path, f"The recording of trial {trial} with {len(outputs)} results and {len(events)} events. {source}"


def _groups(body: Body) -> Iterator[tuple[str, list[int], str]]:
    """Yield name (``RightHip``), indices and names of the axes (``flexion, rotation``) of every joint of the body."""
    chain: list[int] = []
    for i, joint in enumerate(body.joints):
        chain.append(i)
        if joint.segment < 0:
            continue
        names = [body.joints[j].name for j in chain]
        common, _, _ = names[0].rpartition("_")
        common = common if common and all(name.startswith(f"{common}_") for name in names) else names[0]
        axes = ", ".join(name.removeprefix(f"{common}_") for name in names)
        yield "".join(word.title() for word in common.split("_")), chain, axes
        chain = []


def _three(values: Array) -> Array:
    """Return (T, 3): up to three columns, the rest zero."""
    some = values[:, :3]
    return np.pad(some, ((0, 0), (0, 3 - some.shape[1])))


def _loads(body: Body, one: TrialResult, contact: Contact) -> Iterator[Output]:
    """Yield moments and powers; NaN where nobody knows what the ground does to the leg's foot."""
    motion = one.moved
    ground = foot_wrenches(one.trial, contact, soles_from_body(body, motion))
    torque, rate = joint_torques(body, motion, ground).torque, motion.v[:, body.n_root :]
    for name, columns, axes in _groups(body):
        # Where the ground's share in a joint is known: of legs, where their foot's is; of all others.
        leg = any(word in name for word in ("Hip", "Knee", "Ankle"))
        side = next((k for k, word in enumerate(SIDES) if name.startswith(word.title())), None)
        told = motion.determined & contact.told[:, side] if leg and side is not None else motion.determined
        value = np.where(told[:, None], torque[:, columns], np.nan)
        power = np.sum(value * rate[:, columns], axis=1, keepdims=True)
        yield Output(f"{name}Moments", "MOMENTS", _three(value), f"{axes}: what the muscles do", turns=False)
        yield Output(f"{name}Power", "POWERS", _three(power), "all axes of the joint", turns=False)


def _wrenches(body: Body, one: TrialResult, found: WrenchComparison) -> Iterator[Output]:
    for word, wrench in (("Measured", found.measured), ("Predicted", predict_wrench(body, one.moved).value)):
        value = np.where(found.used[:, None], wrench, np.nan)
        yield Output(f"{word}GroundForce", "FORCES", value[:, :3], "x, y, z of the ground's force on the subject")
        yield Output(f"{word}GroundMoment", "MOMENTS", value[:, 3:], "x, y, z of its moment about the lab origin")


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
        if format in MOTION_FORMATS:
            raise SessionRefused(f"{source}: is a robot and no trial. Give a session folder to export {format}.")
        robot = _SHIPPED[str(source)]()
        return target.body(robot, " ".join(robot.notes))
    if isinstance(source, SessionResult):
        return _of_result(source, trial, target)
    session = source if isinstance(source, Session) else None
    if session is None:
        folder = Path(source) if isinstance(source, str | Path) else Path()
        if kept_body(folder).is_file():
            return doubt_told(folder, *_of_kept(folder, trial, target))
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
    """What to write, of whom, with which solids; every method returns the path and what it holds."""

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
            raise TrialRefused(f"Trial {one.name}: it gives no motion. {one.reason or result.placed.source}")
        return target.coordinates(result.body, one.motion, one.name)
    body, words = body_of_result(result)
    if target.format not in MOTION_FORMATS:
        return target.body(body, words)
    if target.format not in FOLDERS:
        trial = _chosen(result.session, trial).name
    chosen = result.trials if trial is None else (result[trial],)
    # each prepared trial has a cut-off of its own; a session is written as it was asked for
    trials = tuple(replace(one.trial, settings=result.settings) for one in chosen)
    return target.trials(replace(result.session, trials=trials), chosen, body, words)


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
        raise SessionRefused(f"{result.session.folder}: {result.placed.source}")
    found = result.identification
    if found is None:
        return result.body, f"Session {name}: nothing identified. {result.placed.source}"
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

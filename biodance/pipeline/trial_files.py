"""One trial as a file with what was found: a copy of its C3D file with the results inside, or a recording for Rerun."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.solids import SegmentSolids, segment_solids
from biodance.errors import MissingLibrary, TrialRefused
from biodance.lab.c3d.results import Event, Output, write_results_c3d
from biodance.lab.c3d.write import FileValue
from biodance.lab.plain_text import refuse_present, whole_file
from biodance.motion.contact import Contact, foot_wrenches
from biodance.motion.dynamics import joint_torques, predict_wrench
from biodance.motion.kinematics import centre_of_mass, poses
from biodance.motion.soles import soles_from_body
from biodance.pipeline.trial import contact_of, movement_of
from biodance.pipeline.trial_result import TrialResult
from biodance.records import SIDES, Array, Wrench
from biodance.settings import COP_FORCE
from biodance.version import __version__

if TYPE_CHECKING:
    from rerun import RecordingStream


_NEWTONS_PER_METRE = 1000.0
_MEASURED, _RESIDUAL, _SKIN = (0, 158, 115), (213, 94, 0), (180, 180, 190, 120)


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
    if one.motion is None:
        raise TrialRefused(f"Trial {one.name}: it gives no motion. {one.reason}".strip())
    refuse_present(path)
    try:
        import rerun
    except ImportError as error:
        raise MissingLibrary(
            f"{path}: the format rerun needs the library rerun-sdk ({error}). Install it with pip install rerun-sdk."
        ) from error
    with whole_file(path) as part:
        _write(rerun, one, body, part, segment_solids(body) if solids is None else solids)
    return path


def _write(rerun: Any, one: TrialResult, body: Body, path: Path, solids: SegmentSolids) -> None:
    assert one.motion is not None
    stream = rerun.RecordingStream("biodance", recording_id=f"{body.name} {one.name}")
    stream.save(path)
    stream.log("lab", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _body(rerun, stream, one, body, solids)
    _markers(rerun, stream, one)
    _forces(rerun, stream, one, body)
    for j, joint in enumerate(body.joints):
        angle = one.motion.known_angles[:, j]
        _send(rerun, stream, f"angles/{joint.name}", one.motion.time, rerun.Scalars.columns(scalars=angle))
    stream.flush()


def _send(rerun: Any, stream: "RecordingStream", place: str, time: Array, columns: Any) -> None:
    stream.send_columns(place, indexes=[rerun.TimeColumn("time", duration=time)], columns=columns)


def _body(rerun: Any, stream: "RecordingStream", one: TrialResult, body: Body, solids: SegmentSolids) -> None:
    """Send the solids, and how they move."""
    assert one.motion is not None
    pose, time = poses(body, one.motion.q), one.motion.time
    for k, name in enumerate(body.segments):
        if name not in solids:
            continue
        mesh = solids[name]
        shape = rerun.Mesh3D(
            vertex_positions=mesh.vertices,
            triangle_indices=mesh.faces,
            vertex_normals=mesh.vertex_normals,
            albedo_factor=_SKIN,
        )
        stream.log(f"lab/body/{name}", shape, static=True)
        moved = rerun.Transform3D.columns(
            translation=pose.position[:, k], quaternion=Rotation.from_matrix(pose.rotation[:, k]).as_quat()
        )
        _send(rerun, stream, f"lab/body/{name}", time, moved)
    centre = centre_of_mass(body, one.motion)
    _send(rerun, stream, "lab/centre_of_mass", time, rerun.Points3D.columns(positions=centre, radii=[0.02] * len(time)))


def _markers(rerun: Any, stream: "RecordingStream", one: TrialResult) -> None:
    """Send the markers that are seen in each frame."""
    markers = one.trial.markers
    if markers is None:
        return
    seen = markers.seen
    points = rerun.Points3D.columns(positions=markers.xyz[seen]).partition(lengths=seen.sum(axis=1))
    _send(rerun, stream, "lab/markers", markers.time, points)


def _forces(rerun: Any, stream: "RecordingStream", one: TrialResult, body: Body) -> None:
    """Send plates, their forces at the centres of pressure, and what the body leaves unexplained at its centre of
    mass.
    """
    assert one.motion is not None
    for plate in one.trial.plates:
        corners = [np.vstack([plate.corners, plate.corners[:1]])]
        stream.log(f"lab/plates/{plate.name}", rerun.LineStrips3D(corners), static=True)
        cop = plate.wrench.cop(height=plate.height, threshold=COP_FORCE)
        _arrows(rerun, stream, f"lab/forces/{plate.name}", plate.wrench.time, plate.wrench.force, cop, _MEASURED)
    if one.comparison is not None:
        found = one.comparison
        left = np.where(found.used[:, None], found.measured - predict_wrench(body, one.motion).value, np.nan)[:, :3]
        centre = centre_of_mass(body, one.motion)
        _arrows(rerun, stream, "lab/forces/residual", found.time, left, centre, _RESIDUAL)


def _arrows(
    rerun: Any,
    stream: "RecordingStream",
    place: str,
    time: Array,
    force: Array,
    at: Array,
    colour: tuple[int, int, int],
) -> None:
    """Send one arrow a frame; none where force or place are not known."""
    known = np.isfinite(force).all(axis=1) & np.isfinite(at).all(axis=1)
    columns = rerun.Arrows3D.columns(
        vectors=force[known] / _NEWTONS_PER_METRE, origins=at[known], colors=[colour] * int(known.sum())
    )
    _send(rerun, stream, place, time, columns.partition(lengths=known.astype(int)))


_NAMES = {True: "Foot Strike", False: "Foot Off"}


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
    outputs = [*_angles(body, one)]
    centre = np.where(one.motion.determined[:, None], centre_of_mass(body, one.motion), np.nan)
    outputs.append(Output("BodyCentreOfMass", "MODELED_MARKERS", centre, "x, y, z"))
    contact = contact_of(one.trial, one, body)
    if one.comparison is not None:
        outputs += _wrenches(body, one)
    if contact is not None:
        outputs += _loads(body, one, contact)
    events = tuple(
        Event(event.time, event.side.title(), _NAMES[event.down]) for event in movement_of(one, body, None).events
    )
    said: dict[str, FileValue] = {
        "VERSION": [__version__],
        "SOURCE": [source[:255]],
        "SEGMENTS": list(body.segments),
        "MASS": body.sip.mass,
        "NOT_MEASURED": [
            f"{span.joint} {span.state.words} {span.start:.3f} {span.end:.3f} s"[:255] for span in one.motion.spans()
        ][:255]
        or ["none"],
    }
    write_results_c3d(path, one.trial.source.path, outputs=outputs, events=events, parameters=said, subject=subject)
    return path, f"The recording of trial {trial} with {len(outputs)} results and {len(events)} events. {source}"


def _groups(body: Body) -> Iterator[tuple[str, list[int], str]]:
    """Yield name (``RightHip``), indices and names of the axes (``flexion, adduction, rotation``) of every joint of
    the body.
    """
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


def _angles(body: Body, one: TrialResult) -> Iterator[Output]:
    assert one.motion is not None
    angle = np.radians(one.motion.known_angles)
    for name, columns, axes in _groups(body):
        yield Output(f"{name}Angles", "ANGLES", _three(angle[:, columns]), axes, turns=False)


def _loads(body: Body, one: TrialResult, contact: Contact) -> Iterator[Output]:
    """Yield moments and powers; NaN where nobody knows what the ground does to the leg's foot."""
    assert one.motion is not None
    motion = one.motion
    ground = foot_wrenches(one.trial, contact, soles_from_body(body, motion))
    torque, rate = joint_torques(body, motion, ground).torque, motion.v[:, body.n_root :]
    for name, columns, axes in _groups(body):
        told = motion.determined & _told(name, contact)
        value = np.where(told[:, None], torque[:, columns], np.nan)
        power = np.sum(value * rate[:, columns], axis=1, keepdims=True)
        yield Output(f"{name}Moments", "MOMENTS", _three(value), f"{axes}: what the muscles do", turns=False)
        yield Output(f"{name}Power", "POWERS", _three(power), "all axes of the joint", turns=False)


def _told(name: str, contact: Contact) -> NDArray[np.bool_]:
    """Return (T,) where the ground's share in a joint is known: of legs, where their foot's is; of all others."""
    leg = any(word in name for word in ("Hip", "Knee", "Ankle"))
    side = next((k for k, word in enumerate(SIDES) if name.startswith(word.title())), None)
    return contact.told[:, side] if leg and side is not None else np.ones(len(contact.told), dtype=bool)


def _wrenches(body: Body, one: TrialResult) -> Iterator[Output]:
    assert one.motion is not None
    assert one.comparison is not None
    found = one.comparison
    predicted = predict_wrench(body, one.motion)
    for word, wrench in (
        ("Measured", Wrench(found.time, found.measured)),
        ("Predicted", replace(predicted, time=found.time)),
    ):
        value = np.where(found.used[:, None], wrench.value, np.nan)
        yield Output(f"{word}GroundForce", "FORCES", value[:, :3], "x, y, z of the ground's force on the subject")
        yield Output(f"{word}GroundMoment", "MOMENTS", value[:, 3:], "x, y, z of its moment about the lab origin")

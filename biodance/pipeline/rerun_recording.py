"""A trial as a recording for the viewer Rerun (rerun.io): solids, markers, plates, forces, residual, joint angles.

Rerun is no part of biodance: ``pip install rerun-sdk``. Lab frame, z up, m; arrows 1 m for `_NEWTONS_PER_METRE` N.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.solids import SegmentSolids, segment_solids
from biodance.errors import FileRefused, MissingLibrary, TrialRefused
from biodance.motion.kinematics import centre_of_mass, poses
from biodance.motion.regressor import predict_wrench
from biodance.pipeline.trial_result import TrialResult
from biodance.records import Array
from biodance.settings import COP_FORCE

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
    if path.exists():
        raise FileRefused(f"{path}: exists already and is not overwritten. Choose another name or remove it.")
    try:
        import rerun
    except ImportError as error:
        raise MissingLibrary(
            f"{path}: the format rerun needs the library rerun-sdk ({error}). Install it with pip install rerun-sdk."
        ) from error
    stream = rerun.RecordingStream("biodance", recording_id=f"{body.name} {one.name}")
    stream.save(path)
    stream.log("lab", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _body(rerun, stream, one, body, segment_solids(body) if solids is None else solids)
    _markers(rerun, stream, one)
    _forces(rerun, stream, one, body)
    for j, joint in enumerate(body.joints):
        angle = np.where(one.motion.determined, one.motion.angles[:, j], np.nan)
        _send(rerun, stream, f"angles/{joint.name}", one.motion.time, rerun.Scalars.columns(scalars=angle))
    stream.flush()
    return path


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

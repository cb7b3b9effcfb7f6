"""Choose and lay out one instant of a session to draw in 3-D: standing, where the residual is largest, where a load
sits.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from biodance.body.body import Body
from biodance.body.changes import parts_as_segments
from biodance.body.solids import box_solid, shape_parts
from biodance.errors import TrialRefused
from biodance.identification.added_mass import LoadSearch
from biodance.identification.load_words import size_and_segments
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import Poses, centre_of_mass, poses
from biodance.motion.newton import facing
from biodance.pipeline.trial_result import Still, TrialResult
from biodance.records import Array, Motion, side_in_name


def parent_segments(body: Body) -> list[int]:
    """Return for every segment the segment it hangs on; -1 for the root's."""
    parents = []
    for joint in body.segment_joint:
        while joint >= 0 and body.joints[joint].parent >= 0 and body.joints[body.joints[joint].parent].segment < 0:
            joint = body.joints[joint].parent
        above = body.joints[joint].parent if joint >= 0 else -1
        parents.append(-1 if joint < 0 else 0 if above < 0 else body.joints[above].segment)
    return parents


def _tip(box: Array) -> Array:
    """Return the end (3,) m of a segment without child: the middle of the face of its ``box`` (2, 3) that lies
    farthest from the origin.
    """
    middle = box.mean(axis=0)
    side, axis = np.unravel_index(np.argmax(np.abs(box)), box.shape)
    middle[axis] = box[side, axis]
    return middle


def bone_lines(body: Body, pose: Poses) -> tuple[Array, tuple[str, ...]]:
    """Return lines (T, B, 2, 3) m of a ``pose`` of T frames and their sides (B).

    A segment is drawn from its origin to the origin of its child; to the middle of a left and a right child, which a
    bar joins; beyond its children, or without any, to the end of its box. Only the trunk reaches beyond its children.
    """
    parents, place = parent_segments(body), pose.position
    lines: list[tuple[Array, Array, str]] = []
    for i, segment in enumerate(body.segments):
        start, children = place[:, i], [j for j, parent in enumerate(parents) if parent == i]
        pair = [place[:, j] for j in children if side_in_name(body.segments[j]) != "middle"]
        if len(pair) > 1:
            middle = (pair[0] + pair[-1]) / 2
            lines += [(pair[0], pair[-1], "middle"), (start, middle, "middle")]
            start = middle
        for j in children:
            side = side_in_name(body.segments[j])
            if len(pair) < 2 or side == "middle":
                lines.append((place[:, i], place[:, j], side))
        if not children or segment.startswith("trunk"):
            lines.append((start, place[:, i] + pose.rotation[:, i] @ _tip(body.boxes[i]), side_in_name(segment)))
    return np.stack([np.stack(line[:2], axis=1) for line in lines], axis=1), tuple(line[2] for line in lines)


@lru_cache(maxsize=64)
def _solid_points(box: bytes) -> Array:
    """Return the points (V, 3) m of the solid that fills a box (2, 3) m, given by its bytes."""
    return np.asarray(box_solid(np.frombuffer(box).reshape(2, 3)).vertices)


def silhouettes(body: Body, q: Array, eye: tuple[float, float]) -> list[tuple[str, Array, float]]:
    """Return the parts of a body in the posture ``q`` (nq,) as seen from the horizontal direction ``eye``: segment,
    outline (n, 2) m, across and up, and how near it is, m.
    """
    from scipy.spatial import ConvexHull

    pose, out = poses(body, q), []
    toward = np.array([*eye, 0.0])
    seen = np.array([[-eye[1], eye[0], 0.0], [0.0, 0.0, 1.0]])
    for segment, box in shape_parts(body):
        points = _solid_points(box.tobytes()) @ pose.rotation[0, segment].T + pose.position[0, segment]
        flat = points @ seen.T
        out.append((body.segments[segment], flat[ConvexHull(flat).vertices], float((points @ toward).mean())))
    return out


def still_of(body: Body, results: tuple[TrialResult, ...]) -> Still:
    """Return the middle frame of the first static trial with a motion, else of the first trial with one.

    Raises
    ------
    TrialRefused
        No trial has a motion.
    """
    moving = sorted((r for r in results if r.motion is not None), key=lambda r: r.trial.role != "static")
    if not moving or moving[0].motion is None or moving[0].trial.markers is None:
        raise TrialRefused("No trial has a tracked motion, so there is no body to draw.")
    return still_at(body, moving[0], moving[0].motion.time.size // 2)


def still_at(body: Body, one: TrialResult, frame: int) -> Still:
    """Return one frame of a trial that has markers and a motion."""
    trial, motion = one.trial, one.motion
    assert motion is not None
    assert trial.markers is not None
    force, cop = np.full(3, np.nan), np.full(3, np.nan)
    if trial.plates:
        force, cop = trial.wrench.force[frame], trial.wrench.cop(height=trial.floor)[frame]
    posed = posture_still(body, motion.q[frame], trial.name)
    return replace(
        posed,
        time=float(motion.time[frame]),
        markers=trial.markers.xyz[frame],
        plates=np.array([plate.corners for plate in trial.plates]).reshape(-1, 4, 3),
        force=force,
        cop=cop,
        forward=facing(body, motion),
    )


def posture_still(body: Body, q: Array, title: str) -> Still:
    """Return a posture ``q`` (nq,) alone: bones, boxes and centre of mass, without markers, plates or forces."""
    motion = Motion(np.zeros(1), q[None], np.zeros((1, body.nv)), np.zeros((1, body.nv)))
    com, body = centre_of_mass(body, motion)[0], parts_as_segments(body)
    pose, nothing, parts = poses(body, q), np.full(3, np.nan), shape_parts(body)
    on = [segment for segment, _ in parts]
    lines, sides = bone_lines(body, pose)
    return Still(
        trial=title,
        time=0.0,
        bones=lines[0],
        sides=sides,
        markers=np.empty((0, 3)),
        plates=np.empty((0, 4, 3)),
        com=com,
        force=nothing,
        cop=nothing,
        forward=facing(body, motion),
        boxes=np.reshape([box for _, box in parts], (-1, 2, 3)),
        rotations=pose.rotation[0, on],
        positions=pose.position[0, on],
        box_sides=tuple(side_in_name(body.segments[segment]) for segment in on),
    )


def worst_still(body: Body, results: tuple[TrialResult, ...]) -> Still | None:
    """Return the fully measured frame in which the force that ``body`` needs differs most from the measured one;
    None without any.
    """
    worst: tuple[float, TrialResult, int, Array] | None = None
    for one in results:
        found, motion = one.comparison, one.motion
        if found is None or motion is None or one.trial.markers is None or not found.used.any():
            continue
        residual = np.where(found.used[:, None], found.measured[:, :3] - predict_wrench(body, motion).force, 0.0)
        size = np.linalg.norm(residual, axis=1)
        frame = int(np.argmax(size))
        if worst is None or size[frame] > worst[0]:
            worst = (float(size[frame]), one, frame, residual[frame])
    if worst is None:
        return None
    size_n, one, frame, force = worst
    x, y, z = (f"{round(value):+d}".replace("-", "−") for value in force)
    about = (
        f"The worst frame: what the plates measured differs by {size_n:.0f} N from what the body needs (x {x}, y {y}, "
        f"z {z} N; arrow: 1 m for 100 N)."
    )
    return replace(still_at(body, one, frame), residual=force, about=about)


def load_still(body: Body, results: tuple[TrialResult, ...], search: LoadSearch) -> Still | None:
    """Return the still of the body with the load that was found, where it sits; None without one, or where its place
    is not known.
    """
    if not search.found or not np.isfinite(search.best.place).all():
        return None
    still, best = still_of(body, results), search.best
    one = next(result for result in results if result.trial.name == still.trial and result.motion is not None)
    assert one.motion is not None
    pose, segment = poses(body, one.motion.q[one.motion.time.size // 2]), body.segment_index(best.segment)
    place = pose.position[0, segment] + pose.rotation[0, segment] @ best.place
    about = f"The load that was found (yellow): {size_and_segments(search)}."
    return replace(still, load=place, about=about)

"""What is drawn of a body: outlines, bones, an instant, a posture that is asked for, a session frame by frame."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.changes import parts_as_segments
from biodance.body.solids import box_solid, shape_parts
from biodance.errors import TrialRefused
from biodance.identification.added_mass import LoadSearch
from biodance.identification.load_words import size_and_segments
from biodance.identification.validation import TrialValidation
from biodance.library import locate, read_toml
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import Poses, centre_of_mass, poses
from biodance.motion.newton import facing
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import Still, TrialResult
from biodance.records import SIDES, Array, Motion, side_in_name
from biodance.spatial import zero_moment_point


def parent_segments(body: Body) -> list[int]:
    """Return for every segment the segment it hangs on; -1 for the root's."""
    parents = []
    for joint in body.segment_joint:
        # joints of several axes are chains of which only the last one carries a segment: go to the first
        while joint >= 0 and body.joints[joint].parent >= 0 and body.joints[body.joints[joint].parent].segment < 0:
            joint = body.joints[joint].parent
        above = body.joints[joint].parent if joint >= 0 else -1
        parents.append(-1 if joint < 0 else 0 if above < 0 else body.joints[above].segment)
    return parents


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
            # the middle of the face of the segment's box that lies farthest from its origin
            box, tip = body.boxes[i], body.boxes[i].mean(axis=0)
            face, axis = np.unravel_index(np.argmax(np.abs(box)), box.shape)
            tip[axis] = box[face, axis]
            lines.append((start, place[:, i] + pose.rotation[:, i] @ tip, side_in_name(segment)))
    return np.stack([np.stack(line[:2], axis=1) for line in lines], axis=1), tuple(line[2] for line in lines)


@lru_cache(maxsize=64)
def _solid_points(box: bytes) -> Array:
    """Return the points (V, 3) m of the solid that fills a box (2, 3) m, given by its bytes."""
    return np.asarray(box_solid(np.frombuffer(box).reshape(2, 3)).vertices)


def silhouettes(body: Body, q: Array, eye: tuple[float, float]) -> list[tuple[str, Array, float]]:
    """Return by segment what ``eye`` sees of a posture (nq,): outline (n, 2) m, across and up, and how near, m."""
    from scipy.spatial import ConvexHull

    pose, out = poses(body, q), []
    toward = np.array([*eye, 0.0])
    # rows: across is the horizontal at right angles to the eye's direction, up is the lab's z
    seen = np.array([[-eye[1], eye[0], 0.0], [0.0, 0.0, 1.0]])
    for segment, box in shape_parts(body):
        points = _solid_points(box.tobytes()) @ pose.rotation[0, segment].T + pose.position[0, segment]
        flat = points @ seen.T
        out.append((body.segments[segment], flat[ConvexHull(flat).vertices], float((points @ toward).mean())))
    return out


def still_of(body: Body, results: tuple[TrialResult, ...]) -> Still:
    """Return the middle frame of the first static trial with a motion, else of the first trial with one. Raises
    TrialRefused: no trial has a motion.
    """
    one = _drawn_first(results)
    if one is None or one.motion is None or one.trial.markers is None:
        raise TrialRefused("No trial has a tracked motion, so there is no body to draw.")
    return still_at(body, one, one.motion.time.size // 2)


def _drawn_first(results: tuple[TrialResult, ...]) -> TrialResult | None:
    moving = (one for one in results if one.motion is not None)
    return min(moving, key=lambda one: one.trial.role != "static", default=None)


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
    """Return the fully measured frame whose force differs most from what ``body`` needs; None without any."""
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
    """Return the still of the body with the load that was found, where it sits; None where that is not known."""
    one, load = _drawn_first(results), _load_place(body, search)
    if load is None or one is None or one.motion is None:
        return None
    pose, (segment, place) = poses(body, one.motion.q[one.motion.time.size // 2]), load
    about = f"The load that was found (yellow): {size_and_segments(search)}."
    return replace(
        still_of(body, results), load=pose.position[0, segment] + pose.rotation[0, segment] @ place, about=about
    )


@cache
def _asked(segment: str) -> tuple[str, dict[str, Any]]:
    """Return the side of a segment ("" for the middle), and what is said and shown of its kind; {} for nothing."""
    side, _, kind = segment.partition("_")
    side, kind = (side, kind) if side in SIDES else ("", segment)
    return side, read_toml(locate("protocols/vocabulary", "asked")).get(kind, {})


def asked_words(segment: str) -> str:
    """Return the sentence by which a person is asked to move a segment, for example ``left_thigh``."""
    side, found = _asked(segment)
    return found["say"].format(side) if found else "Squat, bow, and lift both arms to the side, each once more."


def asked_posture(body: Body, segment: str) -> Array:
    """Return the posture (nq,) of the picture beside these words: soles flat, the lower foot on the floor, z = 0."""
    side, found = _asked(segment)
    asked = {name.format(side): angle for name, angle in found.get("angles", {}).items()}
    q, root = np.array(body.neutral, dtype=float), body.nq - len(body.joints)
    for j, joint in enumerate(body.joints):
        bare = joint.name.partition("_")[2]
        q[root + j] = np.radians(asked.get(joint.name, asked.get(bare, 0.0)))
    # The sum of the angles from pelvis to foot is zero where the sole is flat: the pelvis leans by what they lack.
    lean = asked.get("hip_flexion", 0.0) - asked.get("knee_flexion", 0.0) + asked.get("ankle_dorsiflexion", 0.0)
    q[3:7] = (Rotation.from_euler("y", lean, degrees=True) * Rotation.from_quat(q[3:7])).as_quat()
    q[2] -= min(outline[:, 1].min() for _, outline, _ in silhouettes(body, q, (1.0, 0.0)))
    return q


_FASTEST, _FRAMES = 25.0, 3000
"""Hz of a replay at most, and its frames in all trials together: a page stays small however long the session."""


@dataclass(frozen=True, eq=False)
class TrialReplay:
    """One trial at the frames (F) shown, m and N in the lab frame, NaN = not known.

    ``time`` (F,) s; ``positions`` (F, N, 3) and ``rotations`` (F, N, 4), quaternions x y z w, of the segments;
    ``markers`` (F, K, 3); ``com`` (F, 3); ``measured`` and ``simulated`` (F, 2, 3) force and centre of pressure, with
    ``parameters`` "identified" or "table"; ``residual`` (F, 3) N measured less simulated, of fully measured frames;
    ``plates`` (P, 4, 3) corners; ``worst`` s at which the residual is largest (NaN: nowhere measured);
    ``state`` (F,) `AngleState` of each frame.
    """

    name: str
    time: Array
    positions: Array
    rotations: Array
    markers: Array
    com: Array
    measured: Array
    simulated: Array
    parameters: str
    residual: Array
    plates: Array
    worst: float
    state: NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class SessionReplay:
    """The ``trials`` that can be replayed; ``boxes`` (B, 2, 3) m that the body is drawn as, each on the segment
    ``on`` (B) with its ``sides``; a load that was found: its segment's index and place (3,) m there, else None.
    """

    trials: tuple[TrialReplay, ...]
    boxes: Array
    on: tuple[int, ...]
    sides: tuple[str, ...]
    load: tuple[int, Array] | None = None


def frames_of(result: SessionResult) -> SessionReplay | None:
    """Return the replay of a session; None where no trial has a motion."""
    body, found = result.body, result.identification
    moving = [
        (one, one.motion) for one in result.trials if one.motion and one.motion.time.size > 1 and one.trial.markers
    ]
    if body is None or not moving:
        return None
    validated = {one.name: one for one in (*found.validations, *found.fitted)} if found else {}
    seconds = sum(motion.time.size / motion.rate for _, motion in moving)
    rate = min(_FASTEST, _FRAMES / max(seconds, 1e-9))
    whole, body = body, parts_as_segments(body)
    parts = shape_parts(body)
    return SessionReplay(
        tuple(_trial(whole, body, one, rate, validated) for one, _ in moving),
        np.reshape([box for _, box in parts], (-1, 2, 3)),
        tuple(segment for segment, _ in parts),
        tuple(side_in_name(body.segments[k]) for k, _ in parts),
        _load_place(body, found.search) if found else None,
    )


def _load_place(body: Body, search: LoadSearch) -> tuple[int, Array] | None:
    """Return segment and place (3,) m in it of the load that was found; None without one, or where it is not known."""
    best = search.best if search.found else None
    return (body.segment_index(best.segment), best.place) if best and np.isfinite(best.place).all() else None


def _trial(
    whole: Body, body: Body, one: TrialResult, rate: float, validated: Mapping[str, TrialValidation]
) -> TrialReplay:
    """Return one trial of the ``whole`` body, drawn as ``body``, whose parts are segments."""
    trial, motion = one.trial, one.motion
    assert motion is not None
    assert trial.markers is not None
    simulated, parameters, residual = _simulated(one, validated.get(one.name))
    size = np.linalg.norm(residual, axis=1)
    worst, step = int(np.nanargmax(size)) if np.isfinite(size).any() else None, max(1, round(motion.rate / rate))
    # begin so that every step-th frame meets the worst one
    chosen = np.arange((worst or 0) % step, motion.time.size, step)
    shown = motion.at(chosen)
    pose = poses(body, shown.q)
    measured = np.full((motion.time.size, 2, 3), np.nan)
    if trial.plates:
        measured = np.stack([trial.wrench.force, trial.wrench.cop(height=trial.floor)], axis=1)
    turn = Rotation.from_matrix(pose.rotation.reshape(-1, 3, 3)).as_quat().reshape(*pose.rotation.shape[:2], 4)
    return TrialReplay(
        one.name,
        shown.time,
        pose.position,
        turn,
        trial.markers.xyz[chosen],
        centre_of_mass(whole, shown),
        measured[chosen],
        simulated[chosen],
        parameters,
        residual[chosen],
        np.reshape([plate.corners for plate in trial.plates], (-1, 4, 3)),
        float("nan") if worst is None else float(motion.time[worst]),
        motion.frame_state[chosen],
    )


def _simulated(one: TrialResult, found: TrialValidation | None) -> tuple[Array, str, Array]:
    """Return the simulation's force and centre of pressure (T, 2, 3), whose parameters, and the residual (T, 3) N."""
    assert one.motion is not None
    if found is not None:
        wrench, about, use, parameters = found.identified.value, found.about, found.use, "identified"
        left = found.measured.value - wrench
    elif one.comparison is not None:
        wrench, about, use, parameters = one.comparison.simulated, np.zeros(3), one.comparison.used, "table"
        left = one.comparison.measured - wrench
    else:
        nothing = np.full((one.motion.time.size, 2, 3), np.nan)
        return nothing, "table", nothing[:, 0]
    # the moments are about ``about``: the floor's height and the point found are counted from there
    cop = zero_moment_point(wrench, height=one.trial.floor - about[2], threshold=20.0) + about
    return np.stack([wrench[:, :3], cop], axis=1), parameters, np.where(use[:, None], left[:, :3], np.nan)

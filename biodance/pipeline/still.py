"""Choose and lay out one instant of a session to draw in 3-D."""

import numpy as np

from biodance.body.body import Body
from biodance.errors import TrialRefused
from biodance.motion.kinematics import Poses, poses
from biodance.pipeline.results import Still, TrialResult
from biodance.pipeline.standing import centre_of_mass, facing
from biodance.records import Array


def _parents(body: Body) -> list[int]:
    """Return for every segment the segment it hangs on; -1 for the root's."""
    parents = []
    for joint in body.segment_joint:
        while joint >= 0 and body.joints[joint].parent >= 0 and body.joints[body.joints[joint].parent].segment < 0:
            joint = body.joints[joint].parent
        above = body.joints[joint].parent if joint >= 0 else -1
        parents.append(-1 if joint < 0 else 0 if above < 0 else body.joints[above].segment)
    return parents


def _tip(box: Array) -> Array:
    """Return the end (3,) m of a segment without child: the middle of the face of its ``box`` (2, 3) that lies farthest from the origin."""
    middle = box.mean(axis=0)
    side, axis = np.unravel_index(np.argmax(np.abs(box)), box.shape)
    middle[axis] = box[side, axis]
    return middle


def _side(segment: str) -> str:
    return next((side for side in ("left", "right") if segment.startswith(side)), "middle")


def bones(body: Body, pose: Poses) -> tuple[Array, tuple[str, ...]]:
    """Return lines (B, 2, 3) m of the first frame of ``pose`` and their sides.

    A segment is drawn from its origin to the origin of its child; to the middle of a left and a right child, which a bar joins; beyond its
    children, or without any, to the end of its box. Only the trunk reaches beyond its children.
    """
    parents, place = _parents(body), pose.position[0]
    lines: list[tuple[Array, Array]] = []
    sides: list[str] = []

    def draw(start: Array, end: Array, side: str) -> None:
        lines.append((start, end))
        sides.append(side)

    for i, segment in enumerate(body.segments):
        start = place[i]
        pair = [place[j] for j, parent in enumerate(parents) if parent == i and _side(body.segments[j]) != "middle"]
        if len(pair) > 1:
            draw(pair[0], pair[-1], "middle")
            draw(start, (pair[0] + pair[-1]) / 2, "middle")
            start = (pair[0] + pair[-1]) / 2
        for j in (j for j, parent in enumerate(parents) if parent == i and (len(pair) < 2 or _side(body.segments[j]) == "middle")):
            draw(place[i], place[j], _side(body.segments[j]))
        if i not in parents or segment.startswith("trunk"):
            draw(start, place[i] + pose.rotation[0, i] @ _tip(body.boxes[i]), _side(segment))
    return np.array(lines), tuple(sides)


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
    trial, motion = moving[0].trial, moving[0].motion
    middle = motion.time.size // 2
    force, cop = np.full(3, np.nan), np.full(3, np.nan)
    if trial.plates:
        force, cop = trial.wrench.force[middle], trial.wrench.cop(height=float(np.mean([p.height for p in trial.plates])))[middle]
    lines, sides = bones(body, poses(body, motion.q[middle]))
    return Still(
        trial=trial.name,
        time=float(motion.time[middle]),
        bones=lines,
        sides=sides,
        markers=moving[0].trial.markers.xyz[middle],
        plates=np.array([plate.corners for plate in trial.plates]).reshape(-1, 4, 3),
        com=centre_of_mass(body, motion)[middle],
        force=force,
        cop=cop,
        forward=facing(body, motion),
    )

"""What is drawn of a body: outlines, bones, an instant, a posture that is asked for; and a session frame by frame, as
``replay.js`` draws it in 3-D: small however long the session.
"""

from base64 import b64encode
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.changes import parts_as_segments
from biodance.body.solids import ROUNDNESS, shape_parts
from biodance.dance.problem.stance import SEAT_TO_HIP, Stance
from biodance.identification.added_mass import LoadSearch
from biodance.identification.validation import TrialValidation
from biodance.library import locate, read_toml
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import Poses, centre_of_mass, poses
from biodance.motion.newton import facing
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial import TrialResult
from biodance.pipeline.words import size_and_segments
from biodance.records import SIDES, Array, Motion, side_in_name
from biodance.spatial import zero_moment_point


@dataclass(frozen=True, eq=False)
class Still:
    """One instant to draw in 3-D.

    ``bones`` (B, 2, 3) m lines with ``sides`` (B) "left", "right" or "middle"; ``markers`` (K, 3) m as measured;
    ``plates`` (P, 4, 3) m corners; ``com`` (3,) m; ``force`` and ``cop`` (3,) N, m of the total wrench (NaN =
    unloaded); ``forward`` (2,) unit vector the subject faces. ``boxes`` (N, 2, 3) m of the segments with ``rotations``
    (N, 3, 3) and ``positions`` (N, 3) m in the lab and their ``box_sides``; ``residual`` (3,) N measured minus
    predicted force, ``load`` (3,) m place of a load that was found (NaN = none); ``about`` what the picture shows, one
    sentence.
    """

    trial: str
    time: float
    bones: Array
    sides: tuple[str, ...]
    markers: Array
    plates: Array
    com: Array
    force: Array
    cop: Array
    forward: Array
    boxes: Array = field(default_factory=lambda: np.empty((0, 2, 3)))
    rotations: Array = field(default_factory=lambda: np.empty((0, 3, 3)))
    positions: Array = field(default_factory=lambda: np.empty((0, 3)))
    box_sides: tuple[str, ...] = ()
    residual: Array = field(default_factory=lambda: np.full(3, np.nan))
    load: Array = field(default_factory=lambda: np.full(3, np.nan))
    about: str = ""


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


def silhouettes(body: Body, q: Array, eye: tuple[float, float]) -> list[tuple[str, Array, Array]]:
    """Return by segment what ``eye`` sees of postures (T, nq): outlines (T, n, 2) m, across and up, how near (T,) m.

    An outline joins the points in which the solid of a box (`body.solids`) touches lines of every direction.
    """
    pose, out = poses(body, q), []
    angle = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
    # rows: across is the horizontal at right angles to the eye's direction, up is the lab's z
    seen = np.array([[-eye[1], eye[0], 0.0], [0.0, 0.0, 1.0]])
    outward = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ seen
    for segment, (low, high) in shape_parts(body):
        turn, half = pose.rotation[:, segment], (high - low) / 2
        # largest g y where the p-norm of y is 1: y = sign(g) |g|^(1/(p-1)) over its p-norm, g the direction times half
        slope = outward @ turn * half
        touch = np.sign(slope) * np.abs(slope) ** (1 / (ROUNDNESS - 1))
        touch *= half / (np.abs(touch) ** ROUNDNESS).sum(axis=2, keepdims=True) ** (1 / ROUNDNESS)
        middle = turn @ ((low + high) / 2) + pose.position[:, segment]
        outline = (touch @ turn.transpose(0, 2, 1) + middle[:, None]) @ seen.T
        out.append((body.segments[segment], outline, middle @ np.array([*eye, 0.0])))
    return out


def props(stance: Stance | None, eye: tuple[float, float]) -> list[Array]:
    """Return what ``eye`` sees of a stool and of the grips that are held: lines (n, 2) m, across and up."""
    if stance is None:
        return []
    across, high, out = np.array([-eye[1], eye[0]]), stance.seat - SEAT_TO_HIP, []
    if stance.seat:
        left, right = np.sort(stance.props @ across)[[0, -1]]
        out.append(np.array([[left, 0.0], [left, high], [right, high], [right, 0.0]]))
    for hand in stance.hands[list(stance.holding)]:
        out.append(np.array([[hand[:2] @ across, 0.0], [hand[:2] @ across, hand[2]]]))
    return out


def stills_of(result: SessionResult) -> tuple[Still, ...]:
    """Return what is drawn of a session, first what shows most: the worst frame of the body that is believed, a frame
    of standing, and the load that was found; () where nothing moves.
    """
    body, found = result.body, result.identification
    usual = _usual_still(body, result.trials) if body is not None else None
    if body is None or usual is None:
        return ()
    # beside the paper's programme it is the posterior that is believed
    one = (found.posterior or found).identification if found else None
    worst = worst_still(one.identified if one and one.status == "solved" else body, result.trials)
    load = load_still(body, result.trials, found.search) if found and worst else None
    return tuple(still for still in (worst, usual, load) if still is not None)


def _usual_still(body: Body, results: tuple[TrialResult, ...]) -> Still | None:
    """Return the middle frame of the first static trial with a motion, else of the first trial with one."""
    one = _drawn_first(results)
    if one is None or one.motion is None or one.trial.markers is None:
        return None
    return still_at(body, one, one.motion.time.size // 2)


def _drawn_first(results: tuple[TrialResult, ...]) -> TrialResult | None:
    moving = (one for one in results if one.motion is not None)
    return min(moving, key=lambda one: one.trial.role != "static", default=None)


def still_at(body: Body, one: TrialResult, frame: int) -> Still:
    """Return one frame of a trial that has markers and a motion."""
    trial, motion = one.trial, one.moved
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
    # head and torso are shapes of one segment: drawn apart, they turn together
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
    one, load = _drawn_first(results), load_place(body, search)
    if load is None or one is None or one.motion is None:
        return None
    pose, (segment, place) = poses(body, one.motion.q[one.motion.time.size // 2]), load
    about = f"The load that was found (yellow): {size_and_segments(search)}."
    drawn = still_at(body, one, one.motion.time.size // 2)
    return replace(drawn, load=pose.position[0, segment] + pose.rotation[0, segment] @ place, about=about)


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
    q[2] -= min(outline[..., 1].min() for _, outline, _ in silhouettes(body, q, (1.0, 0.0)))
    return q


def load_place(body: Body, search: LoadSearch) -> tuple[int, Array] | None:
    """Return segment and place (3,) m in it of the load that was found; None without one, or where it is not known."""
    best = search.best if search.found else None
    return (body.segment_index(best.segment), best.place) if best and np.isfinite(best.place).all() else None


FORCE_SCALE, RESIDUAL_SCALE = 0.001, 0.01
"""Length of a drawn force, and of a drawn residual force, m per N: ten times the measured force's."""
_UNKNOWN = -32768  # Whole number of a place that is not known
_FASTEST, _FRAMES = 25.0, 3000
"""Hz of a replay at most, and its frames in all trials together."""


def replay_scene(result: SessionResult) -> dict[str, Any] | None:
    """Return what ``replay.js`` draws of a session, in plain values; None where no trial has a motion.

    ``boxes`` with ``low`` and ``high`` m in the segment ``on``, ``side``; ``load`` segment and place or null; scales of
    the arrows m per N; ``trials`` with ``name``, ``parameters`` of the simulation ("identified" or "table"),
    ``frames``, ``start_s``, ``step_s``, ``worst_s`` at which most is left (NaN: nowhere measured), corners m of
    ``plates``, ``origin`` m and ``unit`` m of a step, and int16 arrays, little-endian in base64, frame by frame:
    ``places`` of segments, markers, centre of mass and the two centres of pressure, ``turns`` (x y z w in 1/32767),
    ``forces`` measured, simulated and left (of fully measured frames) in 0.1 N; ``state`` one digit a frame.
    """
    body, found = result.body, result.identification
    tracked = [(one, one.motion) for one in result.trials if one.motion and one.trial.markers]
    moving = [(one, motion) for one, motion in tracked if motion.time.size > 1]
    if body is None or not moving:
        return None
    validated = {one.name: one for one in (*found.validations, *found.fitted)} if found else {}
    seconds = sum(motion.time.size / motion.rate for _, motion in moving)
    rate = min(_FASTEST, _FRAMES / max(seconds, 1e-9))
    drawn = parts_as_segments(body)
    load = load_place(drawn, found.search) if found else None
    return {
        "boxes": [
            {"on": on, "side": side_in_name(drawn.segments[on]), "low": box[0].round(4), "high": box[1].round(4)}
            for on, box in shape_parts(drawn)
        ],
        "load": None if load is None else {"on": load[0], "place": load[1].round(4)},
        "force_scale": FORCE_SCALE,
        "residual_scale": RESIDUAL_SCALE,
        "trials": [_trial(body, drawn, one, motion, rate, validated.get(one.name)) for one, motion in moving],
    }


def _trial(
    body: Body, drawn: Body, one: TrialResult, motion: Motion, rate: float, validated: TrialValidation | None
) -> dict[str, Any]:
    """Return one trial of the ``body``, ``drawn`` with its parts as segments, at ``rate`` Hz at most."""
    trial, wrench = one.trial, np.full((motion.time.size, 2, 3), np.nan)
    assert trial.markers is not None
    simulated, parameters, residual = _simulated(one, motion, validated)
    size = np.linalg.norm(residual, axis=1)
    worst, step = int(np.nanargmax(size)) if np.isfinite(size).any() else None, max(1, round(motion.rate / rate))
    # begin so that every step-th frame meets the worst one
    chosen = np.arange((worst or 0) % step, motion.time.size, step)
    shown = motion.at(chosen)
    pose, com = poses(drawn, shown.q), centre_of_mass(body, shown)
    if trial.plates:
        wrench = np.stack([trial.wrench.force, trial.wrench.cop(height=trial.floor)], axis=1)
    measured, simulated = wrench[chosen], simulated[chosen]
    pressed = [measured[:, 1:], simulated[:, 1:]]
    places = np.concatenate([pose.position, trial.markers.xyz[chosen], com[:, None], *pressed], axis=1)
    origin = np.nanmean(com, axis=0)
    # whole numbers of 16 bits: the segment furthest from the origin is at most 30,000 steps away
    unit = max(1e-4, float(np.nanmax(np.abs(pose.position - origin))) / 30000)
    turn = Rotation.from_matrix(pose.rotation.reshape(-1, 3, 3)).as_quat().reshape(*pose.rotation.shape[:2], 4)
    return {
        "name": one.name,
        "parameters": parameters,
        "frames": chosen.size,
        "worst_s": float("nan") if worst is None else float(motion.time[worst]),
        "segments": pose.position.shape[1],
        "markers": trial.markers.xyz.shape[1],
        "start_s": float(shown.time[0]),
        "step_s": float(shown.time[-1] - shown.time[0]) / max(shown.time.size - 1, 1),
        "plates": [plate.corners.round(4) for plate in trial.plates],
        "origin": origin.round(4),
        "unit": unit,
        "places": packed_numbers((places - origin.round(4)) / unit),
        "turns": packed_numbers(32767 * turn),
        "forces": packed_numbers(10 * np.stack([measured[:, 0], simulated[:, 0], residual[chosen]], axis=1)),
        "state": "".join(str(int(state)) for state in motion.frame_state[chosen]),
    }


def _simulated(one: TrialResult, motion: Motion, found: TrialValidation | None) -> tuple[Array, str, Array]:
    """Return the simulation's force and centre of pressure (T, 2, 3), whose parameters, and the residual (T, 3) N."""
    if found is not None:
        wrench, about, use, parameters = found.identified.value, found.about, found.use, "identified"
        left = found.measured.value - wrench
    elif one.comparison is not None:
        wrench, about, use, parameters = one.comparison.simulated, np.zeros(3), one.comparison.used, "table"
        left = one.comparison.measured - wrench
    else:
        nothing = np.full((motion.time.size, 2, 3), np.nan)
        return nothing, "table", nothing[:, 0]
    # the moments are about ``about``: the floor's height and the point found are counted from there
    cop = zero_moment_point(wrench, height=one.trial.floor - about[2], threshold=20.0) + about
    return np.stack([wrench[:, :3], cop], axis=1), parameters, np.where(use[:, None], left[:, :3], np.nan)


def packed_numbers(values: Array) -> str:
    """Return values as whole numbers of 16 bits in base64; what is not known or beyond them as -32768."""
    known = np.isfinite(values) & (np.abs(values) < -_UNKNOWN - 0.5)
    whole = np.where(known, np.rint(np.where(known, values, 0.0)), _UNKNOWN).astype("<i2")
    return b64encode(whole.tobytes()).decode("ascii")

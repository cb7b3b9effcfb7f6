"""What a replay of a session shows, frame by frame: body, markers, plates, measured and simulated force, what is
left.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.changes import parts_as_segments
from biodance.body.solids import shape_parts
from biodance.identification.added_mass import LoadSearch
from biodance.identification.validation import TrialValidation
from biodance.motion.kinematics import centre_of_mass, poses
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import TrialResult
from biodance.records import Array, side_in_name
from biodance.spatial import zero_moment_point

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
    """Return the segment's index and the place (3,) m of the load that was found; None where none, or its place is not
    known.
    """
    best = search.best if search.found else None
    return (body.segment_index(best.segment), best.place) if best and np.isfinite(best.place).all() else None


def _trial(
    whole: Body, body: Body, one: TrialResult, rate: float, validated: Mapping[str, TrialValidation]
) -> TrialReplay:
    """Return one trial of the ``whole`` body, drawn as ``body``, whose parts are segments."""
    from scipy.spatial.transform import Rotation

    trial, motion = one.trial, one.motion
    assert motion is not None
    assert trial.markers is not None
    simulated, parameters, residual = _simulated(one, validated.get(one.name))
    size = np.linalg.norm(residual, axis=1)
    worst, step = int(np.nanargmax(size)) if np.isfinite(size).any() else None, max(1, round(motion.rate / rate))
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
    """Return force and centre of pressure (T, 2, 3) of the simulation, whose parameters it has, and the residual force
    (T, 3) of the fully measured frames.
    """
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
    cop = zero_moment_point(wrench, height=one.trial.floor - about[2], threshold=20.0) + about
    return np.stack([wrench[:, :3], cop], axis=1), parameters, np.where(use[:, None], left[:, :3], np.nan)

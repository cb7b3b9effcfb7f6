"""A session frame by frame, as ``replay.js`` draws it in 3-D: small however long the session."""

from base64 import b64encode
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.changes import parts_as_segments
from biodance.body.solids import shape_parts
from biodance.identification.validation import TrialValidation
from biodance.motion.kinematics import centre_of_mass, poses
from biodance.pipeline.results import SessionResult
from biodance.pipeline.still import load_place
from biodance.pipeline.trial_result import TrialResult
from biodance.records import Array, Motion, side_in_name
from biodance.spatial import zero_moment_point

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

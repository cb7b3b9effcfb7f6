"""A dance of ours, danced in the foreign laboratory: its people, bones, tissue, plate and cameras, our postures.

    BIODANCE_FOREIGN_LAB=folder python benchmarks/foreign_dance.py DANCE.npz SECONDS LABORATORY'S OWN OPTIONS ...

The laboratory draws its own movements. Here its `make_trial` is asked for trials "copy0", "copy1", ... of ten seconds,
which together are the dance in SECONDS: every joint of its skeleton is turned as the dance turns ours, five degrees off
(two the pelvis; wandering with 0.25 Hz), both ankles stay where its legs reach as ours do, and its own loop moves the
pelvis until the zero-moment point lies where the plan has it. Arms are raised sideways by 75 degrees at most: its
shoulder has a pole at 90.
"""

import os
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from biodance.body.parts import UPRIGHT
from biodance.dance.dance import Dance
from biodance.motion.kinematics import poses
from biodance.pipeline.front_dance import stretches
from biodance.records import SIDES, Array
from biodance.virtual_lab.movement.performance import SMOOTH, WANDER, Shown

TRIAL = 10.0
"""s of a trial of the foreign laboratory."""
_OFF, _PELVIS_OFF, _SWAY = np.radians(5.0), np.radians(2.0), 0.004
_STEEPEST = np.sin(np.radians(75.0))
_POLE = np.sin(np.radians(8.0))
_SOFT = 0.2
"""s over which an arm's angles are smoothed."""
_FREE = 0.6
"""Share of its way up from which a foot is free."""
_LOWER = 0.02
"""m by which the pelvis is lower than ours, so that legs of other proportions reach."""
_STRAIGHT = -0.05
"""rad: its elbows bend at least so much."""
_BONES = ("thigh", "shank", "foot")
_ROUNDS = 8  # corrections of the pelvis


def windows(shown: tuple[Shown, ...], count: int) -> list[tuple[int, float, float]]:
    """Return the stretch, the first second of it and the seconds planned for each of ``count`` trials."""
    lengths = [float(np.ptp(one.motion.time)) for one in shown]
    share = [max(1, round(count * length / sum(lengths))) for length in lengths[1:]]
    share.insert(0, count - sum(share))
    return [
        (number, k * length / parts, length / parts)
        for number, (length, parts) in enumerate(zip(lengths, share, strict=True))
        for k in range(parts)
    ]


def _turns(shown: Shown, when: Array) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return how every segment is turned (T, 3, 3) from standing upright, x ahead and z up, and its joint (T, 3) m."""
    body, q = shown.body, make_interp_spline(shown.motion.time, shown.motion.q, k=5)(when)
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    pose = poses(body, q)
    turns = {name: pose.rotation[:, i] @ UPRIGHT.T for i, name in enumerate(body.segments)}
    return turns, {name: pose.position[:, i] for i, name in enumerate(body.segments)}


def _arm(trunk: Array, upper: Array, fore: Array) -> Array:
    """Return flexion, abduction, rotation of a shoulder and flexion of its elbow (T, 4) rad."""
    x, y, z = (np.swapaxes(trunk, 1, 2) @ upper @ [0.0, 0.0, -1.0]).T
    abduction = np.arcsin(np.clip(y, -_STEEPEST, _STEEPEST))
    told, frames = np.flatnonzero(np.hypot(x, z) > _POLE), np.arange(len(x))
    flexion = np.interp(frames, told, np.unwrap(np.arctan2(-x, -z)[told])) if told.size else np.zeros(len(x))
    upper_arm = _soft(np.stack([flexion, abduction], axis=1))
    within = trunk @ Rotation.from_euler("YX", upper_arm).as_matrix()
    x, y, z = np.einsum("tji,tj->ti", within, fore @ [0.0, 0.0, -1.0]).T
    elbow = np.stack([np.unwrap(np.arctan2(y, x)), -np.arccos(np.clip(-z, -1.0, 1.0))], axis=1)
    return np.concatenate([upper_arm, _soft(elbow)], axis=1)


def _soft(angles: Array) -> Array:
    """Return angles (T, k) at 100 Hz without the jumps near the shoulder's pole."""
    return np.asarray(gaussian_filter1d(angles, 100.0 * _SOFT, axis=0, mode="nearest"))


def posed(h: Any, turns: dict[str, Array]) -> Array:
    """Return the coordinates (T, n) of the foreign skeleton (module ``h``), its pelvis nowhere yet, feet flat."""
    at = columns(h)
    q: Array = np.zeros((len(turns["pelvis"]), h.NQ))
    q[:, 3:6] = Rotation.from_matrix(turns["pelvis"]).as_euler("ZYX")

    def between(parent: str, child: str) -> Array:
        return Rotation.from_matrix(np.swapaxes(turns[parent], 1, 2) @ turns[child]).as_euler("YXZ")

    q[:, at["trunk"]] = between("pelvis", "trunk_head")
    for side in SIDES:
        arm = _arm(*(turns[name] for name in ("trunk_head", f"{side}_upper_arm", f"{side}_forearm_hand")))
        q[:, at[f"{side[0]}_uarm"]], q[:, at[f"{side[0]}_farm"]] = arm[:, :3], arm[:, 3:]
        q[:, at[f"{side[0]}_thigh"]] = between("pelvis", f"{side}_thigh")
        q[:, at[f"{side[0]}_shank"]] = between(f"{side}_thigh", f"{side}_shank")[:, :1]
    return q


def columns(h: Any) -> dict[str, list[int]]:
    """Return the coordinates of every segment of the foreign skeleton."""
    return dict(zip(h.SEG, h.QI, strict=True))


def copied(lab: Any, shown: Shown, when: Array, rng: np.random.Generator, g: dict[str, Array], phi: Array) -> Any:
    """Return a trial of the foreign laboratory (module ``lab``) that copies the plan at ``when`` (T,) s."""
    h, mo = lab.h, lab.mo
    turns, places = _turns(shown, when)
    off, at = lab.smooth_noise(rng, len(when), h.NQ, WANDER), columns(h)
    q = posed(h, turns)
    legs = {side: [c for bone in _BONES for c in at[f"{side[0]}_{bone}"]] for side in SIDES}
    own = {side: q[:, legs[side]] + _OFF * off[:, legs[side]] for side in SIDES}
    upper = [c for name in ("trunk", "r_uarm", "r_farm", "l_uarm", "l_farm") for c in at[name]]
    q[:, 3:6] += _PELVIS_OFF * off[:, 3:6]
    q[:, upper] += _OFF * off[:, upper]
    for name in ("r_farm", "l_farm"):
        q[:, at[name]] = np.minimum(q[:, at[name]], _STRAIGHT)
    long = np.mean([np.linalg.norm(np.diff([places[f"{s}_{b}"][0] for b in _BONES], axis=0), axis=1) for s in SIDES])
    scale = 0.5 * (h.L["thigh"] + h.L["shank"]) / long
    middle, lift = np.append(shown.ankle[:, :2].mean(axis=0), shown.ankle[:, 2].min()), [0.0, 0.0, h.L["ankle_h"]]
    hips = scale * (np.mean([places[f"{side}_thigh"] for side in SIDES], axis=0) - middle) + lift
    q[:, :3] = hips - turns["pelvis"] @ (0.5 * (g["hipR"] + g["hipL"])) - [0.0, 0.0, _LOWER]
    feet = {side: (turns[f"{side}_foot"], scale * (places[f"{side}_foot"] - middle) + lift) for side in SIDES}
    smoothed = gaussian_filter1d(shown.pressure, SMOOTH / np.diff(shown.motion.time).mean(), axis=0, mode="nearest")
    raised, pressure = (make_interp_spline(shown.motion.time, what, k=3)(when) for what in (shown.raised, smoothed))
    raised = np.clip(raised, 0.0, _FREE) / _FREE
    wanted = scale * (pressure - middle[:2]) + _SWAY * lab.smooth_noise(rng, len(when), 2, 0.5)
    for _ in range(_ROUNDS):
        for k, side in enumerate(SIDES):
            q, _ = mo.leg_ik(q, g, side[0], *feet[side], iters=6)
            free = raised[:, k : k + 1]
            q[:, legs[side]] = (1.0 - free) * q[:, legs[side]] + free * own[side]
        v, a = mo.deriv(q)
        force = h.regressor(h.fk(q, g, v, a)) @ phi
        error = mo.zmp(force) - wanted
        moved = 0.45 * lab.filtfilt(*mo.LP, error, axis=0, padlen=150)
        q[:, :2] -= moved
    q[:, :2] += moved  # the last error is that of the motion before
    place = h.fk(q, g)["p"]
    left = [
        np.linalg.norm((place[h.SEG.index(f"{side[0]}_foot")] - feet[side][1])[raised[:, k] <= 0], axis=1)
        for k, side in enumerate(SIDES)
    ]
    time, missed = np.arange(len(when)) / mo.FS, float(np.concatenate(left).max(initial=0.0))
    print(f"feet {1000 * missed:.1f} mm, zero-moment point {1000 * np.abs(error).max():.0f} mm off at most", flush=True)
    return {"kind": "copy", "t": time, "q": q, "qd": v, "qdd": a, "zdev": error, "ikerr": missed, "F": force}


def dance_there(dance: Dance, seconds: float, words: list[str]) -> None:
    """Let the foreign laboratory write a session of ``seconds`` s in which its person copies ``dance``."""
    sys.path.insert(0, os.environ["BIODANCE_FOREIGN_LAB"])
    lab = import_module("foreign_lab")
    shown = stretches(dance)
    parts = windows(shown, round(seconds / TRIAL))
    usual = lab.mo.make_trial

    def make_trial(kind: str, rng: np.random.Generator, T: float, g: Any, phi: Array, **more: Any) -> Any:
        if not kind.startswith("copy"):
            return usual(kind, rng, T, g, phi, **more)
        number, start, length = parts[int(kind[4:])]
        time = np.arange(int(T * lab.mo.FS)) / lab.mo.FS - lab.PAD
        span = shown[number].motion.time[[0, -1]]
        when = np.clip(span[0] + start + length / TRIAL * time, *span)
        return copied(lab, shown[number], when, rng, g, phi)

    lab.mo.make_trial = make_trial
    kinds = ",".join(f"copy{k}" for k in range(len(parts)))
    lab.main([*words, "--kinds", kinds, "--trials", str(len(parts))])


if __name__ == "__main__":
    dance_there(Dance.load(Path(sys.argv[1])), float(sys.argv[2]), sys.argv[3:])

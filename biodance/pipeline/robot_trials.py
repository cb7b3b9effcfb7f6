"""Which plate recording belongs to which motion of a robot, when and where; what contradicts it, in a sentence."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing

from biodance.body.body import Body
from biodance.errors import BiodanceError, FileRefused, TrialRefused
from biodance.identification.robot import RobotMotion, innovation, robot_fit
from biodance.lab.prepare import LowPass, low_pass
from biodance.lab.robot import BaseSensors, RobotRecording, RobotTrial, for_joints
from biodance.motion.dynamics import predict_wrench
from biodance.motion.grounded import (
    RATE,
    UNDER,
    BaseSeen,
    Grounded,
    PlateFit,
    base_of_inclinations,
    base_of_markers,
    even_angles,
    fit_plate,
    ground,
    on_motion_clock,
)
from biodance.records import Array, Wrench, runs
from biodance.spatial import elementary_rotation

_SAME = 0.9
"""Least correlation of the paths of the centre of pressure, needed and measured, of one motion."""
_SCALES = (0.7, 1.4)
"""Legal sizes of the measured path over the needed one."""
_WEIGHTS = (0.5, 2.0)
"""Legal weight on the plate over that of the drawing."""
ODD, _FAITHFUL = 1.6, 0.99
"""Beyond this surprise, or below this correlation, exchanged columns are looked for, and another standing foot."""
_COARSE, _PARTED = 20.0, 0.5
"""Hz at which exchanged columns and other standing feet are looked for; s by which stretches of these are parted."""
_SLOW = LowPass(cutoff=0.2 * _COARSE)


@dataclass(frozen=True, eq=False)
class MatchedTrial(RobotMotion):
    """A trial as ``recorded``, ``plate`` when and where, ``innovation`` of the drawing at it."""

    recorded: RobotTrial
    plate: PlateFit
    innovation: float


def bring_together(
    body: Body, recording: RobotRecording, *, tell: Callable[[str], None] = lambda _: None
) -> tuple[list[MatchedTrial], dict[str, str]]:
    """Return the trials in which plate and encoders are of one motion, and why others are not, by name."""
    trials, refused = list[MatchedTrial](), dict[str, str]()
    for one in recording.trials:
        tell(f"{one.name}: bringing plate and encoders together")
        try:
            trials.append(_matched(body, one, recording))
        except BiodanceError as why:
            refused[one.name] = str(why)
    return trials, refused


def _matched(body: Body, one: RobotTrial, recording: RobotRecording) -> MatchedTrial:
    """Return one trial with plate and encoders brought together."""
    where = str(one.files[0])
    limits = (np.asarray(body.limits.lower), np.asarray(body.limits.upper))
    encoders = for_joints(one.encoders, tuple(j.name for j in body.joints), limits, where=where, fixed=recording.fixed)
    time, angle = even_angles(encoders)
    measured = Wrench(one.wrench.time, low_pass(one.wrench.value, one.wrench.rate, LowPass()))
    carried = float(np.median(measured.value[:, 2])) / -float(body.gravity[2])
    weight = float(body.sip.mass.sum())
    if not _WEIGHTS[0] < carried / weight < _WEIGHTS[1]:
        raise TrialRefused(
            f"{one.files[1]}: carries {carried:.2f} kg (median), {body.name} weighs {weight:.2f} kg. Is it the plate "
            f"of this robot, in N, zeroed while empty?"
        )
    base = recording.base
    seen = _base_from_imu(one, base, time)
    grounded, fit = _grounded_motion(body, time, angle, measured, base=seen)
    # the plate decides only what the angles leave open
    if grounded.unclear.any() and fit.correlation < _FAITHFUL:
        grounded, fit = _stood_by_plate(body, time, angle, measured, seen)
    if base.markers:
        grounded = _base_from_markers(body, one, base, grounded, angle, fit)
    motion = robot_fit(one.name, grounded, angle, on_motion_clock(measured, time, fit))
    odd = innovation(body, motion)
    foreign = fit.correlation < _SAME or not _SCALES[0] < fit.scale < _SCALES[1]
    # looked for also where the plate seems foreign: exchanged columns make it seem so
    if odd > ODD or fit.correlation < _FAITHFUL:
        pair = _exchanged(body, time, angle, measured, limits)
        if pair and _explains(body, time, angle, measured, pair):
            raise TrialRefused(
                f"{where}: the columns of {pair[0]} and {pair[1]} are exchanged: exchanged back, the motion needs what "
                f"the plate shows. Correct the headings."
            )
    if foreign:
        raise TrialRefused(
            f"{one.files[1]}: is not the plate of this motion ({where}): at no delay does its centre of pressure "
            f"follow what the encoders need (best correlation {fit.correlation:.2f}, least {_SAME:g}; size "
            f"{fit.scale:.2f}, legal {_SCALES[0]:g} to {_SCALES[1]:g}). Pair the files of one run; else look for a "
            f"wrong sign or zero of an encoder, or hands on the robot."
        )
    return MatchedTrial(motion.fit, motion.angle, motion.grounded, replace(one, encoders=encoders), fit, odd)


_Placed = tuple[Grounded, PlateFit]
"""A motion and its place on the plate."""


def _placed(body: Body, time: Array, angle: Array, measured: Wrench, **how: Any) -> _Placed:
    """Return the motion as `ground` finds it (standing feet, filter and base as it takes them), and its plate."""
    found = ground(body, time, angle, **how)
    return found, fit_plate(predict_wrench(body, found.motion), measured, found.use)


def _grounded_motion(body: Body, time: Array, angle: Array, measured: Wrench, **how: Any) -> _Placed:
    """Return the motion and its plate; where angles leave open which foot stands, what agrees best with it."""
    placed = partial(_placed, body, time, angle, measured, **how)
    usual = placed()
    if not usual[0].unclear.any():
        return usual
    others = (placed(under=UNDER[1]), *(placed(lean=np.full(time.size, side)) for side in (0, 1)))
    return max((usual, *others), key=lambda one: one[1].correlation)


def _stood_by_plate(body: Body, time: Array, angle: Array, measured: Wrench, base: BaseSeen | None) -> _Placed:
    """Return the motion and its place on the plate where the plate says which foot stands in every stretch in which the
    angles leave that open: in one stretch, or from one on, the foot with which both agree best, until they agree or
    nothing is better. Stretches are told at `_COARSE` instants.
    """
    step, found = round(RATE / _COARSE), list[_Placed]()
    few = None if base is None else base[::step]
    coarse = partial(_placed, body, *_coarse(time, angle, measured), settings=_SLOW, base=few)
    for under, side in product(UNDER, (-1, 0, 1)):
        lean = _best_lean(partial(coarse, under=under), side)
        fine = np.repeat(lean, step)[: time.size]
        found.append(_placed(body, time, angle, measured, under=under, lean=fine, base=base))
        if found[-1][1].correlation >= _FAITHFUL:
            break
    return max(found, key=lambda one: one[1].correlation)


def _best_lean(placed: Callable[..., _Placed], side: int) -> NDArray[np.intp]:
    """Return the feet with which what is ``placed`` agrees best, beginning with one ``side`` everywhere."""
    unclear = placed(lean=None)[0].unclear
    starts = [start for start, stop in runs(binary_closing(unclear, iterations=round(_PARTED * _COARSE)))]
    lean, before = np.full(unclear.size, side), -1.0
    agreed = placed(lean=lean)[1].correlation
    while _FAITHFUL > agreed > before:
        before = agreed
        for start, stop in pairwise([*starts, unclear.size]):
            for foot, end in product((0, 1), {stop, unclear.size}):
                other = lean.copy()
                other[start:end] = foot
                if (size := placed(lean=other)[1].correlation) > agreed:
                    lean, agreed = other, size
    return lean


def _base_from_imu(one: RobotTrial, base: BaseSensors, time: Array) -> BaseSeen | None:
    """Return what the base's IMU shows at ``time`` (T,) s; None without one."""
    if base.imu is None:
        return None
    lost = [name for name in base.imu if name not in one.encoders.joints]
    if lost:
        raise FileRefused(f"{one.files[0]}: has no column {lost[0]}, which recording.toml [base] imu names.")
    columns = [one.encoders.joints.index(name) for name in base.imu]
    _, angle = even_angles(replace(one.encoders, joints=base.imu, angle=one.encoders.angle[:, columns]))
    return base_of_inclinations(*angle.T)


def _base_from_markers(
    body: Body, one: RobotTrial, base: BaseSensors, found: Grounded, angle: Array, fit: PlateFit
) -> Grounded:
    """Return the motion with its base where its markers are; only frames with all of them count."""
    if one.markers is None:
        raise FileRefused(f"{one.files[1]}: holds no markers, which recording.toml [base] markers names.")
    time, seen = found.motion.time, one.markers
    rotation, position = base_of_markers(seen, dict(base.markers), str(one.files[1]))
    whole = np.isfinite(position[:, 0])
    rows = np.column_stack([position, rotation.reshape(-1, 9)])
    at = time + fit.delay
    rows = np.stack([np.interp(at, seen.time[whole], row[whole]) for row in rows.T], axis=1)
    near = np.interp(at, seen.time, whole, left=0.0, right=0.0) > 1 - 1e-9
    u, _, vt = np.linalg.svd(rows[:, 3:].reshape(-1, 3, 3))
    turn = elementary_rotation("z", -fit.yaw)
    pose = BaseSeen(turn @ (u @ vt), (rows[:, :3] - [*fit.place, 0.0]) @ turn.T)
    out = ground(body, time, angle, lean=found.lean, base=pose, under=found.under)
    return replace(out, use=out.use & near)


def _exchanged(
    body: Body, time: Array, angle: Array, measured: Wrench, limits: tuple[Array, Array]
) -> tuple[str, str] | None:
    """Return the two joints whose exchange lets the plate follow from the encoders; None if no exchange does."""
    coarse, few, measured = _coarse(time, angle, measured)
    low, high = limits[0] - 0.35, limits[1] + 0.35
    inside = (few.min(axis=0)[:, None] >= low) & (few.max(axis=0)[:, None] <= high)
    moving = few.std(axis=0) > 0.01
    # exchanged back, they leave a quarter of what the correlation lacks to one
    best, pair = min(0.25 * _correlation_deficit(body, coarse, few, measured), 2 * (1 - _FAITHFUL)), None
    for i, j in combinations(range(few.shape[1]), 2):
        if not (inside[i, j] and inside[j, i] and (moving[i] or moving[j])):
            continue
        other = few.copy()
        other[:, [i, j]] = few[:, [j, i]]
        size = _correlation_deficit(body, coarse, other, measured)
        if size < best:
            best, pair = size, (body.joints[i].name, body.joints[j].name)
    return pair


def _coarse(time: Array, angle: Array, measured: Wrench) -> tuple[Array, Array, Wrench]:
    """Return times and angles at `_COARSE` Hz, and the measured wrench without what is too fast for it."""
    step = round(RATE / _COARSE)
    return time[::step], angle[::step], Wrench(measured.time, low_pass(measured.value, measured.rate, _SLOW))


def _explains(body: Body, time: Array, angle: Array, measured: Wrench, pair: tuple[str, str]) -> bool:
    """Whether most of the wrench follows with two joints exchanged back: a few seconds may resemble a path."""
    names = [joint.name for joint in body.joints]
    i, j = (names.index(name) for name in pair)
    other = angle.copy()
    other[:, [i, j]] = angle[:, [j, i]]
    found, fit = _grounded_motion(body, time, other, measured)
    motion = robot_fit("exchanged", found, other, on_motion_clock(measured, time, fit))
    most = 2 * motion.fit.use.sum() > found.use.sum()
    return bool(most and fit.correlation > _FAITHFUL and innovation(body, motion) < ODD)


def _correlation_deficit(body: Body, time: Array, angle: Array, measured: Wrench) -> float:
    """Return what the correlation at a coarse motion lacks to one; infinite where nothing fits."""
    try:
        found, fit = _grounded_motion(body, time, angle, measured, settings=_SLOW)
        legal = _SCALES[0] < fit.scale < _SCALES[1] and found.use.any()
        return 1 - fit.correlation if legal else np.inf
    except BiodanceError:
        return np.inf

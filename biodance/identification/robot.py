"""What a robot weighs, link by link, from encoders and a force plate: the identification of people with the errors that
a robot's laboratory makes, as changes of the wrench that the drawing needs.

Encoders are exact but for their zeros, joints are where the drawing has them; where on the plate the robot stood is
known to what the drawing's own errors allow. All of this enters as independent sources of error (`mismatch`), so that
intervals hold with them. A joint that gives lies, beyond its encoder, by torque over stiffness away from it; one with
play by half of the play to the side to which its load pushes. Both torques are the drawing's. The robot is put on its
foot anew with every change.
"""

from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body, load_pinocchio
from biodance.identification.base_parameters import BaseEstimate, BaseParameters, estimate_base
from biodance.identification.identification import Identification, conclude
from biodance.identification.mismatch import Mismatch, long_runs
from biodance.identification.statistics import START, Fit, learn_noise, statistics, usable
from biodance.lab.prepare import LowPass, low_pass
from biodance.motion.dynamics import distribute, joint_torques, predict_wrench, regressor
from biodance.motion.grounded import Grounded, ground_again
from biodance.motion.kinematics import poses
from biodance.records import SIDES, Array, Motion, Wrench
from biodance.spatial import cross, quaternion_matrix, wrench_about_point
from biodance.threads import one_thread
from biodance.uncertainty.bands import WHITE, Bands, Noise
from biodance.uncertainty.plates import plate_errors, plate_sources
from biodance.uncertainty.tolerances import REFERENCE_PERSON

_BANDS = Bands((0.0, 0.04, 0.3, 1.0, 2.5), 25.0)
"""Hz. What a motion needs beyond is the encoders' noise, twice differentiated, more than the motion; parameters that
explain it come out small (regression dilution): with 6 Hz a robot of 7.36 kg in MuJoCo was found 70 g light and its
inertias were further from the truth than the drawing's, with 2.5 Hz it is found within 7 g.
"""


@dataclass(frozen=True, eq=False)
class RobotMotion:
    """One trial ready to identify from: ``fit`` in the frame of the first standing sole, and the ``angle`` (T, n) rad
    that ``grounded`` follows from.
    """

    fit: Fit
    angle: Array
    grounded: Grounded


def robot_fit(name: str, found: Grounded, angle: Array, measured: Array) -> RobotMotion:
    """Return a trial with its ``measured`` wrench (T, 6) in the frame of the first standing sole, NaN unknown."""
    use = found.use & np.isfinite(measured).all(axis=1)
    wrench = Wrench(found.motion.time, measured)
    return RobotMotion(Fit(name, found.motion, wrench, use), angle, found)


def innovation(body: Body, one: RobotMotion) -> float:
    """Return the RMS of what the drawing leaves of a trial's wrench, over what its own standard deviations allow.

    Channels count in units of their allowance, to which the start of the noise is added; 1 is usual.
    """
    pick = np.flatnonzero(one.fit.use)[:: 4 * THINNED]
    motion = one.fit.motion.at(pick)
    W = regressor(body, motion)
    left = one.fit.wrench.value[pick] - W @ body.sip.phi
    # var(W phi) per channel, plus the start of the noise.
    allowed = np.einsum("tci,ij,tcj->tc", W, body.sip.covariance, W, optimize=True) + np.diag(robot_start(body))
    return float(np.sqrt(np.mean(left**2 / allowed)))


@one_thread()
def identify_links(body: Body, trials: tuple[RobotMotion, ...]) -> tuple[Identification, BaseEstimate]:
    """Return the parameters of a robot from its ``trials``, with ``body.sip`` (the drawing) as prior; and the base
    parameters as the paper counts them: every frame independent, noise alone.

    Raises
    ------
    TrialRefused
        No trial has a usable frame.
    """
    fits, about, notes = usable(body, tuple(one.fit for one in trials))
    layout = Noise.unit(about, _BANDS)
    total = statistics(body, fits, layout)
    noise = learn_noise(total, body.sip, start=robot_start(body))
    by_name = {fit.name: fit for fit in fits}
    found = _errors(body, tuple((by_name[one.fit.name], one) for one in trials if one.fit.name in by_name), noise)
    done = conclude(body, total, tuple(by_name), noise=noise, found=found, machine=True)
    return replace(done, notes=(*notes, *done.notes)), _as_the_paper(body, fits, about, done.base.base)


def _as_the_paper(body: Body, fits: tuple[Fit, ...], about: Array, base: BaseParameters) -> BaseEstimate:
    """Return the base parameters by weighted least squares on independent frames, no prior (paper eq. 7)."""
    layout = Noise.unit(about, WHITE)
    total = statistics(body, fits, layout)
    noise, phi = replace(layout, covariance=robot_start(body)[None]), np.zeros(10 * len(body.segments))
    for _ in range(4):
        found = estimate_base(total.information(noise), base)
        phi[list(base.columns)] = found.value
        left = total.moments(phi, np.zeros((phi.size, phi.size))).residual[0]
        # Of count samples with six channels the base parameters take rank degrees of freedom, rank / 6 per channel.
        noise = replace(noise, covariance=np.diag(np.diag(left) / (total.count[0] - found.rank / 6))[None])
    return found


def robot_start(body: Body) -> Array:
    """Return the noise (6, 6) that learning starts with: that of a person, as much smaller as the robot is lighter."""
    return np.asarray(START * (float(body.sip.mass.sum()) / REFERENCE_PERSON) ** 2)


def _errors(body: Body, trials: tuple[tuple[Fit, RobotMotion], ...], noise: Noise) -> Mismatch:
    """Return the scores of encoder zeros, of plate faults (one plate for all trials) and of places."""
    size, plates = 10 * len(body.segments), plate_sources()
    encoders, faults = np.zeros((size, len(body.joints))), np.zeros((size, len(plates.delay)))
    places = []
    for fit, one in trials:
        place = np.zeros((size, places_of(one.grounded)))
        # `ZERO` rad at every joint's encoder.
        zeros = np.broadcast_to(ZERO * np.eye(one.angle.shape[1]), (*one.angle.shape, one.angle.shape[1]))
        changes = angle_changes(body, one.grounded, one.angle, zeros)
        white = noise.at(fit.motion.rate)
        for _, pick in long_runs((fit,), noise.bands):
            motion = fit.motion.at(pick)
            W = regressor(body, motion)
            weight, wrench = white.weighted(W), W @ body.sip.phi
            # Sum over frames and channels of W' S^-1 times what each error changes.
            encoders += np.tensordot(weight, changes[pick // THINNED], axes=((0, 1), (0, 1)))
            faults += np.tensordot(weight, plate_errors(wrench, motion.rate, noise, plates), axes=((0, 1), (0, 1)))
            place += np.tensordot(weight, place_changes(wrench, one.grounded, pick), axes=((0, 1), (0, 1)))
        places.append(place)
    return Mismatch(encoders, np.concatenate([faults, *places], axis=1))


ZERO = 0.005
"""rad: standard deviation of an encoder's zero about the drawing's (judgement: 0.3 degrees, set by hand at stops)."""
GIVE = 0.01
"""rad by which a joint that gives does so at its RMS torque, and half of the play of one that has some: the unit."""
_TURNS = 0.2
"""Of the RMS torque of a joint: load at which its play is taken up (smooth, as friction holds it near zero load)."""
PLACE, YAW = 0.02, 0.035
"""m and rad: how well the place on the plate follows from the drawing's centre of pressure, before the data."""
SLIP = 0.25
"""Of both: how far a later stance may be from where the chain of joints puts it; feet slide, soles are set down askew.
"""
_NEAR = 0.02
"""Of the height of the root: soles so near the lower one bear too."""
_QUIET = 1.5
"""Hz: accelerations below it are the robot's, above it the encoders' noise and vibrations, which would be taken for
causes.
"""
_SLOW = 0.3
"""Cut-off over the thinned rate: changes are smooth."""
THINNED = 4
"""Every so many frames are enough to see what an encoder's zero does."""


def leg_chains(body: Body) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the joints from the root to the right and to the left foot."""
    out = []
    for side in SIDES:
        found, joint = list[int](), body.segment_joint[body.feet[side].segment]
        while joint >= 0:
            found.append(joint)
            joint = body.joints[joint].parent
        out.append(tuple(reversed(found)))
    return out[0], out[1]


@dataclass(frozen=True, eq=False)
class Loads:
    """What gives under load: by how much (T, n) rad each joint lies beyond its encoder where it gives by 1 rad per N·m
    (``soft``) and where it has play of 1 rad to either side (``play``), zero for joints that are not of the legs; by
    how much the standing sole is turned, rotation vectors (T, 3) rad, where ground and sole give by 1 rad per N·m
    ``forwards`` and ``sideways``; and the RMS ``torque`` (n,) of the joints, ``moment`` (2,) of the sole, N·m.
    """

    soft: Array
    play: Array
    forwards: Array
    sideways: Array
    torque: Array
    moment: Array


def loads(body: Body, one: Grounded, measured: Array) -> Loads:
    """Return the loads with the ``measured`` wrench (T, 6) of the ground, NaN where unknown."""
    joints = sorted(set(sum(leg_chains(body), ())))
    every, pressed, ahead = _torques(body, one, measured)
    torque = np.zeros((len(measured), len(body.joints)))
    torque[:, joints] = every[:, joints]
    size = np.sqrt(np.mean(torque**2, axis=0))
    left = np.cross([0.0, 0.0, 1.0], ahead)
    # Moment about the sole's own axes: about its left axis it rocks forwards, about the one ahead sideways.
    give = [-np.einsum("ti,ti->t", pressed, axis) for axis in (left, ahead)]
    moment = np.sqrt(np.mean(np.square(give), axis=1))
    play = -np.tanh(torque / np.maximum(_TURNS * size, 1e-9))
    return Loads(-torque, play, give[0][:, None] * left, give[1][:, None] * ahead, size, moment)


def angle_changes(body: Body, one: Grounded, angle: Array, shapes: Array, tilts: Array | None = None) -> Array:
    """Return the change (T / `THINNED`, 6, k) of the needed wrench by changes ``shapes`` (T, n, k) rad of the joint
    ``angle`` (T, n) rad and ``tilts`` (T, 3, k) rad of the standing sole.
    """
    few, time = angle[::THINNED], one.motion.time
    slow = LowPass(cutoff=_SLOW / float(time[THINNED] - time[0]))
    before = _needed(body, ground_again(body, one, few, every=THINNED, settings=slow).motion)
    out = np.empty((*before.shape, shapes.shape[2]))
    for k in range(shapes.shape[2]):
        tilt = 0.0 if tilts is None else tilts[::THINNED, :, k]
        after = ground_again(body, one, few + shapes[::THINNED, :, k], every=THINNED, settings=slow, tilt=tilt)
        out[:, :, k] = _needed(body, after.motion) - before
    return out


def slow_wrench(body: Body, one: Grounded, angle: Array) -> Array:
    """Return the wrench (T, 6) that a motion needs, without what is faster than `_QUIET`: faults of a plate are made
    from it, since neither the encoders' noise nor forces that no motion explains are in it.
    """
    return _needed(body, ground_again(body, one, angle, settings=LowPass(cutoff=_QUIET)).motion)


def _needed(body: Body, motion: Motion) -> Array:
    """Return the wrench (T, 6) that a motion needs about the origin, ten times faster than by the regressor."""
    pin = load_pinocchio()
    model, rows = body.model, np.empty((motion.time.size, 6))
    data = model.createData()
    for row, q, v, a in zip(rows, motion.q, motion.v, motion.a, strict=True):
        row[:] = pin.rnea(model, data, q, v, a)[:6]
    turn = quaternion_matrix(motion.q[:, 3:7])
    force, moment = (np.einsum("tij,tj->ti", turn, part) for part in (rows[:, :3], rows[:, 3:]))
    # RNEA's first six are the root's wrench in its own axes about its origin: turned, then
    # carried to the lab origin.
    return np.concatenate([force, moment + cross(motion.q[:, :3], force)], axis=1)


def places_of(one: Grounded) -> int:
    """Return how many columns `place_changes` gives."""
    return 3 * len(one.supports)


def place_changes(wrench: Array, one: Grounded, pick: "slice | np.ndarray" = slice(None)) -> Array:
    """Return the changes (T, 6, 3 S) of a wrench by one standard deviation of the place along x, y and of the turn: of
    the whole motion, and of each of the S stances after the first; ``wrench`` at the instants ``pick``.
    """
    force, moment = wrench[:, :3], wrench[:, 3:]
    whole = np.zeros((len(wrench), 6, 3))
    for k in range(2):
        # Shift d of the frame: moment d x F. Turn by a small yaw: z x F, z x M.
        whole[:, 3:, k] = cross(PLACE * np.eye(3)[k], force)
    up = YAW * np.eye(3)[2]
    whole[:, :3, 2], whole[:, 3:, 2] = cross(up, force), cross(up, moment)
    stance = one.stance[pick]
    later = [SLIP * (stance == s)[:, None, None] * whole for s in range(1, len(one.supports))]
    out = np.concatenate([whole, *later], axis=2)
    return out / 10 if one.base is not None and one.base.position is not None else out


def _torques(body: Body, one: Grounded, measured: Array) -> tuple[Array, Array, Array]:
    """Return the torques (T, n) N·m under the measured wrench, from the feet upwards, the moment (T, 3) N·m on the
    standing sole about its middle, and the direction (T, 3) in which it points; a foot whose sole is near the ground
    bears its share. Accelerations are left out: they would bring in the encoders' noise.
    """
    pose = poses(body, one.motion.q)
    rest = poses(body, np.concatenate([[0.0, 0, 0, 0, 0, 0, 1], np.zeros(len(body.joints))])[None])
    soles, aheads = [], []
    for side in SIDES:
        foot = body.feet[side]
        middle = foot.outline.mean(axis=0)
        soles.append(pose.rotation[:, foot.segment] @ middle + pose.position[:, foot.segment])
        # Lab x as the foot sees it at rest, turned with the foot, seen from above.
        ahead = pose.rotation[:, foot.segment] @ (rest.rotation[0, foot.segment].T @ [1.0, 0.0, 0.0])
        flat = ahead * [1.0, 1.0, 0.0]
        aheads.append(flat / np.linalg.norm(flat, axis=1, keepdims=True))
    height = np.stack([sole[:, 2] for sole in soles], axis=1)
    down = height < height.min(axis=1, keepdims=True) + _NEAR * np.median(one.motion.q[:, 2])
    down[np.arange(len(down)), one.foot] = True
    still = replace(one.motion, v=np.zeros_like(one.motion.v), a=np.zeros_like(one.motion.a))
    needed = predict_wrench(body, still).value
    measured = np.where(np.isfinite(measured), measured, needed)
    wrench = Wrench(still.time, low_pass(measured, still.rate, LowPass(cutoff=_QUIET)))
    parts = distribute(wrench, soles[0], soles[1], down)
    names = [body.segments[body.feet[side].segment] for side in SIDES]
    torque = joint_torques(body, still, dict(zip(names, parts, strict=True))).torque
    standing = np.arange(len(down))
    # About the middle of each sole.
    pressed = [wrench_about_point(part.value, sole)[:, 3:] for part, sole in zip(parts, soles, strict=True)]
    return torque, np.array(pressed)[one.foot, standing], np.array(aheads)[one.foot, standing]

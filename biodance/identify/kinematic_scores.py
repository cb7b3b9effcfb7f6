"""What wrong kinematics do to the equations of a trial: exact, by the adjoint, for every single source at once.

A source (a marker that slides with an angle, flesh that shifts, a joint centre or a hinge's axis elsewhere) moves model markers, the
coordinates answer through the inverse kinematics, the wrench changes by e = L x to first order (`twins`, docs/derivations.md, section 8).
What enters the equations is the score W' S^-1 e. Instead of sending each of some hundred sources forward, the p columns of S^-1 W are sent
backward through L' once: the covariance of the scores over all sources then has no sampling error.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.identify.twins import central_inertia
from biodance.motion.kinematics import Poses, poses, segment_motion
from biodance.motion.marker_jacobian import below, chains, jacobian, skew
from biodance.records import Array, Motion


@dataclass(frozen=True, eq=False)
class KinematicScores:
    """Scores per unit of every source: ``slide`` (n, M, 3, p) and ``flesh`` (n, N, 3, p) per m/rad, joint by marker or segment;
    ``centre`` (n, 3, p) per m of the first axis of every joint in its parent's frame; ``tilt`` (n, 3, p) per rad of a hinge's axis.
    """

    slide: Array
    flesh: Array
    centre: Array
    tilt: Array

    def __add__(self, other: "KinematicScores") -> "KinematicScores":
        """Return the scores of two trials together."""
        return KinematicScores(self.slide + other.slide, self.flesh + other.flesh, self.centre + other.centre, self.tilt + other.tilt)


def kinematic_scores(body: Body, motion: Motion, weight: Array) -> KinematicScores:
    """Return sum over time of ``weight``' e for every source of wrench errors e; ``weight`` (T, 6, p), wrench about the lab origin."""
    pose, size = poses(body, motion.q), weight.shape[2]
    segment, frames = list(body.markers.segment), motion.time.size
    on_place, on_turn = _backward(body, motion, weight)
    on_marker = _through_tracking(body, pose, on_place, on_turn).reshape(frames, len(segment), 3, size)
    angles = motion.q[:, body.nq - len(body.joints) :]
    return KinematicScores(
        -_pulled(angles, np.swapaxes(pose.rotation[:, segment], -1, -2) @ on_marker),
        _pulled(angles, np.swapaxes(pose.rotation, -1, -2) @ on_place),
        _of_centres(body, pose, _with_markers(on_place, on_marker, segment)),
        _of_tilts(body, pose, angles, (on_place, on_turn, on_marker)),
    )


def _backward(body: Body, motion: Motion, weight: Array) -> tuple[Array, Array]:
    """Return the adjoint of `twins.wrench_change`: weights (T, N, 3, p) on the places of the centres of mass and on the segments' turns."""
    move, step, mass = segment_motion(body, motion), 1.0 / motion.rate, body.sip.mass
    com = (move.rotation @ body.sip.com[..., None])[..., 0] + move.position
    momentum = mass[:, None] * np.gradient(com, step, axis=0)
    inertia = move.rotation @ central_inertia(body) @ np.swapaxes(move.rotation, -1, -2)
    spin = (inertia @ move.angular_velocity[..., None])[..., 0]
    force, moment = weight[:, None, :3], weight[:, None, 3:]
    late = _gradient_adjoint(moment, step)
    pushed = _gradient_adjoint(_gradient_adjoint(force, step) - skew(com) @ late, step)
    place = mass[:, None, None] * (pushed - skew(body.gravity) @ moment) + skew(momentum) @ late
    return place, skew(spin) @ late + _gradient_adjoint(inertia @ late, step)


def _gradient_adjoint(values: Array, step: float) -> Array:
    """Return the transpose of ``np.gradient(., step, axis=0)`` applied to ``values`` (T, ...)."""
    out = np.zeros_like(values)
    inner = values[1:-1] / (2 * step)
    out[2:] += inner
    out[:-2] -= inner
    first, last = values[0] / step, values[-1] / step
    out[1] += first
    out[0] -= first
    out[-1] += last
    out[-2] -= last
    return out


def _through_tracking(body: Body, pose: Poses, on_place: Array, on_turn: Array) -> Array:
    """Return the weights (T, 3M, p) on the markers: transpose of dq = -(J'DJ)^-1 J'D dx and of what dq moves."""
    segment, everything = list(body.markers.segment), list(range(len(body.segments)))
    J, _ = jacobian(body, pose, segment, pose.points(segment, body.markers.position))
    place, turn = jacobian(body, pose, everything, pose.points(everything, body.sip.com))
    frames, size = on_place.shape[0], on_place.shape[3]
    on_tangent = np.swapaxes(place, 1, 2) @ on_place.reshape(frames, -1, size) + np.swapaxes(turn, 1, 2) @ on_turn.reshape(frames, -1, size)
    weighted = np.repeat(body.markers.weight, 3)[:, None] * J
    normal = np.swapaxes(weighted, 1, 2) @ J
    ridge = 1e-6 * np.trace(normal, axis1=1, axis2=2)[:, None, None] / body.nv * np.eye(body.nv)
    return np.asarray(-weighted @ np.linalg.solve(normal + ridge, on_tangent))


def _pulled(angles: Array, weight: Array) -> Array:
    """Return (n, S, 3, p): sum over time of every angle times ``weight`` (T, S, 3, p)."""
    return np.asarray((angles.T @ weight.reshape(len(weight), -1)).reshape(angles.shape[1], *weight.shape[1:]))


def _with_markers(on_place: Array, on_marker: Array, segment: list[int]) -> Array:
    """Return the weights (T, N, 3, p) on a drift of whole segments with their markers."""
    out = on_place.copy()
    np.add.at(np.swapaxes(out, 0, 1), segment, np.swapaxes(on_marker, 0, 1))
    return out


def _of_centres(body: Body, pose: Poses, weight: Array) -> Array:
    """Return (n, 3, p): a displaced centre carries what hangs on it, less what the neutral posture calibrates away."""
    rest, hangs = poses(body, body.neutral), below(body)
    out = np.zeros((len(body.joints), 3, weight.shape[3]))
    for joint in (chain[0] for chain in chains(body)):
        parent = body.joints[joint].parent
        turn, still = (at.root_rotation if parent < 0 else at.joint_rotation[:, parent] for at in (pose, rest))
        for s in np.flatnonzero(hangs[joint]):
            own = turn - pose.rotation[:, s] @ (rest.rotation[0, s].T @ still[0])
            out[joint] += np.einsum("tij,tip->jp", own, weight[:, s], optimize=True)
    return out


def _of_tilts(body: Body, pose: Poses, angles: Array, weights: tuple[Array, Array, Array]) -> Array:
    """Return (n, 3, p): a tilted hinge turns and displaces what hangs on it, by the angle times the tilt."""
    on_place, on_turn, on_marker = weights
    hangs, segment = below(body), list(body.markers.segment)
    com, marker = pose.points(list(range(len(body.segments))), body.sip.com), pose.points(segment, body.markers.position)
    out = np.zeros((len(body.joints), 3, on_place.shape[3]))
    for joint in (chain[0] for chain in chains(body) if len(chain) == 1):
        on, carried = np.flatnonzero(hangs[joint]), np.flatnonzero(hangs[joint][segment])
        origin = pose.joint_position[:, joint, None]
        total = on_turn[:, on].sum(axis=1) + (skew(com[:, on] - origin) @ on_place[:, on]).sum(axis=1)
        total += (skew(marker[:, carried] - origin) @ on_marker[:, carried]).sum(axis=1)
        turned = np.swapaxes(pose.joint_rotation[:, joint], -1, -2) @ total
        out[joint] = np.einsum("t,tjp->jp", angles[:, joint], turned)
    return out

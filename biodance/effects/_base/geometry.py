"""Causes in the body's geometry: what a moved joint or marker changes in the tracked posture, the wrench and the
markers' residuals.

Computed at 25 Hz or more (the low-pass leaves nothing above 10 Hz) and interpolated; one factorisation per frame serves
all causes.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.changes import carried_by, neutral_turn
from biodance.effects._base.moved_geometry import PostureSensitivity, centres_of, moved_matter, wrench_of
from biodance.lab.prepare import LowPass
from biodance.motion.kinematics import Poses, SegmentMotion, below, chains, jacobian
from biodance.records import Array, Index, Motion
from biodance.spatial import skew
from biodance.uncertainty.sources import joint_of

_RATE = 25.0
"""Hz, at least, of the frames in which the sensitivity is computed."""
_ENDS = 10
"""Frames at each end of the trial that are all computed."""
_TOGETHER = 8
"""Frames of such a mean worked on at once: little memory, however many markers there are."""
MEANS = 60
"""Frames, about, over which the mean marker residual is taken: it changes slowly."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """What a trial says about its body's geometry.

    ``time`` (F,) s of the chosen frames, ``wanted`` (T,) s of all; ``sensitivity`` of the posture; ``matter`` P, Q, S
    (F, 9, nv) per unit of every coordinate; ``direct`` (F, 9, N, 3) per metre of every segment; ``turns`` (F, N, 3,
    nv) rad of the segments per unit of every coordinate; ``seen`` (F, K) 1 where a marker was seen; ``phi`` (10N,)
    the parameters of the matter; ``smoothed`` the low-pass of the motion.
    """

    time: Array
    wanted: Array
    sensitivity: PostureSensitivity
    matter: Array
    direct: Array
    turns: Array
    seen: Array
    phi: Array
    smoothed: LowPass

    @cached_property
    def marker_changes(self) -> "Changes":
        """What one metre of every marker of the model does, three axes of its segment each: P = 3 K."""
        sensitivity = self.sensitivity
        count = len(sensitivity.segment)
        own, turn = range(count), sensitivity.pose.rotation[:, list(sensitivity.segment)]

        def moved(some: Index) -> Array:
            place = np.zeros((some.size, count, 3, count, 3))
            # (f, count, 3, count, 3): a marker moves by the column of its segment's axes, the others not at all.
            place[:, own, :, own] = np.moveaxis(turn[some], 1, 0)
            return place.reshape(some.size, count, 3, -1)

        posture = sensitivity.follow_markers()
        return Changes(self._wrench(self.matter @ posture), self._residual(posture, moved))

    @cached_property
    def joint_changes(self) -> "Changes":
        """What one metre does at every anatomical joint, P = 4 per joint: its centre along the three axes of the
        segment nearer to the root, all else kept in the neutral posture; and that segment longer towards the joint, all
        beyond it carried along.
        """
        sensitivity, slopes, direct, moved = self.sensitivity, [], [], []
        hanging = below(sensitivity.body)
        for chain in chains(sensitivity.body):
            centre, carried = _moves(sensitivity, chain)
            slopes.append(sensitivity.joint_slopes(chain, centre, carried))
            direct.append(self.direct[:, :, hanging[chain[-1]] > 0].sum(axis=2) @ carried)
            moved.append(carried)
        on = [sensitivity.distal[chain[-1]][:, None, None] for chain in chains(sensitivity.body)]
        posture = sensitivity.follow(np.concatenate(slopes, axis=2))
        # By the posture that follows, and directly: what hangs on the joint is carried along.
        wrench = self._wrench(self.matter @ posture + np.concatenate(direct, axis=2))
        pairs = list(zip(on, moved, strict=True))
        return Changes(
            wrench,
            self._residual(posture, lambda few: np.concatenate([k * one[few][:, None] for k, one in pairs], axis=3)),
        )

    @property
    def changes(self) -> "GeometryChanges":
        """Only what serves on: what was needed to find it is some ten times as large."""
        return GeometryChanges(self.marker_changes, self.joint_changes, self.phi)

    def _wrench(self, nine: Array) -> NDArray[np.float32]:
        return wrench_of(nine, self.time, self.wanted, smoothed=self.smoothed, gravity=self.sensitivity.body.gravity)

    def _residual(self, posture: Array, moved: Callable[[Index], Array]) -> Array:
        """Return the change (K, 3, P) m of the mean marker residual (measured less model, segment axes) when the
        model's markers move by ``moved`` of some frames, (f, K, 3, P) m, at fixed posture and the posture changes by
        ``posture`` (F, nv, P).
        """
        few = np.arange(0, len(self.time), max(1, len(self.time) // MEANS))
        # Weights of the time mean: frames are not evenly spaced at the ends.
        lasting = self.seen[few] * np.gradient(self.time)[few, None]
        share = lasting / np.maximum(lasting.sum(axis=0), 1e-12)
        parts = zip(*(np.array_split(one, max(1, few.size // _TOGETHER)) for one in (few, share)), strict=True)
        return np.sum([self._mean_change(some, lasts, posture, moved(some)) for some, lasts in parts], axis=0)

    def _mean_change(self, few: Index, share: Array, posture: Array, moved: Array) -> Array:
        """Return what frames ``few`` (f,) add to that mean, of which they are the ``share`` (f, K)."""
        sensitivity, segment = self.sensitivity, list(self.sensitivity.segment)
        frames, count = share.shape
        wide = (frames, count, 3, posture.shape[2])
        place = (sensitivity.tangent[few].reshape(frames, 3 * count, -1) @ posture[few]).reshape(wide) + moved
        turns = self.turns[few][:, segment].reshape(frames, 3 * count, -1)
        weight = np.where(sensitivity.weight > 0, sensitivity.weight, 1.0)[few]
        # `apart` carries the weight; the turning of the segment turns the residual's distance in metres.
        apart = skew(sensitivity.apart[few] / weight[..., None])
        # Measured less model in segment axes: the segment's turn r changes it by -r x d, the moved model by -p.
        change = -(apart @ (turns @ posture[few]).reshape(wide)) - place
        back = np.swapaxes(sensitivity.pose.rotation[few][:, segment], 2, 3) * share[..., None, None]
        return np.asarray((back @ change).sum(axis=0))


@dataclass(frozen=True, eq=False)
class Changes:
    """Per metre of P changes in the body's geometry: of the wrench (T, 6, P) about the lab origin that the tracked
    motion needs, and of the mean marker residual (K, 3, P), measured less model in segment axes.
    """

    wrench: NDArray[np.float32]
    residual: Array


@dataclass(frozen=True, eq=False)
class GeometryChanges:
    """What a metre of every marker (P = 3 K) and of every joint (P = 4 per joint) changes in a trial, as in
    `Geometry`; ``phi`` (10N,) the parameters of the matter that moves.
    """

    marker_changes: Changes
    joint_changes: Changes
    phi: Array


def _moves(sensitivity: PostureSensitivity, chain: tuple[int, ...]) -> tuple[Array, Array]:
    """Return how a joint's origin and what is distal to it move (F, 3, 4) in the four changes of ``joint_changes``."""
    joint, pose = sensitivity.body.joints[chain[0]], sensitivity.pose
    parent = pose.root_rotation if joint.parent < 0 else pose.joint_rotation[:, joint.parent]
    # parent - child C: what is distal keeps its place in the neutral posture.
    kept = pose.rotation[:, carried_by(sensitivity.body, chain[0])] @ neutral_turn(sensitivity.body, chain[0])
    out = parent @ (joint.translation / max(float(np.linalg.norm(joint.translation)), 1e-9))[:, None]
    return np.concatenate([parent, out], axis=2), np.concatenate([parent - kept, out], axis=2)


def geometry(
    body: Body,
    motion: Motion,
    phi: Array,
    *,
    poses: Poses,
    segments: SegmentMotion,
    columns: tuple[int, ...],
    measured: Array,
    smoothed: LowPass,
) -> Geometry:
    """Return the geometry of a tracked trial.

    ``poses`` and ``segments`` of the ``motion``; ``columns`` (K) which markers of the body were ``measured`` (T, K, 3)
    m; ``smoothed`` the motion's low-pass.
    """
    every = _frames(motion.time.size, motion.rate)
    pose = Poses(*(getattr(poses, one.name)[every] for one in fields(poses)))
    moving = SegmentMotion(*(getattr(segments, one.name)[every] for one in fields(segments)))
    segment = tuple(body.markers.segment[c] for c in columns)
    markers = pose.points(list(segment), body.markers.position[list(columns)])
    measured = measured[every]
    seen = np.asarray(np.isfinite(measured).all(axis=2), dtype=float)
    weight = seen * body.markers.weight[list(columns)]
    # Weighted residual of the tracking, zero where a marker is hidden.
    apart = weight[..., None] * np.where(seen[..., None] > 0, markers - measured, 0.0)
    sensitivity = PostureSensitivity(
        body, pose, motion.q[every, body.nq - len(body.joints) :], segment, markers, apart, weight
    )
    phi, links = body.link_parameters(phi), list(range(len(body.links)))
    com = pose.points(links, centres_of(phi))
    place, turn = jacobian(body, pose, links, com)
    shape = (len(com), len(links), 3, body.nv)
    speed = (place @ _tangent_speed(body, motion, pose, every)[..., None]).reshape(shape[:3])
    # P, Q, S per metre and per radian of every segment.
    by_place, by_turn = moved_matter(moving, phi, speed)
    flat = (len(place), 9, -1)
    return Geometry(
        motion.time[every],
        motion.time,
        sensitivity,
        # dP, dQ, dS through displacements and turns: two matrix products over the segments.
        by_place.reshape(flat) @ place + by_turn.reshape(flat) @ turn,
        by_place,
        turn.reshape(shape),
        seen,
        phi,
        smoothed,
    )


def _frames(count: int, rate: float) -> Index:
    """Return the frames at RATE or more, and all of them at both ends, where a coarse spline would err."""
    chosen = np.arange(count) % max(1, int(rate / _RATE + 1e-6)) == 0
    chosen[:_ENDS] = chosen[-_ENDS:] = True
    return np.flatnonzero(chosen)


def _tangent_speed(body: Body, motion: Motion, pose: Poses, every: Index) -> Array:
    """Return the velocity (F, nv) in the lab-frame tangent."""
    v = np.array(motion.v[every])
    for k in range(0, body.n_root, 3):
        # Root velocities of Pinocchio are in the root's axes: into the lab.
        v[:, k : k + 3] = (pose.root_rotation @ v[:, k : k + 3, None])[..., 0]
    return v


def joint_chains(body: Body) -> dict[str, tuple[int, ...]]:
    """Return the anatomical joints by name, each with its axes from the parent outwards."""
    return {joint_of(body, chain): chain for chain in chains(body)}

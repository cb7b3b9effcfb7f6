"""Multi-body optimisation: the posture of every frame whose markers come nearest to the measured ones, joint limits
respected.

Each frame minimises its weighted squared marker distances by itself (Lu & O'Connor 1999, DOI
10.1016/S0021-9290(98)00158-4); the other frames only serve the first guess, and stand in where a frame's own markers
leave the posture open.
"""

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.errors import BiodanceError, TrialRefused
from biodance.motion.ik.marker_problem import MarkerProblem, Minimum, marker_distances, marker_problem, minimise_markers
from biodance.motion.ik.search import from_guess, interpolate_postures, search
from biodance.motion.kinematics import poses
from biodance.records import Array, Index, Markers

_LEVER = 0.1
"""m, what one radian is compared with: one metre of root translation counts as 10 rad."""

LEAST_MOTION = 0.02
"""Least share of its lever by which any unit change of posture must move the markers that it carries, for the
posture to be determined.
"""


@dataclass(frozen=True, eq=False)
class Determination:
    """Per frame: ``determined`` (T,); ``open_coordinates`` names what the best-seen frame leaves open (empty if it
    is determined).
    """

    determined: NDArray[np.bool_]
    open_coordinates: tuple[str, ...]


def determination(body: Body, columns: list[int], seen: NDArray[np.bool_]) -> Determination:
    """Tell for every frame whether the markers seen fix every coordinate of ``body``.

    ``columns`` (K) indices of the markers in ``body.markers``; ``seen`` (T, K). Judged by the marker Jacobian at one
    general posture, so that the answer depends on the markers and not on the pose: with the weighted Jacobian's columns
    in units of moved weight and ``LEVER``, its smallest singular value must reach ``LEAST_MOTION``.
    """
    jacobian = _jacobian(body, columns)
    useful = seen & (body.markers.weight[columns] > 0)
    first = np.concatenate([[True], (useful[1:] != useful[:-1]).any(axis=1)])[: len(useful)]
    patterns, which = np.unique(useful[first], axis=0, return_inverse=True)
    which = which.ravel()[np.cumsum(first) - 1]
    weight = body.markers.weight[columns] * patterns
    value = np.concatenate(
        [np.linalg.eigvalsh(_normal(jacobian, weight[i : i + 256]))[:, 0] for i in range(0, len(weight), 256)]
    )
    best = patterns.sum(axis=1).argmax()
    names = ("root x", "root y", "root z", "root rotation x", "root rotation y", "root rotation z")[: body.n_root]
    names += tuple(joint.name for joint in body.joints)
    vague = _open(_normal(jacobian, weight[best : best + 1])[0])
    return Determination(
        value[which] >= LEAST_MOTION**2, tuple(name for name, is_open in zip(names, vague, strict=True) if is_open)
    )


def _normal(jacobian: Array, weight: Array) -> Array:
    """Return (P, nv, nv) scaled normal matrices of P patterns of marker weights (P, K)."""
    moves = np.abs(jacobian).max(axis=1) > 0
    moved = weight @ moves
    scale = 1 / np.sqrt(np.where(moved > 0, moved, 1.0))
    pairs = np.einsum("kim,kin->kmn", jacobian, jacobian)
    return np.einsum("pk,kmn->pmn", weight, pairs, optimize=True) * scale[:, :, None] * scale[:, None]


def _open(normal: Array) -> NDArray[np.bool_]:
    """Return (nv,) the coordinates that take part in a change of posture that the markers hardly see."""
    value, vector = np.linalg.eigh(normal)
    return (np.abs(vector[:, value < LEAST_MOTION**2]) > 0.2).any(axis=1)


def _jacobian(body: Body, columns: list[int]) -> Array:
    """Return (K, 3, nv) at a general posture: marker motion per m, and per rad divided by LEVER."""
    angles = np.clip(0.4 + 0.2 * np.cos(1.7 * np.arange(len(body.joints))), body.limits.lower, body.limits.upper)
    pose = poses(body, np.concatenate([body.neutral[: body.nq - len(angles)], angles]))
    segment = [body.markers.segment[c] for c in columns]
    points = pose.points(segment, body.markers.position[columns])[0]
    out = np.zeros((len(columns), 3, body.nv))
    if body.n_root:
        out[:, :, :3] = np.eye(3)
        out[:, :, 3:6] = np.cross(np.eye(3), points[:, None]).transpose(0, 2, 1) / _LEVER
    carried = _carried(body)
    for i, joint in enumerate(body.joints):
        axis = pose.joint_rotation[0, i] @ joint.axis
        moved = carried[i, segment][:, None]
        out[:, :, body.n_root + i] = moved * np.cross(axis, points - pose.joint_position[0, i]) / _LEVER
    return out


def _carried(body: Body) -> NDArray[np.bool_]:
    """Return (n, N) True where a segment moves with a joint."""
    out = np.zeros((len(body.joints), len(body.segments)), dtype=bool)
    for segment, joint in enumerate(body.segment_joint):
        while joint >= 0:
            out[joint, segment] = True
            joint = body.joints[joint].parent
    return out


LEAN = 1e-3
"""Weight, per unit marker weight, of the interpolated posture in a frame whose own markers do not determine it."""


class FrameStatus(IntEnum):
    """How the posture of a frame was found."""

    SOLVED = 0
    """At the minimum, from the frame's own markers."""
    LEANING = 1
    """The frame's markers do not determine the posture: what they leave open comes from the frames before and after."""
    STOPPED = 2
    """Not at a minimum after all steps: markers and body do not fit together; look at the residuals."""


@dataclass(frozen=True, eq=False)
class InverseKinematics:
    """Postures of T frames: ``q`` (T, nq); ``residual`` (T, K) m distance of marker and model, NaN = not seen;
    ``status`` (T,) ``FrameStatus``; ``slope`` (T,) m, mean marker displacement that some coordinate could still gain;
    ``steps`` (T,) Newton steps.
    """

    q: Array
    residual: Array
    status: NDArray[np.int8]
    slope: Array
    steps: NDArray[np.intp]
    marker_names: tuple[str, ...]


def solve_ik(body: Body, markers: Markers, *, guess: Array | None = None, tolerance: float = 1e-7) -> InverseKinematics:
    """Return the posture of ``body`` in every frame of ``markers``, matched by name; a hidden marker (NaN) has no
    weight in its frame.

    ``guess`` (T, nq) replaces the search for a start (a root that is far off is put right first); ``tolerance`` (m) is
    the largest ``slope`` of a solved frame.

    Raises
    ------
    TrialRefused
        No frame shows enough markers to determine the posture; the message names the open coordinates and the missing
        markers.
    """
    names = tuple(name for name in body.markers.names if name in markers)
    columns = [body.markers.names.index(name) for name in names]
    chosen = markers.select(names)
    verdict = determination(body, columns, chosen.seen)
    if not verdict.determined.any():
        raise TrialRefused(_too_few(body, chosen, verdict.open_coordinates))
    problem = marker_problem(body, columns, chosen.xyz, tolerance=tolerance)
    own, open_frames = np.flatnonzero(verdict.determined), np.flatnonzero(~verdict.determined)
    found = search(problem, own) if guess is None else from_guess(problem, own, _checked(guess, body, chosen)[own])
    leaning = _lean(problem, own, found, open_frames)
    order = np.argsort(np.concatenate([own, open_frames]), kind="stable")
    q, slope, steps = (
        np.concatenate([a, b])[order]
        for a, b in ((found.q, leaning.q), (found.slope, leaning.slope), (found.steps, leaning.steps))
    )
    status = np.where(verdict.determined, FrameStatus.SOLVED, FrameStatus.LEANING).astype(np.int8)
    status[slope > tolerance] = FrameStatus.STOPPED
    residual = np.where(chosen.seen, marker_distances(problem, q), np.nan)
    return InverseKinematics(q, residual, status, slope, steps, names)


def _lean(problem: MarkerProblem, own: Index, found: Minimum, frames: Index) -> Minimum:
    """Solve ``frames`` with their markers and, at the weight ``LEAN``, all markers of the posture interpolated from
    the ``own`` frames.
    """
    start = interpolate_postures(problem, own, found.q, frames)
    if not frames.size:
        return Minimum(start, np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.intp))
    hidden = problem.weight[frames] == 0
    stand_in = poses(problem.body, start).points(problem.segment, problem.chain.local)
    xyz, weight = problem.xyz.copy(), problem.weight.copy()
    xyz[frames] = np.where(hidden[:, :, None], stand_in, xyz[frames])
    weight[frames] = np.where(hidden, LEAN, weight[frames])
    return minimise_markers(replace(problem, xyz=xyz, weight=weight), frames, start)


def _checked(guess: Array, body: Body, markers: Markers) -> Array:
    guess = np.asarray(guess, dtype=float)
    if guess.shape != (markers.time.size, body.nq) or not np.isfinite(guess).all():
        raise BiodanceError(
            f"The guess has shape {guess.shape}; expected ({markers.time.size}, {body.nq}), all finite. Leave it out."
        )
    return guess


def _too_few(body: Body, markers: Markers, open_coordinates: tuple[str, ...]) -> str:
    best = markers.seen.sum(axis=1).max(initial=0)
    never = [
        name
        for name in body.markers.names
        if name not in markers or not markers.seen[:, markers.names.index(name)].any()
    ]
    return (
        f"No frame shows enough markers for the posture of {body.name}: at best {best} of its "
        f"{len(body.markers.names)} markers are seen, "
        f"which leaves open: {', '.join(open_coordinates)}. Never seen: {', '.join(never) or 'none'}. "
        "Label them, or use a body without those joints."
    )

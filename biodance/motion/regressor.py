"""The root regressor: the ground wrench that a motion needs, linear in the standard inertial parameters (paper eq. 3,
upper part); and how such a wrench agrees with a measured one, channel by channel.

For every segment with origin p, rotation R, angular velocity w and acceleration dw (lab frame) and origin acceleration
a, with g the gravity vector, first moment h = R mc and inertia J = R I R' about the segment origin:

    f = m (a - g) + dw x h + w x (w x h)
    n = h x (a - g) + J dw + w x J w        (about the segment origin)

and the wrench about the lab origin is [f; n + p x f]. Both are linear in [m, mc, I]: the columns of W.
"""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.errors import BiodanceError, TrialRefused
from biodance.motion.ik.compiled.tree import fill_regressor, fill_wrench
from biodance.motion.kinematics import SegmentMotion, in_blocks, segment_motion
from biodance.records import CHANNELS, Array, Motion, Wrench

_NEEDED: WeakKeyDictionary[Motion, WeakKeyDictionary[Body, Wrench]] = WeakKeyDictionary()
"""What motions need with a body's own parameters, kept as long as both live: many stages of a session ask for it."""


def regressor_of(segments: SegmentMotion, *, gravity: Array, sharing: Array | None = None) -> Array:
    """Return W (T, 6, 10N): wrench about the lab origin, force first, per unit of each parameter; ``gravity`` (3,)
    m/s², lab frame; ``sharing`` (10 M, 10 N) what each of the M links that move has of the N segments
    (``Body.sharing``; None: they are the segments).
    """
    frames, count = segments.position.shape[:2]
    W = np.zeros((frames, 6, 10 * count))
    omega, alpha, drive = segments.angular_velocity, segments.angular_acceleration, segments.acceleration - gravity
    fill_regressor(segments.rotation, segments.position, omega, alpha, drive, W)
    return W if sharing is None else W @ sharing


def regressor(body: Body, motion: Motion) -> Array:
    """Return W (T, 6, 10N) of ``body`` during ``motion``: ``W[t] @ sip.phi`` is the ground wrench about the lab origin
    (N, N·m).

    Parameters of segment i are columns 10i..10i+9 in Pinocchio's order [m, mc (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz] about
    the segment's joint frame. Gravity is the body's.
    """
    return regressor_of(segment_motion(body, motion), gravity=body.gravity, sharing=body.sharing)


def predict_wrench(body: Body, motion: Motion, phi: Array | None = None) -> Wrench:
    """Return the wrench that a motion needs from the ground.

    Parameters
    ----------
    body : Body
        Who moves, and under which gravity.
    motion : Motion
        At T instants.
    phi : numpy.ndarray, optional
        (10N,) inertial parameters, see `Sip`; by default the body's.

    Returns
    -------
    Wrench
        (T, 6) N, N·m ON the subject about the lab origin, force first.

    References
    ----------
    Ground wrench of a tree of rigid bodies, linear in the inertial parameters; docs/derivations.md.

    Examples
    --------
    >>> needed = biodance.predict_wrench(result.body, result["squat_1"].motion)
    >>> round(float(needed.force[:, 2].mean()), -1)
    610.0
    """
    if phi is not None:
        return _predicted(body, motion, phi)
    kept = _NEEDED.setdefault(motion, WeakKeyDictionary())
    if body not in kept:
        kept[body] = _predicted(body, motion, body.sip.phi)
    return kept[body]


def _predicted(body: Body, motion: Motion, phi: Array) -> Wrench:
    value = np.empty((motion.time.size, 6))
    for part, frames in in_blocks(motion):
        value[part] = wrench_of_segments(body, segment_motion(body, frames), phi)
    return Wrench(motion.time, value)


def wrench_of_segments(body: Body, move: SegmentMotion, phi: Array) -> Array:
    """Return the wrench (T, 6) about the lab origin that segments which ``move`` need with the parameters ``phi``
    (10N,): the regressor times phi, without the regressor; what has no parameters costs nothing.
    """
    links = np.array(phi if body.sharing is None else body.sharing @ phi, dtype=float).reshape(-1, 10)
    heavy = np.flatnonzero(links.any(axis=1))
    turn, place, omega, alpha, drive = (
        part if heavy.size == len(links) else part.take(heavy, axis=1)
        for part in (move.rotation, move.position, move.angular_velocity, move.angular_acceleration, move.acceleration)
    )
    value = np.zeros((len(move.position), 6))
    fill_wrench(turn, place, omega, alpha, drive - body.gravity, links[heavy], value)
    return value


LEAST_FRAMES = 3
"""A correlation of fewer frames says nothing."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """How two wrenches agree over ``frames`` frames.

    ``rms`` (6,) N, N·m, root mean square of the difference per channel Fx Fy Fz Mx My Mz; ``correlation`` (6)
    Pearson's, None where it is not defined; ``notes`` say why not.
    """

    frames: int
    rms: Array
    correlation: tuple[float | None, ...]
    notes: tuple[str, ...] = ()


def compare(measured: Wrench, simulated: Wrench, mask: NDArray[np.bool_] | None = None) -> Agreement:
    """Compare two wrenches of the same times over the frames where ``mask`` (T,) is True (all frames without it).

    Frames in which either wrench is not known (NaN) are left out, and said.

    Raises
    ------
    BiodanceError
        The two wrenches do not have the same times, or the mask has another length.
    TrialRefused
        No frame is left to compare.
    """
    if measured.time.shape != simulated.time.shape or not np.allclose(measured.time, simulated.time, rtol=0, atol=1e-6):
        raise BiodanceError(
            f"The wrenches have different times ({measured.time.size} and {simulated.time.size} frames). Prepare the "
            f"trial first."
        )
    chosen = np.ones(measured.time.size, dtype=bool) if mask is None else np.asarray(mask, dtype=bool)
    if chosen.shape != measured.time.shape:
        raise BiodanceError(f"The mask has {chosen.size} frames, the wrenches have {measured.time.size}.")
    known = np.isfinite(measured.value).all(axis=1) & np.isfinite(simulated.value).all(axis=1)
    used = chosen & known
    if not used.any():
        raise TrialRefused(
            f"No frame is left to compare: {chosen.sum()} of {chosen.size} may be used, and none of them is known in "
            f"both."
        )
    first, second = measured.value[used], simulated.value[used]
    rms = np.sqrt(np.mean((first - second) ** 2, axis=0))
    correlation = tuple(_pearson(a, b) for a, b in zip(first.T, second.T, strict=True))
    notes = [f"{int((chosen & ~known).sum())} frames left out: not known in both."] if np.any(chosen & ~known) else []
    flat = [name for name, value in zip(CHANNELS, correlation, strict=True) if value is None]
    if flat:
        why = f"only {used.sum()} frames" if used.sum() < LEAST_FRAMES else "constant"
        notes.append(f"No correlation of {', '.join(flat)}: {why}.")
    return Agreement(int(used.sum()), rms, correlation, tuple(notes))


def _pearson(first: Array, second: Array) -> float | None:
    """Return Pearson's correlation of two signals (T,); None if one does not vary or there are too few samples."""
    if first.size < LEAST_FRAMES:
        return None
    a, b = first - first.mean(), second - second.mean()
    flat = [np.linalg.norm(centred) <= 1e-9 * np.linalg.norm(signal) for centred, signal in ((a, first), (b, second))]
    return None if any(flat) else float(np.clip(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)), -1.0, 1.0))

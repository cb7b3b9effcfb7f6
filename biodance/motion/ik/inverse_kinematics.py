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
from biodance.motion.ik.compiled.ball_step import continue_angles
from biodance.motion.ik.determination import determination
from biodance.motion.ik.marker_problem import MarkerProblem, Minimum, marker_distances, marker_problem, minimise_markers
from biodance.motion.ik.search import from_guess, interpolate_postures, search
from biodance.motion.kinematics import poses
from biodance.records import Array, Index, Markers

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
    continue_angles(problem.chain, q)
    status = np.where(verdict.determined, FrameStatus.SOLVED, FrameStatus.LEANING).astype(np.int8)
    status[slope > tolerance] = FrameStatus.STOPPED
    residual = np.where(chosen.seen, marker_distances(problem, q), np.nan)
    residual.setflags(write=False)  # the records keep it without a copy
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

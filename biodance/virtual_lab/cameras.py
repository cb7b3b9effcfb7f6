"""What the cameras record of a performance: marker trajectories with soft tissue, noise, gaps, in the laboratory's own axes."""

import numpy as np

from biodance.motion.kinematics import poses
from biodance.records import Array, Markers
from biodance.virtual_lab.performance import Performance
from biodance.virtual_lab.randomness import smooth_noise
from biodance.virtual_lab.soft_tissue import SoftTissue, displaced
from biodance.virtual_lab.tolerances import Tolerances

LONGEST_GAP, SHORTEST_GAP = 0.30, 0.05
"""s."""


def true_markers(performance: Performance, tissue: SoftTissue, time: Array, rng: np.random.Generator) -> Array:
    """Return the true marker positions (T, K, 3) m at ``time`` (T,) s: fixed to the bone, plus what the skin adds; true vertical."""
    from scipy.interpolate import make_interp_spline

    person = performance.person
    motion = performance.motion(time)
    pose = poses(person.body, motion.q)
    markers = person.body.markers
    bone = pose.points(markers.segment, np.array(markers.position))
    acceleration = make_interp_spline(time, bone, k=5).derivative(2)(time)
    return bone + displaced(tissue, person, pose, motion.q[:, 7:], acceleration, time, rng)


def film(
    performance: Performance, tissue: SoftTissue, time: Array, tilt: Array, tolerances: Tolerances, rng: np.random.Generator
) -> Markers:
    """Return what the cameras deliver at ``time`` (T,) s, lab frame; ``tilt`` (3, 3) turns true-vertical axes into the laboratory's.

    Gaps come in every trial except the static one, which every laboratory repeats until it is complete.
    """
    xyz = true_markers(performance, tissue, time, rng) @ tilt.T
    wander = smooth_noise(rng, time, columns=3 * xyz.shape[1], cutoff=0.6).reshape(xyz.shape)
    xyz = xyz + tolerances.camera_wander * wander + tolerances.camera_noise * rng.normal(size=xyz.shape)
    if performance.plan.role != "static":
        step = time[1] - time[0]
        for _ in range(rng.poisson(tolerances.gaps_per_minute * (time[-1] - time[0]) / 60.0)):
            first, marker = int(rng.integers(0, time.size)), int(rng.integers(0, xyz.shape[1]))
            xyz[first : first + int(rng.uniform(SHORTEST_GAP, LONGEST_GAP) / step), marker] = np.nan
    return Markers(performance.person.body.markers.names, time, xyz)

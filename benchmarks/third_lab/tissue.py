"""Soft tissue: masses that wobble and sag on the bones, skin that follows joint angles and rings after a jerk."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.signal import bilinear, lfilter

from benchmarks.third_lab.faults import Array
from benchmarks.third_lab.people import Person
from benchmarks.third_lab.skeleton import COLUMNS, GRAVITY, PARENTS, SIDES, pose_segments

SHARES = {"thigh": 0.22, "shank": 0.16, "lumbar": 0.18, "waist": 0.15, "upper_arm": 0.12}  # of the segment's mass
SKIN_MM = {"pelvis": 5, "lumbar": 6, "waist": 6, "thorax": 4, "neck": 2, "head": 1, "clavicle": 7, "upper_arm": 6,
           "forearm": 3, "hand": 2, "thigh": 11, "shank": 5, "foot": 1.5, "toes": 1.5}  # fmt: skip


@dataclass(frozen=True)
class Tissue:
    """Soft tissue of one person: frequency (Hz), damping ratio of each wobbling mass, and a factor for the skin."""

    frequency: dict[str, float]
    damping: dict[str, float]
    skin: float


def kind_of(name: str) -> str:
    """Name of a segment without its side."""
    return name.split("_", 1)[1] if name.split("_")[0] in SIDES else name


def draw_tissue(rng: np.random.Generator) -> Tissue:
    """Draw tissue: 5 to 9 Hz, 15 to 40 % of critical damping (thigh and shank: Günther et al. 2003; Gruber 1998)."""
    soft = [name for name in PARENTS if kind_of(name) in SHARES]
    return Tissue({name: rng.uniform(5, 9) for name in soft}, {name: rng.uniform(0.15, 0.4) for name in soft},
                  float(np.exp(rng.normal(0, 0.3))))  # fmt: skip


def swing(acceleration: Array, rate: float, frequency: float, damping: float) -> Array:
    """Displacement of a mass on spring and damper whose foot is accelerated.

    Parameters
    ----------
    acceleration : array, shape (n, k)
        Of the foot less gravity's change, m/s².
    rate : float
        Samples a second.
    frequency : float
        Hz.
    damping : float
        Share of critical damping.

    Returns
    -------
    displacement : array, shape (n, k)
        Relative to the foot, m; at rest in the first sample.
    """
    natural = 2 * np.pi * frequency
    b, a = bilinear([-1.0], [1.0, 2 * damping * natural, natural**2], rate)
    first = acceleration[:1]
    return lfilter(b, a, acceleration - first, axis=0) - first / natural**2


def shake(person: Person, tissue: Tissue, path: BSpline, times: Array) -> tuple[Array, Array]:
    """Force and moment that wobbling and sagging add to what the ground must give.

    A share of the segment's mass sits at the segment's centre of mass when the person stands; gravity that turns in the
    segment's frame and the segment's acceleration displace it.

    Returns
    -------
    forces, moments : array, shape (n, 3)
        N, and N·m about the origin of the world.
    """
    rate = 1 / (times[1] - times[0])
    rotations, places = pose_segments(person, path(times))
    forces, moments = np.zeros((2, len(times), 3))
    for name, frequency in tissue.frequency.items():
        mass = SHARES[kind_of(name)] * person.masses[name]
        foot = places[name] + rotations[name] @ person.coms[name]
        acceleration = differentiate(differentiate(foot, rate), rate)
        sag = (
            rotations[name] @ GRAVITY - GRAVITY
        )  # gravity that the tissue carried while standing, turned with the bone
        moved = swing(acceleration + sag, rate, frequency, tissue.damping[name])
        more = mass * differentiate(differentiate(moved, rate), rate)
        forces += more
        moments += np.cross(foot + moved, more) + np.cross(moved, mass * (acceleration - GRAVITY))
    return forces, moments


def differentiate(values: Array, rate: float) -> Array:
    """Central differences along time, per second."""
    return np.gradient(values, 1 / rate, axis=0, edge_order=2)


def slide_skin(
    seed: int, person: Person, tissue: Tissue, path: BSpline, times: Array, where: dict[str, tuple[str, Array]]
) -> dict[str, Array]:
    """Displacement of each marker in its segment's frame.

    Skin follows the angles of the joints at both ends of the segment (a fixed matrix for each marker, part of it common
    to the segment: Bonci et al. 2014) and rings at 8 to 14 Hz after accelerations.

    Parameters
    ----------
    seed : int
        The same for all trials of a session: the skin is.
    where : dict of str to (str, array)
        Segment and place of each marker.

    Returns
    -------
    displacements : dict of str to array, shape (n, 3)
        m.
    """
    rng, rate = np.random.default_rng(seed), 1 / (times[1] - times[0])
    q = path(times)
    rotations, places = pose_segments(person, q)
    common: dict[str, Array] = {}
    slid = {}
    for marker, (segment, _) in where.items():
        size = 1e-3 * tissue.skin * SKIN_MM[kind_of(segment)]
        ends = [name for name in (segment, *(s for s, p in PARENTS.items() if p == segment)) if name != "pelvis"][:3]
        angles = np.hstack([np.sin(q[:, COLUMNS[name]]) for name in ends])
        angles = np.hstack([angles, 1 - np.cos(q[:, COLUMNS[segment].start :][:, :1])])
        if segment not in common:
            common[segment] = rng.normal(0, 0.6, (angles.shape[1], 3))
        matrix = common[segment] + rng.normal(0, 0.6, common[segment].shape)
        acceleration = differentiate(differentiate(places[segment], rate), rate)
        local = np.einsum("nji,nj->ni", rotations[segment], acceleration)
        ring = swing(local, rate, rng.uniform(8, 14), 0.2) * rng.uniform(0.2, 1.0) * min(1.0, size / 0.005)
        slid[marker] = size * angles @ matrix + ring
    return slid

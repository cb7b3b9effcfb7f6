"""The table's standard deviations, widened by what the table cannot know: how the model's frames sit in this person.

The table's numbers hold in ideal anatomical frames. Markers turn the frames by degrees (the long axis of an arm by
tens of degrees), and a CoM that is off by d adds m d² to the inertia about the joint, which a first-order covariance
leaves out.
"""

import functools
from collections.abc import Callable

import numpy as np
from scipy.linalg import block_diag

from biodance.body.parts import TENSOR, JointError, inertia_tensor
from biodance.body.tables.anthropometry import read_segment_table
from biodance.body.tables.choice import BASE, PARTS
from biodance.body.tables.error_sizes import error_size, joint_size
from biodance.lab.markers.sets import part_of
from biodance.records import Array, Sip
from biodance.spatial import skew

JOINT = {
    "thigh": "hip",
    "shank": "knee",
    "foot": "ankle",
    "trunk_head": "trunk",
    "upper_arm": "shoulder",
    "forearm_hand": "elbow",
}
"""The joint at the origin of each segment's frame."""


def widened_prior(prior: Sip, calibrated: tuple[JointError, ...] = ()) -> Sip:
    """Return ``prior``, known about the true joint centres, with the same values and a covariance that holds for frames
    that are turned and centres that are displaced: as far as the functional calibration that ``calibrated`` the joints
    leaves them, or as joints usually are.
    """
    # The body's own spread, that of masses, and joint centres; per segment then first and second order of its frame.
    covariance = np.array(prior.covariance) + _mass_spread(prior) + misplaced(prior, calibrated)
    for i, segment in enumerate(prior.segments):
        cut = slice(10 * i, 10 * i + 10)
        phi, own = prior.phi[cut], covariance[cut, cut].copy()
        if phi[0] <= 0:
            continue
        # First order: (10, 3) slope times the standard deviation of each axis, S S' its covariance.
        slope = _turn_slope(phi) * frame_turn(segment)
        covariance[cut, cut] = own + slope @ slope.T + _displacement(phi, own)
    return Sip(prior.segments, prior.phi, covariance)


def frame_turn(segment: str) -> Array:
    """Return (3,) rad: standard deviation of the turn of a segment's frame about its axes."""
    turn = np.full(3, error_size("frame_turn", "any"))
    if segment.endswith(("upper_arm", "forearm_hand")):
        turn[1] = error_size("frame_turn", "arm axis")
    return turn


def misplaced(sip: Sip, calibrated: tuple[JointError, ...]) -> Array:
    """Return the covariance (p, p) of the parameters of ``sip`` in the model's frames that comes from joint centres
    off their true places, each on its own.
    """
    names = {error.joint for error in calibrated}
    return _by_segment(sip, lambda name, phi: _centre_size(name, names) * shift_slope(phi))


def _by_segment(sip: Sip, slope: Callable[[str, Array], Array]) -> Array:
    """Return the covariance (p, p) of errors ``slope`` (10, n) of unit deviation, each segment's its own."""
    each = (slope(name, phi) for name, phi in zip(sip.segments, sip.phi.reshape(-1, 10), strict=True))
    return np.asarray(block_diag(*(one @ one.T for one in each)))


def _centre_size(segment: str, calibrated: set[str]) -> float:
    """Return the standard deviation per axis, m, of the centre at the origin of a segment's frame."""
    joint = _joint_of(segment)
    if not calibrated:
        return error_size("joint_centre", "other", state="before")
    if joint in calibrated:
        return error_size("joint_centre", joint.partition("_")[2] or joint, state="after")
    return joint_size("joint_centre", joint or segment)


def from_true_centres(sip: Sip, table: Sip, calibrated: tuple[JointError, ...]) -> Sip:
    """Return ``sip``, believed in the model's frames after the prior ``table`` (`widened_prior` for joints that were
    ``calibrated``), with a covariance about the true joint centres.

    With the prior covariance P in the model's frames, D of it from misplaced centres and B of the posterior, the error
    about the true centres has the covariance B + D - K B - B K', K = D P^-1: where the data told nothing P - D, what
    the table is off; where they told all D, what the joints are off. Where the placing itself leaves a centre farther
    off than D counts (a trunk that bends along its length), that enters as far as the data told: T E T', T = 1 - B
    P^-1. Centres that no movement placed come on top.
    """
    if not calibrated:
        return about_true_centres(sip)
    # In units of the standard deviations: kg and kg·m² differ by orders, and rcond would cut the small ones.
    off, scale = misplaced(table, calibrated), np.sqrt(np.diag(table.covariance))
    # A parameter that is held fixed (no variance) stays out of the inverse.
    unit = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)
    inverse = np.linalg.pinv(table.covariance * np.outer(unit, unit), rcond=1e-12, hermitian=True)
    # P^-1 B, of which K B = D P^-1 B is `shared`; 1 - P^-1 B = T' is `told`.
    kept = unit[:, None] * inverse * unit @ sip.covariance
    shared, told = off @ kept, np.eye(len(off)) - kept
    left = {error.joint: error.centre for error in calibrated}

    def beyond(name: str, phi: Array) -> Array:
        # Independent errors: only the variance beyond what `misplaced` counts already.
        more = left.get(_joint_of(name), 0.0) ** 2 - _centre_size(name, set(left)) ** 2
        return np.sqrt(max(more, 0.0)) * shift_slope(phi)

    farther = told.T @ _by_segment(sip, beyond) @ told
    return Sip(sip.segments, sip.phi, sip.covariance + off - shared - shared.T + farther)


def about_true_centres(sip: Sip, calibrated: tuple[JointError, ...] = ()) -> Sip:
    """Return ``sip`` with a covariance that also holds about the true joint centres, which no wrench can find, where
    these are no part of what was believed before.

    The data tell where matter is relative to the model's frames; where the person's own joint centre is stays as
    uncertain as the formula that predicted it, or as the movement that ``calibrated`` it left it.
    """
    known = {error.joint: error.centre for error in calibrated}

    def centre(name: str, phi: Array) -> Array:
        joint = _joint_of(name)
        return known.get(joint, joint_size("joint_centre", joint or name)) * shift_slope(phi)

    return Sip(sip.segments, sip.phi, sip.covariance + _by_segment(sip, centre))


def in_other_frames(sip: Sip, calibrated: tuple[JointError, ...] = ()) -> Sip:
    """Return ``sip``, known about the true joint centres of a person, as it is known in the frames of another session:
    markers glued anew turn them, and its own joint centres are displaced again, as far as the movement that
    ``calibrated`` them left it.
    """
    known = about_true_centres(sip, calibrated)
    turned = _by_segment(sip, lambda name, phi: _turn_slope(phi) * frame_turn(name))
    return Sip(sip.segments, sip.phi, known.covariance + turned)


def _joint_of(segment: str) -> str:
    """Return the anatomical joint at the origin of a segment of the human, "" for other segments."""
    return next((segment.removesuffix(kind) + joint for kind, joint in JOINT.items() if segment.endswith(kind)), "")


def shift_slope(phi: Array) -> Array:
    """Return d phi / d d (10, 3) for a shift of the matter of ``phi`` (10,) by d (3,) m: how mass, first moments and
    inertia about the origin change.
    """
    out = np.zeros((10, 3))
    # dh = m d, and dI = 2 (h.d) 1 - h d' - d h' (parallel axes to first order, h the first moments).
    out[1:4] = phi[0] * np.eye(3)
    for row, (i, j) in enumerate(TENSOR, start=4):
        out[row] = 2 * phi[1:4] * (i == j)
        out[row, i] -= phi[1 + j]
        out[row, j] -= phi[1 + i]
    return out


def _mass_spread(prior: Sip) -> Array:
    """Return the covariance (p, p) that raises every relative mass sd to the floor of a table, total unchanged."""
    table, variance = prior.phi.reshape(-1, 10), np.diag(prior.covariance)[::10]
    mass = np.maximum(table[:, 0], 1e-12)
    least = error_size("segment_mass", "floor") * np.array(
        [0.0 if name in prior.measured else _averaged(name) for name in prior.segments]
    )
    # Only what lacks to the floor, in quadrature; what is held fixed, or has no mass, stays as it is.
    missing = np.sqrt(np.maximum(least**2 - variance / mass**2, 0.0)) * (table[:, 0] > 0) * (variance > 0)
    names = [part_of(name) for name in prior.segments]
    sides = error_size("left_right_correlation", "mass")
    alike = np.array(
        [[1.0 if a == b else sides if x == y else 0.0 for b, y in enumerate(names)] for a, x in enumerate(names)]
    )
    masses = alike * np.outer(missing * mass, missing * mass)
    # Conditioned on the total mass, known to `scale`: M - M 1 1' M / (1' M 1 + s²).
    total = masses.sum(axis=1)
    masses = masses - np.outer(total, total) / (total.sum() + error_size("scale", "mass") ** 2)
    # All ten parameters of a segment scale with its mass: d phi = (phi / m) dm.
    return np.asarray(
        np.kron(masses, np.ones((10, 10))) * np.outer(prior.phi / np.repeat(mass, 10), prior.phi / np.repeat(mass, 10))
    )


@functools.cache
def _averaged(segment: str) -> float:
    """Return how much less a segment of several parts may be off than one part: independent errors average."""
    parts = PARTS.get(part_of(segment), ())
    if len(parts) < 2:
        return 1.0
    mass = np.array([read_segment_table(BASE).value(part, "mass", sex="M") for part in parts])
    # Independent relative errors e of parts: sd(sum m e) / sum m = e |m| / sum m.
    return float(np.linalg.norm(mass) / mass.sum())


def _turn_slope(phi: Array) -> Array:
    """Return d phi / d rho (10, 3) for a turn of the matter by rho (3,) rad."""
    inertia, out = inertia_tensor(phi[4:]), np.zeros((10, 3))
    for axis, S in enumerate(skew(np.eye(3))):
        # dh = rho x h, and dI = S I + I S' = S I - I S with S = [rho]x.
        out[1:4, axis] = S @ phi[1:4]
        change = S @ inertia - inertia @ S
        out[4:, axis] = [change[i, j] for i, j in TENSOR]
    return out


_FORMS = np.array(
    [
        2 * np.eye(3) * (i == j) - np.outer(np.eye(3)[i], np.eye(3)[j]) - np.outer(np.eye(3)[j], np.eye(3)[i])
        for i, j in TENSOR
    ]
)
"""(6, 3, 3) A: the elements of |d|² 1 - d d' are d' A d / 2 in the order of `TENSOR`."""


def _displacement(phi: Array, own: Array) -> Array:
    """Return the second moment (10, 10) of m (|d|² 1 - d d') for the CoM's error d ~ N(0, its covariance): its mean
    and its variance: with F = m A Sigma (`_FORMS`) half the trace of F, and half those of F F'.
    """
    mass, com = phi[0], phi[1:4] / phi[0]
    slope = np.zeros((3, 10))
    # dc = (dh - c dm) / m.
    slope[:, 0], slope[:, 1:4] = -com / mass, np.eye(3) / mass
    spread = slope @ own @ slope.T
    forms = mass * _FORMS @ spread
    # For q_k = d'F_k d / 2: mean tr(F_k) / 2, covariance of q_k and q_l tr(F_k F_l) / 2 (normal d).
    mean = 0.5 * np.einsum("kii->k", forms)
    variance = 0.5 * np.einsum("kij,lji->kl", forms, forms)
    out = np.zeros((10, 10))
    # Second moment about zero: the displacement adds inertia on average, and the values keep those of the prior.
    out[4:, 4:] = variance + np.outer(mean, mean)
    return out

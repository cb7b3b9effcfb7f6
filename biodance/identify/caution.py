"""The table's standard deviations, widened by what the table cannot know: how the model's frames sit in this person.

The table's numbers hold in ideal anatomical frames. Markers turn the frames by degrees (the long axis of an arm by tens of degrees), and
a CoM that is off by d adds m d² to the inertia about the joint, which a first-order covariance leaves out.
"""

import numpy as np

from biodance.body.body import JointError
from biodance.body.inertia import TENSOR
from biodance.identify.twins import skew
from biodance.records import Array, Sip

TURN = np.array([0.05, 0.05, 0.05])
"""(3,) rad: standard deviation of a segment frame's turn about its axes; 3 degrees."""
ARM_TURN = np.array([0.05, 0.4, 0.05])
"""(3,) rad for upper arm and forearm: their long axis turns with a plane that a nearly straight arm hardly defines."""


MASS_FLOOR = 0.14
"""Relative standard deviation of a segment's mass: no table is known to fit a person better (spread between de Leva 1996, Dumas 2018 and
Zatsiorsky, and the tables' own residuals)."""
SIDES, SCALE_SD = 0.8, 0.2
"""Correlation of the right and the left side; kg, how well the scale pins the total mass."""
CENTRE = {"thigh": 0.012, "shank": 0.008, "foot": 0.008, "trunk_head": 0.030, "upper_arm": 0.012, "forearm_hand": 0.020}
"""m per axis: how far the origin of a segment's frame may be from its true joint centre (see `twins.JOINT_CENTRE`)."""
JOINT = {"thigh": "hip", "shank": "knee", "foot": "ankle", "trunk_head": "trunk", "upper_arm": "shoulder", "forearm_hand": "elbow"}
"""The joint at the origin of each segment's frame."""
ROOT_CENTRE = 0.008
"""m per axis: the same for the pelvis, and for segments of other bodies."""


def widened(prior: Sip) -> Sip:
    """Return ``prior`` with the same values and a covariance that holds for frames that are turned and centres that are displaced."""
    covariance = np.array(prior.covariance) + _mass_spread(prior)
    for i, segment in enumerate(prior.segments):
        cut = slice(10 * i, 10 * i + 10)
        phi, own = prior.phi[cut], covariance[cut, cut].copy()
        if phi[0] <= 0:
            continue
        turn = ARM_TURN if segment.endswith(("upper_arm", "forearm_hand")) else TURN
        slope = _turn_slope(phi) * turn
        covariance[cut, cut] = own + slope @ slope.T + _displacement(phi, own)
    return Sip(prior.segments, prior.phi, covariance)


def about_true_centres(sip: Sip, placed: tuple[JointError, ...] = ()) -> Sip:
    """Return ``sip`` with a covariance that also holds about the true joint centres, which no wrench can find.

    The data tell where matter is relative to the model's frames; where the person's own joint centre is stays as uncertain as the formula
    that predicted it, or as the movement that ``placed`` it left it.
    """
    covariance = np.array(sip.covariance)
    known = {error.joint: error.centre for error in placed}
    for i, segment in enumerate(sip.segments):
        by_formula = next((value for kind, value in CENTRE.items() if segment.endswith(kind)), ROOT_CENTRE)
        sd = known.get(_joint_of(segment), by_formula)
        slope = sd * _shift_slope(sip.phi[10 * i : 10 * i + 10])
        covariance[10 * i : 10 * i + 10, 10 * i : 10 * i + 10] += slope @ slope.T
    return Sip(sip.segments, sip.phi, covariance)


def _joint_of(segment: str) -> str:
    """Return the anatomical joint at the origin of a segment of the human, "" for other segments."""
    return next((segment.removesuffix(kind) + joint for kind, joint in JOINT.items() if segment.endswith(kind)), "")


def _shift_slope(phi: Array) -> Array:
    """Return d phi / d d (10, 3) for a shift of the matter by d (3,) m."""
    out = np.zeros((10, 3))
    out[1:4] = phi[0] * np.eye(3)
    for row, (i, j) in enumerate(TENSOR, start=4):
        out[row] = 2 * phi[1:4] * (i == j)
        out[row, i] -= phi[1 + j]
        out[row, j] -= phi[1 + i]
    return out


def _mass_spread(prior: Sip) -> Array:
    """Return the covariance (p, p) that raises every relative mass sd to the floor, sides alike, the total mass unchanged."""
    table, variance = prior.phi.reshape(-1, 10), np.diag(prior.covariance)[::10]
    mass = np.maximum(table[:, 0], 1e-12)
    missing = np.sqrt(np.maximum(MASS_FLOOR**2 - variance / mass**2, 0.0)) * (table[:, 0] > 0) * (variance > 0)
    names = [name.removeprefix("right_").removeprefix("left_") for name in prior.segments]
    alike = np.array([[1.0 if a == b else SIDES if x == y else 0.0 for b, y in enumerate(names)] for a, x in enumerate(names)])
    masses = alike * np.outer(missing * mass, missing * mass)
    total = masses.sum(axis=1)
    masses = masses - np.outer(total, total) / (total.sum() + SCALE_SD**2)
    return np.asarray(np.kron(masses, np.ones((10, 10))) * np.outer(prior.phi / np.repeat(mass, 10), prior.phi / np.repeat(mass, 10)))


def _turn_slope(phi: Array) -> Array:
    """Return d phi / d rho (10, 3) for a turn of the matter by rho (3,) rad."""
    inertia = np.empty((3, 3))
    for value, (i, j) in zip(phi[4:], TENSOR, strict=True):
        inertia[i, j] = inertia[j, i] = value
    out = np.zeros((10, 3))
    for axis, S in enumerate(skew(np.eye(3))):
        out[1:4, axis] = S @ phi[1:4]
        change = S @ inertia - inertia @ S
        out[4:, axis] = [change[i, j] for i, j in TENSOR]
    return out


def _displacement(phi: Array, own: Array) -> Array:
    """Return the second moment (10, 10) of m (|d|² 1 - d d') for the CoM's error d ~ N(0, its covariance): its mean and its variance."""
    mass, com = phi[0], phi[1:4] / phi[0]
    slope = np.zeros((3, 10))
    slope[:, 0], slope[:, 1:4] = -com / mass, np.eye(3) / mass
    spread = slope @ own @ slope.T
    forms = []
    for i, j in TENSOR:
        form = 2 * mass * np.eye(3) * (i == j)
        form[i, j] -= mass
        form[j, i] -= mass
        forms.append(form @ spread)
    mean = np.array([0.5 * np.trace(form) for form in forms])
    variance = np.array([[0.5 * np.trace(a @ b) for b in forms] for a in forms])
    out = np.zeros((10, 10))
    out[4:, 4:] = variance + np.outer(mean, mean)
    return out

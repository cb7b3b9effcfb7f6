"""The table's standard deviations, widened by what the table cannot know: how the model's frames sit in this person.

The table's numbers hold in ideal anatomical frames. Markers turn the frames by degrees (the long axis of an arm by tens of degrees), and
a CoM that is off by d adds m d² to the inertia about the joint, which a first-order covariance leaves out.
"""

import numpy as np

from biodance.identify.twins import skew
from biodance.motion.regressor import PHI_TENSOR
from biodance.records import Array, Sip

TURN = np.array([0.05, 0.05, 0.05])
"""(3,) rad: standard deviation of a segment frame's turn about its axes; 3 degrees."""
ARM_TURN = np.array([0.05, 0.4, 0.05])
"""(3,) rad for upper arm and forearm: their long axis turns with a plane that a nearly straight arm hardly defines."""


def widened(prior: Sip) -> Sip:
    """Return ``prior`` with the same values and a covariance that holds for frames that are turned and centres that are displaced."""
    covariance = np.array(prior.covariance)
    for i, segment in enumerate(prior.segments):
        cut = slice(10 * i, 10 * i + 10)
        phi, own = prior.phi[cut], covariance[cut, cut].copy()
        if phi[0] <= 0:
            continue
        turn = ARM_TURN if segment.endswith(("upper_arm", "forearm_hand")) else TURN
        slope = _turn_slope(phi) * turn
        covariance[cut, cut] = own + slope @ slope.T + _displacement(phi, own)
    return Sip(prior.segments, prior.phi, covariance)


def _turn_slope(phi: Array) -> Array:
    """Return d phi / d rho (10, 3) for a turn of the matter by rho (3,) rad."""
    inertia = np.empty((3, 3))
    for value, (i, j) in zip(phi[4:], PHI_TENSOR, strict=True):
        inertia[i, j] = inertia[j, i] = value
    out = np.zeros((10, 3))
    for axis, S in enumerate(skew(np.eye(3))):
        out[1:4, axis] = S @ phi[1:4]
        change = S @ inertia - inertia @ S
        out[4:, axis] = [change[i, j] for i, j in PHI_TENSOR]
    return out


def _displacement(phi: Array, own: Array) -> Array:
    """Return the second moment (10, 10) of m (|d|² 1 - d d') for the CoM's error d ~ N(0, its covariance): its mean and its variance."""
    mass, com = phi[0], phi[1:4] / phi[0]
    slope = np.zeros((3, 10))
    slope[:, 0], slope[:, 1:4] = -com / mass, np.eye(3) / mass
    spread = slope @ own @ slope.T
    forms = []
    for i, j in PHI_TENSOR:
        form = 2 * mass * np.eye(3) * (i == j)
        form[i, j] -= mass
        form[j, i] -= mass
        forms.append(form @ spread)
    mean = np.array([0.5 * np.trace(form) for form in forms])
    variance = np.array([[0.5 * np.trace(a @ b) for b in forms] for a in forms])
    out = np.zeros((10, 10))
    out[4:, 4:] = variance + np.outer(mean, mean)
    return out

"""Which joint lies elsewhere than the static trial puts it, or which marker has moved since, from the linearisation of
a functional calibration (`joint_fit`).

With theta the free unknowns at the found minimum, g and H gradient and information of the cost there, P the information
of the prior alone, the logarithm of the evidence is (Laplace; Bishop 2006, section 4.4)

    -cost + 1/2 g' H^-1 g - 1/2 log |H| + 1/2 log |P|,

once as everything is believed to be, and once with the prior of a fault about one joint, or with one marker free to lie
elsewhere on its segment.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from biodance.body.human.scaling import Scaling
from biodance.body.human.skeleton import JOINTS
from biodance.body.tables.error_sizes import error_size
from biodance.motion.ik.joint_unknowns import FAULTY, JointUnknowns, own_unknowns
from biodance.records import Array, Index

_MORE_PROBABLE = 10.0
"""Natural logarithm by which a joint elsewhere, or a marker that has moved, must make the markers of a movement more
probable (34 sessions of an independent laboratory and ten real ones without fault: 3.3 at most; hips, knees and markers
60 to 120 mm off, three people: 11 to 65).
"""


@dataclass(frozen=True, eq=False)
class MarkerSlopes:
    """What the markers of a movement say of their own places: ``names`` (K); per metre along the three axes of its
    segment each, ``gradient`` (K, 3) and ``information`` (K, 3, 3) of the cost, and ``shared`` (K, 3, p) with the
    unknowns of the joints.
    """

    names: tuple[str, ...]
    gradient: Array
    information: Array
    shared: Array


@dataclass(frozen=True)
class Elsewhere:
    """A ``joint`` or a ``marker`` (the other one is "") that lies elsewhere, with its log Bayes factor."""

    log_bayes_factor: float
    joint: str = ""
    marker: str = ""


def elsewhere(
    scaling: Scaling,
    theta: Array,
    cost: tuple[Array, Array],
    markers: MarkerSlopes,
    shown: NDArray[np.bool_],
) -> Elsewhere | None:
    """Return what most probably lies elsewhere; None where nothing is more probable by `_MORE_PROBABLE`.

    ``theta`` (37,) the unknowns found, ``cost`` its gradient (37,) and information (37, 37) there, those ``shown``
    (37,) free.
    """
    wrong = scaling.centres.contradicted
    found = [Elsewhere(_joint(scaling, theta, cost, shown, one), joint=one) for one in JOINTS if one not in wrong]
    free = np.flatnonzero(shown)
    found += [Elsewhere(value, marker=name) for name, value in _markers(cost, markers, free).items()]
    best = max(found, key=lambda one: one.log_bayes_factor)
    return best if best.log_bayes_factor >= _MORE_PROBABLE else None


def _joint(scaling: Scaling, theta: Array, cost: tuple[Array, Array], shown: NDArray[np.bool_], joint: str) -> float:
    """Return the log Bayes factor of a fault at a joint."""
    gradient, information = cost
    usual = JointUnknowns(scaling.centres).prior(theta)
    doubted = replace(scaling.centres, contradicted=(*scaling.centres.contradicted, joint))
    faulty = JointUnknowns(doubted).prior(theta)
    freed = np.array(shown)
    freed[own_unknowns(joint)] = True
    moved = (
        gradient + faulty[1].T @ faulty[0] - usual[1].T @ usual[0],
        information + faulty[1].T @ faulty[1] - usual[1].T @ usual[1],
    )
    before = _evidence(*cost, usual, np.flatnonzero(shown))
    return _evidence(*moved, faulty, np.flatnonzero(freed)) - before


def _evidence(gradient: Array, information: Array, prior: tuple[Array, Array], free: Index) -> float:
    """Return the logarithm of the evidence up to the part of the cost that no prior changes."""
    own, pull = np.ix_(free, free), gradient[free]
    before = (prior[1].T @ prior[1])[own]
    volume = np.linalg.slogdet(before)[1] - np.linalg.slogdet(information[own])[1]
    gain = pull @ np.linalg.solve(information[own], pull)
    return float(0.5 * (gain + volume - prior[0] @ prior[0]))


def _markers(cost: tuple[Array, Array], markers: MarkerSlopes, free: Index) -> dict[str, float]:
    """Return the log Bayes factor of every marker that has moved, the ``free`` unknowns of the joints adapting."""
    gradient, information = cost
    before = (FAULTY * error_size("soft_tissue", "marker")) ** -2
    inner = np.linalg.inv(information[np.ix_(free, free)])
    shared = markers.shared[:, :, free]
    pull = markers.gradient - shared @ (inner @ gradient[free])
    left = markers.information - shared @ inner @ np.swapaxes(shared, 1, 2) + before * np.eye(3)
    gain = np.einsum("ki,kij,kj->k", pull, np.linalg.inv(left), pull)
    value = 0.5 * (gain + 3 * np.log(before) - np.linalg.slogdet(left)[1])
    return dict(zip(markers.names, value.tolist(), strict=True))

"""Do the knees bend where the static trial's markers have them? The axis that the movement shows, against the one that
was marked: how far before or behind the lateral marker it passes, and how far it is turned about the bone.

Before the movement both are normal about zero, with the standard deviations by which examiners differ (`hinge_centre`
and `axis_turn` in sizes.csv). A most probable value that the movement moves has the variance by which it makes them
surer, so that the distance is standard normal in people who were marked as people are. Elbows are left out: a nearly
straight arm hardly defines their axis, and nobody marks it.
"""

import numpy as np
from numpy.typing import NDArray

from biodance.body.human.static_centres import Centres
from biodance.motion.ik.joint_unknowns import HINGES, SIZE, JointUnknowns, own_centre, own_turn
from biodance.records import Array

BEYOND = 3.0
"""Standard deviations from which a knee was not marked where it bends."""


def knees_elsewhere(
    centres: Centres, theta: Array, information: Array, shown: NDArray[np.bool_], *, known: tuple[str, ...]
) -> tuple[str, ...]:
    """Return a warning for every knee whose axis the movement shows elsewhere than the static trial, by more than
    markers usually are beside it.

    Parameters
    ----------
    centres : Centres
        Joints as the static trial has them.
    theta, information : Array
        (37,) m, rad: the unknowns found; (37, 37) what prior and movement together say of them.
    shown : NDArray
        (37,) unknowns that the movement shows; the others are where the static trial has them.
    known : tuple of str
        Joints of which something is said already.

    Returns
    -------
    tuple of str
        Sentences that begin with "Warning".
    """
    free, slope = np.flatnonzero(shown), JointUnknowns(centres).prior(theta)[1]
    before, after = (np.linalg.inv(one[np.ix_(free, free)]) for one in (slope.T @ slope, information))
    notes = []
    for knee in (hinge for hinge in HINGES if hinge.endswith("_knee") and hinge not in known):
        if not shown[own_turn(knee)]:
            continue
        ways = _ways(centres, knee)
        ahead, turned = ways @ theta
        expected = np.einsum("ki,ij,kj->k", ways[:, free], before - after, ways[:, free])
        far = float(np.max(np.abs([ahead, turned]) / np.sqrt(expected)))
        if far > BEYOND:
            notes.append(_warning(knee, float(ahead), float(turned), far))
    return tuple(notes)


def _ways(centres: Centres, knee: str) -> Array:
    """Return (2, 37): what the unknowns move a knee's axis forwards from the place that the lateral marker gives it, m,
    and turn it about the bone, rad.
    """
    bone, out = JointUnknowns(centres).bone(knee), np.zeros((2, SIZE))
    forwards = np.cross(bone, centres.right[knee])
    forwards /= np.linalg.norm(forwards)
    out[0, own_centre(knee)] = forwards
    out[0, own_turn(knee)] = -forwards @ np.cross(bone, centres.place[knee] - centres.lateral[knee])
    out[1, own_turn(knee)] = 1.0
    return out


def _warning(knee: str, ahead: float, turned: float, far: float) -> str:
    return (
        f"Warning: the {knee.replace('_', ' ')} bends about an axis {abs(1e3 * ahead):.0f} mm "
        f"{'before' if ahead > 0 else 'behind'} its lateral marker and {abs(np.degrees(turned)):.0f} degrees from the "
        f"one that was marked, {far:.1f} standard deviations of how examiners differ: check the markers of that knee."
    )

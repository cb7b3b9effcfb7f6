"""The unknowns of a functional calibration: where joints are in the static posture, and how the axes of the hinges
turn about the bone; which of them a movement shows, and of which it contradicts the static trial's place.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit, logit

from biodance.body.body import Body
from biodance.body.human.skeleton import JOINTS
from biodance.body.human.static_centres import Centres, static_sd
from biodance.body.tables.error_sizes import error_size
from biodance.motion.kinematics import Poses, below, chains, poses
from biodance.records import SIDES, Array, Index
from biodance.records.attention import Doubt
from biodance.spatial import axis_rotation, skew

HINGES = ("right_knee", "left_knee", "right_elbow", "left_elbow")
_ABOVE = {"knee": "hip", "elbow": "shoulder"}
_LIMBS = (("hip", "knee"), ("knee", "ankle"))
"""Joints at the ends of the limbs that a person has equally long on both sides, within `error_size("side_length")`."""
_TURNS = 3 * len(JOINTS)
SIZE = _TURNS + len(HINGES)
"""Unknowns: 3 m per joint of ``JOINTS`` (displacement, lab axes, in the static posture), then rad per hinge about
the bone above it.
"""


FAULTY = 3.0
"""Times its standard deviation by which a centre that the movement contradicts may be off, or a marker that has moved:
such an error is a fault, and faults are as rare and as large as the diagnosis takes them
(`biodance.diagnosis.candidates.SCALE`).
"""


MISSED = 0.015
"""m per axis by which a centre is typically off where it is wrong: regressions for the hip miss by 12.3 mm (Harrington)
to 25 mm (Davis; Mantovani 2016).
"""


FARTHEST = 0.1
"""m: no joint centre lies farther from where the static trial puts it. Half the depth of an adult's waist (0.23 m,
ANSUR II 2012) and half the length of the lumbar spine (0.18 m) are hardly more, half the breadth of a limb is less: a
place beyond is outside the body. What asks for it is no joint centre, but skin, a bent spine or a chair.
"""


def centre_sd(joint: str, *, contradicted: bool = False) -> float:
    """Return the standard deviation (m per axis) of a ``joint``'s centre before any movement (`static_sd`); wider where
    the movement has ``contradicted`` that place.
    """
    return FAULTY * static_sd(joint) if contradicted else static_sd(joint)


@dataclass(frozen=True, eq=False)
class JointUnknowns:
    """The unknowns theta (37,) about the static trial's ``centres``, theta = 0."""

    centres: Centres

    @property
    def free(self) -> Index:
        """Return the unknowns of the joints that the movement shows; the others are where the static trial has them."""
        own = (i for joint in JOINTS if joint not in self.centres.unshown for i in own_unknowns(joint))
        return np.array(sorted(own), dtype=int)

    def bone(self, hinge: str) -> Array:
        """Return the unit vector (3,), lab, upwards along the bone above a hinge."""
        side, joint = hinge.split("_")
        along = self.centres.place[f"{side}_{_ABOVE[joint]}"] - self.centres.place[hinge]
        return np.asarray(along / np.linalg.norm(along))

    def moved(self, theta: Array) -> Centres:
        """Return the centres at ``theta``."""
        shift = {joint: theta[own_centre(joint)] for joint in JOINTS}
        place = {joint: at + shift.get(joint, 0.0) for joint, at in self.centres.place.items()}
        right = {hinge: self._turn(hinge, theta) @ axis for hinge, axis in self.centres.right.items()}
        return replace(self.centres, place=place, right=right)

    def _turn(self, hinge: str, theta: Array) -> Array:
        return np.asarray(axis_rotation(self.bone(hinge), theta[[own_turn(hinge)]])[0])

    def prior(self, theta: Array) -> tuple[Array, Array]:
        """Return residuals (39,) in standard deviations and their slope (39, 37): how far joints are from their static
        places, knees and elbows from where the lateral marker sees them when the axis turns, and how much longer
        thigh and shank are on the right than on the left (`_sides`).
        """
        residual, slope = np.empty(SIZE), np.zeros((SIZE, SIZE))
        for joint in JOINTS:
            rows, sd = own_centre(joint), centre_sd(joint, contradicted=joint in self.centres.contradicted)
            residual[rows] = theta[rows] / sd
            slope[rows, rows] = np.eye(3) / sd
        for hinge in HINGES:
            rows, k, sd = own_centre(hinge), own_turn(hinge), self.centres.axis_sd[hinge]
            arm = self.centres.place[hinge] - self.centres.lateral[hinge]
            swung = self._turn(hinge, theta) @ arm
            about = centre_sd(hinge, contradicted=hinge in self.centres.contradicted)
            # Knee and elbow lie beside the lateral marker along the axis: turning it swings the expected centre.
            residual[rows] -= (swung - arm) / about
            # d(R arm) / d turn = bone x R arm.
            slope[rows, k] = -np.cross(self.bone(hinge), swung) / about
            residual[k], slope[k, k] = theta[k] / sd, 1 / sd
        apart, apart_slope = self._sides(theta)
        return np.concatenate([residual, apart]), np.concatenate([slope, apart_slope])

    def _sides(self, theta: Array) -> tuple[Array, Array]:
        """Return by how many sds the limbs are longer on the right (2,), and the slope (2, 37)."""
        more, slope = np.zeros(len(_LIMBS)), np.zeros((len(_LIMBS), SIZE))
        sd = np.full(len(_LIMBS), error_size("side_length", "limb"))
        for row, (upper, lower) in enumerate(_LIMBS):
            for side, sign in (("right", 1.0), ("left", -1.0)):
                ends = [f"{side}_{joint}" for joint in (upper, lower)]
                wrong = [centre_sd(end, contradicted=True) for end in ends if end in self.centres.contradicted]
                held = [static_sd(end) for end in ends if end in self.centres.unshown]
                # A contradicted end may be off itself, and one that stays where the static trial puts it is as far off
                # as static trials are: its own standard deviation is added.
                sd[row] = np.linalg.norm([sd[row], *wrong, *held])
                above, below = (self.centres.place[end] + theta[own_centre(end)] for end in ends)
                length = np.linalg.norm(below - above)
                # Slope of the length: unit vector along the limb, at either end with opposite sign.
                along = sign * (below - above) / length
                more[row] += sign * length
                slope[row, own_centre(ends[0])] -= along
                slope[row, own_centre(ends[1])] += along
        return more / sd, slope / sd[:, None]

    def axis(self, hinge: str, theta: Array) -> tuple[Array, Array]:
        """Return the unit flexion axis z (3,) of a hinge in the lab, static posture, and its slope (3, 37): square to
        the bone above, in its plane with ``right``.
        """
        side, joint = hinge.split("_")
        centres = self.moved(theta)
        upper, lower = centres.place[f"{side}_{_ABOVE[joint]}"], centres.place[hinge]
        length, right = np.linalg.norm(upper - lower), centres.right[hinge]
        y = (upper - lower) / length
        # `right` without its part along the bone (Gram-Schmidt).
        across = right - (right @ y) * y
        z = across / np.linalg.norm(across)
        slope_y, slope_right = np.zeros((3, SIZE)), np.zeros((3, SIZE))
        # Derivative of a unit vector: (1 - y y') / length times that of the difference.
        slope_y[:, own_centre(f"{side}_{_ABOVE[joint]}")] = (np.eye(3) - np.outer(y, y)) / length
        slope_y[:, own_centre(hinge)] = -(np.eye(3) - np.outer(y, y)) / length
        slope_right[:, own_turn(hinge)] = np.cross(self.bone(hinge), right)
        # d(right - (right.y) y), then projected on the plane square to z and divided by the length.
        slope = slope_right - np.outer(y, y @ slope_right + right @ slope_y) - (right @ y) * slope_y
        return z, (np.eye(3) - np.outer(z, z)) @ slope / np.linalg.norm(across)

    def slope(self, body: Body, stand: Array, pose: Poses, points: Array, theta: Array) -> Array:
        """Return (T, 3K, 37): how the markers (T, K, 3) m of the ``body`` at ``theta`` move with the unknowns while
        every joint keeps its turn from the static posture ``stand`` (nq,), where the markers stay. ``pose`` is that of
        the T frames.

        A centre that moves by d takes the markers beyond it along by (P - C) d, where P and C carry vectors of the
        static posture along with the segments above and below; an axis that turns by r turns them about the centre by
        (P - C) r. That the two axes of the ankle turn with the shank is left out.
        """
        rest = poses(body, stand[None]).rotation[0]
        # R R_rest': carries a vector of the static posture along with the segment.
        carried = pose.rotation @ np.swapaxes(rest, -1, -2)
        hangs = below(body)[:, list(body.markers.segment)]
        out = np.zeros((*points.shape, SIZE))
        for chain in chains(body):
            first, child = body.joints[chain[0]], body.joints[chain[-1]].segment
            name = first.name.rsplit("_", 1)[0]
            above = 0 if first.parent < 0 else body.joints[first.parent].segment
            apart = (carried[:, above] - carried[:, child])[:, None]
            on = np.flatnonzero(hangs[chain[0]])
            out[:, on, :, own_centre(name)] += apart
            if name in HINGES:
                arm = points[:, on] - pose.joint_position[:, chain[0], None]
                z, slope = self.axis(name, theta)
                # Rotation vector r = z x dz; a point at `arm` moves by ((P - C) r) x arm = -[arm]x (P - C) r.
                out[:, on] -= skew(arm) @ (apart @ (skew(z) @ slope))
        return out.reshape(len(points), -1, SIZE)


def own_centre(joint: str) -> slice:
    """Return the unknowns of a joint's centre."""
    i = 3 * JOINTS.index(joint)
    return slice(i, i + 3)


def own_turn(hinge: str) -> int:
    """Return the unknown of a hinge's axis."""
    return _TURNS + HINGES.index(hinge)


_EXCITED = 0.3
"""Share of a joint's prior standard deviation that the movement must remove; below it the static trial's answer is
kept, because what little the markers say of such a joint is soft tissue.
"""


def unshown(centres: Centres, theta: Array, information: Array) -> tuple[str, ...]:
    """Return the joints of whose standard deviation the movement removes less than the share ``_EXCITED``, from the
    ``information`` (37, 37) at ``theta``.

    A hinge is judged by its axis.
    """
    slope = JointUnknowns(centres).prior(theta)[1]
    # Standard deviations by the prior alone, and with the movement.
    before, after = (np.sqrt(np.diag(np.linalg.inv(known))) for known in (slope.T @ slope, information))
    judged = {joint: [own_turn(joint)] if joint in HINGES else own_unknowns(joint) for joint in JOINTS}
    return tuple(
        joint
        for joint, own in judged.items()
        if np.linalg.norm(after[own]) >= (1 - _EXCITED) * np.linalg.norm(before[own])
    )


def doubted(centres: Centres, wrong: tuple[str, ...]) -> Centres:
    """Return the ``centres`` with the joints that are ``wrong``; one hip alone leaves the middle of the hips there."""
    hips = [centres.place[f"{side}_hip"] for side in SIDES]
    alone = sum(joint.endswith("_hip") for joint in wrong) == 1
    return replace(
        centres,
        contradicted=wrong,
        unshown=tuple(joint for joint in centres.unshown if joint not in wrong),
        mid_hip=np.mean(hips, axis=0) if alone else None,
    )


def own_unknowns(joint: str) -> list[int]:
    """Return the unknowns of a joint: its centre, of a hinge also its axis."""
    return [*range(SIZE)[own_centre(joint)], *([own_turn(joint)] if joint in HINGES else [])]


MISMARKED = 0.02
"""Probability that a joint was marked elsewhere, before any movement shows it."""


def mismarked(far: float) -> float:
    """Return the probability that a joint was marked elsewhere that lies ``far`` standard deviations of how examiners
    differ from its marks.

    Those of marks that are wrong are `FAULTY` times as large, so that the odds are

        p / (1 - p)  N(far; 0, FAULTY^2) / N(far; 0, 1),    p = `MISMARKED`.
    """
    # Log odds: prior, ratio of the normal densities' factors, and of their exponents.
    return float(expit(logit(MISMARKED) - np.log(FAULTY) + far**2 / 2 * (1 - FAULTY**-2)))


def knees_elsewhere(centres: Centres, theta: Array, information: Array, *, known: tuple[str, ...]) -> tuple[str, ...]:
    """Return a warning for every knee whose axis the movement shows elsewhere than the static trial, where it is more
    probable than not that it was marked elsewhere.

    Parameters
    ----------
    centres : Centres
        Joints as the static trial has them, and which of them the movement does not show.
    theta, information : Array
        (37,) m, rad: the unknowns found; (37, 37) what prior and movement together say of them.
    known : tuple of str
        Joints of which something is said already.

    Returns
    -------
    tuple of str
        Sentences that begin with "Warning".
    """
    unknowns = JointUnknowns(centres)
    free, slope = unknowns.free, unknowns.prior(theta)[1]
    before, after = (np.linalg.inv(one[np.ix_(free, free)]) for one in (slope.T @ slope, information))
    notes = []
    told = (*known, *centres.unshown)
    for knee in (hinge for hinge in HINGES if hinge.endswith("_knee") and hinge not in told):
        ways = _ways(centres, knee)
        ahead, turned = ways @ theta
        # Variance of the posterior mean: what the data took off the prior's.
        expected = np.einsum("ki,ij,kj->k", ways[:, free], before - after, ways[:, free])
        far = float(np.max(np.abs([ahead, turned]) / np.sqrt(expected)))
        if mismarked(far) > 0.5:
            notes.append(_warning(knee, float(ahead), float(turned), far))
    return tuple(notes)


def _ways(centres: Centres, knee: str) -> Array:
    """Return (2, 37): what the unknowns move a knee's axis forwards, m, and turn it about the bone, rad."""
    bone, out = JointUnknowns(centres).bone(knee), np.zeros((2, SIZE))
    forwards = np.cross(bone, centres.right[knee])
    forwards /= np.linalg.norm(forwards)
    out[0, own_centre(knee)] = forwards
    # Turning the axis swings the centre about the lateral marker: what of it goes forwards is no move of the axis.
    out[0, own_turn(knee)] = -forwards @ np.cross(bone, centres.place[knee] - centres.lateral[knee])
    out[1, own_turn(knee)] = 1.0
    return out


def _warning(knee: str, ahead: float, turned: float, far: float) -> str:
    return Doubt(
        f"the {knee.replace('_', ' ')} bends about an axis {abs(1e3 * ahead):.0f} mm "
        f"{'before' if ahead > 0 else 'behind'} its lateral marker and {abs(np.degrees(turned)):.0f} degrees from the "
        f"one that was marked, {far:.1f} standard deviations of how examiners differ",
        "Check the markers of that knee.",
        about=(knee,),
    )

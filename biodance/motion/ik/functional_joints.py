"""Functional calibration: joint centres and hinge axes from how a person moves, with the static trial's answer as the
prior.

Every choice of the unknowns is a body that meets the static markers exactly. Sought is the most probable one: marker
distances over postures of the moving trials, each at its own best inverse kinematics, plus the squared distance from
the static answer (`joint_fit`). What the movement contradicts is found on the way (`motion.ik.elsewhere`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from biodance.body.human.scaling import Scaling
from biodance.body.human.skeleton import JOINTS
from biodance.body.parts import JointError
from biodance.body.tables.error_sizes import error_size
from biodance.errors import TrialRefused
from biodance.motion.ik.joint_fit import (
    CalibrationState,
    beside_sliding_skin,
    elsewhere,
    evaluate_joints,
    fit_joints,
    spread_postures,
)
from biodance.motion.ik.joint_unknowns import (
    FARTHEST,
    FAULTY,
    HINGES,
    MISSED,
    SIZE,
    JointUnknowns,
    centre_sd,
    doubted,
    excited,
    knees_elsewhere,
    own_centre,
    own_turn,
    own_unknowns,
)
from biodance.motion.kinematics import chains, poses
from biodance.records import Array, Markers
from biodance.threads import one_thread

PLACED = "Joints placed by movement"
"""Beginning of the note on joints that the movement moved."""
_ALIKE = 8.0
"""s of movement that count as one independent posture, because skin slides with the posture and neighbours err alike.
On virtual dances the places are the same from 1 to 16 s, their standard deviations are true at 8 s; in real walks of 2
s less than 1 s moves joints by decimetres.
"""
_NO_FIXED_POINT = ("shoulder", "trunk")
"""Joints of which no fixed point of the trunk gives the centre: what the table says of that is added to their standard
deviations, which are then those of 12 virtual dances.
"""
_FAULTS = 3  # Joints that lie elsewhere and markers that have moved, at most, in one session
_NO_POSTURE = 0.1
"""m, RMS marker distance from which on a frame shows no posture of this body: 0.009 to 0.033 at most in eleven real
sessions, 0.044 in one with exchanged head markers, metres where a recording went wrong.
"""


@dataclass(frozen=True, eq=False)
class _FunctionalJoints:
    """``scaling`` with the joints where the movement puts them; joint -> ``moved`` m; hinge -> ``turned`` rad;
    ``errors`` of the joints that moved; ``kept`` the joints that the movement does not show; ``rms`` m, weighted marker
    distance before and after; ``notes`` say all this in plain sentences.
    """

    scaling: Scaling
    moved: Mapping[str, float]
    turned: Mapping[str, float]
    errors: tuple[JointError, ...]
    kept: tuple[str, ...]
    rms: tuple[float, float]
    notes: tuple[str, ...]


@one_thread()
def functional_joints(scaling: Scaling, trials: Sequence[Markers]) -> _FunctionalJoints:
    """Return ``scaling`` with joint centres and hinge axes from the moving ``trials`` (labels as in the marker set).

    A joint that these contradict is placed by them alone; a marker that has moved since the static trial does not
    count.

    Raises
    ------
    TrialRefused
        The trials show no marker of the body, or no frame determines a posture.
    """
    postures = spread_postures(trials, scaling.with_centres(scaling.centres)[0].markers.names)
    seconds = sum(one.time.size / one.rate for one in trials if one.time.size > 1)
    skin = error_size("soft_tissue", "marker")
    fresh = evaluate_joints(scaling, postures, np.zeros(SIZE), None, noise=skin)
    body = scaling.with_centres(scaling.centres)[0]
    place = poses(body, fresh.q).points(list(body.markers.segment), body.markers.position)
    shows = np.sqrt(np.nanmean(np.sum((place - postures.xyz) ** 2, axis=2), axis=1)) < _NO_POSTURE
    if not shows.any():
        raise TrialRefused(_NOBODY)
    if not shows.all():
        postures = Markers(postures.names, postures.time[shows], postures.xyz[shows])
        scaling = replace(scaling, notes=(*scaling.notes, _not_shown(shows)))
        fresh = evaluate_joints(scaling, postures, np.zeros(SIZE), fresh.q[shows], noise=skin)
    alike = max(1.0, postures.time.size * _ALIKE / seconds)
    noise = max(skin, fresh.rms / np.sqrt(3)) * np.sqrt(alike)
    start = evaluate_joints(scaling, postures, np.zeros(SIZE), fresh.q, noise=noise)
    shown = excited(scaling.centres, start.theta, start.information)
    found, refused = _inside_the_body(scaling, postures, start, shown, noise=noise)
    spared: dict[str, tuple[str, float]] = {}
    for _ in range(_FAULTS):
        cost, slopes = beside_sliding_skin(scaling, postures, found, noise=noise, alike=alike)
        wrong = elsewhere(scaling, found.theta, cost, slopes, shown)
        if wrong is None:
            break
        if wrong.marker:
            joint = _pulled(scaling, found, wrong.marker)
            spared[joint] = wrong.marker, float(np.linalg.norm(found.theta[own_centre(joint)]))
            xyz = np.array(postures.xyz)
            xyz[:, postures.names.index(wrong.marker)] = np.nan
            postures = replace(postures, xyz=xyz)
        else:
            scaling = replace(scaling, centres=doubted(scaling.centres, (*scaling.centres.contradicted, wrong.joint)))
            shown[own_unknowns(wrong.joint)] = True
        again = evaluate_joints(scaling, postures, found.theta, found.q, noise=noise)
        found, beyond = _inside_the_body(scaling, postures, again, shown, noise=noise)
        refused |= beyond
    return _told(scaling, start, found, shown, spared, refused)


def _inside_the_body(
    scaling: Scaling, postures: Markers, start: CalibrationState, shown: NDArray[np.bool_], *, noise: float
) -> tuple[CalibrationState, dict[str, float]]:
    """Return the fit over the unknowns ``shown`` (37,) without the joints that it would put outside the body
    (`FARTHEST`), which stay where the static trial puts them and are taken out of ``shown``; joint -> m how far it
    would go. A joint that the movement contradicts is another matter: it is named.
    """
    refused: dict[str, float] = {}
    while True:
        found = fit_joints(scaling, postures, start, shown, noise=noise)
        far = {joint: float(np.linalg.norm(found.theta[own_centre(joint)])) for joint in JOINTS}
        beyond = {j: m for j, m in far.items() if m > FARTHEST and j not in scaling.centres.contradicted}
        if not beyond:
            return found, refused
        worst = max(beyond, key=lambda joint: beyond[joint])
        refused[worst] = beyond[worst]
        shown[own_unknowns(worst)] = False
        theta = start.theta.copy()
        theta[own_unknowns(worst)] = 0.0
        start = evaluate_joints(scaling, postures, theta, start.q, noise=noise)


_NOBODY = (
    f"In every frame of the moving trials the markers lie {1e3 * _NO_POSTURE:.0f} mm or more from the body (RMS), so "
    "the joints stay where the static trial puts them. Are the labels right, and is it the same person?"
)


def _not_shown(shows: NDArray[np.bool_]) -> str:
    """Return what is said of the frames that show no posture of the body."""
    return (
        f"Warning: {np.count_nonzero(~shows)} of {shows.size} frames did not count in placing the joints: there the "
        f"markers lie {1e3 * _NO_POSTURE:.0f} mm or more from the body (RMS). Look at the trials with the largest "
        "marker distance: labels, gaps, jumps."
    )


def _pulled(scaling: Scaling, found: CalibrationState, marker: str) -> str:
    """Return the joint of the marker's segment that it has pulled farthest, in its standard deviations."""
    body, off = scaling.with_centres(scaling.centres)[0], JointUnknowns(scaling.centres).prior(found.theta)[0]
    segment = body.markers.segment[body.markers.names.index(marker)]
    meet = []
    for chain in chains(body):
        parent = body.joints[chain[0]].parent
        above = 0 if parent < 0 else body.joints[parent].segment
        name = body.joints[chain[0]].name.rsplit("_", 1)[0]
        if segment in (above, body.joints[chain[-1]].segment) and name in JOINTS:
            meet.append(name)
    return max(meet, key=lambda joint: float(np.linalg.norm(off[own_centre(joint)])))


def _told(
    scaling: Scaling,
    start: CalibrationState,
    found: CalibrationState,
    shown: NDArray[np.bool_],
    spared: Mapping[str, tuple[str, float]],
    refused: Mapping[str, float],
) -> _FunctionalJoints:
    """Return the result with its notes: markers ``spared``, and how far ``refused`` joints would go."""
    covariance: Array = np.asarray(np.linalg.inv(found.information), dtype=float)
    deviation = np.sqrt(np.diag(covariance))
    kept = tuple(joint for joint in JOINTS if not shown[own_centre(joint)].any())
    moved = {joint: float(np.linalg.norm(found.theta[own_centre(joint)])) for joint in JOINTS if joint not in kept}
    axis = {hinge: float(deviation[own_turn(hinge)]) for hinge in HINGES}
    wrong = scaling.centres.contradicted

    def error(joint: str) -> JointError:
        marker, far = spared.get(joint, ("", moved.get(joint, 0.0)))
        reach = _reach(joint, found.theta, covariance) if joint in wrong else (0.0, 0.0)
        centre = _centre_sd(joint, deviation)
        return JointError(joint, centre, axis.get(joint, 0.0), joint in wrong, far, marker, *reach)

    errors = tuple(error(joint) for joint in JOINTS if joint in moved or joint in spared)
    turned = {hinge: float(found.theta[own_turn(hinge)]) for hinge in HINGES if hinge not in kept}
    notes = _placed_notes(moved, turned, start, found)
    notes += _unseen_notes([joint for joint in kept if joint not in refused])
    notes += [_outside(joint, far) for joint, far in refused.items()]
    notes += [_contradiction(joint, moved[joint]) for joint in wrong]
    notes += [_moved_since(joint, *own) for joint, own in spared.items()]
    notes += knees_elsewhere(scaling.centres, found.theta, found.information, shown, known=(*wrong, *spared))
    centres = replace(JointUnknowns(scaling.centres).moved(found.theta), errors=errors)
    placed = replace(scaling, centres=centres, notes=(*scaling.notes, *notes))
    return _FunctionalJoints(placed, moved, turned, errors, kept, (start.rms, found.rms), tuple(notes))


def _placed_notes(
    moved: Mapping[str, float], turned: Mapping[str, float], start: CalibrationState, found: CalibrationState
) -> list[str]:
    """Say how far the joints that the movement shows were ``moved`` (m) and ``turned`` (rad), if any."""
    turns = {hinge: f" and {abs(np.degrees(angle)):.0f} deg" for hinge, angle in turned.items()}
    each = [f"{joint.replace('_', ' ')} {1e3 * far:.0f} mm{turns.get(joint, '')}" for joint, far in moved.items()]
    fits = f"{len(found.q)} postures, marker distance {1e3 * start.rms:.1f} to {1e3 * found.rms:.1f} mm"
    return [f"{PLACED} ({fits}), from the static trial's place, axis turned: {', '.join(each)}."] if each else []


def _unseen_notes(joints: Sequence[str]) -> list[str]:
    """Say which joints the movement does not show, if any."""
    names = ", ".join(joint.replace("_", " ") for joint in joints)
    return [f"Joints that the movement does not show, kept where the static trial puts them: {names}."] if names else []


def _outside(joint: str, far: float) -> str:
    """Return what is said of a joint that the movement would put ``far`` m away from the static trial's place."""
    return (
        f"The movement would put the {joint.replace('_', ' ')} joint {1e3 * far:.0f} mm from the static trial's place, "
        f"outside the body (at most {1e3 * FARTHEST:.0f} mm): it stays where the static trial puts it."
    )


def _contradiction(joint: str, far: float) -> str:
    """Return what is said of a joint that the movement puts ``far`` m away from the static trial's place."""
    return (
        f"Warning: the movement contradicts the static trial about the {joint.replace('_', ' ')}: it turns about a "
        f"point {1e3 * far:.0f} mm away, and is placed there. Check the markers from which the static trial placed it."
    )


def _moved_since(joint: str, marker: str, far: float) -> str:
    """Return what is said of a marker that has moved and would pull a joint ``far`` m along."""
    return (
        f"Warning: the marker {marker} does not count in placing the joints: with it the {joint.replace('_', ' ')} "
        f"would lie {1e3 * far:.0f} mm from the static trial's place. It seems to have moved since that trial."
    )


def _reach(joint: str, theta: Array, covariance: Array) -> tuple[float, float]:
    """Return how far (m) a joint that the movement contradicts lies from the static trial's place, and the standard
    deviation of that: what the movement says of it (the posterior of the unknowns ``theta`` (37,) with ``covariance``
    (37, 37), less the prior under which it was placed), under a prior as wide as wrong centres are off.
    """
    own, before = own_centre(joint), centre_sd(joint, contradicted=True)
    told = np.linalg.inv(covariance[own, own])
    shown, axes = np.linalg.eigh(told - np.eye(3) / before**2)
    spread = 1 / (np.maximum(shown, 0.0) + max(FAULTY * MISSED, before) ** -2)
    wide = axes @ np.diag(spread) @ axes.T
    shift = wide @ told @ theta[own]
    far = float(np.linalg.norm(shift))
    return far, float(np.hypot(np.sqrt(shift @ wide @ shift) / far, fixed_point(joint)))


def _centre_sd(joint: str, deviation: Array) -> float:
    """Return the standard deviation of a centre per axis, m (root mean square), from those of the unknowns (37,)."""
    return float(np.hypot(np.sqrt(np.mean(deviation[own_centre(joint)] ** 2)), fixed_point(joint)))


def fixed_point(joint: str) -> float:
    """Return what no fixed point can give of a joint's centre, m per axis."""
    kind = joint.split("_")[-1]
    return error_size("fixed_point", kind, state="after") if kind in _NO_FIXED_POINT else 0.0

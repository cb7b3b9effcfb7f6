"""Functional calibration: joint centres and hinge axes from how a person moves, with the static trial's answer as the
prior; and which joints beyond its 23 axes a body needs: those with which markers are foretold better by the others.

Every choice of the unknowns is a body that meets the static markers exactly. Sought is the most probable one: marker
distances over postures of the moving trials, each at its own best inverse kinematics, plus the squared distance from
the static answer (`joint_fit`). What the movement contradicts is found on the way (`motion.ik.elsewhere`).

More joints always bring the markers nearer that a posture was fitted to. What counts is how far a marker lies from
where the others put it: generalised cross-validation (Golub, Heath and Wahba 1979, doi:10.1080/00401706.1979.10489751)
gives the RMS distance of markers left out one at a time, distance / (1 - h / n), from the n coordinates of the markers
and the trace h of the map that the posture's least squares make of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.human.scaling import Scaling
from biodance.body.human.skeleton import JOINTS, OPTIONAL_JOINTS, with_optional
from biodance.body.parts import JointError
from biodance.body.tables.error_sizes import error_size
from biodance.errors import TrialRefused
from biodance.lab.markers.sets import part_of
from biodance.motion.ik.inverse_kinematics import solve_ik
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
    knees_elsewhere,
    own_centre,
    own_turn,
    own_unknowns,
    unshown,
)
from biodance.motion.kinematics import chains, place_jacobian, poses
from biodance.motion.track import hold_open
from biodance.records import Array, Index, Markers
from biodance.records.attention import Doubt
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
    body = scaling.with_centres(scaling.centres)[0]
    postures = spread_postures(trials, body.markers.names)
    seconds = sum(one.time.size / one.rate for one in trials if one.time.size > 1)
    skin = error_size("soft_tissue", "marker")
    fresh = evaluate_joints(scaling, postures, np.zeros(SIZE), None, noise=skin)
    place = poses(body, fresh.q).points(list(body.markers.segment), body.markers.position)
    shows = np.sqrt(np.nanmean(np.sum((place - postures.xyz) ** 2, axis=2), axis=1)) < _NO_POSTURE
    if not shows.any():
        raise TrialRefused(_NOBODY)
    if not shows.all():
        postures = Markers(postures.names, postures.time[shows], postures.xyz[shows])
        scaling = replace(scaling, notes=(*scaling.notes, _not_shown(shows)))
        fresh = evaluate_joints(scaling, postures, np.zeros(SIZE), fresh.q[shows], noise=skin)
    # Number of postures per independent one: neighbours in time err alike.
    alike = max(1.0, postures.time.size * _ALIKE / seconds)
    # Distance per axis (a third of the square) or skin, whichever is more; sqrt(alike) for dependent postures.
    noise = max(skin, fresh.rms / np.sqrt(3)) * np.sqrt(alike)
    start = evaluate_joints(scaling, postures, np.zeros(SIZE), fresh.q, noise=noise)
    held = unshown(scaling.centres, start.theta, start.information)
    scaling, found, refused = _inside_the_body(_holding(scaling, held), postures, start, noise=noise)
    spared: dict[str, tuple[str, float]] = {}
    # Joints that lie elsewhere and markers that have moved, at most, in one session
    for _ in range(3):
        cost, slopes = beside_sliding_skin(scaling, postures, found, noise=noise, alike=alike)
        wrong = elsewhere(scaling, found.theta, cost, slopes)
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
        scaling, found, beyond = _inside_the_body(scaling, postures, found, noise=noise)
        refused |= beyond
    return _told(scaling, start, found, spared, refused)


def _inside_the_body(
    scaling: Scaling, postures: Markers, start: CalibrationState, *, noise: float
) -> tuple[Scaling, CalibrationState, dict[str, float]]:
    """Return the fit from ``start`` on without the joints that it would put outside the body (`FARTHEST`), which stay
    where the static trial puts them: ``scaling`` that holds these, too, and joint -> m how far it would go. A joint
    that the movement contradicts is another matter: it is named.
    """
    refused: dict[str, float] = {}
    while True:
        start = evaluate_joints(scaling, postures, start.theta, start.q, noise=noise)
        found = fit_joints(scaling, postures, start, noise=noise)
        far = {joint: float(np.linalg.norm(found.theta[own_centre(joint)])) for joint in JOINTS}
        beyond = {j: m for j, m in far.items() if m > FARTHEST and j not in scaling.centres.contradicted}
        if not beyond:
            return scaling, found, refused
        worst = max(beyond, key=lambda joint: beyond[joint])
        refused[worst] = beyond[worst]
        theta = start.theta.copy()
        theta[own_unknowns(worst)] = 0.0
        scaling, start = _holding(scaling, (*scaling.centres.unshown, worst)), replace(start, theta=theta)


def _holding(scaling: Scaling, joints: tuple[str, ...]) -> Scaling:
    """Return the ``scaling`` that holds ``joints`` where the static trial puts them."""
    return replace(scaling, centres=replace(scaling.centres, unshown=joints))


_NOBODY = (
    f"In every frame of the moving trials the markers lie {1e3 * _NO_POSTURE:.0f} mm or more from the body (RMS), so "
    "the joints stay where the static trial puts them. Are the labels right, and is it the same person?"
)


def _not_shown(shows: NDArray[np.bool_]) -> str:
    """Return what is said of the frames that show no posture of the body."""
    return Doubt(
        f"{np.count_nonzero(~shows)} of {shows.size} frames did not count in placing the joints: there the markers lie "
        f"{1e3 * _NO_POSTURE:.0f} mm or more from the body (RMS)",
        "Look at the trials with the largest marker distance: labels, gaps, jumps.",
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
    spared: Mapping[str, tuple[str, float]],
    refused: Mapping[str, float],
) -> _FunctionalJoints:
    """Return the result with its notes: markers ``spared``, and how far ``refused`` joints would go."""
    # Laplace: inverse of the information at the minimum.
    covariance: Array = np.asarray(np.linalg.inv(found.information), dtype=float)
    deviation = np.sqrt(np.diag(covariance))
    kept = scaling.centres.unshown
    moved = {joint: float(np.linalg.norm(found.theta[own_centre(joint)])) for joint in JOINTS if joint not in kept}
    axis = {hinge: float(deviation[own_turn(hinge)]) for hinge in HINGES}
    wrong = scaling.centres.contradicted

    def error(joint: str) -> JointError:
        marker, far = spared.get(joint, ("", moved.get(joint, 0.0)))
        reach = _reach(joint, found.theta, covariance) if joint in wrong else (0.0, 0.0)
        # RMS over the three axes, and what no fixed point can give, in quadrature.
        centre = float(np.hypot(np.sqrt(np.mean(deviation[own_centre(joint)] ** 2)), fixed_point(joint)))
        return JointError(joint, centre, axis.get(joint, 0.0), joint in wrong, far, marker, *reach)

    errors = tuple(error(joint) for joint in JOINTS if joint in moved or joint in spared)
    turned = {hinge: float(found.theta[own_turn(hinge)]) for hinge in HINGES if hinge not in kept}
    notes = _placed_notes(moved, turned, start, found)
    if unseen := ", ".join(joint.replace("_", " ") for joint in kept if joint not in refused):
        notes.append(f"Joints that the movement does not show, kept where the static trial puts them: {unseen}.")
    notes += [
        f"The movement would put the {joint.replace('_', ' ')} joint {1e3 * far:.0f} mm from the static trial's place, "
        f"outside the body (at most {1e3 * FARTHEST:.0f} mm): it stays where the static trial puts it."
        for joint, far in refused.items()
    ]
    notes += [_contradiction(joint, moved[joint]) for joint in wrong]
    notes += [_moved_since(joint, *own) for joint, own in spared.items()]
    notes += knees_elsewhere(scaling.centres, found.theta, found.information, known=(*wrong, *spared))
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


def _contradiction(joint: str, far: float) -> str:
    """Return what is said of a joint that the movement puts ``far`` m away from the static trial's place."""
    return Doubt(
        f"the movement contradicts the static trial about the {joint.replace('_', ' ')}: it turns about a point "
        f"{1e3 * far:.0f} mm away, and is placed there",
        "Check the markers from which the static trial placed it.",
        about=(joint,),
    )


def _moved_since(joint: str, marker: str, far: float) -> str:
    """Return what is said of a marker that has moved and would pull a joint ``far`` m along."""
    return Doubt(
        f"the marker {marker} does not count in placing the joints: with it the {joint.replace('_', ' ')} would lie "
        f"{1e3 * far:.0f} mm from the static trial's place",
        "It seems to have moved since that trial.",
        about=(joint, marker),
        mended=True,
    )


def _reach(joint: str, theta: Array, covariance: Array) -> tuple[float, float]:
    """Return how far (m) a joint that the movement contradicts lies from the static trial's place, and the standard
    deviation of that: what the movement says of it (the posterior of the unknowns ``theta`` (37,) with ``covariance``
    (37, 37), less the prior under which it was placed), under a prior as wide as wrong centres are off.
    """
    own, before = own_centre(joint), centre_sd(joint, contradicted=True)
    # Precision of the posterior less that of its prior: what the movement tells.
    told = np.linalg.inv(covariance[own, own])
    shown, axes = np.linalg.eigh(told - np.eye(3) / before**2)
    spread = 1 / (np.maximum(shown, 0.0) + max(FAULTY * MISSED, before) ** -2)
    wide = axes @ np.diag(spread) @ axes.T
    # told @ theta is movement's information times its estimate, as the prior's mean is zero.
    shift = wide @ told @ theta[own]
    far = float(np.linalg.norm(shift))
    # Standard deviation along the shift: s' C s / |s|².
    return far, float(np.hypot(np.sqrt(shift @ wide @ shift) / far, fixed_point(joint)))


def fixed_point(joint: str) -> float:
    """Return what no fixed point can give of a joint's centre, m per axis."""
    kind = joint.split("_")[-1]
    return error_size("fixed_point", kind, state="after") if kind in _NO_FIXED_POINT else 0.0


NEED = 0.020
"""m: markers that lie within this of the body, RMS, in every trial ask for no further joint (OpenSim's user guide)."""
_NEARER = 0.9
"""A joint is taken if the markers left out lie nearer than this share of their distance without it."""
_FRAMES, _TRIALS = 48, 6  # Frames of all trials together that are looked at, and trials, evenly chosen
_TELLING = {
    "neck": ("head",),
    "forearms": ("forearm_hand", "hand"),
    "wrists": ("forearm_hand", "hand"),
    "clavicles": ("clavicle", "upper_arm", "forearm_hand", "hand"),
}
"""The segments and parts whose markers tell whether a joint is there."""


@dataclass(frozen=True)
class JointGain:
    """What one of the optional joints (``name``) brings: the ``markers`` that tell of it; ``fitted`` m, their RMS
    distance from the body without it; ``without``, ``with_it`` m, the RMS distance of each from where the others put
    it; all over the half of the trials that shows the joint best; whether it is ``taken``.
    """

    name: str
    markers: tuple[str, ...]
    fitted: float
    without: float
    with_it: float
    taken: bool = False


@dataclass(frozen=True, eq=False)
class _Sample:
    """Frames of several trials, one behind the other: the ``markers`` that all have, and the ``trial`` (F,) of each."""

    markers: Markers
    trial: Index


@dataclass(frozen=True, eq=False)
class _Followed:
    """How a body follows a sample: ``names`` (K); ``square`` (F, K) m², distances, NaN = hidden; ``share`` (F, K) of a
    marker's displacement that the model's own follows.
    """

    names: tuple[str, ...]
    square: Array
    share: Array

    def distances(self, told: list[str], trial: Index) -> tuple[Array, Array]:
        """Return for every trial (R,) the RMS distance, m, of the markers ``told`` as fitted, and of each left out."""
        at = [self.names.index(name) for name in told]
        own = [np.ix_(trial == one, at) for one in np.unique(trial)]
        fitted = np.array([np.sqrt(np.nanmean(self.square[rows])) for rows in own])
        # Left out, a marker is farther by 1 / (1 - h): deletion residual.
        return fitted, fitted / (1 - np.array([self.share[rows].mean() for rows in own]))


def with_shown_joints(
    body: Body, recorded: tuple[Markers, ...], landmarks: Mapping[str, tuple[tuple[str, ...], ...]]
) -> tuple[Body, tuple[JointGain, ...]]:
    """Return the body with those optional joints that its markers show in the movements ``recorded``, the one with the
    largest gain first, and what each joint brings whose markers lie far from the body without it.

    ``landmarks`` of the marker set: which labels mark the wrists.
    """
    some, gains, left = _sample(body, recorded), list[JointGain](), list(OPTIONAL_JOINTS)
    before = None if some is None else _follow(body, some)
    while some is not None:
        wider = [(name, with_optional(body, name, landmarks)) for name in left]
        # Markers of a body that was found too stiff elsewhere need be 15 mm off, not `NEED`.
        tried = [
            one
            for name, more in wider
            if more is not body
            for one in _tried(name, more, some, before, 0.015 if gains else NEED)
        ]
        more, best, after = min(tried, key=lambda one: one[1].with_it / one[1].without, default=(body, None, before))
        if best is None or best.with_it >= _NEARER * best.without:
            return body, (*gains, *(gain for _, gain, _ in tried))
        body, before, gains = more, after, [*gains, replace(best, taken=True)]
        left.remove(best.name)
    return body, ()


def _tried(
    name: str, more: Body, some: _Sample, before: _Followed | None, need: float
) -> list[tuple[Body, JointGain, _Followed]]:
    """Return the body with one joint more, what that brings and how it follows; nothing where no markers ask for it."""
    worn = zip(more.markers.names, more.markers.segment, strict=True)
    told = [one for one, s in worn if one in some.markers and part_of(more.links[s]) in _TELLING[name]]
    if before is None or not told:
        return []
    fitted, without = before.distances(told, some.trial)
    after = _follow(more, some) if fitted.max() > need else None
    if after is None:
        return []
    _, with_it = after.distances(told, some.trial)
    best = np.argsort(with_it / without)[: (len(without) + 1) // 2]
    all_of, foretold, better = (float(np.sqrt(np.mean(x**2))) for x in (fitted[best], without[best], with_it[best]))
    return [(more, JointGain(name, tuple(told), all_of, foretold, better), after)]


def _follow(body: Body, some: _Sample) -> _Followed | None:
    """Return how the body follows the sample; None where its markers determine no posture."""
    try:
        held, _ = hold_open(body, some.markers)
        found = solve_ik(held, some.markers)
    except TrialRefused:
        return None
    return _Followed(found.marker_names, found.residual**2, _leverage(held, found.q, found.marker_names))


def _leverage(body: Body, q: Array, names: tuple[str, ...]) -> Array:
    """Return (F, K): how much of a marker's displacement the model follows in postures ``q`` (F, nq)."""
    rows = [body.markers.names.index(name) for name in names]
    segment, pose = [body.markers.segment[k] for k in rows], poses(body, q)
    J = place_jacobian(body, pose, segment, pose.points(segment, body.markers.position[rows]))
    # Coordinates that are free only: held joints follow nothing.
    J = J[:, :, np.concatenate([np.ones(body.n_root, dtype=bool), body.free])]
    weighted = J * np.repeat(body.markers.weight[rows], 3)[:, None]
    # J'WJ with a ridge, as markers may leave a coordinate open.
    normal = np.swapaxes(weighted, 1, 2) @ J
    # A millionth of the mean squared lever keeps what no marker shows where it is.
    normal += 1e-6 * np.trace(normal, axis1=1, axis2=2)[:, None, None] / J.shape[2] * np.eye(J.shape[2])
    # Diagonal of J (J'WJ)^-1 J'W: how far each coordinate of a marker follows itself.
    share = np.sum(J @ np.linalg.inv(normal) * weighted, axis=2)
    return np.asarray(share.reshape(len(q), -1, 3).mean(axis=2))


def _sample(body: Body, recorded: tuple[Markers, ...]) -> _Sample | None:
    """Return frames of the recordings; None without any, or without a marker that all have."""
    chosen = [recorded[i] for i in _evenly(len(recorded), _TRIALS)]
    names = tuple(name for name in body.markers.names if all(name in one for one in chosen))
    if not chosen or not names:
        return None
    xyz = [one.select(names).xyz[_evenly(len(one.time), _FRAMES // len(chosen))] for one in chosen]
    trial = np.concatenate([np.full(len(part), k) for k, part in enumerate(xyz)])
    return _Sample(Markers(names, np.arange(len(trial)) / 100.0, np.concatenate(xyz)), trial)


def _evenly(count: int, wanted: int) -> Index:
    """Return up to ``wanted`` of ``count`` indices."""
    return np.unique(np.linspace(0, count - 1, min(count, wanted)).round().astype(np.intp))

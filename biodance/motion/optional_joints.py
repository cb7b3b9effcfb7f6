"""Which joints beyond its 23 axes a body needs: those with which markers are foretold better by the others.

More joints always bring the markers nearer that a posture was fitted to. What counts is how far a marker lies from
where the others put it: generalised cross-validation (Golub, Heath and Wahba 1979, doi:10.1080/00401706.1979.10489751)
gives the RMS distance of markers left out one at a time, distance / (1 - h / n), from the n coordinates of the markers
and the trace h of the map that the posture's least squares make of them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.body.human.optional_joints import OPTIONAL_JOINTS, with_optional
from biodance.body.human.skeleton import kind_of
from biodance.errors import TrialRefused
from biodance.motion.ik.inverse_kinematics import solve_ik
from biodance.motion.kinematics import place_jacobian, poses
from biodance.motion.track import hold_open
from biodance.records import Array, Index, Markers

NEED = 0.020
"""m: markers that lie within this of the body, RMS, in every trial ask for no further joint (OpenSim's user guide)."""
_ONCE_WIDER = 0.015  # m: the same for a body that was found too stiff elsewhere
_NEARER = 0.9
"""A joint is taken if the markers left out lie nearer than this share of their distance without it."""
_FRAMES, _TRIALS = 48, 6  # Frames of all trials together that are looked at, and trials, evenly chosen
_RIDGE = 1e-6  # Of the mean squared lever: keeps what no marker shows where it is
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
        return fitted, fitted / (1 - np.array([self.share[rows].mean() for rows in own]))


def with_shown_joints(
    body: Body, recorded: tuple[Markers, ...], landmarks: Mapping[str, tuple[tuple[str, ...], ...]]
) -> tuple[Body, tuple[JointGain, ...]]:
    """Return the body with those optional joints that its markers show in the movements ``recorded``, the one with the
    largest gain first, and what each joint brings whose markers lie far from the body without it.

    ``landmarks`` of the marker set: which labels mark the wrists.
    """
    some, gains, left = _sample(body, recorded), list[JointGain](), list(OPTIONAL_JOINTS)
    while some is not None:
        before = _follow(body, some)
        wider = [(name, with_optional(body, name, landmarks)) for name in left]
        tried = [
            pair
            for name, more in wider
            if more is not body
            for pair in _tried(name, more, some, before, _ONCE_WIDER if gains else NEED)
        ]
        more, best = min(tried, key=lambda pair: pair[1].with_it / pair[1].without, default=(body, None))
        if best is None or best.with_it >= _NEARER * best.without:
            return body, (*gains, *(gain for _, gain in tried))
        body, gains = more, [*gains, replace(best, taken=True)]
        left.remove(best.name)
    return body, ()


def _tried(name: str, more: Body, some: _Sample, before: _Followed | None, need: float) -> list[tuple[Body, JointGain]]:
    """Return the body with one joint more and what it brings; nothing where no markers can show it, or none asks."""
    worn = zip(more.markers.names, more.markers.segment, strict=True)
    told = [one for one, s in worn if one in some.markers and kind_of(more.links[s]) in _TELLING[name]]
    if before is None or not told:
        return []
    fitted, without = before.distances(told, some.trial)
    after = _follow(more, some) if fitted.max() > need else None
    if after is None:
        return []
    _, with_it = after.distances(told, some.trial)
    best = np.argsort(with_it / without)[: (len(without) + 1) // 2]
    all_of, foretold, better = (float(np.sqrt(np.mean(x**2))) for x in (fitted[best], without[best], with_it[best]))
    return [(more, JointGain(name, tuple(told), all_of, foretold, better))]


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
    J = J[:, :, np.concatenate([np.ones(body.n_root, dtype=bool), body.free])]
    weighted = np.swapaxes(J, 1, 2) * np.repeat(body.markers.weight[rows], 3)
    normal = weighted @ J
    normal += _RIDGE * np.trace(normal, axis1=1, axis2=2)[:, None, None] / J.shape[2] * np.eye(J.shape[2])
    share = np.sum(np.swapaxes(J, 1, 2) * np.linalg.solve(normal, weighted), axis=1)
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

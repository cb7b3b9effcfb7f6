"""A joint that the body has and the model lacks: tracked again with it, to see how it moves and what that changes in
the wrench.

The author of such a cause writes the body with the joint (``extended_body``) and the angle that everybody moves it by
(``natural``).
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.interpolate import make_interp_spline

from biodance.body.body import Body
from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.errors import TrialRefused
from biodance.lab.prepare import LowPass, low_pass, motion_filter
from biodance.motion.dynamics import wrench_of_segments
from biodance.motion.ik.inverse_kinematics import solve_ik
from biodance.motion.kinematics import SegmentMotion, chains, poses, segment_motion
from biodance.motion.track import smooth, track
from biodance.records import Array, Markers

_RATE = 25.0
"""Hz, at least: the low-pass leaves nothing that needs more."""

_SLACK = 0.05
"""Weight of markers that are not to be relied on, as a share of their own."""


def angle_and_beyond(typical: float, source: str, *, least: float) -> tuple[Parameter, Parameter]:
    """Return the parameters of a joint that turns by a ``typical`` angle (rad rms per axis), as a ``source`` says: the
    angle, of which ``least`` matters, and what the wrench shows beyond it.
    """
    half = "half the angle: where the joint lies and what hangs on it is known to a half"
    return Parameter("angle", "rad", typical, source, least=least), Parameter("beyond", "rad", typical / 2, half)


class MissingJoint(Effect, ABC):
    """A joint that turns by an angle (rad rms per axis, the first parameter) in the course of time that its markers
    show; the second parameter is what the wrench shows beyond that.
    """

    natural: ClassVar[float] = 0.0
    """rad rms per axis that skin, breathing and habit make in any session."""

    @classmethod
    @abstractmethod
    def extended_body(cls, case: Case) -> Body | None:
        """Return the body of ``case`` with the joint; None where the trial's markers do not show it."""

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return one target where the markers show the joint."""
        return ("",) if cls.extended_body(case) is not None else ()

    def columns(self, case: Case) -> Array:
        """Return (T, 6, 2) the wrench that the joint's motion adds, per radian: of the angle shown, and of more than
        that.
        """
        found = _movement(case, self)
        if found is None:
            return np.zeros((case.motion.time.size, 6, 2))
        # Per radian of the angle that was seen; a spline back to all frames.
        added = make_interp_spline(found.time, found.wrench(case) / max(found.angle, 1e-6), k=5)(case.motion.time)
        return np.repeat(added[:, :, None], 2, axis=2)

    def marker_columns(self, case: Case) -> Array:
        """Return (K, 3, 2) m per radian: the mean residual that the angle shown explains."""
        found = _movement(case, self)
        nearer = np.zeros_like(case.marker_residual) if found is None else found.markers / max(found.angle, 1e-6)
        return np.stack([nearer, np.zeros_like(nearer)], axis=2)

    def shown(self, *cases: Case) -> Array:
        """Return (2,) rad: the angle of its own (`Movement.own`) in all ``cases`` that is left when the natural one is
        taken off (squares of independent movements add up), and NaN for what only the wrench can show.
        """
        found = [(case.motion.time.size, _movement(case, self)) for case in cases]
        # Mean square over all frames of all cases.
        square = sum(frames * one.own**2 for frames, one in found if one is not None) / sum(
            frames for frames, _ in found
        )
        return np.array([np.sqrt(max(square - self.natural**2, 0.0)), np.nan])

    def measured(self, theta: Array, *cases: Case) -> Array:
        """Return the angle shown, and what the wrench shows in all (the sum of both) less that. What such a joint does
        to wrench and mean residuals is modelled poorly: inferred from all rows, a thorax that moves by 0.18 rad, of
        which the markers show 0.12, came to 0.07.
        """
        angle = self.shown(*cases)[0]
        return np.array([angle, theta.sum() - angle])

    @property
    def unlike(self) -> float:
        """How much more or less than the angle shown the wrench may show: so poorly is it known where the joint lies
        and what hangs on it, and so unlike may the wrench be in one trial, band or channel as in all of them.
        """
        return float(self.typical[1] / self.typical[0])

    def possible(self, theta: Array) -> bool:
        """Return whether markers and wrench show a movement the same way: the joint turns by the sum of both."""
        return bool(theta.sum() > 0)

    def corrected(self, case: Case, theta: Array) -> Case:
        """Return the trial tracked with the body that has the joint."""
        body = self.extended_body(case)
        if body is None:
            return case
        body = replace(body, markers=replace(body.markers, weight=case.body.markers.weight))
        return replace(case, body=body, motion=track(body, case.trial))


@dataclass(frozen=True, eq=False)
class Movement:
    """A trial tracked with the joint, at ``time`` (F,) s: the motion ``loose`` of the segments of the ``body`` with it,
    ``stiff`` of those of the one without; ``markers`` (K, 3) m by which the model's markers come nearer on average,
    in segment axes; ``angle`` rad rms of the joint's axes, ``own`` of that what does not follow the angles of the
    joint that carries its segment, where no movement has placed that one: if it lies elsewhere than in the model, a
    second one that follows it brings the markers nearer, and nothing else moves there.
    """

    time: Array
    body: Body
    loose: SegmentMotion
    stiff: SegmentMotion
    markers: Array
    angle: float
    own: float

    def wrench(self, case: Case) -> Array:
        """Return (F, 6) about the lab origin: what the joint's motion adds with the parameters in use."""
        with_joint, without = ((self.body, self.loose), (case.body, self.stiff))
        return wrench_of_segments(*with_joint, case.phi) - wrench_of_segments(*without, case.phi)


def _movement(case: Case, effect: MissingJoint) -> Movement | None:
    """Return how the joint moves; None where the markers do not determine it or are not there."""
    if effect.name not in case.memory:
        body = effect.extended_body(case)
        try:
            case.memory[effect.name] = None if body is None else _tracked(case, body)
        except TrialRefused:
            case.memory[effect.name] = None
    found = case.memory[effect.name]
    assert found is None or isinstance(found, Movement)
    return found


@dataclass(frozen=True, eq=False)
class _Slow:
    """A trial at about `RATE`: ``markers`` low-passed, postures ``q`` (F, nq) as tracked, and the motion of the
    segments in them.
    """

    markers: Markers
    q: Array
    segments: SegmentMotion
    settings: LowPass


def _slow(case: Case) -> _Slow:
    """Return the trial at about `RATE`, as it was tracked."""
    if "slow" not in case.memory:
        every = slice(None, None, max(1, int(case.motion.rate / _RATE + 1e-6)))
        markers, time = case.trial.markers, case.motion.time[every]
        assert markers is not None
        usual = motion_filter(case.trial.settings)
        calm = Markers(markers.names, time, low_pass(markers.xyz, case.motion.rate, usual)[every])
        # Below the Nyquist frequency of the thinned frames.
        settings = replace(usual, cutoff=min(usual.cutoff, 0.45 * case.motion.rate / (every.step or 1)))
        stiff = smooth(case.body, time, case.motion.q[every], settings=settings)
        case.memory["slow"] = _Slow(calm, stiff.q, segment_motion(case.body, stiff), settings)
    found = case.memory["slow"]
    assert isinstance(found, _Slow)
    return found


def _tracked(case: Case, body: Body) -> Movement:
    slow = _slow(case)
    names = {joint.name for joint in case.body.joints}
    new = np.flatnonzero([joint.name not in names for joint in body.joints]) + body.nq - len(body.joints)
    # New joints start at zero between the known angles; each insertion shifts those behind it.
    guess = np.insert(slow.q, new - np.arange(new.size), 0.0, axis=1)
    time = slow.markers.time
    loose = smooth(body, time, solve_ik(body, slow.markers, guess=guess).q, settings=slow.settings)
    angles = loose.q[:, new]
    # Root mean square about their means.
    angle, own = (
        float(np.sqrt(one.var(axis=0).mean()))
        for one in (angles, _not_following(angles, loose.q[:, _unplaced(case, body)]))
    )
    nearer = _markers(case, body, loose.q, slow.q)
    return Movement(time, body, segment_motion(body, loose), slow.segments, nearer, angle, own)


def _unplaced(case: Case, body: Body) -> list[int]:
    """Return where in a posture of ``body`` the angles are of the joints that carry those which only it has, and that
    no movement has placed.
    """
    index = {joint.name: body.nq - len(body.joints) + k for k, joint in enumerate(body.joints)}
    old, placed = {joint.name for joint in case.body.joints}, {error.joint for error in case.body.joint_errors}
    ends = {body.joints[joint.parent].name for joint in body.joints if joint.name not in old and joint.parent >= 0}
    chained = [[case.body.joints[k].name for k in chain] for chain in chains(case.body)]
    open_ones = (names for names in chained if names[-1] in ends and names[0].rsplit("_", 1)[0] not in placed)
    return [index[name] for names in open_ones for name in names]


def _not_following(angles: Array, others: Array) -> Array:
    """Return what of the course of ``angles`` (F, n) is in no proportion to those of ``others`` (F, m)."""
    angles, others = angles - angles.mean(axis=0), others - others.mean(axis=0)
    # Residual of a regression on the other angles (both about their means).
    return angles - others @ np.linalg.lstsq(others, angles, rcond=None)[0]


def _markers(case: Case, body: Body, loose: Array, stiff: Array) -> Array:
    """Return (K, 3) m: the mean step of the model's markers from the postures without to those with the joint, in
    segment axes.
    """
    columns = list(case.marker_columns)
    places, markers = case.body.markers, body.markers
    before, after = poses(case.body, stiff), poses(body, loose)
    segment = [places.segment[c] for c in columns]
    step = after.points([markers.segment[c] for c in columns], markers.position[columns]) - before.points(
        segment, places.position[columns]
    )
    return np.asarray(np.einsum("tkij,tki->kj", before.rotation[:, segment], step) / len(step))


def doubting(body: Body, names: Iterable[str]) -> Body:
    """Return the body whose markers ``names`` hardly count: what they show is not this joint, but skin or another
    joint.
    """
    weight = np.where(np.isin(body.markers.names, list(names)), _SLACK, 1.0) * body.markers.weight
    return replace(body, markers=replace(body.markers, weight=weight))

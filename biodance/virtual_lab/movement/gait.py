"""A person who walks or runs on a belt: one stride that the ground forces carry, repeated through the trial."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.records import SIDES, Array, Wrench
from biodance.virtual_lab.movement.choreography import WIDTH, Curves
from biodance.virtual_lab.movement.performance import MARGIN, Performance
from biodance.virtual_lab.movement.posing import Z, take_stance, turn_about
from biodance.virtual_lab.movement.protocol import GAITS, Gait, TrialPlan
from biodance.virtual_lab.movement.steps import BeltFoot
from biodance.virtual_lab.movement.stride import STRIDE_RATE, FoundStride, find_stride
from biodance.virtual_lab.person.person import Person
from biodance.virtual_lab.tolerances import REALISTIC, LabTolerances, stream

_STATURE = 1.75
"""m of the person whose gait is described by `gaits`; others go in proportion."""


@dataclass(frozen=True, eq=False)
class GaitPerformance(Performance):
    """A trial on a belt: as `Performance`, its ground forces prescribed foot by foot.

    ``gait`` and ``feet`` (right, left) in the axes of the belt; ``stride`` that is repeated; ``balance_error`` N·m·s,
    angular momentum that the motion lacks.
    """

    gait: Gait = GAITS["walk"]
    feet: tuple[BeltFoot, ...] = ()
    stride: FoundStride = None  # type: ignore[assignment]

    def foot_wrench(self, time: Array, side: str) -> Array:
        """Return the true wrench (T, 6) about the lab origin under one foot, exactly zero while it is in the air."""
        asked = {foot.side: self._asked(foot, time) for foot in self.feet}
        total = np.sum([*asked.values()], axis=0)
        share = asked[side][:, 2:3] / np.maximum(total[:, 2:3], 1e-9)
        value = asked[side] + share * (self._wrench_spline(time) - total)
        return np.asarray(np.where(asked[side][:, 2:3] > 0, value, 0.0))

    def wrench(self, time: Array) -> Wrench:
        """Return the true ground wrench on the person about the lab origin, both feet together."""
        return Wrench(time, self.foot_wrench(time, "right") + self.foot_wrench(time, "left"))

    def _asked(self, foot: BeltFoot, time: Array) -> Array:
        """Return the prescribed wrench (T, 6) of one foot about the lab origin."""
        force = foot.force(self.gait, time, self.person.mass, self.stride.aim)
        moment = np.cross(foot.pressure(self.gait, time), force)
        moment[:, 2] += self.stride.twist * force[:, 2]
        turn = turn_about(Z, np.array([self.stance.heading]))[0]
        force, moment = force @ turn.T, moment @ turn.T
        return np.concatenate([force, moment + np.cross(self.middle, force)], axis=1)

    @cached_property
    def middle(self) -> Array:
        """(3,) m, where the belt's middle under the person lies in the laboratory."""
        return floor_between(self.stance.ankle)


def floor_between(ankle: dict[str, Array]) -> Array:
    """Return the place (3,) m on the floor between the ankles of a stance."""
    return np.array([*np.mean([ankle[side][:2] for side in SIDES], axis=0), 0.0])


def perform_gait(
    person: Person,
    plan: TrialPlan,
    session: int,
    *,
    tolerances: LabTolerances = REALISTIC,
    centre: Array,
    heading: float = 0.0,
) -> GaitPerformance:
    """Let ``person`` walk or run through a trial with the ``plan``'s gait at ``centre`` (2,) m, facing ``heading`` rad
    from lab x; the same arguments give the same motion.
    """
    rng = stream(person.seed, "gait", str(session), plan.name)
    gait = _personal(GAITS[plan.gait], rng, tolerances, plan.speed, person.subject.stature)
    stance = take_stance(person, "parallel", centre, heading, rng)
    feet = tuple(
        BeltFoot(side, person.size["sole"], person.size["ankle_height"], out)
        for side, out in zip(SIDES, person.habits.toe_out, strict=True)
    )
    found = find_stride(person, gait, feet)
    index = np.arange(round((plan.duration + 2 * MARGIN) * STRIDE_RATE) + 1) - round(MARGIN * STRIDE_RATE)
    nodes, time = found.q[np.mod(index, len(found.q))].copy(), index / STRIDE_RATE
    turn = turn_about(Z, np.array([stance.heading]))[0]
    nodes[:, :3] = nodes[:, :3] @ turn.T + floor_between(stance.ankle)
    nodes[:, 3:7] = _without_jumps((Rotation.from_matrix(turn) * Rotation.from_quat(nodes[:, 3:7])).as_quat())
    curves = Curves(time, np.zeros((time.size, WIDTH)))
    return GaitPerformance(plan, person, stance, curves, time, nodes, found.missed, gait=gait, feet=feet, stride=found)


def _personal(gait: Gait, rng: np.random.Generator, tolerances: LabTolerances, speed: float, stature: float) -> Gait:
    """Return the gait of this trial: lengths as the ``stature`` m, times and speed as its square root (both pendulums
    alike), and everything but the belt's ``speed`` (0: the gait's) a little its own.
    """
    size = stature / _STATURE
    names = ("width", "strike", "push", "clearance", "arm", "elbow", "lean")
    own = {name: getattr(gait, name) * float(1 + tolerances.performance * rng.normal()) for name in names}
    own = {name: value * (size if name in ("width", "clearance") else 1) for name, value in own.items()}
    pace = np.sqrt(size) * float(1 + 0.3 * tolerances.performance * rng.normal())
    stride = 2 * round(0.5 * gait.stride * pace * STRIDE_RATE) / STRIDE_RATE
    return replace(gait, speed=float(np.sqrt(size)) * (speed or gait.speed), stride=stride, **own)


def _without_jumps(quaternion: Array) -> Array:
    """Return quaternions (T, 4) without jumps of sign."""
    flips = np.where(np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0, -1.0, 1.0)
    return np.asarray(quaternion * np.concatenate([[1.0], np.cumprod(flips)])[:, None])

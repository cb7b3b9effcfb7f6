"""What may be wrong about a robot or its laboratory, each as a column: what a recording shows of it at unit size, and
the recording without it.
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from biodance.body.body import Body
from biodance.effects import unit_of
from biodance.identification.robot import (
    GIVE,
    ZERO,
    Loads,
    RobotMotion,
    angle_changes,
    leg_chains,
    loads,
    places_of,
    slow_wrench,
)
from biodance.identification.statistics import layout_for, standing_point
from biodance.lab.plates.faults import DELAY, OFFSET
from biodance.motion.grounded import ground_again
from biodance.records import Array, Wrench
from biodance.uncertainty.bands import Bands
from biodance.uncertainty.noise import Noise
from biodance.uncertainty.plates import SOURCES, Plates, plate_errors, plate_sources, source_sizes

AnyMotion = TypeVar("AnyMotion", bound=RobotMotion)
_WIDE = 10.0
"""Standard deviation of a cause that is there, over the usual error of its kind."""
_LOADED = 2.0
"""The same of what gives or has play, in units of `GIVE`; usual is none."""
_ALIKE = 0.33
"""Of the RMS torque of its like: a joint that bears less says nothing of whether both give."""
LOADED_KINDS = ("flexible_joint", "backlash", "soft_sole")
SOLE = {"forwards": 0, "sideways": 1}
BANDS_OF_CAUSES = Bands((0.0, 0.04, 0.3, 1.0), 25.0)
"""Hz. Beyond, what a motion needs is more and more the encoders' noise, twice differentiated: masses that explain it
come out small (regression dilution), and any cause made from a smoother motion makes up for them. With 2.5 and 6 Hz as
well a clean recording in MuJoCo was blamed for a gain of Mx of 7 % (63 nats); without, for nothing.
"""


@dataclass(frozen=True)
class RobotCause:
    """One thing that may be wrong: ``kind`` (encoder_zero, flexible_joint, backlash, soft_sole, plate_gain,
    plate_crosstalk, plate_rotation, plate_position, plate_offset, time_delay), ``where`` joints, direction or channel,
    what one column means: ``per`` of ``unit``, and the ``joints`` (numbers) whose angle is wrong.
    """

    kind: str
    where: str
    per: float
    unit: str
    joints: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Columns:
    """Names and meaning of all columns beside the parameters (None: a place on the plate): ``usual`` and ``wide`` (k,)
    standard deviations; ``places`` first column and number of every trial's places.
    """

    causes: tuple[RobotCause | None, ...]
    usual: Array
    wide: Array
    layout: Noise
    places: tuple[tuple[int, int], ...]

    @property
    def of_motion(self) -> tuple[RobotCause, ...]:
        """The causes, first of all, that show a motion as it was not."""
        return tuple(one for one in self.causes if one is not None and _moves(one))


def _moves(cause: RobotCause) -> bool:
    return bool(cause.joints) or cause.kind == "soft_sole"


def cause_columns(body: Body, fitted: tuple[RobotMotion, ...], trials: tuple[RobotMotion, ...]) -> Columns:
    """Return what may be wrong in ``trials``; units by the loads of those ``fitted``."""
    found = [loads(body, one.grounded, one.fit.wrench.value) for one in fitted]
    torque, moment = (np.mean([getattr(one, name) for one in found], axis=0) for name in ("torque", "moment"))
    names = [joint.name for joint in body.joints]
    causes: list[RobotCause | None] = [
        RobotCause("encoder_zero", name, ZERO, "rad", (j,)) for j, name in enumerate(names)
    ]
    encoders, groups = len(causes), _legs_and_pairs(body, torque)
    for some in groups:
        per = GIVE / float(torque[list(some)].mean() + 1e-9)
        causes.append(RobotCause("flexible_joint", _both(names, some), per, "rad/(N·m)", some))
    causes += [RobotCause("backlash", _both(names, some), 2 * GIVE, "rad", some) for some in groups]
    causes += [RobotCause("soft_sole", way, GIVE / float(moment[k] + 1e-9), "rad/(N·m)") for way, k in SOLE.items()]
    loaded = slice(encoders, len(causes))
    causes += _plate_causes()
    usual, wide = np.ones(len(causes)), np.full(len(causes), _WIDE)
    usual[loaded], wide[loaded] = 0.0, _LOADED
    counts = [places_of(one.grounded) for one in trials]
    starts = len(causes) + np.cumsum([0, *counts[:-1]])
    places = np.ones(sum(counts))
    return Columns(
        (*causes, *[None] * len(places)),
        np.append(usual, places),
        np.append(wide, places),
        layout_for(standing_point(tuple(one.fit for one in fitted)), BANDS_OF_CAUSES),
        tuple((int(start), count) for start, count in zip(starts, counts, strict=True)),
    )


def _legs_and_pairs(body: Body, torque: Array) -> list[tuple[int, ...]]:
    """Return every joint of the legs alone, and each of the right with its like of the left where both bear ``torque``
    (n,) N·m.
    """
    right, left = leg_chains(body)
    pairs = [pair for pair in zip(right, left, strict=False) if len(right) == len(left) and pair[0] != pair[1]]
    both = [pair for pair in pairs if torque[list(pair)].min() > _ALIKE * torque[list(pair)].max()]
    return [*((j,) for j in sorted({*right, *left})), *both]


def _both(names: list[str], some: tuple[int, ...]) -> str:
    return " and ".join(names[j] for j in some)


def _plate_causes() -> list[RobotCause]:
    """Return the causes of `plate_sources`, in its order."""
    out = []
    for (fault, place), size in zip(SOURCES, source_sizes(), strict=True):
        where = "plate" if fault is DELAY else place.replace("->", " to ")
        unit = unit_of(place) if fault is OFFSET else fault.unit.replace("1", "")
        out.append(RobotCause(fault.name, where, float(size), unit))
    return out


def motion_changes(body: Body, one: RobotMotion, causes: tuple[RobotCause, ...]) -> Array:
    """Return the change (T / `THINNED`, 6, k) of the wrench that a trial needs by one unit of every cause of motion."""
    found = loads(body, one.grounded, one.fit.wrench.value)
    units = [_unit(one, cause, found) for cause in causes]
    angles, tilts = (np.stack(some, axis=2) for some in zip(*units, strict=True))
    return angle_changes(body, one.grounded, one.angle, angles, tilts)


def _unit(one: RobotMotion, cause: RobotCause, found: Loads) -> tuple[Array, Array]:
    """Return by how much the joints (T, n) and the standing sole (T, 3), rad, are not where one unit of a cause shows
    them.
    """
    angle, tilt, some = np.zeros_like(one.angle), np.zeros((len(one.angle), 3)), list(cause.joints)
    match cause.kind:
        case "encoder_zero":
            angle[:, some] = -ZERO
        case "flexible_joint":
            angle[:, some] = cause.per * found.soft[:, some]
        case "backlash":
            angle[:, some] = GIVE * found.play[:, some]
        case _:
            tilt[:] = cause.per * (found.forwards, found.sideways)[SOLE[cause.where]]
    return angle, tilt


def without(body: Body, one: AnyMotion, columns: Columns, cause: RobotCause, amount: float) -> AnyMotion:
    """Return a trial without ``amount`` units of a cause."""
    fit = one.fit
    if _moves(cause):
        angle, tilt = _unit(one, cause, loads(body, one.grounded, fit.wrench.value))
        angle = one.angle + amount * angle
        found = ground_again(body, one.grounded, angle, tilt=amount * tilt)
        return replace(one, fit=replace(fit, motion=found.motion), angle=angle, grounded=found)
    plates, k = plate_sources(), columns.causes.index(cause) - len(columns.of_motion)
    fault = Plates(plates.mixing[k : k + 1], plates.offset[k : k + 1], plates.delay[k : k + 1])
    about = layout_for(standing_point((fit,)))
    error = plate_errors(slow_wrench(body, one.grounded, one.angle), fit.motion.rate, about, fault)[:, :, 0]
    return replace(one, fit=replace(fit, wrench=Wrench(fit.wrench.time, fit.wrench.value - amount * error)))

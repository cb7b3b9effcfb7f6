"""Curves over a cycle, 0 to 100 %: joint angles, pelvis and foot in the lab, centre of mass; moments and powers of the
joints; what the ground does to a foot, in % of body weight, and where it presses the sole.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.cycles.cut import PERCENT, Cycle, heel_and_toe
from biodance.cycles.strides import place_at
from biodance.identification.torques import ground_torques, torque_regressor_of_links
from biodance.motion.kinematics import Poses, chains, poses
from biodance.motion.soles import Soles
from biodance.records import SIDES, Array, Mask, Motion, Sip, Wrench, freeze, grouped
from biodance.records.motion import BY_FRAME
from biodance.settings import STANDARD_GRAVITY
from biodance.spatial import zero_moment_point, zxy_angles

_TRAVELS = 0.3
"""m that the pelvis goes in a cycle from which its way, not the way it faces, is the direction of walking."""
WHOLE = (PERCENT.size,)


@dataclass(frozen=True, eq=False)
class CycleCurve:
    """One ``quantity`` over one ``cycle``: ``side`` "right", "left" or "middle" of the joint; ``value`` (101,) at
    `PERCENT` in ``unit``, NaN = not known; ``sd`` (101,) what the inertial parameters leave uncertain, NaN = not
    counted.
    """

    cycle: Cycle
    quantity: str
    side: str
    unit: str
    value: Array
    sd: Array

    def __post_init__(self) -> None:
        freeze(self, f"CycleCurve {self.quantity}", value=WHOLE, sd=WHOLE)


@dataclass(frozen=True, eq=False)
class CurveGroup:
    """All repetitions of one quantity: ``kind`` of the cycles; ``values`` (n, 101); their ``mean`` and ``sd`` (101,)
    between repetitions (NaN for fewer than two); ``parameters_sd`` (101,) what the inertial parameters leave uncertain
    in the mean (NaN = not counted). NaN where no repetition is known.
    """

    kind: str
    quantity: str
    side: str
    unit: str
    values: Array
    mean: Array
    sd: Array
    parameters_sd: Array

    def __repr__(self) -> str:
        count = f"{len(self.values)} {self.kind} cycle{'s' * (len(self.values) != 1)}"
        return f"CurveGroup({self.quantity} {self.side}, {count}, {self.unit})"


def over_cycle(
    cycle: Cycle, quantity: str, side: str, unit: str, time: Array, value: Array, sd: Array | None = None
) -> CycleCurve:
    """Return a quantity (T,) of a trial over one of its cycles; NaN beside frames in which it is NaN."""
    at = cycle.times()
    spread = np.full(at.size, np.nan) if sd is None else np.interp(at, time, sd)
    return CycleCurve(cycle, quantity, side, unit, np.interp(at, time, value), spread)


def group_curves(curves: Sequence[CycleCurve]) -> tuple[CurveGroup, ...]:
    """Return the curves of the same kind, quantity and side together, in the order in which they come."""
    groups = []
    same = grouped(((one.cycle.kind, one.quantity, one.side), one) for one in curves)
    for (kind, quantity, side), some in same.items():
        values = np.stack([one.value for one in some])
        parameters_sd, _ = mean_and_sd(np.stack([one.sd for one in some]))
        groups.append(CurveGroup(kind, quantity, side, some[0].unit, values, *mean_and_sd(values), parameters_sd))
    return tuple(groups)


def mean_and_sd(values: Array) -> tuple[Array, Array]:
    """Return mean and standard deviation (101,) over the rows (n, 101) that are known; NaN for fewer than one, two."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    # Zeros where not known, so the sum is over what is known; the count says of how many.
    mean = np.where(count > 0, np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)
    square = np.where(known, (values - mean) ** 2, 0.0).sum(axis=0)
    # Sample variance: n - 1.
    return mean, np.where(count > 1, np.sqrt(square / np.maximum(count - 1, 1)), np.nan)


def angle_curves(cycle: Cycle, body: Body, motion: Motion) -> Iterator[CycleCurve]:
    """Yield the joint angles of a cycle in degrees: of its own side and of the trunk in a gait cycle, else of all.

    The axes are those of the ISB (Wu et al. 2002, doi:10.1016/S0021-9290(01)00222-6) in the order flexion about the
    z axis of the proximal segment, adduction about the floating axis, rotation about the y axis of the distal one;
    docs/guide/movement.md says each sign. In a gait cycle bending and rotation of the trunk are seen from the cycle's
    side, as those of the pelvis: its own side down, its own side forwards are positive.
    """
    motion = _only(motion, cycle.frames(motion.time))
    angle = motion.known_angles
    for j, joint in enumerate(body.joints):
        if (seen := _seen_from(cycle, joint.name)) is not None:
            side, quantity, sign = seen
            yield over_cycle(cycle, quantity, side, "deg", motion.time, sign * angle[:, j])


def _only(motion: Motion, frames: slice | Mask) -> Motion:
    """Return a motion in some of its frames."""
    return replace(motion, **{name: getattr(motion, name)[frames] for name in BY_FRAME})


def _seen_from(cycle: Cycle, joint: str) -> tuple[str, str, float] | None:
    """Return side, name without it and sign with which a joint belongs to a cycle; None where it does not."""
    first, _, rest = joint.partition("_")
    side, name = (first, rest) if first in SIDES else ("middle", joint)
    if cycle.side == "both":
        return side, name, 1.0
    if side == "middle":
        return cycle.side, name, -1.0 if cycle.side == "left" and not name.endswith("flexion") else 1.0
    return (side, name, 1.0) if side == cycle.side else None


def lab_curves(cycle: Cycle, body: Body, motion: Motion, soles: Soles, centre: Array) -> Iterator[CycleCurve]:
    """Yield pelvis, foot progression (deg) and centre of mass, from ``centre`` (T, 3) m of the trial, of a cycle.

    The pelvis in the frame of the way it goes (of the way it faces on average where it goes nowhere), in the order
    rotation, obliquity, tilt (Baker 2001, doi:10.1016/S0966-6362(00)00083-7): forward tilt, the cycle's own side up,
    its own side forward are positive. Foot progression is the rotation of the foot about what is up in it, the last of
    tilt, obliquity and rotation as in plug-in gait, toes inwards positive: told first, it would count what a foot with
    a raised heel is turned about its own length. The centre of mass: m ahead of where the cycle began, to the side of
    the foot, over the ground.
    """
    part = cycle.frames(motion.time)
    motion, centre = _only(motion, part), centre[part]
    pose, time = poses(body, motion.q), motion.time
    x, y = direction_of(cycle, pose, time)
    # Rows: ahead, up, right of the way, the axes of the pelvis and foot when they are not turned.
    frame = np.array([[x, y, 0.0], [0.0, 0.0, 1.0], [y, -x, 0.0]])
    middle, mirror = "middle" if cycle.side == "both" else cycle.side, -1.0 if cycle.side == "left" else 1.0
    known = np.where(motion.determined, 1.0, np.nan)
    rotation = frame @ pose.rotation[:, 0]
    # R = Ry(t) Rx(o) Rz(l), turn t, over o, tilt l: the third column is (sin t cos o, -sin o, cos t cos o), the
    # second row begins with cos o sin l, cos o cos l.
    turn = np.arctan2(rotation[:, 0, 2], rotation[:, 2, 2])
    over = -np.arcsin(np.clip(rotation[:, 1, 2], -1.0, 1.0))
    tilt = np.arctan2(rotation[:, 1, 0], rotation[:, 1, 1])
    for name, angle in zip(
        ("tilt", "obliquity", "rotation"),
        (-np.degrees(tilt), -mirror * np.degrees(over), mirror * np.degrees(turn)),
        strict=True,
    ):
        yield over_cycle(cycle, f"pelvis_{name}", middle, "deg", time, known * angle)
    for side in SIDES:
        if cycle.side in (side, "both"):
            foot = frame @ pose.rotation[:, body.sip.segments.index(f"{side}_foot")]
            inwards = np.degrees(zxy_angles(foot)[2]) * (-1.0 if side == "left" else 1.0)
            yield over_cycle(cycle, "foot_progression", side, "deg", time, known * inwards)
    # Zero is the place at the start, and the ground in height.
    began = place_at(centre, time, cycle.start) * np.array([1.0, 1.0, 0.0])
    # Fifth percentile: single frames below the ground do not count.
    ground = float(np.percentile(soles.outline[..., 2].min(axis=(1, 2)), 5))
    for name, axis, sign, zero in (("ahead", 0, 1.0, 0.0), ("aside", 2, mirror, 0.0), ("height", 1, 1.0, ground)):
        path = sign * ((centre - began) @ frame[axis]) - zero
        yield over_cycle(cycle, f"centre_of_mass_{name}", middle, "m", time, known * path)


def direction_of(cycle: Cycle, pose: Poses, time: Array) -> Array:
    """Return the horizontal unit vector (2,) in which a cycle goes, or in which the pelvis faces on average."""
    inside = (time >= cycle.start) & (time <= cycle.end)
    faces = pose.rotation[inside, 0, :2, 0].mean(axis=0)
    path = pose.position[inside, 0, :2]
    way = path[-1] - path[0]
    chosen = way if np.linalg.norm(way) > _TRAVELS and way @ faces > 0 else faces
    return np.asarray(chosen / np.linalg.norm(chosen))


_ENOUGH = 0.8  # Share of a cycle in which a moment or a power must be known
_BEYOND = 0.05  # s before and behind a cycle that are looked at for its first and last per cent


def load_curves(
    cycle: Cycle, body: Body, sip: Sip, motion: Motion, feet: Mapping[str, Wrench], known: Mask
) -> Iterator[CycleCurve]:
    """Yield the moments (N·m/kg) and powers (W/kg) of a cycle, those of its own side and of the trunk in a gait cycle.

    ``feet`` the wrenches on the right and the left foot, ``known`` (T, 2) where they are known: elsewhere the leg's
    values are NaN. A curve of which less than `_ENOUGH` is known is left out: a mean over cycles of which one shows the
    stance and others the swing would be nobody's. ``sip`` parameters with covariance, whose total is the body mass. A
    moment is what the muscles do about a joint's axis, positive as its angle; a power sums over the axes of a joint,
    positive where they give energy.

    Notes
    -----
    With torque = Y phi - c (`identification.torques`) a power is sum(v torque) over the axes, so that its variance is
    y' C y with y = sum(v Y): the axes of a joint are not independent.
    """
    near = (motion.time >= cycle.start - _BEYOND) & (motion.time <= cycle.end + _BEYOND)
    motion, known = _only(motion, near), known[near]
    ground = {
        # A wrench that is not known is zero here and its values become NaN below.
        f"{side}_foot": Wrench(motion.time, np.where(known[:, foot, None], feet[f"{side}_foot"].value[near], 0.0))
        for foot, side in enumerate(SIDES)
    }
    named = [(joint.name, "moment", [j]) for j, joint in enumerate(body.joints)]
    named += [(body.joints[axes[-1]].name.rpartition("_")[0], "power", list(axes)) for axes in chains(body)]
    own = [(kind, axes, seen) for joint, kind, axes in named if (seen := _seen_from(cycle, joint)) is not None]
    rows, given = _moments_and_powers(body, motion, ground, [(kind, axes) for kind, axes, _ in own])
    # No sharing: the parameters are those of the segments themselves.
    share, mass = np.eye(sip.phi.size) if body.sharing is None else body.sharing, float(sip.mass.sum())
    # phi_links = S phi: covariance S C S'.
    variance, covariance = np.empty(given.shape), share @ sip.covariance @ share.T
    for column in range(len(own)):  # of the links beyond the joint alone: no other parameter moves it
        beyond = np.flatnonzero(rows[:, column].any(axis=0))
        # Columns that are zero at all times need no covariance.
        needs = rows[:, column, beyond]
        # y'C y of every frame.
        variance[:, column] = np.sum((needs @ covariance[np.ix_(beyond, beyond)]) * needs, axis=-1)
    # (Y phi - c) / m.
    value, sd = (rows @ (share @ sip.phi) - given) / mass, np.sqrt(np.maximum(variance, 0.0)) / mass
    for column, (kind, _, (side, joint, sign)) in enumerate(own):
        of_leg = joint.startswith(("hip", "knee", "ankle"))  # which needs its own foot, trunk and arms nothing
        use = motion.determined & (known[:, SIDES.index(side)] if of_leg else True)
        # The sign of an angle turns its moment, not the power, the product of moment and rate.
        shown, sign = np.where(use, 1.0, np.nan), sign if kind == "moment" else 1.0
        unit = "N·m/kg" if kind == "moment" else "W/kg"
        curves = sign * shown * value[:, column], shown * sd[:, column]
        one = over_cycle(cycle, f"{joint}_{kind}", side, unit, motion.time, *curves)
        if np.isfinite(one.value).mean() > _ENOUGH:
            yield one


def _moments_and_powers(
    body: Body, motion: Motion, ground: Mapping[str, Wrench], wanted: Sequence[tuple[str, list[int]]]
) -> tuple[Array, Array]:
    """Return rows (T, m, 10L) and given (T, m) of the ``wanted`` "moment" about one axis, or "power" over the axes of a
    joint: value = rows phi - given.
    """
    joints = sorted({axis for _, axes in wanted for axis in axes})
    regressor, given = torque_regressor_of_links(body, motion, joints), ground_torques(body, motion, ground)[:, joints]
    rows, known = np.empty((len(given), len(wanted), regressor.shape[2])), np.empty((len(given), len(wanted)))
    for column, (kind, axes) in enumerate(wanted):
        at = [joints.index(axis) for axis in axes]
        if kind == "moment":
            rows[:, column], known[:, column] = regressor[:, at[0]], given[:, at[0]]
        else:  # sum over the joint's axes of v_j tau_j = (v'Y) phi - v'c
            rates = motion.v[:, [body.n_root + axis for axis in axes]]
            rows[:, column] = np.einsum("tj,tjp->tp", rates, regressor[:, at])
            known[:, column] = np.sum(rates * given[:, at], axis=1)
    return rows, known


_PRESSES = 0.05
"""Share of body weight below which a centre of pressure is mostly noise."""


def ground_curves(
    cycle: Cycle, body: Body, motion: Motion, soles: Soles, feet: Mapping[str, Wrench], known: Mask
) -> Iterator[CycleCurve]:
    """Yield the ground reaction on the foot of a gait cycle (% of body weight) and its centre of pressure (m).

    The reaction forwards along the way of walking, inwards (towards the other foot) and up is positive; zero in the
    swing. The centre of pressure lies `pressure_ahead` of the heel along the sole and `pressure_outward` of its line
    from heel to toe; NaN where the foot carries less than `_PRESSES` of the weight. ``feet`` the wrenches on the right
    and the left foot, ``known`` (T, 2) where they are known: elsewhere all are NaN.
    """
    if cycle.side not in SIDES:
        return
    foot, outwards, part = SIDES.index(cycle.side), 1.0 if cycle.side == "right" else -1.0, cycle.frames(motion.time)
    wrench, weight = feet[f"{cycle.side}_foot"].value[part], STANDARD_GRAVITY * float(body.sip.mass.sum())
    time, told = motion.time[part], known[part, foot]
    x, y = direction_of(cycle, poses(body, motion.q[part]), time)
    # % of the weight; exactly zero after the foot has left.
    carries = np.where(time > cycle.off, 0.0, 100 / weight)
    shown = np.where(told, carries, np.nan)
    # [y, -x] is to the right of the way.
    inwards = -outwards * (wrench[:, :2] @ [y, -x])
    for name, force in (("forward", wrench[:, :2] @ [x, y]), ("inward", inwards), ("up", wrench[:, 2])):
        yield over_cycle(cycle, f"ground_reaction_{name}", cycle.side, "%", time, shown * force)
    ahead, aside = _on_sole(body, soles.outline[part], foot, wrench, threshold=_PRESSES * weight)
    inside = np.where(told, 1.0, np.nan)
    for name, place in (("ahead", ahead), ("outward", outwards * aside)):
        yield over_cycle(cycle, f"pressure_{name}", cycle.side, "m", time, inside * place)


def _on_sole(body: Body, outline: Array, foot: int, wrench: Array, *, threshold: float) -> tuple[Array, Array]:
    """Return where the pressure lies ahead of the heel along the sole of an ``outline`` (T, 2, P, 3) m and to the right
    of that line, (T,) m each.
    """
    heel, toe = (place[:, foot, :2] for place in heel_and_toe(body, outline))
    along = (toe - heel) / np.linalg.norm(toe - heel, axis=1, keepdims=True)
    height = outline[:, foot, :, 2].min(axis=1)
    from_heel = zero_moment_point(wrench, height=height, threshold=threshold)[:, :2] - heel
    ahead = np.einsum("tk,tk->t", from_heel, along)
    # Cross product: (along_y, -along_x) is to the right.
    return ahead, from_heel[:, 0] * along[:, 1] - from_heel[:, 1] * along[:, 0]

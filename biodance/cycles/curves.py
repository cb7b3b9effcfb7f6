"""Curves over a cycle, 0 to 100 %: joint angles, pelvis and foot in the lab, centre of mass."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.cycles.cut import PERCENT, Cycle, place_at
from biodance.cycles.events import heel_and_toe
from biodance.motion.contact.soles import Soles
from biodance.motion.kinematics import Poses, centre_of_mass, poses
from biodance.records import SIDES, Array, Motion, freeze

_TRAVELS = 0.3
"""m that the pelvis goes in a cycle from which its way, not the way it faces, is the direction of walking."""
_WHOLE = (PERCENT.size,)


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
        freeze(self, f"CycleCurve {self.quantity}", value=_WHOLE, sd=_WHOLE)


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
    same: dict[tuple[str, str, str], list[CycleCurve]] = {}
    for one in curves:
        same.setdefault((one.cycle.kind, one.quantity, one.side), []).append(one)
    groups = []
    for (kind, quantity, side), some in same.items():
        values = np.stack([one.value for one in some])
        parameters_sd, _ = mean_and_sd(np.stack([one.sd for one in some]))
        groups.append(CurveGroup(kind, quantity, side, some[0].unit, values, *mean_and_sd(values), parameters_sd))
    return tuple(groups)


def mean_and_sd(values: Array) -> tuple[Array, Array]:
    """Return mean and standard deviation (101,) over the rows (n, 101) that are known; NaN for fewer than one, two."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    mean = np.where(count > 0, np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)
    square = np.where(known, (values - mean) ** 2, 0.0).sum(axis=0)
    return mean, np.where(count > 1, np.sqrt(square / np.maximum(count - 1, 1)), np.nan)


def angle_curves(cycle: Cycle, body: Body, motion: Motion) -> Iterator[CycleCurve]:
    """Yield the joint angles of a cycle in degrees: of its own side and of the trunk in a gait cycle, else of all.

    The axes are those of the ISB (Wu et al. 2002, doi:10.1016/S0021-9290(01)00222-6) in the order flexion about the
    z axis of the proximal segment, adduction about the floating axis, rotation about the y axis of the distal one;
    docs/guide/movement.md says each sign. In a gait cycle bending and rotation of the trunk are seen from the cycle's
    side, as those of the pelvis: its own side down, its own side forwards are positive.
    """
    angle = motion.known_angles
    for j, joint in enumerate(body.joints):
        if (seen := seen_from(cycle, joint.name)) is not None:
            side, quantity, sign = seen
            yield over_cycle(cycle, quantity, side, "deg", motion.time, sign * angle[:, j])


def seen_from(cycle: Cycle, joint: str) -> tuple[str, str, float] | None:
    """Return side, name without it and sign with which a joint belongs to a cycle; None where it does not."""
    first, _, rest = joint.partition("_")
    side, name = (first, rest) if first in SIDES else ("middle", joint)
    if cycle.side == "both":
        return side, name, 1.0
    if side == "middle":
        return cycle.side, name, -1.0 if cycle.side == "left" and not name.endswith("flexion") else 1.0
    return (side, name, 1.0) if side == cycle.side else None


def lab_curves(cycle: Cycle, body: Body, motion: Motion, soles: Soles) -> Iterator[CycleCurve]:
    """Yield pelvis, foot progression (deg) and centre of mass (m) of a cycle.

    The pelvis in the frame of the way it goes (of the way it faces on average where it goes nowhere), in the order
    rotation, obliquity, tilt (Baker 2001, doi:10.1016/S0966-6362(00)00083-7): forward tilt, the cycle's own side up,
    its own side forward are positive. Foot progression, while the foot stands: toes inwards are positive. The centre of
    mass: m ahead of where the cycle began, to the side of the foot, over the ground.
    """
    pose, time = poses(body, motion.q), motion.time
    x, y = _direction(cycle, pose, time)
    frame = np.array([[x, y, 0.0], [0.0, 0.0, 1.0], [y, -x, 0.0]])
    middle, mirror = "middle" if cycle.side == "both" else cycle.side, -1.0 if cycle.side == "left" else 1.0
    known = np.where(motion.determined, 1.0, np.nan)
    for name, angle in zip(
        ("tilt", "obliquity", "rotation"), _pelvis(frame @ pose.rotation[:, 0], mirror), strict=True
    ):
        yield over_cycle(cycle, f"pelvis_{name}", middle, "deg", time, known * angle)
    heel, toe = heel_and_toe(body, soles.outline)
    for foot, side in enumerate(SIDES):
        if cycle.side in (side, "both"):
            ahead, aside = ((toe - heel)[:, foot] @ frame[k] for k in (0, 2))
            inwards = -np.degrees(np.arctan2(aside, ahead)) * (-1.0 if side == "left" else 1.0)
            stands = np.where((time > cycle.off) & (cycle.side == side), np.nan, known)
            yield over_cycle(cycle, "foot_progression", side, "deg", time, stands * inwards)
    centre = centre_of_mass(body, motion)
    began = place_at(centre, time, cycle.start) * np.array([1.0, 1.0, 0.0])
    ground = float(np.percentile(soles.outline[..., 2].min(axis=(1, 2)), 5))
    for name, axis, sign, zero in (("ahead", 0, 1.0, 0.0), ("aside", 2, mirror, 0.0), ("height", 1, 1.0, ground)):
        path = sign * ((centre - began) @ frame[axis]) - zero
        yield over_cycle(cycle, f"centre_of_mass_{name}", middle, "m", time, known * path)


def _direction(cycle: Cycle, pose: Poses, time: Array) -> Array:
    """Return the horizontal unit vector (2,) in which a cycle goes, or in which the pelvis faces on average."""
    inside = (time >= cycle.start) & (time <= cycle.end)
    faces = pose.rotation[inside, 0, :2, 0].mean(axis=0)
    path = pose.position[inside, 0, :2]
    way = path[-1] - path[0]
    chosen = way if np.linalg.norm(way) > _TRAVELS and way @ faces > 0 else faces
    return np.asarray(chosen / np.linalg.norm(chosen))


def _pelvis(rotation: Array, mirror: float) -> tuple[Array, Array, Array]:
    """Return tilt, obliquity and rotation (T,) deg of the pelvis (T, 3, 3) in the frame forward, up, right; ``mirror``
    -1 for the left side.
    """
    turn = np.arctan2(rotation[:, 0, 2], rotation[:, 2, 2])
    over = -np.arcsin(np.clip(rotation[:, 1, 2], -1.0, 1.0))
    tilt = np.arctan2(rotation[:, 1, 0], rotation[:, 1, 1])
    return -np.degrees(tilt), -mirror * np.degrees(over), mirror * np.degrees(turn)


FEWEST_PEOPLE = 3
"""People without whom there is no band."""
_EVERY = 5
"""% between two values of a band in a file."""


@dataclass(frozen=True, eq=False)
class NormalCurve:
    """One quantity of one kind of cycle over ``people``: ``mean`` and ``sd`` between them (101,) at `PERCENT` in
    ``unit``; both sides together.
    """

    kind: str
    quantity: str
    unit: str
    people: int
    mean: Array
    sd: Array

    def __post_init__(self) -> None:
        freeze(self, f"NormalCurve {self.quantity}", mean=_WHOLE, sd=_WHOLE)


def normal_curves(people: Mapping[str, Sequence[CurveGroup]]) -> tuple[NormalCurve, ...]:
    """Return the bands of all quantities that at least `FEWEST_PEOPLE` have all through the cycle.

    ``people`` by name, with the curves of all their trials; a person's own mean is over trials and sides.
    """
    means: dict[tuple[str, str, str], dict[str, list[Array]]] = {}
    for name, groups in people.items():
        for one in groups:
            means.setdefault((one.kind, one.quantity, one.unit), {}).setdefault(name, []).append(one.mean)
    bands = []
    for (kind, quantity, unit), own in means.items():
        whole = [mean for some in own.values() if np.isfinite(mean := mean_and_sd(np.stack(some))[0]).mean() > 0.9]
        if len(whole) >= FEWEST_PEOPLE:
            bands.append(NormalCurve(kind, quantity, unit, len(whole), *mean_and_sd(np.stack(whole))))
    return tuple(bands)


def normal_toml(bands: Sequence[NormalCurve]) -> list[str]:
    """Return the lines of ``[normal]`` in lab.toml: every fifth per cent; NaN where less than two are known."""
    lines = []
    for one in bands:
        lines += [f'[normal."{one.kind} {one.quantity}"]', f'unit = "{one.unit}"', f"people = {one.people}"]
        for name, values in (("mean", one.mean), ("sd", one.sd)):
            row = [f"{v:.4g}" for v in values[::_EVERY]]
            half = len(row) // 2
            lines += [f"{name} = [{', '.join(row[:half])},", f"  {', '.join(row[half:])}]"]
        lines.append("")
    return lines


def normal_of(raw: Mapping[str, Mapping[str, object]]) -> tuple[NormalCurve, ...]:
    """Return the bands of ``[normal]``, read from a lab.toml.

    Raises
    ------
    KeyError, TypeError, ValueError
        It is not what `normal_toml` writes.
    """
    bands = []
    for name, row in raw.items():
        kind, quantity = name.split(" ")
        mean, sd = (np.interp(PERCENT, PERCENT[::_EVERY], np.asarray(row[key], dtype=float)) for key in ("mean", "sd"))
        bands.append(NormalCurve(kind, quantity, str(row["unit"]), int(str(row["people"])), mean, sd))
    return tuple(bands)

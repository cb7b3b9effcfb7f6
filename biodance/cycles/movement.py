"""What moved in one trial, in one record: events, cycles, curves over each of them, spatio-temporal values; how deep
a squat goes, where the ground presses a foot, and what another program wrote into the same file.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from biodance import display
from biodance.body.body import Body
from biodance.cycles.curves import (
    CurveGroup,
    CycleCurve,
    angle_curves,
    direction_of,
    group_curves,
    lab_curves,
    load_curves,
    over_cycle,
)
from biodance.cycles.cut import (
    PERCENT,
    Cycle,
    Stride,
    agreement_of_events,
    delay_of_nearest,
    foot_events,
    gait_cycles,
    heel_and_toe,
    is_left_out,
    joined_events,
    kinematic_events,
    mean_values,
    repetitions,
    replaced_events,
    strides,
)
from biodance.errors import TrialRefused, UnknownName
from biodance.lab.c3d.subject import FileOutputs
from biodance.motion.contact import Contact, foot_wrenches
from biodance.motion.kinematics import centre_of_mass, poses
from biodance.motion.soles import Soles, soles_from_body
from biodance.records import SIDES, Array, FootEvent, Mask, Motion, Sip, Trial, Wrench
from biodance.settings import STANDARD_GRAVITY
from biodance.spatial import zero_moment_point

if TYPE_CHECKING:
    import pandas as pd


LIFT_UNITS: Mapping[str, str] = {"duration": "s", "depth": "m", "share_right": "%", "force_rise": "%/s"}
"""Quantity of a squat or a rise -> unit."""
_OVER = 0.1
"""s over which the force rises that its rate is told of."""


def lift(
    cycle: Cycle, centre: Array, time: Array, weight: float, feet: Mapping[str, Wrench] | None, sure: Mask
) -> Stride:
    """Return the values of one squat or rise.

    ``depth`` by how much the ``centre`` (T, 3) m of mass goes down and comes up again, the smaller of both for a squat,
    the way up for a rise; ``share_right`` of the vertical force over the repetition; ``force_rise`` the fastest rise of
    the force of both feet over `_OVER` s, % of the ``weight`` N per s. The last two where ``sure`` (T,): both ``feet``
    are known, each on a plate of its own, throughout.
    """
    inside = (time >= cycle.start) & (time <= cycle.end)
    height = centre[inside, 2]
    down, up = height[0] - height.min(), height[-1] - height.min()
    values = {"duration": cycle.duration, "depth": float(min(down, up) if cycle.kind == "squat" else up)}
    if feet is not None and sure[inside].all():
        right, left = (feet[f"{side}_foot"].force[inside, 2] for side in SIDES)
        total, at = right + left, time[inside]
        later = np.minimum(at + _OVER, at[-1])
        values["share_right"] = float(100 * right.sum() / total.sum())
        values["force_rise"] = float(100 * ((np.interp(later, at, total) - total) / _OVER).max() / weight)
    return Stride(cycle, values)


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
    carries = np.where(time > cycle.off, 0.0, 100 / weight)
    shown = np.where(told, carries, np.nan)
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
    return ahead, from_heel[:, 0] * along[:, 1] - from_heel[:, 1] * along[:, 0]


_PLUG_IN_GAIT: Mapping[str, tuple[str, int]] = {
    "pelvis_tilt": ("PelvisAngles", 0),
    "pelvis_obliquity": ("PelvisAngles", 1),
    "pelvis_rotation": ("PelvisAngles", 2),
    "hip_flexion": ("HipAngles", 0),
    "hip_adduction": ("HipAngles", 1),
    "hip_rotation": ("HipAngles", 2),
    "knee_flexion": ("KneeAngles", 0),
    "ankle_dorsiflexion": ("AnkleAngles", 0),
    "foot_progression": ("FootProgressAngles", 2),
}
"""Our angle -> the label (with L or R before it) and component of plug-in gait's, where both have the same positive
sense. Its knee has two more angles, which ours has not; the turn of its foot is that of a line, not of a body.
"""
_AGAINST_LAB = ("PelvisAngles", "FootProgressAngles")
"""What plug-in gait tells against the laboratory's axes."""
_OBLIQUE = 6.0  # deg
_NEAR_EVENT = 0.15  # s within which an event of ours and one of the file are the same
_FEWEST = 20  # Frames without which nothing is compared


@dataclass(frozen=True)
class AngleComparison:
    """One joint angle beside that of the file: ``offset`` deg the mean of ours less the file's, ``sd`` deg of the
    difference about it, ``correlation`` (NaN where one does not move), over ``frames``.
    """

    joint: str
    label: str
    offset: float
    sd: float
    correlation: float
    frames: int


@dataclass(frozen=True)
class EventComparison:
    """Our strikes (``down``) or leavings beside the file's: ``late`` s, the mean of ours less the file's, ``sd`` s over
    ``count`` events; ``missed`` events of the file without one of ours.
    """

    down: bool
    late: float
    sd: float
    count: int
    missed: int


def compare_angles(body: Body, motion: Motion, outputs: FileOutputs) -> tuple[AngleComparison, ...]:
    """Return every angle that both have, over the frames in which both are known."""
    comparisons = []
    for j, joint in enumerate(body.joints):
        side, _, name = joint.name.partition("_")
        label, axis = _PLUG_IN_GAIT.get(name, ("", 0))
        label = f"{side[:1].upper()}{label}"
        theirs = outputs.angles.get(label)
        if name not in _PLUG_IN_GAIT or theirs is None or len(theirs) != motion.time.size:
            continue
        known = motion.determined & np.isfinite(theirs).all(axis=1)
        ours, other = motion.angles[known, j], theirs[known, axis]
        if ours.size < _FEWEST:
            continue
        moves = np.ptp(ours) > 1.0 and np.ptp(other) > 1.0
        correlation = float(np.corrcoef(ours, other)[0, 1]) if moves else float("nan")
        apart, label = ours - other, f"{label} {'xyz'[axis]}"
        mean, sd = float(apart.mean()), float(apart.std())
        comparisons.append(AngleComparison(joint.name, label, mean, sd, correlation, ours.size))
    return tuple(comparisons)


def compare_events(events: tuple[FootEvent, ...], outputs: FileOutputs) -> tuple[EventComparison, ...]:
    """Return how our events lie beside those that the file holds; () where it holds none."""
    comparisons = []
    for down in (True, False):
        delays = [delay_of_nearest(events, one) for one in outputs.events if one.down is down]
        late = [delay for delay in delays if abs(delay) < _NEAR_EVENT]
        if delays:
            mean, sd = (float(np.mean(late)), float(np.std(late))) if late else (np.nan, np.nan)
            comparisons.append(EventComparison(down, mean, sd, len(late), len(delays) - len(late)))
    return tuple(comparisons)


def file_curves(cycle: Cycle, outputs: FileOutputs, time: Array, ours: Sequence[CycleCurve]) -> Iterator[CycleCurve]:
    """Yield plug-in gait's own angles over a gait cycle, under our names, at the frames' ``time`` (T,) s.

    Its pelvis and the turn of its foot are told against one axis of the laboratory, ours against the way that the
    person goes. Where the pelvis of ``ours``, the curves of the same cycle, is turned otherwise by more than
    `_OBLIQUE` on average, they are no curves of the same thing and are left out.
    """
    if cycle.kind != "gait":
        return
    found = []
    for quantity, (label, axis) in _PLUG_IN_GAIT.items():
        theirs = outputs.angles.get(f"{cycle.side[:1].upper()}{label}")
        if theirs is not None and len(theirs) == time.size:
            found.append(over_cycle(cycle, quantity, cycle.side, "deg", time, (theirs[:, axis] + 180) % 360 - 180))
    turned = [[one.value for one in some if one.quantity == "pelvis_rotation"] for some in (ours, found)]
    oblique = not all(turned) or not abs(np.nanmean(turned[1][0] - turned[0][0])) < _OBLIQUE
    yield from (one for one in found if not (oblique and _PLUG_IN_GAIT[one.quantity][0] in _AGAINST_LAB))


_WORDS = {"gait": ("gait cycle", "gait cycles"), "squat": ("squat", "squats"), "sit_to_stand": ("rise", "rises")}


@dataclass(frozen=True, eq=False)
class TrialMovement:
    """What moved in one trial.

    Parameters
    ----------
    trial : str
        Its name.
    events : tuple of FootEvent
        Strikes and leavings of both feet: by hand where session.toml says those of a foot, of the plates where they saw
        one, else of the markers.
    cycles : tuple of Cycle
        Gait cycles of each foot, squats, rises from a chair.
    curves : tuple of CycleCurve
        Angles (deg), moments (N·m/kg) and powers (W/kg) of every cycle over 0 to 100 %, with what the parameters leave
        uncertain in them; pelvis, foot progression and centre of mass.
    strides : tuple of Stride
        Spatio-temporal values of every gait cycle.
    late : tuple
        (n,) s arrays for strikes and leavings: how much later the markers tell them than the plates.
    file_angles, file_events : tuple
        Ours beside those that another program wrote into the same file.
    file_curves : tuple of CycleCurve
        Plug-in gait's own angles over the gait cycles.
    lifts : tuple of Stride
        Depth, force share of the feet and rise of the force of every squat and rise.
    shared : tuple of Cycle
        Gait cycles in which both feet stood on one plate: there the loads of the leg are not known.
    notes : tuple of str
        What a person should know.

    Examples
    --------
    >>> biodance.describe_movement(result)["squat_1"]
    TrialMovement('squat_1': 3 squats)
    """

    trial: str
    events: tuple[FootEvent, ...]
    cycles: tuple[Cycle, ...]
    curves: tuple[CycleCurve, ...]
    strides: tuple[Stride, ...]
    late: tuple[Array, Array]
    file_angles: tuple[AngleComparison, ...] = ()
    file_events: tuple[EventComparison, ...] = ()
    file_curves: tuple[CycleCurve, ...] = ()
    lifts: tuple[Stride, ...] = ()
    shared: tuple[Cycle, ...] = ()
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"TrialMovement({self.trial!r}: {self.told})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), None, self.notes)

    @property
    def name(self) -> str:
        """Name of the trial."""
        return self.trial

    @property
    def told(self) -> str:
        """The repetitions in words."""
        counts = {kind: sum(one.kind == kind for one in self.cycles) for kind in _WORDS}
        return ", ".join(f"{n} {_WORDS[kind][n > 1]}" for kind, n in counts.items() if n) or "no repetition"

    @cached_property
    def groups(self) -> tuple[CurveGroup, ...]:
        """The curves of each quantity and side together, with mean and sd."""
        return group_curves(self.curves)

    def curve(self, quantity: str, side: str = "right") -> CurveGroup:
        """Return all repetitions of one quantity.

        Parameters
        ----------
        quantity : str
            As ``knee_flexion``, ``knee_flexion_moment`` or ``knee_power``.
        side : str
            "right", "left" or "middle".

        Returns
        -------
        CurveGroup
            ``values`` (n, 101), ``mean``, ``sd`` in ``unit``.

        Raises
        ------
        UnknownName
            There is none; the legal names are listed.

        Examples
        --------
        >>> biodance.describe_movement(result)["squat_1"].curve("knee_flexion", "left").unit
        'deg'
        """
        same = [one for one in self.groups if (one.quantity, one.side) == (quantity, side)]
        if not same:
            names = tuple(dict.fromkeys(f"{one.quantity} ({one.side})" for one in self.groups))
            raise UnknownName.of(f"curve of trial {self.trial}", f"{quantity} ({side})", names)
        return same[0]

    def table(self) -> "pd.DataFrame":
        """Return mean and sd of every curve.

        Returns
        -------
        pandas.DataFrame
            One row for each quantity, side and per cent: kind, quantity, side, unit, percent, count, mean, sd,
            parameters_sd.

        Examples
        --------
        >>> biodance.describe_movement(result)["squat_1"].table()["percent"].max()
        100.0
        """
        import pandas as pd

        columns = ["kind", "quantity", "side", "unit", "percent", "count", "mean", "sd", "parameters_sd"]
        rows = [
            (one.kind, one.quantity, one.side, one.unit, float(percent), int(count), *values)
            for one in self.groups
            for percent, count, *values in zip(
                PERCENT, np.isfinite(one.values).sum(axis=0), one.mean, one.sd, one.parameters_sd, strict=True
            )
        ]
        return pd.DataFrame(rows, columns=columns)

    def spatiotemporal(self, side: str = "both") -> dict[str, tuple[float, float, int]]:
        """Return mean, sd and number of the spatio-temporal values.

        Parameters
        ----------
        side : str
            "right", "left" or "both".

        Returns
        -------
        dict
            Name -> (mean, sd, count) in the units of `cycles.cut.STRIDE_UNITS`; {} where nobody walks.

        Examples
        --------
        >>> biodance.describe_movement(result)["squat_1"].spatiotemporal()
        {}
        """
        return mean_values(self.strides, side)


def trial_movement(
    trial: Trial,
    body: Body,
    motion: Motion,
    *,
    sip: Sip | None = None,
    contact: Contact | None = None,
    outputs: FileOutputs | None = None,
) -> TrialMovement:
    """Return what moved in a prepared trial.

    ``sip`` what is known of the inertial parameters (by default the body's), ``contact`` with the plates (None: no
    forces, so that only trunk and arms have moments), ``outputs`` of another program in the trial's file.

    Raises
    ------
    TrialRefused
        The body has no two feet, or the trial less than three frames.
    """
    if motion.time.size < 3:
        raise TrialRefused(f"Trial {trial.name}: has {motion.time.size} frames, which hold no movement.")
    soles = soles_from_body(body, motion)
    markers, force = kinematic_events(body, motion), tuple[FootEvent, ...]()
    feet = foot_wrenches(trial, contact, soles) if contact is not None else None
    if contact is not None and feet is not None:
        force = foot_events(feet, contact)
    events = replaced_events(joined_events(force, markers) if markers else (), trial.events)
    found = (*gait_cycles(trial.name, events), *repetitions(trial.name, body, motion, soles))
    cycles = tuple(one for one in found if not is_left_out(one, trial.left_out))
    centre, weight = centre_of_mass(body, motion), STANDARD_GRAVITY * float(body.sip.mass.sum())
    sure = _fully_measured(contact, motion.time.size)
    curves, theirs = list[CycleCurve](), list[CycleCurve]()
    for cycle in cycles:
        own = [*angle_curves(cycle, body, motion), *lab_curves(cycle, body, motion, soles)]
        curves += own
        theirs += file_curves(cycle, outputs, motion.time, own) if outputs else ()
        if contact is not None and feet is not None:
            known = _known_loads(cycle, contact)
            curves += load_curves(cycle, body, sip or body.sip, motion, feet, known)
            curves += ground_curves(cycle, body, motion, soles, feet, known)
    return TrialMovement(
        trial.name,
        events,
        cycles,
        tuple(curves),
        strides(cycles, events, body, soles, centre),
        agreement_of_events(force, markers),
        compare_angles(body, motion, outputs) if outputs else (),
        compare_events(events, outputs) if outputs else (),
        tuple(theirs),
        tuple(lift(one, centre, motion.time, weight, feet, sure) for one in cycles if one.kind != "gait"),
        tuple(one for one in cycles if one.kind == "gait" and _on_one_plate(one, contact)),
        _notes(cycles, contact),
    )


def _on_one_plate(cycle: Cycle, contact: Contact | None) -> bool:
    """Return whether both feet were on one plate at some time of a cycle."""
    return contact is not None and bool((_shared(contact) & _inside(cycle, contact)).any())


def _known_loads(cycle: Cycle, contact: Contact) -> Mask:
    """Return (T, 2) where the force under each foot counts; in gait not while both feet are on one plate."""
    return contact.told & ~_shared(contact)[:, None] if cycle.kind == "gait" else contact.told


def _fully_measured(contact: Contact | None, frames: int) -> Mask:
    """Return (T,) where the plates tell the force under each foot; nowhere without plates."""
    return np.zeros(frames, dtype=bool) if contact is None else contact.told.all(axis=1) & ~_shared(contact)


def _shared(contact: Contact) -> Mask:
    """Return (T,) where both feet are on one plate."""
    return np.asarray(np.all(contact.on_plate, axis=1).any(axis=1))


def _inside(cycle: Cycle, contact: Contact) -> Mask:
    return np.asarray((contact.time >= cycle.start) & (contact.time <= cycle.end))


def _notes(cycles: Sequence[Cycle], contact: Contact | None) -> tuple[str, ...]:
    if not cycles:
        return ("No step, no squat and no rise from a chair was found, so there are no cycles.",)
    if contact is None:
        return ("No force plate tells what the ground does, so there are no moments and powers.",)
    standing = [_inside(one, contact) for one in cycles if one.kind != "gait"]
    if standing and np.any(_shared(contact) & np.any(standing, axis=0)):
        return (
            "Both feet stood on one plate: what each of them carried is an estimate from the centre of pressure, so a "
            "difference between left and right moments is not measured.",
        )
    return ()

"""Which steps and repetitions does a trial hold, and what do the joints do in each of them.

Events of the feet (from forces and from the tracked body), cycles from 0 to 100 %, curves over them with mean and sd,
moments and powers with what the parameters leave uncertain, spatio-temporal values, and all of it beside what another
program wrote into the same file.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from biodance import display
from biodance.body.body import Body
from biodance.body.human.conventional import ConventionalModel
from biodance.cycles import cut
from biodance.cycles.curves import (
    CurveGroup,
    CycleCurve,
    angle_curves,
    direction_of,
    ground_curves,
    group_curves,
    lab_curves,
    load_curves,
    over_cycle,
)
from biodance.cycles.pelvis import with_own_pelvis
from biodance.cycles.strides import Stride, lift, mean_values, strides
from biodance.errors import TrialRefused, UnknownName
from biodance.lab.c3d.subject import NO_OUTPUTS, FileOutputs
from biodance.motion.contact import Contact, foot_wrenches
from biodance.motion.kinematics import centre_of_mass, poses
from biodance.motion.soles import Soles, soles_from_body
from biodance.records import SIDES, Array, FootEvent, Mask, Motion, Plate, Sip, Trial, Wrench
from biodance.settings import STANDARD_GRAVITY

if TYPE_CHECKING:
    import pandas as pd

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
EMG = "_emg"
"""Ending of a quantity that is the activity of a muscle."""
_AGAINST_LAB = ("PelvisAngles", "FootProgressAngles")
"""What plug-in gait tells against the laboratory's axes."""
_OBLIQUE = 6.0  # deg
_X = np.array([1.0, 0.0])


@dataclass(frozen=True)
class AngleComparison:
    """One joint angle beside that of the file: ``offset`` deg the mean of ours less the file's, ``sd`` deg of the
    difference about it, ``correlation`` (NaN where one does not move), over ``frames``; ``conventional`` deg the RMS
    difference of the conventional gait model, computed here from the same markers, to the file's (NaN without one).
    """

    joint: str
    label: str
    offset: float
    sd: float
    correlation: float
    frames: int
    conventional: float = float("nan")


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


def emg_curves(cycle: cut.Cycle, outputs: FileOutputs) -> Iterator[CycleCurve]:
    """Yield the envelopes of a cycle's own leg, of both in a squat, a rise or a jump, as ``soleus_emg``."""
    for one in outputs.emg:
        inside = one.time[0] <= cycle.start and cycle.end <= one.time[-1]
        if inside and cycle.side in (one.side, "both"):
            yield over_cycle(cycle, f"{one.muscle}{EMG}", one.side, one.unit, one.time, one.value)


def compare_angles(
    body: Body, motion: Motion, outputs: FileOutputs, conventional: ConventionalModel | None = None
) -> tuple[AngleComparison, ...]:
    """Return every angle that both have, over the frames in which both are known."""
    comparisons, here = [], {side: conventional.angles(side, _X) for side in SIDES} if conventional else {}
    for j, joint in enumerate(body.joints):
        side, _, name = joint.name.partition("_")
        label, axis = _PLUG_IN_GAIT.get(name, ("", 0))
        label = f"{side[:1].upper()}{label}"
        theirs = outputs.angles.get(label)
        if name not in _PLUG_IN_GAIT or theirs is None or len(theirs) != motion.time.size:
            continue
        known = motion.determined & np.isfinite(theirs).all(axis=1)
        ours, other = motion.angles[known, j], theirs[known, axis]
        # Fewer than twenty frames are not compared.
        if ours.size < 20:
            continue
        moves = np.ptp(ours) > 1.0 and np.ptp(other) > 1.0
        # The correlation of an angle that does not move is noise.
        correlation = float(np.corrcoef(ours, other)[0, 1]) if moves else float("nan")
        apart, label = ours - other, f"{label} {'xyz'[axis]}"
        mean, sd, rms = float(apart.mean()), float(apart.std()), float("nan")
        if here:
            rms = float(np.sqrt(np.nanmean((here[side][name][known] - other) ** 2)))
        comparisons.append(AngleComparison(joint.name, label, mean, sd, correlation, ours.size, rms))
    return tuple(comparisons)


def compare_events(events: tuple[FootEvent, ...], outputs: FileOutputs) -> tuple[EventComparison, ...]:
    """Return how our events lie beside those that the file holds; () where it holds none."""
    comparisons = []
    for down in (True, False):
        delays = [cut.delay_of_nearest(events, one) for one in outputs.events if one.down is down]
        # 0.15 s within which an event of ours and one of the file are the same
        late = [delay for delay in delays if abs(delay) < 0.15]
        if delays:
            mean, sd = (float(np.mean(late)), float(np.std(late))) if late else (np.nan, np.nan)
            comparisons.append(EventComparison(down, mean, sd, len(late), len(delays) - len(late)))
    return tuple(comparisons)


def file_curves(
    cycle: cut.Cycle, outputs: FileOutputs, time: Array, ours: Sequence[CycleCurve]
) -> Iterator[CycleCurve]:
    """Yield plug-in gait's own angles over a gait cycle, under our names, at the frames' ``time`` (T,) s.

    Its pelvis and the turn of its foot are told against one axis of the laboratory, ours against the way that the
    person goes. Where the pelvis of ``ours``, the curves of the same cycle, is turned otherwise by more than
    `_OBLIQUE` on average, they are no curves of the same thing and are left out.
    """
    named = {name: (outputs.angles.get(f"{cycle.side[:1].upper()}{of}"), k) for name, (of, k) in _PLUG_IN_GAIT.items()}
    told = {name: some[:, k] for name, (some, k) in named.items() if some is not None and len(some) == time.size}
    yield from _beside(cycle, told, time, ours)


def _beside(
    cycle: cut.Cycle, angles: Mapping[str, Array], time: Array, ours: Sequence[CycleCurve]
) -> Iterator[CycleCurve]:
    """Yield ``angles`` (T,) deg by quantity over a gait cycle, as far as they are of the same thing as ``ours``."""
    if cycle.kind != "gait":
        return
    # Wrapped to [-180, 180).
    wrapped = {name: (angle + 180) % 360 - 180 for name, angle in angles.items()}
    theirs = [over_cycle(cycle, name, cycle.side, "deg", time, angle) for name, angle in wrapped.items()]
    # Mean over the cycle of theirs less ours.
    turned = [[one.value for one in some if one.quantity == "pelvis_rotation"] for some in (ours, theirs)]
    oblique = not all(turned) or not abs(np.nanmean(turned[1][0] - turned[0][0])) < _OBLIQUE
    yield from (one for one in theirs if not (oblique and _PLUG_IN_GAIT[one.quantity][0] in _AGAINST_LAB))


def conventional_curves(
    cycle: cut.Cycle, conventional: ConventionalModel | None, body: Body, motion: Motion, ours: Sequence[CycleCurve]
) -> Iterator[CycleCurve]:
    """Yield the angles of the conventional gait model over a gait cycle, under our names.

    Pelvis and foot against the axis of the laboratory that lies nearest to the way of the cycle, as plug-in gait has
    them, and left out as those of a file are (`file_curves`), beside ``ours``.
    """
    if conventional is None or cycle.kind != "gait":
        return
    part = cycle.frames(motion.time)
    time = motion.time[part]
    way = direction_of(cycle, poses(body, motion.q[part]), time)
    axis = int(np.argmax(np.abs(way)))
    angles = conventional.angles(cycle.side, np.sign(way[axis]) * np.eye(2)[axis], part)
    yield from _beside(cycle, angles, time, ours)


_WORDS = {
    "gait": ("gait cycle", "gait cycles"),
    "squat": ("squat", "squats"),
    "sit_to_stand": ("rise", "rises"),
    "jump": ("jump", "jumps"),
}


@dataclass(frozen=True, eq=False)
class TrialMovement:
    """What moved in one ``trial`` (its name).

    ``events`` strikes and leavings of both feet: by hand where session.toml says those of a foot, of the plates where
    they saw one, else of the markers; ``cycles`` of each foot, squats, rises from a chair, jumps; ``curves`` of every
    cycle over 0 to 100 %: angles (deg), moments (N·m/kg) and powers (W/kg) with what the parameters leave uncertain in
    them, pelvis, foot progression and centre of mass, envelopes of EMG channels (mV); ``strides`` spatio-temporal
    values of every gait cycle; ``late`` (n,) s for strikes and for leavings: how much later the markers tell them than
    the plates; ``file_angles``, ``file_events`` ours beside those that another program wrote into the same file;
    ``file_curves`` plug-in gait's own angles over the gait cycles, ``conventional_curves`` the same of the conventional
    gait model, computed here from the markers; ``lifts`` depth, height, force share of the feet and
    rise of the force of every squat, rise and jump; ``shared`` gait cycles in which both feet stood on one plate (there
    the loads of the leg are not known); ``notes`` what a person should know.

    Examples
    --------
    >>> biodance.describe_movement(result)["squat_1"]
    TrialMovement('squat_1': 3 squats)
    """

    trial: str
    events: tuple[FootEvent, ...]
    cycles: tuple[cut.Cycle, ...]
    curves: tuple[CycleCurve, ...]
    strides: tuple[Stride, ...]
    late: tuple[Array, Array]
    file_angles: tuple[AngleComparison, ...] = ()
    file_events: tuple[EventComparison, ...] = ()
    file_curves: tuple[CycleCurve, ...] = ()
    conventional_curves: tuple[CycleCurve, ...] = ()
    lifts: tuple[Stride, ...] = ()
    shared: tuple[cut.Cycle, ...] = ()
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

        groups, each = self.groups, len(cut.PERCENT)
        about = {name: [getattr(one, name) for one in groups] for name in ("kind", "quantity", "side", "unit")}
        columns = {name: np.repeat(np.array(some, dtype=object), each) for name, some in about.items()}
        columns["percent"] = np.tile(cut.PERCENT, len(groups))
        columns["count"] = np.array([np.isfinite(one.values).sum(axis=0) for one in groups], dtype=int).ravel()
        for name in ("mean", "sd", "parameters_sd"):
            columns[name] = np.array([getattr(one, name) for one in groups], dtype=float).ravel()
        return pd.DataFrame(columns)

    def spatiotemporal(self, side: str = "both") -> dict[str, tuple[float, float, int]]:
        """Return mean, sd and number of the spatio-temporal values.

        Parameters
        ----------
        side : str
            "right", "left" or "both".

        Returns
        -------
        dict
            Name -> (mean, sd, count) in the units of `cycles.strides.STRIDE_UNITS`; {} where nobody walks.

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
    outputs: FileOutputs = NO_OUTPUTS,
    conventional: ConventionalModel | None = None,
) -> TrialMovement:
    """Return what moved in a prepared trial.

    ``sip`` what is known of the inertial parameters (by default the body's), ``contact`` with the plates (None: no
    forces, so that only trunk and arms have moments), ``outputs`` of other programs in the trial's file,
    ``conventional`` the conventional gait model on its markers.

    Raises
    ------
    TrialRefused
        The body has no two feet, or the trial less than three frames.
    """
    if motion.time.size < 3:
        raise TrialRefused(f"Trial {trial.name}: has {motion.time.size} frames, which hold no movement.")
    soles = soles_from_body(body, motion)
    feet, with_peaks = _on_feet(trial, contact, soles)
    force = cut.foot_events(feet, contact, trial.plates) if contact is not None and feet is not None else ()
    markers = cut.that_may_touch(cut.kinematic_events(body, motion), contact)
    events = cut.replaced_events(cut.joined_events(force, markers) if markers else (), trial.events)
    centre, weight = centre_of_mass(body, motion), STANDARD_GRAVITY * float(body.sip.mass.sum())
    known_of_feet, shared = _known_feet(contact, trial.plates, motion.time.size)
    jumped = cut.jumps(trial.name, motion, soles, centre, feet, known_of_feet, trial.plates)
    lifts = (one for one in cut.repetitions(trial.name, body, motion, soles) if not any(map(one.near, jumped)))
    found = (*cut.gait_cycles(trial.name, events), *lifts, *jumped)
    cycles = tuple(one for one in found if not cut.is_left_out(one, trial.left_out))
    whole = np.asarray(known_of_feet.all(axis=1))
    sure = whole & ~shared
    on_one = [one for one in cycles if shared[(motion.time >= one.start) & (motion.time <= one.end)].any()]
    shown = with_own_pelvis(trial, body, motion)
    curves, theirs, usual = list[CycleCurve](), list[CycleCurve](), list[CycleCurve]()
    for cycle in cycles:
        own = [*angle_curves(cycle, body, shown), *lab_curves(cycle, body, shown, soles, centre)]
        curves += own
        theirs += file_curves(cycle, outputs, motion.time, own)
        usual += conventional_curves(cycle, conventional, body, motion, own)
        curves += emg_curves(cycle, outputs)
        if feet is not None:
            # in gait the force under a foot does not count while both are on one plate
            known = known_of_feet & ~shared[:, None] if cycle.kind == "gait" else known_of_feet
            curves += load_curves(cycle, body, sip or body.sip, motion, feet, known)
            curves += ground_curves(cycle, body, motion, soles, with_peaks, known)
    return TrialMovement(
        trial.name,
        events,
        cycles,
        tuple(curves),
        strides(cycles, events, body, soles, centre),
        cut.agreement_of_events(force, markers),
        compare_angles(body, shown, outputs, conventional),
        compare_events(events, outputs),
        tuple(theirs),
        tuple(usual),
        tuple(lift(one, centre, motion.time, weight, feet, sure, whole) for one in cycles if one.kind != "gait"),
        tuple(one for one in on_one if one.kind == "gait"),
        _notes(cycles, on_one, contact),
    )


def _on_feet(trial: Trial, contact: Contact | None, soles: Soles) -> tuple[dict[str, Wrench] | None, dict[str, Wrench]]:
    """Return the wrenches on both feet for joint moments, and with their peaks (`Plate.peaks`); None and none without
    plates.
    """
    if contact is None:
        return None, {}
    mild = tuple(replace(one, wrench=one.peaks or one.wrench) for one in trial.plates)
    return foot_wrenches(trial, contact, soles), foot_wrenches(replace(trial, plates=mild), contact, soles)


def _known_feet(contact: Contact | None, plates: Sequence[Plate], frames: int) -> tuple[Mask, Mask]:
    """Return (T, 2) where the plates tell the force under each foot, nowhere without plates; and (T,) where both feet
    may be on one plate.
    """
    if contact is None:
        return np.zeros((frames, 2), dtype=bool), np.zeros(frames, dtype=bool)
    return contact.told, cut.under_both_feet(contact, plates)


def _notes(cycles: Sequence[cut.Cycle], on_one: Sequence[cut.Cycle], contact: Contact | None) -> tuple[str, ...]:
    """Return what a person should know of the ``cycles``, of which ``on_one`` had both feet on one plate."""
    if not cycles:
        return ("No step, no squat, no rise from a chair and no jump was found, so there are no cycles.",)
    if contact is None:
        return ("No force plate tells what the ground does, so there are no moments and powers.",)
    if any(one.kind != "gait" for one in on_one):
        return (
            "Both feet stood on one plate: what each of them carried is an estimate from the centre of pressure, so a "
            "difference between left and right moments is not measured.",
        )
    return ()

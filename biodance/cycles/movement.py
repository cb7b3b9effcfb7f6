"""What moved in one trial: events, cycles, curves over each of them, spatio-temporal values, all in one record."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from biodance import display
from biodance.body.body import Body
from biodance.cycles import cut
from biodance.cycles.beside import (
    AngleComparison,
    EventComparison,
    compare_angles,
    compare_events,
    emg_curves,
    file_curves,
)
from biodance.cycles.curves import (
    CurveGroup,
    CycleCurve,
    angle_curves,
    ground_curves,
    group_curves,
    lab_curves,
    load_curves,
)
from biodance.cycles.lifts import jumps, lift
from biodance.cycles.strides import Stride, mean_values, strides
from biodance.errors import TrialRefused, UnknownName
from biodance.lab.c3d.subject import NO_OUTPUTS, FileOutputs
from biodance.motion.contact import Contact, foot_wrenches
from biodance.motion.kinematics import centre_of_mass
from biodance.motion.soles import soles_from_body
from biodance.records import Array, FootEvent, Mask, Motion, Sip, Trial
from biodance.settings import STANDARD_GRAVITY

if TYPE_CHECKING:
    import pandas as pd

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
    ``file_curves`` plug-in gait's own angles over the gait cycles; ``lifts`` depth, height, force share of the feet and
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

        columns = ["kind", "quantity", "side", "unit", "percent", "count", "mean", "sd", "parameters_sd"]
        rows = [
            (one.kind, one.quantity, one.side, one.unit, float(percent), int(count), *values)
            for one in self.groups
            for percent, count, *values in zip(
                cut.PERCENT, np.isfinite(one.values).sum(axis=0), one.mean, one.sd, one.parameters_sd, strict=True
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
) -> TrialMovement:
    """Return what moved in a prepared trial.

    ``sip`` what is known of the inertial parameters (by default the body's), ``contact`` with the plates (None: no
    forces, so that only trunk and arms have moments), ``outputs`` of other programs in the trial's file.

    Raises
    ------
    TrialRefused
        The body has no two feet, or the trial less than three frames.
    """
    if motion.time.size < 3:
        raise TrialRefused(f"Trial {trial.name}: has {motion.time.size} frames, which hold no movement.")
    soles = soles_from_body(body, motion)
    feet = foot_wrenches(trial, contact, soles) if contact is not None else None
    force = cut.foot_events(feet, contact) if contact is not None and feet is not None else ()
    markers = cut.kinematic_events(body, motion)
    events = cut.replaced_events(cut.joined_events(force, markers) if markers else (), trial.events)
    centre, weight = centre_of_mass(body, motion), STANDARD_GRAVITY * float(body.sip.mass.sum())
    known_of_feet, shared = _known_feet(contact, motion.time.size)
    jumped = jumps(trial.name, motion, soles, centre, feet, known_of_feet)
    lifts = (one for one in cut.repetitions(trial.name, body, motion, soles) if not any(map(one.near, jumped)))
    found = (*cut.gait_cycles(trial.name, events), *lifts, *jumped)
    cycles = tuple(one for one in found if not cut.is_left_out(one, trial.left_out))
    whole = np.asarray(known_of_feet.all(axis=1))
    sure = whole & ~shared
    on_one = [one for one in cycles if shared[(motion.time >= one.start) & (motion.time <= one.end)].any()]
    curves, theirs = list[CycleCurve](), list[CycleCurve]()
    for cycle in cycles:
        own = [*angle_curves(cycle, body, motion), *lab_curves(cycle, body, motion, soles)]
        curves += own
        theirs += file_curves(cycle, outputs, motion.time, own)
        curves += emg_curves(cycle, outputs)
        if feet is not None:
            # in gait the force under a foot does not count while both are on one plate
            known = known_of_feet & ~shared[:, None] if cycle.kind == "gait" else known_of_feet
            curves += load_curves(cycle, body, sip or body.sip, motion, feet, known)
            curves += ground_curves(cycle, body, motion, soles, feet, known)
    return TrialMovement(
        trial.name,
        events,
        cycles,
        tuple(curves),
        strides(cycles, events, body, soles, centre),
        cut.agreement_of_events(force, markers),
        compare_angles(body, motion, outputs),
        compare_events(events, outputs),
        tuple(theirs),
        tuple(lift(one, centre, motion.time, weight, feet, sure, whole) for one in cycles if one.kind != "gait"),
        tuple(one for one in on_one if one.kind == "gait"),
        _notes(cycles, on_one, contact),
    )


def _known_feet(contact: Contact | None, frames: int) -> tuple[Mask, Mask]:
    """Return (T, 2) where the plates tell the force under each foot, nowhere without plates; and (T,) where both feet
    are on one plate.
    """
    if contact is None:
        return np.zeros((frames, 2), dtype=bool), np.zeros(frames, dtype=bool)
    return contact.told, np.asarray(np.all(contact.on_plate, axis=1).any(axis=1))


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

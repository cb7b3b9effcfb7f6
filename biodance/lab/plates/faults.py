"""What can be wrong with an installed plate, each fault as one object: what the plate reads instead of the wrench that
is there, and its inverse; and what a laboratory once accepted of it, with the recordings without it: ``[corrections]``
in lab.toml.

    [corrections.plate_position."plate1:x"]
    shift = 0.0301                       # m, as the diagnosis named it
    sd = 0.0012
    source = "session S1"

Every correction is exact and needs the recording alone: neither body nor movement. Signs as in `effects`: the value is
what the plate does wrong.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeGuard

import numpy as np

from biodance.errors import FileRefused
from biodance.library import read_toml
from biodance.records import CHANNELS, Array, Plate, Session, Trial, Wrench
from biodance.spatial import axis_rotation, skew, wrench_shift

_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class PlateFault:
    """One fault of a plate: ``name`` of its effect, ``parameter`` and ``unit`` of its size, and whether it is
    ``lasting``: stays with a laboratory from one session to the next; ``legal`` sizes: beyond them the plate
    reads another unit, or is another plate, which no correction mends; ``places`` where on a plate it can be;
    ``of_plate`` whether a target must name its plate, too.

    With a fault of some size at a place (a channel ``Fz``, a pair ``Fz->My``, an axis ``x``) a plate reads ``mixing`` @
    wrench + size ``zero``, about its centre (N, N·m).
    """

    name: str
    parameter: str
    unit: str
    legal: tuple[float, float]
    lasting: bool = True
    places: tuple[str, ...] = CHANNELS
    of_plate: bool = False

    def slope(self, place: str) -> Array:
        """Return (6, 6), the change of ``mixing`` per unit of a small size."""
        return np.zeros((6, 6))

    def zero(self, place: str) -> Array:
        """Return (6,) what is read per unit of size whatever is there."""
        return np.zeros(6)

    def mixing(self, place: str, size: float) -> Array:
        """Return (6, 6), what is read per unit of what is there."""
        return np.eye(6) + size * self.slope(place)

    def corners(self, plate: Plate, place: str, size: float) -> Array:
        """Return (4, 3) m, where the file puts the corners."""
        return plate.corners

    def inverse(self, size: float) -> float:
        """Return the size of the same fault that undoes one of ``size``."""
        return -size

    def joined(self, first: float, second: float) -> float:
        """Return the size of a fault whose ``second`` part was found in recordings freed from the ``first``."""
        return first + second

    def done(self, plate: Plate, place: str, size: float) -> Plate:
        """Return what a sound ``plate`` would have recorded with the fault."""
        back = wrench_shift(-plate.centre)
        # To the centre, the fault there, and back about the lab's origin.
        mixing = back @ self.mixing(place, size) @ wrench_shift(plate.centre)
        value = plate.wrench.value @ mixing.T + size * back @ self.zero(place)
        value.setflags(write=False)  # the record keeps it without a copy
        return replace(plate, wrench=Wrench(plate.wrench.time, value), corners=self.corners(plate, place, size))

    def undone(self, plate: Plate, place: str, size: float) -> Plate:
        """Return what a ``plate`` with the fault would have recorded without it."""
        return self.done(plate, place, self.inverse(size))

    def is_target(self, target: str) -> bool:
        """Return whether ``target`` names a place of this fault, with or without its plate."""
        return (":" in target or not self.of_plate) and target.rpartition(":")[2] in self.places


class _Position(PlateFault):
    """The file puts the plate ``size`` m along an axis beside where it is: M = shift x F."""

    def slope(self, place: str) -> Array:
        # Block (moment, force): shift x F.
        return np.asarray(np.kron([[0.0, 0.0], [1.0, 0.0]], skew(_unit(place))), dtype=float)

    def corners(self, plate: Plate, place: str, size: float) -> Array:
        return plate.corners + size * _unit(place)


class _Rotation(PlateFault):
    """What is recorded is turned by ``size`` rad about an axis through the plate's centre, as its corners are."""

    def slope(self, place: str) -> Array:
        # Turned by a small angle both vectors change by angle e x themselves.
        return np.asarray(np.kron(np.eye(2), skew(_unit(place))), dtype=float)

    def mixing(self, place: str, size: float) -> Array:
        return np.asarray(np.kron(np.eye(2), _turn(place, size)), dtype=float)

    def corners(self, plate: Plate, place: str, size: float) -> Array:
        return plate.centre + (plate.corners - plate.centre) @ _turn(place, size).T


class _Gain(PlateFault):
    """A channel reads (1 + ``size``) times what is there."""

    def slope(self, place: str) -> Array:
        return np.diag(_channel(place))

    def inverse(self, size: float) -> float:
        # (1 + s)(1 - s / (1 + s)) = 1.
        return -size / (1 + size)

    def joined(self, first: float, second: float) -> float:
        # Factors multiply: the second was found behind the first.
        return (1 + first) * (1 + second) - 1


class _Crosstalk(PlateFault):
    """A channel reads ``size`` times another one in addition."""

    def slope(self, place: str) -> Array:
        first, _, second = place.partition("->")
        # Row of the second, column of the first channel; its square is zero, so -size undoes size exactly.
        return np.outer(_channel(second), _channel(first))


class _Offset(PlateFault):
    """A channel reads ``size`` when nobody is on the plate."""

    def zero(self, place: str) -> Array:
        return _channel(place)


class _Delay(PlateFault):
    """All that the plate reads comes ``size`` s late."""

    def done(self, plate: Plate, place: str, size: float) -> Plate:
        return replace(plate, wrench=Wrench(plate.wrench.time + size, plate.wrench.value))

    def is_target(self, target: str) -> bool:
        return not target


def _unit(place: str) -> Array:
    return np.eye(3)[_AXES.index(place)]


def _turn(place: str, angle: float) -> Array:
    return np.asarray(axis_rotation(_unit(place), np.array([angle]))[0])


def _channel(place: str) -> Array:
    return np.eye(6)[CHANNELS.index(place)]


POSITION = _Position("plate_position", "shift", "m", (-10.0, 10.0), places=_AXES, of_plate=True)
ROTATION = _Rotation("plate_rotation", "angle", "rad", (-np.pi, np.pi), places=_AXES, of_plate=True)
GAIN = _Gain("plate_gain", "gain", "1", (-0.5, 1.0))
_PAIRS = tuple(f"{a}->{b}" for a in CHANNELS for b in CHANNELS if a != b)
CROSSTALK = _Crosstalk("plate_crosstalk", "ratio", "1", (-1.0, 1.0), places=_PAIRS)
OFFSET = _Offset("plate_offset", "offset", "N or N·m", (-2e4, 2e4), lasting=False)
DELAY = _Delay("time_delay", "delay", "s", (-10.0, 10.0), places=("",))
PLATE_FAULTS: Mapping[str, PlateFault] = MappingProxyType(
    {one.name: one for one in (POSITION, ROTATION, GAIN, CROSSTALK, OFFSET, DELAY)}
)
"""By name. What an offset was today it is not tomorrow; all else is lasting."""


APPLIED = "corrected.toml"
"""File in a folder of corrected trials that says what was corrected already."""


@dataclass(frozen=True)
class PlateCorrection:
    """One accepted cause: ``effect`` at ``target`` of size ``value`` with ``sd``, in the unit of its parameter (m, rad,
    1, s, N or N·m); ``source`` in words: where it was found; ``trials`` it is in (() = all).
    """

    effect: str
    target: str
    value: float
    sd: float = float("nan")
    source: str = ""
    trials: tuple[str, ...] = ()

    def __str__(self) -> str:
        name = f"{self.effect} {self.target}".replace("_", " ").strip()
        # a channel of forces or of moments has one of two units
        unit = self.fault.unit.split(" or ")[-1 if self.target.rpartition(":")[2].startswith("M") else 0]
        return f"{name} ({self.fault.parameter} {self.value:.3g} {unit})".replace(" 1)", ")")

    @property
    def fault(self) -> PlateFault:
        """What it corrects."""
        return PLATE_FAULTS[self.effect]

    def of(self, plate: Plate, trial: Trial) -> bool:
        """Return whether a ``plate`` of a ``trial`` is meant; a target without a plate means the only one, a delay all
        of them. A zero that was read from the empty plate is off already.
        """
        if (self.trials and trial.name not in self.trials) or (self.fault is OFFSET and plate.tared):
            return False
        named, colon, _ = self.target.partition(":")
        return plate.name == named if colon else self.fault is DELAY or len(trial.plates) == 1


def _free(plate: Plate, one: PlateCorrection) -> Plate:
    """Return a plate as it would have recorded without the cause, at the same times."""
    free = one.fault.undone(plate, one.target.rpartition(":")[2], one.value)
    time, moved = plate.wrench.time, free.wrench.time
    # Only a delay moves the times; all else is done.
    if moved is time:
        return free
    from scipy.interpolate import make_interp_spline

    value = free.wrench.value
    known = np.isfinite(value).all(axis=1)
    if not known.any():
        return plate
    # The free samples, at their own times, read at the times of the record.
    spline = make_interp_spline(moved[known], value[known], k=min(3, int(known.sum()) - 1))
    there = np.clip(time, *moved[known][[0, -1]])
    # Between a known and an unknown sample the interpolated mark is above zero.
    beside = np.interp(there, moved, np.logical_not(known)) > 0
    return replace(plate, wrench=Wrench(time, np.where(beside[:, None], np.nan, spline(there))))


def corrected_trial(trial: Trial, corrections: Iterable[PlateCorrection]) -> Trial:
    """Return a trial as read, with its plates as they would have recorded without the causes."""
    plates, said = list(trial.plates), []
    for one in corrections:
        meant = [k for k, plate in enumerate(plates) if one.of(plate, trial)]
        for k in meant:
            plates[k] = _free(plates[k], one)
        said += [f"Corrected: {one}, {one.source or 'from lab.toml'}."] * bool(meant)
    return replace(trial, plates=tuple(plates), history=(*trial.history, *said))


def correction_doubts(trial: Trial, corrections: Iterable[PlateCorrection]) -> Array:
    """Return what one standard deviation more of each of n ``corrections`` takes off the wrench of a ``trial`` that was
    corrected for them, (T, 6, n) N, N·m about the lab origin; zero where it says nothing, or its sd is not known.
    """
    found, plain = [], trial.wrench.value
    for one in corrections:
        more = corrected_trial(trial, [replace(one, value=one.sd)]) if np.isfinite(one.sd) else trial
        # By how much the corrected wrench changes when one standard deviation more is taken off.
        found.append(np.nan_to_num(plain - more.wrench.value))
    return np.stack(found, axis=2) if found else np.zeros((*plain.shape, 0))


def corrected_session(session: Session, corrections: tuple[PlateCorrection, ...]) -> Session:
    """Return a session as read with its laboratory's corrections made, but not those that it has (`APPLIED`)."""
    path = session.folder / APPLIED
    done = {(one.effect, one.target) for one in read_corrections(path)} if path.is_file() else set()
    told = [line for trial in session.trials for line in trial.history]
    made = (one for one in corrections if any(line.startswith(f"Corrected: {one}") for line in told))
    done |= {(one.effect, one.target) for one in made}
    asked = tuple(one for one in corrections if (one.effect, one.target) not in done)
    again = [one for one in corrections if (one.effect, one.target) in done]
    said = [f"Corrected as lab.toml says: {one}." for one in asked]
    said += [f"Not corrected again, these recordings have it already: {one}." for one in again]
    trials = tuple(corrected_trial(trial, asked) for trial in session.trials)
    return replace(session, trials=trials, notes=(*session.notes, *said))


def read_corrections(path: str | Path) -> tuple[PlateCorrection, ...]:
    """Return what ``[corrections]`` of a lab.toml says, in its order; () where there is none.

    Raises
    ------
    FileRefused
        The file cannot be read, is not TOML, or names a cause, a target or a value that cannot be corrected.
    """
    found = read_toml(Path(path)).get("corrections", {})
    if not isinstance(found, dict):
        raise FileRefused(f"{path}: corrections = {found!r}; expected tables [corrections.CAUSE.TARGET].")
    return tuple(
        _correction(path, effect, target, said)
        for effect, targets in found.items()
        for target, said in (targets.items() if isinstance(targets, dict) else [("", targets)])
    )


def _is_number(value: object) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _correction(path: str | Path, effect: str, target: str, said: Any) -> PlateCorrection:
    where = f"{path}: [corrections.{effect}.{target!r}]"
    if effect not in PLATE_FAULTS:
        raise FileRefused(f"{where} is nothing that can be corrected. Legal causes: {', '.join(PLATE_FAULTS)}.")
    fault = PLATE_FAULTS[effect]
    name = fault.parameter
    value = said.get(name) if isinstance(said, dict) else None
    low, high = fault.legal
    if not _is_number(value) or not low <= value <= high:
        raise FileRefused(f"{where} {name} = {value!r}; expected a number in {fault.unit}, {low:g} to {high:g}.")
    sd = said.get("sd", np.nan)
    if not (_is_number(sd) and (np.isnan(sd) or 0 <= sd <= high - low)):
        raise FileRefused(f"{where} sd = {sd!r}; expected a number in {fault.unit}, 0 to {high - low:g}.")
    if not fault.is_target(target):
        legal = "plate1:x" if fault in (POSITION, ROTATION) else "Fz, plate1:Fz or Fz->My"
        raise FileRefused(f"{where} has no such target. Expected for example {legal}.")
    return PlateCorrection(effect, target, float(value), float(sd), str(said.get("source", "")))


def corrections_text(corrections: Iterable[PlateCorrection]) -> str:
    """Return the tables ``[corrections]`` of a lab.toml that `read_corrections` reads."""
    lines = []
    for one in corrections:
        key = f'corrections.{one.effect}."{one.target}"'
        lines += [f"[{key}]", f"{one.fault.parameter} = {one.value:.6g}  # {one.fault.unit}"]
        lines += [f"sd = {one.sd:.3g}"] * bool(np.isfinite(one.sd)) + [f"source = {json.dumps(one.source)}", ""]
    return "\n".join(lines)


def joined_corrections(
    earlier: Iterable[PlateCorrection], later: Iterable[PlateCorrection]
) -> tuple[PlateCorrection, ...]:
    """Return both: what was found in recordings that were ``earlier`` corrected adds to what they were corrected by."""
    out = {(one.effect, one.target): one for one in earlier}
    for one in later:
        before = out.get((one.effect, one.target))
        if before is not None:
            both = one.fault.joined(before.value, one.value)
            source = f"{before.source}; {one.source}".strip("; ")
            one = replace(one, value=both, source=source)
        out[one.effect, one.target] = one
    return tuple(out.values())

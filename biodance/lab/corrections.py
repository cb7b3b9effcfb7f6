"""What a laboratory once accepted as wrong with its force plates, and the recordings without it: ``[corrections]`` in
lab.toml.

    [corrections.plate_position."plate1:x"]
    shift = 0.0301                       # m, as the diagnosis named it
    sd = 0.0012
    source = "session S1"

Every correction is exact and needs the recording alone: neither body nor movement. Signs as in `effects`: the value is
what the plate does wrong.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.plates.faults import DELAY, OFFSET, PLATE_FAULTS, POSITION, ROTATION, PlateFault
from biodance.library import read_toml
from biodance.records import Array, Plate, Session, Trial, Wrench

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
        return f"{name} ({self.fault.parameter} {self.value:.4g} {self.fault.unit})".replace(" 1)", ")")

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
        said += [f"{_said(one)}, {one.source or 'from lab.toml'}."] * bool(meant)
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


def _said(one: PlateCorrection) -> str:
    return f"Corrected: {one}"


def corrected_session(session: Session, corrections: tuple[PlateCorrection, ...]) -> Session:
    """Return a session as read with its laboratory's corrections made, but not those that it has (`APPLIED`)."""
    path = session.folder / APPLIED
    done = {(one.effect, one.target) for one in read_corrections(path)} if path.is_file() else set()
    told = [line for trial in session.trials for line in trial.history]
    done |= {(one.effect, one.target) for one in corrections if any(line.startswith(_said(one)) for line in told)}
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

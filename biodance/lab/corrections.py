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
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from biodance.errors import FileRefused
from biodance.library import read_toml
from biodance.records import CHANNELS, Array, Plate, Session, Trial, Wrench
from biodance.spatial import axis_rotation, wrench_about_origin, wrench_about_point

APPLIED = "corrected.toml"
"""File in a folder of corrected trials that says what was corrected already."""


@dataclass(frozen=True)
class PlateCorrection:
    """One accepted cause: ``effect`` at ``target`` of size ``value`` with ``sd``, in the unit of its parameter (m, rad,
    1, s, N or N·m); ``source`` in words: where it was found.
    """

    effect: str
    target: str
    value: float
    sd: float = float("nan")
    source: str = ""

    def __str__(self) -> str:
        name = f"{self.effect} {self.target}".replace("_", " ").strip()
        return f"{name} ({PARAMETER_OF[self.effect]} {self.value:.4g} {_UNIT_OF[self.effect]})".replace(" 1)", ")")

    def of(self, plate: str, plates: tuple[str, ...]) -> bool:
        """Return whether ``plate`` is meant; a target without a plate means the only one, a delay all of them."""
        named, colon, _ = self.target.partition(":")
        return plate == named if colon else self.effect == "time_delay" or len(plates) == 1


def _moved(plate: Plate, one: PlateCorrection) -> Plate:
    """Move back a plate that the file puts ``value`` m along an axis beside where it is: M = M' - shift x F."""
    shift = one.value * np.eye(3)["xyz".index(one.target[-1])]
    value = plate.wrench.value - np.hstack([np.zeros((len(plate.wrench.time), 3)), np.cross(shift, plate.wrench.force)])
    return _with(plate, value, corners=plate.corners - shift)


def _turned(plate: Plate, one: PlateCorrection) -> Plate:
    """Turn back what was recorded turned by ``value`` rad about an axis through the plate's centre."""
    back = axis_rotation(np.eye(3)["xyz".index(one.target[-1])], np.array([-one.value]))[0]
    local = wrench_about_point(plate.wrench.value, plate.centre)
    value = wrench_about_origin(np.hstack([local[:, :3] @ back.T, local[:, 3:] @ back.T]), plate.centre)
    return _with(plate, value, corners=plate.centre + (plate.corners - plate.centre) @ back.T)


def _scaled(plate: Plate, one: PlateCorrection) -> Plate:
    """Divide a channel about the plate's centre that reads (1 + ``value``) times what is there."""
    factor = np.ones(6)
    factor[CHANNELS.index(one.target.rpartition(":")[2])] = 1 / (1 + one.value)
    return _about_centre(plate, lambda local: local * factor)


def _uncrossed(plate: Plate, one: PlateCorrection) -> Plate:
    """Take off a channel about the plate's centre ``value`` times another one, which it shows in addition."""
    first, _, second = one.target.rpartition(":")[2].partition("->")
    mixing = one.value * np.outer(np.eye(6)[CHANNELS.index(first)], np.eye(6)[CHANNELS.index(second)])
    return _about_centre(plate, lambda local: local - local @ mixing)


def _zeroed(plate: Plate, one: PlateCorrection) -> Plate:
    """Take off a channel about the plate's centre the ``value`` that it reads when nobody is on the plate."""
    return _about_centre(
        plate, lambda local: local - one.value * np.eye(6)[CHANNELS.index(one.target.rpartition(":")[2])]
    )


def _earlier(plate: Plate, one: PlateCorrection) -> Plate:
    """Move forces that come ``value`` s late to their instant; they are held constant beyond the ends."""
    from scipy.interpolate import make_interp_spline

    time = plate.wrench.time
    spline = make_interp_spline(time, plate.wrench.value, k=min(3, time.size - 1))
    return _with(plate, np.asarray(spline(np.clip(time + one.value, time[0], time[-1]))))


def _about_centre(plate: Plate, change: Callable[[Array], Array]) -> Plate:
    local = change(wrench_about_point(plate.wrench.value, plate.centre))
    return _with(plate, wrench_about_origin(local, plate.centre))


def _with(plate: Plate, value: Array, *, corners: Array | None = None) -> Plate:
    return replace(
        plate, wrench=Wrench(plate.wrench.time, value), corners=plate.corners if corners is None else corners
    )


_METHODS: dict[str, Callable[[Plate, PlateCorrection], Plate]] = {
    "plate_position": _moved,
    "plate_rotation": _turned,
    "plate_gain": _scaled,
    "plate_crosstalk": _uncrossed,
    "plate_offset": _zeroed,
    "time_delay": _earlier,
}
PARAMETER_OF = dict(zip(_METHODS, ("shift", "angle", "gain", "ratio", "offset", "delay"), strict=True))
"""Name of the one parameter of every cause that can be corrected in a recording."""
_UNIT_OF = dict(zip(_METHODS, ("m", "rad", "1", "1", "N or N·m", "s"), strict=True))
LASTING = ("plate_position", "plate_rotation", "plate_gain", "plate_crosstalk", "time_delay")
"""Causes that stay with a laboratory from one session to the next: what an offset was today it is not tomorrow."""


def corrected_trial(trial: Trial, corrections: Iterable[PlateCorrection]) -> Trial:
    """Return a trial as read, with its plates as they would have recorded without the causes."""
    names = tuple(plate.name for plate in trial.plates)
    plates, said = list(trial.plates), []
    for one in corrections:
        meant = [k for k, name in enumerate(names) if one.of(name, names)]
        for k in meant:
            plates[k] = _METHODS[one.effect](plates[k], one)
        said += [f"{_said(one)}, {one.source or 'from lab.toml'}."] * bool(meant)
    return replace(trial, plates=tuple(plates), history=(*trial.history, *said))


def _said(one: PlateCorrection) -> str:
    return f"Corrected: {one}"


def corrected_session(session: Session, corrections: tuple[PlateCorrection, ...]) -> Session:
    """Return a session as read, with the corrections of its laboratory made; those that its folder says it has already
    (`APPLIED`) are not made twice.
    """
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


def _correction(path: str | Path, effect: str, target: str, said: Any) -> PlateCorrection:
    where = f"{path}: [corrections.{effect}.{target!r}]"
    if effect not in _METHODS:
        raise FileRefused(f"{where} is nothing that can be corrected. Legal causes: {', '.join(_METHODS)}.")
    name = PARAMETER_OF[effect]
    value = said.get(name) if isinstance(said, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value) or value == -1.0:
        raise FileRefused(f"{where} {name} = {value!r}; expected a number in {_UNIT_OF[effect]}.")
    if not _legal(effect, target):
        legal = "plate1:x" if effect in ("plate_position", "plate_rotation") else "Fz, plate1:Fz or Fz->My"
        raise FileRefused(f"{where} has no such target. Expected for example {legal}.")
    return PlateCorrection(effect, target, float(value), float(said.get("sd", np.nan)), str(said.get("source", "")))


def _legal(effect: str, target: str) -> bool:
    place = target.rpartition(":")[2]
    if effect in ("plate_position", "plate_rotation"):
        return place in ("x", "y", "z") and ":" in target
    if effect == "plate_crosstalk":
        first, _, second = place.partition("->")
        return first in CHANNELS and second in CHANNELS and first != second
    return place in CHANNELS if effect != "time_delay" else not target


def corrections_text(corrections: Iterable[PlateCorrection]) -> str:
    """Return the tables ``[corrections]`` of a lab.toml that `read_corrections` reads."""
    lines = []
    for one in corrections:
        key = f'corrections.{one.effect}."{one.target}"'
        lines += [f"[{key}]", f"{PARAMETER_OF[one.effect]} = {one.value:.6g}  # {_UNIT_OF[one.effect]}"]
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
            gain = one.effect == "plate_gain"
            both = (1 + before.value) * (1 + one.value) - 1 if gain else before.value + one.value
            source = f"{before.source}; {one.source}".strip("; ")
            one = replace(one, value=both, source=source)
        out[one.effect, one.target] = one
    return tuple(out.values())

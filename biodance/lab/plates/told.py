"""What the analyst says of the force plates (``[plates.NAME]`` in session.toml): it comes before what the file says."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from biodance.lab.plates.corners import plate_axes
from biodance.records import Array, Plate, Trial, Wrench
from biodance.spatial import wrench_about_origin, wrench_about_point

_C3D_ONLY = ("type", "channels", "sensitivity", "origin_m")


@dataclass(frozen=True, eq=False)
class ToldPlate:
    """What is said of one plate; None = nothing, the file decides.

    ``corners`` (4, 3) m in the lab frame (z up, as `inspect` shows them), in the order +x+y, -x+y, -x-y, +x-y of the
    plate axes; ``type`` of the C3D standard; ``channels`` labels, or numbers from 1; ``sensitivity`` (rows, channels)
    N and N·m per unit of a channel as the file gives it; ``origin`` (3,) m from the sensor to the centre of the
    surface, plate axes; ``foot`` that stands on it, "" = as the markers show; ``use`` False leaves the plate out.
    """

    corners: Array | None = None
    type: int | None = None
    channels: tuple[str | int, ...] | None = None
    sensitivity: Array | None = None
    origin: Array | None = None
    foot: str = ""
    use: bool = True

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of session.toml that say something of what the plate measures and where."""
        said = {
            "corners_m": self.corners,
            "type": self.type,
            "channels": self.channels,
            "sensitivity": self.sensitivity,
            "origin_m": self.origin,
            "foot": self.foot or None,
        }
        return tuple(key for key, value in said.items() if value is not None)

    @property
    def sentence(self) -> str:
        """What is taken from session.toml, for the history; "" for nothing."""
        return f"{', '.join(self.keys)} as session.toml says." if self.keys else ""


NOTHING_TOLD = ToldPlate()


@dataclass(frozen=True, eq=False)
class Told:
    """What the analyst says that a reader of forces must know: ``plates`` by name (``plate1``), the declared body
    ``mass`` kg, None = not said.
    """

    plates: Mapping[str, ToldPlate] = field(default_factory=lambda: MappingProxyType({}))
    mass: float | None = None


def as_told(trial: Trial, told: Told) -> Trial:
    """Return a trial of a format whose plates come as wrenches (text, AMTI) with what the analyst says of them.

    A plate of unknown place gets its corners; one that was placed in a frame of its own is moved there with what it
    measured. What only the channels of a C3D file can follow is named in a warning.
    """
    plates, history, warnings = [], [], []
    for plate in trial.plates:
        said = told.plates.get(plate.name, NOTHING_TOLD)
        if not said.use:
            history.append(f"{plate.name} was left out, as session.toml says.")
            continue
        idle = [key for key in said.keys if key in _C3D_ONLY]
        if idle:
            warnings.append(f"{plate.name}: {', '.join(idle)} of session.toml can be followed in C3D files only.")
        done = plate if said.corners is None else _placed(plate, said.corners)
        if used := ", ".join(key for key in said.keys if key not in idle):
            taken = f"{used} as session.toml says."
            done = replace(done, foot=said.foot, decisions=(*done.decisions, f"{taken[0].upper()}{taken[1:]}"))
            history.append(f"{plate.name}: {taken}")
        plates.append(done)
    return replace(
        trial,
        plates=tuple(plates),
        history=(*trial.history, *history),
        warnings=(*trial.warnings, *warnings),
    )


def _placed(plate: Plate, corners: Array) -> Plate:
    """Return the plate at ``corners`` (4, 3) m."""
    if not plate.placed:
        return replace(plate, corners=corners, placed=True)
    turn = plate_axes(corners) @ plate_axes(plate.corners).T
    local = wrench_about_point(plate.wrench.value, plate.centre)
    turned = np.hstack([local[:, :3] @ turn.T, local[:, 3:] @ turn.T])
    wrench = Wrench(plate.wrench.time, wrench_about_origin(turned, corners.mean(axis=0)))
    return replace(plate, corners=corners, wrench=wrench, zero=turn @ plate.zero)

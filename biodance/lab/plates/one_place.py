"""One place of a plate in all trials of a session: what the feet of every trial say of it, joined."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from biodance.records import Array, Plate, Trial, Wrench
from biodance.records.attention import WARNING

_MOVED = 0.05
"""m between two trials from which on the plate was another one, or moved: nearly three times what the feet
leave open in two (0.013 m each)."""


def one_place(trials: Sequence[Trial]) -> tuple[list[Trial], list[str]]:
    """Return the trials with every plate that was put by the feet (``Plate.put``) at the median of what they say, and
    notes: a plate does not move between the trials of one visit, while people lean otherwise in each.

    Where two trials differ by more than 50 mm all keep their own, and a note says so.
    """
    puts: dict[str, list[Array]] = {}
    for trial in trials:
        for plate in trial.plates:
            if plate.put is not None:
                puts.setdefault(plate.name, []).append(plate.put)
    place, notes = {}, []
    for name, found in puts.items():
        apart = float(np.ptp(found, axis=0).max())
        if apart > _MOVED:
            notes.append(
                f"{WARNING}{name} would lie up to {1000 * apart:.0f} mm elsewhere in another trial by where the feet "
                f"stand: each trial keeps its own place. Give corners_m in [plates.{name}] of session.toml."
            )
        elif len(found) > 1:
            place[name] = np.median(found, axis=0)
            x, y = place[name]
            notes.append(
                f"{name} was put at ({x:.3f}, {y:.3f}, 0) m in all trials, the median of what the feet of "
                f"{len(found)} say, which are up to {1000 * apart:.0f} mm apart."
            )
    return [replace(trial, plates=tuple(_moved(plate, place) for plate in trial.plates)) for trial in trials], notes


def _moved(plate: Plate, place: dict[str, Array]) -> Plate:
    """Return the plate, with its wrench, at its ``place``."""
    if plate.put is None or plate.name not in place:
        return plate
    shift = np.array([*(place[plate.name] - plate.put), 0.0])
    value = np.hstack([plate.wrench.force, plate.wrench.moment + np.cross(shift, plate.wrench.force)])
    moved = Wrench(plate.wrench.time, value)
    return replace(plate, corners=plate.corners + shift, wrench=moved, put=place[plate.name])

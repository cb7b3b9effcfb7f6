"""Recordings altered as a wrong file, cable or clock would alter them: what sensitivities are compared with.

The plates' samples themselves are altered, channel by channel about the plate's centre; no formula here is one of
`biodance.observations`.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from biodance.observations import Observation, SeenTrial, observe
from biodance.records import CHANNELS, Array, Plate, Wrench
from biodance.spatial import axis_rotation, wrench_about_origin, wrench_about_point


def altered(seen: SeenTrial, effect: str, target: str, size: float) -> SeenTrial:
    """Return the recording that a cause of a ``size`` would have produced."""
    if effect == "body_mass":
        return replace(seen, mass=seen.mass - size)
    if effect == "time_delay":
        plates = [replace(p, wrench=Wrench(p.wrench.time + size, p.wrench.value)) for p in seen.trial.plates]
    else:
        name, _, where = target.rpartition(":")
        plates = [_ALTER[effect](p, where, size) if name in ("", p.name) else p for p in seen.trial.plates]
    return replace(seen, trial=replace(seen.trial, plates=tuple(plates)))


def differences(seen: SeenTrial, found: tuple[Observation, ...], effect: str, target: str, step: float) -> Array:
    """Return (n,) the slope of value less expectation between the recordings altered by a step either way; NaN where
    an observation is then missing.
    """
    sides = [
        {one.key: one.value - one.expected for one in observe(altered(seen, effect, target, size))}
        for size in (-step, step)
    ]
    return np.array([(sides[1].get(o.key, np.nan) - sides[0].get(o.key, np.nan)) / (2 * step) for o in found])


def _about_centre(plate: Plate, change: Callable[[Array], Array]) -> Plate:
    local = np.array(wrench_about_point(plate.wrench.value, plate.centre))
    return replace(plate, wrench=Wrench(plate.wrench.time, wrench_about_origin(change(local), plate.centre)))


def _moved(plate: Plate, axis: str, shift: float) -> Plate:
    vector = shift * np.eye(3)["xyz".index(axis)]
    wrench = Wrench(plate.wrench.time, wrench_about_origin(plate.wrench.value, vector))
    return replace(plate, wrench=wrench, corners=plate.corners + vector)


def _turned(plate: Plate, axis: str, angle: float) -> Plate:
    turn = axis_rotation(np.eye(3)["xyz".index(axis)], np.array([angle]))[0]
    return _about_centre(plate, lambda w: np.concatenate([w[:, :3] @ turn.T, w[:, 3:] @ turn.T], axis=1))


def _mixed(plate: Plate, pair: str, ratio: float) -> Plate:
    """Return the plate with ``ratio`` of one channel added to another: of itself, for a gain."""
    source, _, into = pair.partition("->")

    def change(local: Array) -> Array:
        local[:, CHANNELS.index(into or source)] += ratio * local[:, CHANNELS.index(source)]
        return local

    return _about_centre(plate, change)


def _offset(plate: Plate, channel: str, size: float) -> Plate:
    """Return the plate with a constant in a channel, which the reader has taken off if it saw the plate empty."""
    k = CHANNELS.index(channel)
    if any("mean was subtracted" in said for said in plate.decisions):
        return replace(plate, zero=plate.zero + size * np.eye(3)[k]) if k < 3 else plate
    return _about_centre(plate, lambda local: local + size * np.eye(6)[k])


_ALTER: dict[str, Callable[[Plate, str, float], Plate]] = {
    "plate_position": _moved,
    "plate_rotation": _turned,
    "plate_gain": _mixed,
    "plate_crosstalk": _mixed,
    "plate_offset": _offset,
}

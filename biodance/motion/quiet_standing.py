"""Quiet standing on the plates: the mass they carry, and the centre of mass beside the centre of pressure."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.lab.markers.sets import landmark, read_marker_set
from biodance.lab.markers.upright import movement, quiet_run
from biodance.motion.kinematics import centre_of_mass, in_blocks, poses
from biodance.records import Array, Markers, Motion, Trial

_FOOT_LANDMARKS = tuple(
    f"{side}_{place}" for side in ("left", "right") for place in ("heel", "toe", "ankle_lateral", "toe_lateral")
)


_PART = 1.0
"""s: shorter parts of a steady run are not looked at: in this time the typical marker gains less than 0.06 m/s,
which is 0.6 % of the weight.
"""


@dataclass(frozen=True, eq=False)
class QuietStanding:
    """A quiet standing on the plates from ``start`` to ``end`` s; ``mass`` kg on the plates (mean vertical force / g),
    ``mass_sd`` kg.

    ``cop`` and ``com`` (T, 2) m, horizontal lab coordinates of the centre of pressure and of the table's centre of mass
    (``com`` empty without a tracked motion); ``forward`` (2,) unit vector the subject faces; ``com_ahead``,
    ``com_left`` m: mean of CoM minus CoP along it and to its left; ``feet`` (F, 2) m foot landmarks and their
    ``foot_names`` (``left_heel`` ...); ``plates`` (P, 4, 2) m corners.
    """

    trial: str
    start: float
    end: float
    mass: float
    mass_sd: float
    cop: Array
    com: Array
    forward: Array
    com_ahead: float
    com_left: float
    feet: Array
    foot_names: tuple[str, ...]
    plates: Array


def facing(body: Body, motion: Motion) -> Array:
    """Return the horizontal unit vector (2,) along which the pelvis faces on average (its x axis, anterior)."""
    ahead = np.sum([poses(body, part.q).rotation[:, 0, :2, 0].sum(axis=0) for _, part in in_blocks(motion)], axis=0)
    return np.asarray(ahead / np.linalg.norm(ahead))


def _feet(trial: Trial, run: slice) -> tuple[tuple[str, ...], Array]:
    """Return names and mean horizontal places (F, 2) m of the foot landmarks that the marker set knows."""
    if trial.markers is None or not trial.marker_set:
        return (), np.empty((0, 2))
    marker_set = read_marker_set(trial.marker_set)
    found = {name: landmark(trial.markers, marker_set, name) for name in _FOOT_LANDMARKS}
    places = {
        name: np.nanmean(path[run, :2], axis=0)
        for name, path in found.items()
        if path is not None and np.isfinite(path[run]).any()
    }
    return tuple(places), np.array(list(places.values())).reshape(-1, 2)


def _still_part(markers: Markers | None, run: slice, rate: float, within: float) -> slice | None:
    """Return the longest part of ``run``, halved down to `_PART` s, with the typical marker ``within`` m; or None."""
    if markers is None:
        return run
    length = run.stop - run.start
    while True:
        for start in range(run.start, run.stop - length + 1, length):
            part = slice(start, start + length)
            if movement(Markers(markers.names, markers.time[part], markers.xyz[part])) <= within:
                return part
        length //= 2
        if length < _PART * rate:
            return None


def quiet_standing(
    trial: Trial, used: NDArray[np.bool_], body: Body | None, motion: Motion | None
) -> QuietStanding | None:
    """Return the quiet standing of a prepared trial, in the longest steady run of the frames ``used`` (T,); None
    without one.

    Steady means the vertical force, and the markers where there are any: walking, too, loads the plates evenly for a
    moment.
    """
    wrench, rules = trial.wrench, trial.settings.standing
    run = quiet_run(wrench.force[:, 2], used, wrench.rate, rules)
    run = _still_part(trial.markers, run, wrench.rate, rules.still) if run is not None else None
    if run is None:
        return None
    cop = wrench.cop(height=trial.floor)[run, :2]
    com, ahead = np.empty((0, 2)), np.array([1.0, 0.0])
    if body is not None and motion is not None:
        com, ahead = centre_of_mass(body, motion)[run, :2], facing(body, motion)
    arm = com.mean(axis=0) - cop.mean(axis=0) if com.size else np.full(2, np.nan)
    mass = wrench.force[run, 2] / trial.settings.gravity
    names, feet = _feet(trial, run)
    return QuietStanding(
        trial=trial.name,
        start=float(wrench.time[run][0]),
        end=float(wrench.time[run][-1]),
        mass=float(mass.mean()),
        mass_sd=float(mass.std()),
        cop=cop,
        com=com,
        forward=ahead,
        com_ahead=float(arm @ ahead),
        com_left=float(arm @ np.array([-ahead[1], ahead[0]])),
        feet=feet,
        foot_names=names,
        plates=np.array([plate.corners[:, :2] for plate in trial.plates]),
    )

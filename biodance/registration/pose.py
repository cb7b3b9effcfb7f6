"""A force recording in its own frame and clock, and the pose that carries it into the room of the markers."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from biodance.errors import TrialRefused
from biodance.lab.prepare import force_filter, low_pass
from biodance.records import Array, Markers, Mask, Motion, Plate, Trial, Wrench, freeze
from biodance.records.motion import BY_FRAME
from biodance.settings import Settings
from biodance.spatial import axis_rotation, wrench_about_origin

_UP = np.array([0.0, 0.0, 1.0])
_RATE = 200.0
"""Hz at which low-passed forces are kept between two looks: ten times the default cut-off."""

_LOADED = 50.0
"""N: somebody stood on a plate that carried more."""
_UNSIZED = "MOT"
"""Format of recordings that does not say where a plate ends."""


@dataclass(frozen=True, eq=False)
class FramePose:
    """Where the frame of a force file lies in the room, and how late its clock is.

    Parameters
    ----------
    delay : float
        s, the force file's time of an event minus the marker file's: forces late = positive.
    yaw : float
        rad, from room x to the file's x, about the vertical.
    shift : array_like
        (3,) m, origin of the file's frame in the room.
    """

    delay: float
    yaw: float
    shift: Array

    def __post_init__(self) -> None:
        freeze(self, "FramePose", shift=(3,))

    @property
    def turn(self) -> Array:
        """(3, 3) room_R_file."""
        return np.asarray(axis_rotation(_UP, np.array([self.yaw]))[0])

    def points(self, points: Array) -> Array:
        """Return points (..., 3) m of the file's frame in the room."""
        return np.asarray(points @ self.turn.T + self.shift)

    def wrench(self, value: Array) -> Array:
        """Return wrenches (..., 6) about the file's origin as wrenches about the room's."""
        turned = np.concatenate([value[..., :3] @ self.turn.T, value[..., 3:] @ self.turn.T], axis=-1)
        return wrench_about_origin(turned, self.shift)

    def in_room(self, plate: Plate, time: Array, value: Array) -> Plate:
        """Return a plate of the file in the room, with what it recorded, ``value`` (T, 6) about the file's origin."""
        return replace(plate, corners=self.points(plate.corners), wrench=Wrench(time, self.wrench(value)))

    def changed(self, change: Array, about: Array) -> "FramePose":
        """Return the pose after a ``change`` (4,): x, y m, yaw rad about the vertical through ``about`` (3,) m, delay
        s.
        """
        x, y, yaw, delay = change
        turned = axis_rotation(_UP, np.array([yaw]))[0] @ (self.shift - about) + about
        return FramePose(self.delay + delay, self.yaw + yaw, turned + np.array([x, y, 0.0]))


@dataclass(frozen=True, eq=False)
class Forces:
    """What some plates recorded, low-passed, in the frame and clock of their own file: ``plates`` with ``time`` (S,) s
    and ``value`` (P, S, 6) N, N·m about the file's origin; ``at`` their spline over time; ``sized`` whether the file
    says how large the plates are (a table of forces does not).
    """

    plates: tuple[Plate, ...]
    time: Array
    value: Array
    at: Callable[[Array], Array]
    sized: bool = True

    @property
    def loaded(self) -> Mask:
        """(P,) whether somebody ever stands on a plate."""
        return np.asarray(self.value[:, :, 2].max(axis=1) > _LOADED)

    @property
    def height(self) -> float:
        """Height m of the plates that are loaded (all of them where none is), the mean, in the file's frame."""
        heights = np.array([plate.height for plate in self.plates])
        return float(heights[self.loaded].mean() if self.loaded.any() else heights.mean())

    def during(self, time: Array) -> Array:
        """Return (P, T, 6) at the times ``time`` (T,) s of the file's clock; NaN where nothing was recorded."""
        inside = (time >= self.time[0]) & (time <= self.time[-1])
        value = np.array(self.at(np.clip(time, self.time[0], self.time[-1])))
        value[:, ~inside] = np.nan
        return value


def forces_of(trial: Trial, settings: Settings) -> Forces:
    """Return the force recording of a trial, low-passed as the ``settings`` of the markers say.

    Raises
    ------
    TrialRefused
        There is no plate, a sample is no number, or the plates have different times.
    """
    from scipy.interpolate import make_interp_spline

    if not trial.plates:
        raise TrialRefused(f"{trial.source.path}: holds no force plate that can be read, so there is nothing to place.")
    time = trial.plates[0].wrench.time
    if any(not np.array_equal(plate.wrench.time, time) for plate in trial.plates):
        raise TrialRefused(f"{trial.source.path}: its plates have different times. Export them at one rate.")
    raw = np.stack([plate.wrench.value for plate in trial.plates])
    if not np.isfinite(raw).all():
        raise TrialRefused(f"{trial.source.path}: some force samples are not numbers. Export the file again.")
    rate, step = trial.plates[0].wrench.rate, max(1, int(trial.plates[0].wrench.rate // _RATE))
    value = np.stack([low_pass(one, rate, force_filter(settings)) for one in raw])[:, ::step]
    spline = make_interp_spline(time[::step], value, k=3, axis=1)
    return Forces(trial.plates, time[::step], value, spline, trial.source.format != _UNSIZED)


def with_forces_at(trial: Trial, motion: Motion, forces: Forces, pose: FramePose) -> tuple[Trial, Motion]:
    """Return a prepared trial with the plates in the room at the times of ``motion``, and the motion, both cut to the
    time that the force file knows.

    Raises
    ------
    TrialRefused
        The two share no time.
    """
    own = motion.time + pose.delay
    known = np.flatnonzero((own >= forces.time[0]) & (own <= forces.time[-1]))
    if known.size < 2:
        raise TrialRefused(f"Trial {trial.name}: under this delay ({pose.delay:.2f} s) the two files share no time.")
    kept = slice(known[0], known[-1] + 1)
    recorded = zip(forces.plates, forces.during(own[kept]), strict=True)
    plates = tuple(pose.in_room(plate, motion.time[kept], value) for plate, value in recorded)
    cut = replace(motion, **{name: getattr(motion, name)[kept] for name in BY_FRAME})
    markers = trial.markers
    seen = None if markers is None else Markers(markers.names, markers.time[kept], markers.xyz[kept])
    return replace(trial, plates=plates, markers=seen), cut


def registered_plates(plates: tuple[Plate, ...], pose: FramePose) -> tuple[Plate, ...]:
    """Return plates as recorded (not filtered) in the room, on the markers' clock."""
    return tuple(pose.in_room(plate, plate.wrench.time - pose.delay, plate.wrench.value) for plate in plates)

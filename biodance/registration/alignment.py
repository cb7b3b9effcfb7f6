"""A force recording in its own frame and clock, the pose that carries it into the room of the markers, and the search
over all delays: for each the planar pose that carries the measured centre of pressure and shear onto those that the
motion needs, in closed form: for one delay there is one best yaw.

With c the measured centre of pressure and f the shear as complex numbers in the plates' frame, p and g those that the
motion needs, the yaw is the argument of ``sum w conj(c - c0) (p - p0) / s_c² + sum w conj(f) g / s_f²`` (Procrustes
in the plane), and the weights w of samples that do not fit (a foot beside the plates) sink from round to round
(Geman and McClure).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from biodance.errors import TrialRefused
from biodance.lab.prepare import force_filter, low_pass
from biodance.records import Array, Markers, Mask, Motion, Plate, Trial, Wrench, freeze
from biodance.records.motion import BY_FRAME
from biodance.settings import COP_FORCE, Settings
from biodance.spatial import axis_rotation, turned_wrench, wrench_about_origin, zero_moment_point

_UP = np.array([0.0, 0.0, 1.0])


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
        # Both vectors turn about the file's origin; then the moment is taken to the room's.
        return wrench_about_origin(turned_wrench(value, self.turn), self.shift)

    def in_room(self, plate: Plate, time: Array, value: Array) -> Plate:
        """Return a plate of the file in the room, with what it recorded, ``value`` (T, 6) about the file's origin."""
        return replace(plate, corners=self.points(plate.corners), wrench=Wrench(time, self.wrench(value)))

    def changed(self, change: Array, about: Array) -> "FramePose":
        """Return the pose after a ``change`` (4,): x, y m, yaw rad about the vertical through ``about`` (3,) m, delay
        s.
        """
        x, y, yaw, delay = change
        # The origin of the file goes round `about`, then all is shifted.
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
        """(P,) whether somebody ever stands on a plate: it carries more than 50 N."""
        return np.asarray(self.value[:, :, 2].max(axis=1) > 50.0)

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
    # Kept at 200 Hz, ten times the default cut-off.
    rate, step = trial.plates[0].wrench.rate, max(1, int(trial.plates[0].wrench.rate // 200.0))
    value = np.stack([low_pass(one, rate, force_filter(settings)) for one in raw])[:, ::step]
    spline = make_interp_spline(time[::step], value, k=3, axis=1)
    return Forces(trial.plates, time[::step], value, spline, trial.source.format != "MOT")


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


_PRESSURE, _SHEAR, _VERTICAL = 0.02, 10.0, 25.0
"""m, N, N: by how much a body from tables misses the centre of pressure, the shear and the vertical force."""
_OUTLIER = 12.0
"""Squared distance at which a sample counts half: three standard deviations of the four numbers together."""
_STEP, _EVERY = 0.02, 0.04
"""s between two delays, and between two samples."""
_LEAST = 0.4
"""s of loaded plates, and of shared time."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """One hypothesis: its ``pose`` (z as given), the ``gain`` it explains (seconds under load, samples that fit count
    one, times `_OUTLIER`), and the ``misfit`` per sample, 0 to `_OUTLIER`.
    """

    pose: FramePose
    gain: float
    misfit: float


def _aligned(
    cop: Array, shear: Array, needed_cop: Array, needed_shear: Array, lift: Array
) -> tuple[complex, complex, Array]:
    """Return turn and shift (complex) and the loss (n,) of every loaded sample: complex numbers of the measured ``cop``
    m and ``shear`` N, and of the needed ones; ``lift`` the squared misfit of the vertical force.
    """
    # Geman and McClure: the loss u / (1 + u / c) has the slope 1 / (1 + u / c)², the weight of the next round.
    weight = 1.0 / (1.0 + lift / _OUTLIER) ** 2
    for _ in range(4):
        centre, needed = (np.sum(weight * x) / weight.sum() for x in (cop, needed_cop))
        # the argument of sum conj(a) b is the turn that carries a onto b
        both = np.sum(weight * np.conj(cop - centre) * (needed_cop - needed)) / _PRESSURE**2
        # Shear is a vector without a place: nothing is centred.
        both += np.sum(weight * np.conj(shear) * needed_shear) / _SHEAR**2
        turn = complex(np.exp(1j * np.angle(both)))
        apart = np.abs(needed_cop - needed - turn * (cop - centre)) ** 2 / _PRESSURE**2
        loss = apart + np.abs(needed_shear - turn * shear) ** 2 / _SHEAR**2 + lift
        weight = 1.0 / (1.0 + loss / _OUTLIER) ** 2
    # p = turn (c - c0) + p0, so the shift is p0 - turn c0.
    return turn, complex(needed - turn * centre), loss / (1.0 + loss / _OUTLIER)


def alignments(motion: Motion, needed: Array, forces: Forces, *, floor: float) -> tuple[Alignment, ...]:
    """Return the hypotheses, best first, each different from all before it.

    ``needed`` (T, 6) N, N·m wrench that ``motion`` needs about the room's origin; ``floor`` m the height in the room
    on which the feet stand.

    Raises
    ------
    TrialRefused
        The plates are never loaded, or not for long enough under any delay.
    """
    height = floor - forces.height
    found = list(_scanned(motion, needed, forces, height))
    if not found:
        raise TrialRefused(
            f"Under no delay do the plates carry anybody for {_LEAST:g} s while the markers are seen. "
            "Are these the files of one trial?"
        )
    # The alignments that explain no less than those of the delays beside theirs.
    # Ends count as lower than all: a peak may lie there.
    gain = np.array([-np.inf, *(one.gain for one in found), -np.inf])
    top = (gain[1:-1] >= gain[:-2]) & (gain[1:-1] >= gain[2:])
    peaks = sorted([one for one, is_top in zip(found, top, strict=True) if is_top], key=lambda one: -one.gain)
    # Four times finer around the highest peak; the others are looked at as they are.
    fine = peaks[0].pose.delay + np.arange(-_STEP, 1.05 * _STEP, _STEP / 4)
    best = max(_scanned(motion, needed, forces, height, fine), key=lambda one: one.gain)
    return (best, *(one for one in peaks[1:] if abs(one.pose.delay - best.pose.delay) > 0.1))


def _scanned(
    motion: Motion, needed: Array, forces: Forces, height: float, delays: Array | None = None
) -> Iterator[Alignment]:
    """Yield the best alignment of every delay."""
    if delays is None:
        # All delays under which both share `_LEAST` at least.
        first, last = forces.time[0] - motion.time[-1] + _LEAST, forces.time[-1] - motion.time[0] - _LEAST
        delays = np.arange(first, last, _STEP)
    for delay in map(float, delays):
        samples = _samples(motion, needed, forces, delay, height)
        if samples is not None:
            turn, shift, loss = _aligned(*samples)
            pose = FramePose(delay, float(np.angle(turn)), np.array([shift.real, shift.imag, height]))
            # The loss of a sample stays below `_OUTLIER`: each one that fits adds, none takes off.
            yield Alignment(pose, float(_EVERY * np.sum(_OUTLIER - loss)), float(loss.mean()))


def _samples(
    motion: Motion, needed: Array, forces: Forces, delay: float, height: float
) -> tuple[Array, Array, Array, Array, Array] | None:
    """Return the samples in which the plates are loaded under one delay, as `_aligned` takes them; None where they are
    too few.
    """
    every = max(1, round(_EVERY * motion.rate))
    time, value = motion.time[::every], needed[::every]
    measured = forces.during(time + delay).sum(axis=0)
    # The same threshold for both: a light foot has no usable centre of pressure.
    here = zero_moment_point(np.nan_to_num(measured), height=forces.height, threshold=2.5 * COP_FORCE)
    there = zero_moment_point(value, height=forces.height + height, threshold=2.5 * COP_FORCE)
    use = np.isfinite(measured).all(axis=1) & np.isfinite(here).all(axis=1) & np.isfinite(there).all(axis=1)
    if use.sum() * _EVERY < _LEAST:
        return None
    # A plane as complex numbers: x + iy.
    a, b, c, d = (x[use, 0] + 1j * x[use, 1] for x in (here, measured, there, value))
    return a, b, c, d, ((value[use, 2] - measured[use, 2]) / _VERTICAL) ** 2

"""The search over all delays: for each the planar pose that carries the measured centre of pressure and shear onto
those that the motion needs, in closed form: for one delay there is one best yaw.

With c the measured centre of pressure and f the shear as complex numbers in the plates' frame, p and g those that the
motion needs, the yaw is the argument of ``sum w conj(c - c0) (p - p0) / s_c² + sum w conj(f) g / s_f²`` (Procrustes
in the plane), and the weights w of samples that do not fit (a foot beside the plates) sink from round to round
(Geman and McClure).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from biodance.errors import TrialRefused
from biodance.records import Array, Motion
from biodance.registration.pose import Forces, FramePose
from biodance.settings import COP_FORCE
from biodance.spatial import zero_moment_point

_PRESSURE, _SHEAR, _VERTICAL = 0.02, 10.0, 25.0
"""m, N, N: by how much a body from tables misses the centre of pressure, the shear and the vertical force."""
_OUTLIER = 12.0
"""Squared distance at which a sample counts half: three standard deviations of the four numbers together."""
_ROUNDS = 4
_STEP, _EVERY = 0.02, 0.04
"""s between two delays, and between two samples."""
_LEAST = 0.4
"""s of loaded plates, and of shared time."""
_APART = 0.1
"""s between the delays of two hypotheses."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """One hypothesis: its ``pose`` (z as given), the ``gain`` it explains (seconds under load, samples that fit count
    one, times `_OUTLIER`), and the ``misfit`` per sample, 0 to `_OUTLIER`.
    """

    pose: FramePose
    gain: float
    misfit: float


@dataclass(frozen=True, eq=False)
class _Samples:
    """Complex numbers over the loaded samples: measured ``cop`` m, ``shear`` N; needed the same; ``lift`` the
    squared misfit of the vertical force.
    """

    cop: Array
    shear: Array
    needed_cop: Array
    needed_shear: Array
    lift: Array

    def aligned(self) -> tuple[complex, complex, Array]:
        """Return turn and shift (complex) and the loss (n,) of every sample."""
        weight = 1.0 / (1.0 + self.lift / _OUTLIER) ** 2
        for _ in range(_ROUNDS):
            centre, needed = (np.sum(weight * x) / weight.sum() for x in (self.cop, self.needed_cop))
            both = np.sum(weight * np.conj(self.cop - centre) * (self.needed_cop - needed)) / _PRESSURE**2
            both += np.sum(weight * np.conj(self.shear) * self.needed_shear) / _SHEAR**2
            turn = complex(np.exp(1j * np.angle(both)))
            apart = np.abs(self.needed_cop - needed - turn * (self.cop - centre)) ** 2 / _PRESSURE**2
            loss = apart + np.abs(self.needed_shear - turn * self.shear) ** 2 / _SHEAR**2 + self.lift
            weight = 1.0 / (1.0 + loss / _OUTLIER) ** 2
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
    peaks = sorted(_peaks(found), key=lambda one: -one.gain)
    fine = peaks[0].pose.delay + np.arange(-_STEP, 1.05 * _STEP, _STEP / 4)
    best = max(_scanned(motion, needed, forces, height, fine), key=lambda one: one.gain)
    return (best, *(one for one in peaks[1:] if abs(one.pose.delay - best.pose.delay) > _APART))


def _peaks(found: list[Alignment]) -> list[Alignment]:
    """Return the alignments that explain no less than those of the delays beside theirs."""
    gain = np.array([-np.inf, *(one.gain for one in found), -np.inf])
    top = (gain[1:-1] >= gain[:-2]) & (gain[1:-1] >= gain[2:])
    return [one for one, is_top in zip(found, top, strict=True) if is_top]


def _scanned(
    motion: Motion, needed: Array, forces: Forces, height: float, delays: Array | None = None
) -> Iterator[Alignment]:
    """Yield the best alignment of every delay."""
    if delays is None:
        first, last = forces.time[0] - motion.time[-1] + _LEAST, forces.time[-1] - motion.time[0] - _LEAST
        delays = np.arange(first, last, _STEP)
    for delay in map(float, delays):
        samples = _samples(motion, needed, forces, delay, height)
        if samples is not None:
            turn, shift, loss = samples.aligned()
            pose = FramePose(delay, float(np.angle(turn)), np.array([shift.real, shift.imag, height]))
            yield Alignment(pose, float(_EVERY * np.sum(_OUTLIER - loss)), float(loss.mean()))


def _samples(motion: Motion, needed: Array, forces: Forces, delay: float, height: float) -> _Samples | None:
    """Return the samples in which the plates are loaded under one delay; None where they are too few."""
    every = max(1, round(_EVERY * motion.rate))
    time, value = motion.time[::every], needed[::every]
    measured = forces.during(time + delay).sum(axis=0)
    here = zero_moment_point(np.nan_to_num(measured), height=forces.height, threshold=2.5 * COP_FORCE)
    there = zero_moment_point(value, height=forces.height + height, threshold=2.5 * COP_FORCE)
    use = np.isfinite(measured).all(axis=1) & np.isfinite(here).all(axis=1) & np.isfinite(there).all(axis=1)
    if use.sum() * _EVERY < _LEAST:
        return None
    a, b, c, d = (x[use, 0] + 1j * x[use, 1] for x in (here, measured, there, value))
    return _Samples(a, b, c, d, ((value[use, 2] - measured[use, 2]) / _VERTICAL) ** 2)

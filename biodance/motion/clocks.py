"""Clock and place of a force plate beside a robot's encoders: where and when the plate saw the centre of pressure that
the motion needs.

Both paths are complex numbers x + i y. Between a path and the same path turned, shifted and late, the normalised
correlation at the right delay is 1 in size, its angle is the turn; turns and shifts need no search. All delays at
which half of the shorter recording overlaps are tried at once (fast Fourier transform, gaps masked: Padfield 2012,
doi:10.1109/TIP.2011.2181402).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.errors import TrialRefused
from biodance.records import Array, Wrench
from biodance.spatial import elementary_rotation, wrench_about_point

_OVERLAP = 0.5
"""Share of the shorter recording that must overlap."""
_MOVES = 0.002
"""m: centres of pressure that stay nearer than this (sd) tell no time."""


@dataclass(frozen=True)
class PlateFit:
    """``delay`` s by which the plate's clock is ahead: what the encoders show at t, the plate shows at t + delay; the
    frame of the first standing sole lies at ``place`` (x, y) m, turned by ``yaw`` rad, in that of the plate;
    ``correlation`` of the two paths, ``scale`` of the plate's over the needed one.
    """

    delay: float
    place: tuple[float, float]
    yaw: float
    correlation: float
    scale: float


def fit_plate(needed: Wrench, measured: Wrench, use: NDArray[np.bool_], *, within: float = float("inf")) -> PlateFit:
    """Return when and where the plate saw what a motion needs: ``needed`` (T, 6) in the frame of the first standing
    sole, of which ``use`` (T,) counts, and ``measured`` (S, 6) about the lab origin, both evenly sampled; delays are
    tried ``within`` so many s.

    Raises
    ------
    TrialRefused
        The recordings are too short, or the centre of pressure does not move.
    """
    rate = needed.rate
    clock = np.arange(measured.time[0], measured.time[-1], 1 / rate)
    seen = np.stack([np.interp(clock, measured.time, one) for one in measured.value.T], axis=1)
    path, mask = _path(needed.value), use & np.isfinite(_path(needed.value))
    other = _path(seen)
    if path[mask].std() < _MOVES if mask.any() else True:
        raise TrialRefused(
            "The centre of pressure hardly moves, so plate and encoders cannot be brought together. Record a motion "
            "that shifts the weight."
        )
    correlation, slope, first, second = _correlated(path, mask, other, np.isfinite(other))
    late = clock[0] - needed.time[0] + (np.arange(correlation.size) - (path.size - 1)) / rate
    size = np.where(np.abs(late) <= within, np.abs(correlation), 0.0)
    k = int(np.argmax(size))
    if size[k] == 0:
        raise TrialRefused(
            f"Plate and encoders overlap for less than half of {min(path.size, other.size) / rate:.1f} s."
        )
    part = _peak(size, k)
    lag = k - (path.size - 1) + part
    turn = slope[k] / abs(slope[k])
    place = second[k] - turn * first[k]
    delay = clock[0] - needed.time[0] + lag / rate
    return PlateFit(
        float(delay),
        (float(place.real), float(place.imag)),
        float(np.angle(turn)),
        float(size[k]),
        float(abs(slope[k])),
    )


def on_motion_clock(measured: Wrench, time: Array, fit: PlateFit) -> Array:
    """Return the ``measured`` wrench (T, 6) at ``time`` (T,) s of the motion, in the frame of the first standing sole;
    NaN beyond the recording.
    """
    at = time + fit.delay
    seen = np.stack([np.interp(at, measured.time, one, left=np.nan, right=np.nan) for one in measured.value.T], axis=1)
    return from_plate(seen, fit.place, fit.yaw)


def from_plate(wrench: Array, place: tuple[float, float], yaw: float) -> Array:
    """Return a wrench (T, 6) about the lab origin in a frame at ``place`` m, turned by ``yaw`` rad about z."""
    near = wrench_about_point(wrench, np.array([*place, 0.0]))
    turn = elementary_rotation("z", yaw)
    return np.concatenate([near[:, :3] @ turn, near[:, 3:] @ turn], axis=1)


def _path(wrench: Array) -> NDArray[np.complex128]:
    """Return the centre of pressure (T,) as x + i y, m; NaN where hardly anything presses."""
    force = wrench[:, 2]
    least = 0.2 * np.nanmedian(np.abs(force))
    path = np.full(force.size, complex(np.nan, np.nan))
    some = np.abs(force) > max(least, 1e-9)
    path[some] = (-wrench[some, 4] + 1j * wrench[some, 3]) / force[some]
    return path


def _correlated(
    a: NDArray[np.complex128], a_mask: NDArray[np.bool_], b: NDArray[np.complex128], b_mask: NDArray[np.bool_]
) -> tuple[NDArray[np.complex128], ...]:
    """Return for every lag of b behind a, -(len(a) - 1) to len(b) - 1: correlation (0 where too little overlaps),
    slope of b on a, means of a and of b over the overlap.
    """
    shift_a, shift_b = a[a_mask].mean(), b[b_mask].mean()
    x, y = (np.where(m, z - c, 0) for z, m, c in ((a, a_mask, shift_a), (b, b_mask, shift_b)))
    size = 1 << int(np.ceil(np.log2(a.size + b.size)))
    lags = (np.arange(-(a.size - 1), b.size)) % size

    def sums(one: NDArray[Any], other: NDArray[Any]) -> NDArray[np.complex128]:
        product = np.conj(np.fft.fft(one, size)) * np.fft.fft(other, size)
        return np.asarray(np.fft.ifft(product)[lags])

    count = sums(a_mask * 1.0, b_mask * 1.0).real.round()
    n = np.maximum(count, 1)
    mean_a, mean_b = np.conj(sums(x, b_mask * 1.0)) / n, sums(a_mask * 1.0, y) / n
    both = sums(x, y) / n - np.conj(mean_a) * mean_b
    own_a = sums(np.abs(x) ** 2, b_mask * 1.0).real / n - np.abs(mean_a) ** 2
    own_b = sums(a_mask * 1.0, np.abs(y) ** 2).real / n - np.abs(mean_b) ** 2
    enough = (count >= _OVERLAP * min(a_mask.sum(), b_mask.sum())) & (own_a > 1e-8) & (own_b > 1e-8)
    scale = np.sqrt(np.where(enough, own_a * own_b, 1.0))
    return (
        np.where(enough, both / scale, 0),
        np.where(enough, both / np.where(enough, own_a, 1.0), 1),
        mean_a + shift_a,
        mean_b + shift_b,
    )


def _peak(values: Array, k: int) -> float:
    """Return where, in samples about ``k``, the parabola through three values is largest."""
    if not 0 < k < values.size - 1:
        return 0.0
    before, here, after = values[k - 1 : k + 2]
    bend = before - 2 * here + after
    return float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend < 0 else 0.0


def onto_plate(wrench: Array, fit: PlateFit) -> Array:
    """Return a wrench (T, 6) in the first standing sole's frame in that of the plate; the inverse of `from_plate`."""
    turn = elementary_rotation("z", fit.yaw)
    turned = np.concatenate([wrench[:, :3] @ turn.T, wrench[:, 3:] @ turn.T], axis=1)
    return wrench_about_point(turned, -np.array([*fit.place, 0.0]))

"""Where a robot is, from its joint angles alone: the foot that stands is flat on the ground and does not move, and the
rest follows through the chain.

Which foot stands: one under whose plane no part of the other sole lies. It stands until the other one goes below it;
where the standing foot changes, the new one stays where the chain has brought it, laid flat. The frame is that of the
first standing sole: origin in its middle, x forwards, y left, z up.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.parts import UPRIGHT
from biodance.body.similarity import sole_normal
from biodance.errors import TrialRefused
from biodance.lab.prepare import LowPass, low_pass
from biodance.motion.kinematics import poses
from biodance.motion.track import smooth
from biodance.records import SIDES, Array, Markers, Motion, Wrench, runs
from biodance.records.motion import Encoders
from biodance.spatial import cross, elementary_rotation, rigid_fit, skew, turned_wrench, wrench_about_point

_FAR = 0.02  # m RMS: markers so far from where they are said to be are not those


@dataclass(frozen=True, eq=False)
class BaseSeen:
    """The base at T instants: ``rotation`` (T, 3, 3), of which an IMU knows the upward direction alone, and its
    ``position`` (T, 3) m, None from an IMU.
    """

    rotation: Array
    position: Array | None = None

    def __getitem__(self, pick: slice) -> "BaseSeen":
        """Return some of the instants."""
        return BaseSeen(self.rotation[pick], None if self.position is None else self.position[pick])

    def corrected(self, rotation: Array, position: Array, foot: Array) -> tuple[Array, Array]:
        """Return turn (T, 3, 3) and place (T, 3) m of the base, given those that follow from the standing foot, whose
        middle is at ``foot`` (T, 3) m: inclinations turn all about that.
        """
        if self.position is not None:
            return self.rotation, self.position
        # R B' z: the direction that the IMU takes for up, as the chain from the foot has it.
        up = np.einsum("tij,tkj,k->ti", rotation, self.rotation, np.array([0.0, 0.0, 1.0]))
        axis = cross(up, np.array([0.0, 0.0, 1.0]))  # of the smallest turn that brings `up` upright
        K = skew(axis)
        # Rodrigues with cos = up_z: 1 + K + K² / (1 + cos), K = [up x z]x.
        turn = np.asarray(np.eye(3) + K + K @ K / (1 + up[:, 2])[:, None, None])
        # The turn is about the foot's middle, which stands.
        return turn @ rotation, foot + np.einsum("tij,tj->ti", turn, position - foot)


def base_of_markers(markers: Markers, places: dict[str, tuple[float, float, float]], where: str) -> tuple[Array, Array]:
    """Return turn (T, 3, 3) and place (T, 3) m of the base, NaN where too few markers were seen.

    ``places`` m of the markers from the root link's origin: forwards, left, up.

    Raises
    ------
    TrialRefused
        Markers are missing, too few, or not where they are said to be.
    """
    lacks = [name for name in places if name not in markers.names]
    # Three markers fix a posture.
    if lacks or len(places) < 3:
        what = f"markers {', '.join(lacks)} are missing" if lacks else f"{len(places)} markers tell no posture"
        raise TrialRefused(f"{where}: {what}; recording.toml [base] markers needs three and more of those recorded.")
    local = np.array(list(places.values())) @ UPRIGHT
    seen = markers.xyz[:, [markers.names.index(name) for name in places]]
    whole = np.isfinite(seen).all(axis=(1, 2))
    if not whole.any():
        raise TrialRefused(f"{where}: at no time all markers of the base were seen.")
    rotation, position = np.full((len(seen), 3, 3), np.nan), np.full((len(seen), 3), np.nan)
    turn, position[whole] = rigid_fit(local, seen[whole])
    rotation[whole] = turn
    # Measured less model: p + R local.
    off = seen[whole] - position[whole][:, None] - np.einsum("tij,kj->tki", turn, local)
    rms = float(np.sqrt(np.mean(np.sum(off**2, axis=2))))
    if rms > _FAR:
        raise TrialRefused(
            f"{where}: the markers of the base are {1000 * rms:.0f} mm RMS from where recording.toml says; legal are "
            f"{1000 * _FAR:.0f} mm. Give m from the root link's origin: forwards, left, up."
        )
    return rotation, position


def base_of_inclinations(roll: Array, pitch: Array) -> BaseSeen:
    """Return the base of an IMU: ``roll`` (T,) rad, right side down, and ``pitch`` (T,) rad, front down, about the
    base's own axes (heading, then pitch, then roll).
    """
    return BaseSeen(elementary_rotation("y", pitch) @ elementary_rotation("x", roll) @ UPRIGHT)


UNDER = (0.02, 0.008)
"""Of the leg's length: how far the other sole may lie under the ground of the standing one (encoders, soft soles);
the second where a step is so low that the first does not see it.
"""
_AROUND = 0.25
"""s around a change of the standing foot that do not count: what the soles are off shows as a jump there."""
RATE = 100.0
"""Hz at which motion and wrench are compared."""
Lean = NDArray[np.intp] | None
"""Foot (T,) that stands where joint angles leave that open: 0 right, 1 left, -1 or None the one that stood before."""


@dataclass(frozen=True, eq=False)
class Grounded:
    """The ``motion`` of a robot in the frame of its first standing sole, ``foot`` (T,) which stands (0 right, 1 left),
    ``use`` (T,) where one certainly does; ``unclear`` (T,) where angles alone leave that open, and ``lean`` (T,) the
    foot that was taken to stand there (None: the one that did before); ``base`` what was seen of it beside the joints,
    ``under`` as in `ground`, and ``tilt`` (T, 3) rad by which the standing sole is not flat.
    """

    motion: Motion
    foot: NDArray[np.intp]
    use: NDArray[np.bool_]
    unclear: NDArray[np.bool_]
    lean: Lean = None
    base: BaseSeen | None = None
    under: float = UNDER[0]
    tilt: Array | None = None

    @property
    def stance(self) -> NDArray[np.intp]:
        """Number (T,) of the stance, from 0: it grows where the standing foot changes."""
        return np.cumsum(np.diff(self.foot, prepend=self.foot[:1]) != 0)

    @property
    def supports(self) -> tuple[tuple[str, float, float], ...]:
        """Side that the frame hangs on, from and to, s."""
        # Indices at which the stance changes, with both ends.
        edges = [0, *(np.flatnonzero(np.diff(self.foot)) + 1).tolist(), self.foot.size]
        time = self.motion.time
        return tuple((SIDES[self.foot[a]], float(time[a]), float(time[b - 1])) for a, b in pairwise(edges))


def even_angles(encoders: Encoders) -> tuple[Array, Array]:
    """Return times (T,) s, evenly spaced from the encoders' first, and the joint angles (T, n) rad at them.

    What is faster than 0.4 times that `RATE` is taken off before, so that it does not appear as something slow.
    """
    own, angle = encoders.rate, encoders.angle
    count = int((encoders.time[-1] - encoders.time[0]) * own) + 1
    even = encoders.time[0] + np.arange(count) / own
    angle = np.stack([np.interp(even, encoders.time, one) for one in angle.T], axis=1)
    if own > RATE:
        angle = low_pass(angle, own, LowPass(cutoff=0.4 * RATE))
    time = encoders.time[0] + np.arange(int((even[-1] - even[0]) * RATE) + 1) / RATE
    return time, np.stack([np.interp(time, even, one) for one in angle.T], axis=1)


def ground(
    body: Body,
    time: Array,
    angle: Array,
    *,
    settings: LowPass | None = None,
    lean: Lean = None,
    base: BaseSeen | None = None,
    under: float = UNDER[0],
) -> Grounded:
    """Return the motion of ``body`` with joint ``angle`` (T, n) rad at ``time`` (T,) s, evenly spaced.

    ``settings`` of the low-pass, as for people by default; ``lean`` the foot that stands where a lifted one is so
    tilted that either could; ``base`` where it was seen; ``under`` of `UNDER`.

    Raises
    ------
    TrialRefused
        At no time does a foot stand flat.
    """
    if set(body.feet) != set(SIDES):
        raise TrialRefused(f"{body.name}: has no right and left foot, so nothing tells where it is.")
    turn, place, height = _soles(body, angle)
    # In proportion to the way from root to sole at zero angles, m.
    depth = under * float(np.linalg.norm(_soles(body, np.zeros((1, len(body.joints))))[1][0, 0]))
    stands = height > -depth
    unclear = np.asarray(stands.all(axis=0) & (height > depth).any(axis=0))
    if lean is not None:
        # Where both could stand, the one that is told; -1 tells nothing.
        stands &= ~unclear | (lean < 0) | (lean == [[0], [1]])
    foot, use = _standing(stands, float(1.0 / (time[1] - time[0])))
    q = _q(angle, turn, place, foot, base=base)
    return Grounded(smooth(body, time, q, settings=settings), foot, use, unclear, lean, base, under)


def _q(
    angle: Array, turn: Array, place: Array, foot: NDArray[np.intp], *, base: BaseSeen | None, tilt: Array | None = None
) -> Array:
    """Return configurations (T, nq) of a robot on ``foot`` (T,); ``tilt`` (T, 3) rad turns its sole from flat."""
    from scipy.spatial.transform import Rotation

    rotation, position = _chained(turn, place, foot)
    # Middle of the standing sole in the frame of the first one: it stays where it is under any turn.
    middle = position + np.einsum("tij,tj->ti", rotation, place[foot, np.arange(foot.size)])
    if tilt is not None:
        lean_over = np.asarray(Rotation.from_rotvec(tilt).as_matrix())
        rotation = lean_over @ rotation
        position = middle + np.einsum("tij,tj->ti", lean_over, position - middle)
    if base is not None:
        rotation, position = base.corrected(rotation, position, middle)
    return np.concatenate([position, Rotation.from_matrix(rotation).as_quat(), angle], axis=1)


def ground_again(
    body: Body,
    one: Grounded,
    angle: Array,
    *,
    every: int = 1,
    settings: LowPass | None = None,
    tilt: Array | float = 0.0,
) -> Grounded:
    """Return the motion with other joint ``angle`` (T / ``every``, n) rad, standing on the same feet as ``one`` does,
    of every so many of its instants; ``tilt`` (T / ``every``, 3) rad more than there.
    """
    base, foot = one.base[::every] if one.base else None, one.foot[::every]
    leans = tilt if one.tilt is None else one.tilt[::every] + tilt
    lean_over = leans if isinstance(leans, np.ndarray) else None
    turn, place, _ = _soles(body, angle)
    q = _q(angle, turn, place, foot, base=base, tilt=lean_over)
    motion = smooth(body, one.motion.time[::every], q, settings=settings)
    use, unclear = one.use[::every], one.unclear[::every]
    lean = None if one.lean is None else one.lean[::every]
    return replace(one, motion=motion, foot=foot, use=use, unclear=unclear, lean=lean, base=base, tilt=lean_over)


def _soles(body: Body, angle: Array) -> tuple[Array, Array, Array]:
    """Return both soles in the root's frame, turn and place, and ``height`` (2, T) m of the other's lowest corner."""
    root = np.array([0.0, 0, 0, 0, 0, 0, 1])
    # First row: zero angles, in which the sole says what is forwards.
    q = np.concatenate([np.tile(root, (len(angle) + 1, 1)), np.vstack([np.zeros(angle.shape[1]), angle])], axis=1)
    pose = poses(body, q)
    turn, place, corners = [], [], []
    for side in SIDES:
        foot = body.feet[side]
        rotation, position = pose.rotation[:, foot.segment], pose.position[:, foot.segment]
        up = sole_normal(foot)
        # Forwards of the root at zero angles, in the foot's axes; then square to the sole.
        ahead = rotation[0].T @ np.array([1.0, 0.0, 0.0])
        ahead = ahead - (ahead @ up) * up
        ahead /= np.linalg.norm(ahead)
        # Columns forwards, left, up: the sole's frame in the root's.
        turn.append(rotation[1:] @ np.stack([ahead, np.cross(up, ahead), up], axis=1))
        place.append(position[1:] + rotation[1:] @ foot.outline.mean(axis=0))
        corners.append(position[1:, None] + foot.outline @ np.swapaxes(rotation[1:], 1, 2))
    # Corners of the other foot above this sole's plane: its third axis times the way from its middle.
    height = [np.einsum("tkj,tj->tk", corners[1 - s] - place[s][:, None], turn[s][:, :, 2]).min(axis=1) for s in (0, 1)]
    return np.array(turn), np.array(place), np.array(height)


def _standing(stands: NDArray[np.bool_], rate: float) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return which foot stands (T,) and where that is certain (T,); ``stands`` (2, T) which could."""
    if not stands.any():
        raise TrialRefused(
            "At no time does a foot stand flat: each sole lies under the other's plane. Are columns swapped, or signs "
            "turned?"
        )
    # Where both could stand at first, the foot that could more often.
    foot, now = np.zeros(stands.shape[1], dtype=np.intp), int(np.argmax(stands.sum(axis=1)))
    starts = np.flatnonzero(stands.any(axis=0))
    now = int(np.argmax(stands[:, starts[0]])) if not stands[:, starts[0]].all() else now
    for t in range(foot.size):
        if not stands[now, t] and stands[1 - now, t]:
            now = 1 - now
        foot[t] = now
    both = np.asarray(stands.all(axis=0))
    for change in (np.flatnonzero(np.diff(foot)) + 1).tolist():  # into the middle of the time before it on both feet
        start = change
        while start > 0 and both[start - 1] and foot[start - 1] != foot[change]:
            start -= 1
        foot[(start + change) // 2 : change] = foot[change]
    use: NDArray[np.bool_] = np.array(stands[foot, np.arange(foot.size)])
    wide = round(_AROUND * rate)
    for change in np.flatnonzero(np.diff(foot)).tolist():
        use[max(0, change - wide) : change + wide + 1] = False
    # At both ends nothing tells whether the foot has just changed.
    use[:wide] = use[-wide:] = False
    for start, stop in runs(use):
        # 0.5 s: shorter stances are looked over
        if stop - start < 0.5 * rate:
            use[start:stop] = False
    return foot, use


def _chained(turn: Array, place: Array, foot: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return turn (T, 3, 3) and place (T, 3) m of the root in the frame of the first standing sole."""
    rotation, position = np.empty(turn.shape[1:]), np.empty(place.shape[1:])
    yaw, at = np.eye(3), np.zeros(3)
    edges = [0, *(np.flatnonzero(np.diff(foot)) + 1).tolist(), foot.size]
    for start, stop in pairwise(edges):
        side = foot[start]
        if start:  # the root as the foot before sees it, then the new sole from the root, laid flat
            before = 1 - side
            # Root in the frame so far: the sole before stands at `at`, `yaw`; R_root = yaw R_sole'.
            root = yaw @ turn[before, start].T
            origin = at - root @ place[before, start]
            at, yaw = origin + root @ place[side, start], root @ turn[side, start]
            # Laid flat: height zero and only the yaw of the new sole is kept.
            at, yaw = at * np.array([1.0, 1.0, 0.0]), elementary_rotation("z", float(np.arctan2(yaw[1, 0], yaw[0, 0])))
        # Inverse of the sole in the root's frame: R' and -R' p.
        rotation[start:stop] = yaw @ np.swapaxes(turn[side, start:stop], 1, 2)
        position[start:stop] = at - np.einsum("tij,tj->ti", rotation[start:stop], place[side, start:stop])
    return rotation, position


# Both paths are complex numbers x + i y. Between a path and the same path turned, shifted and late, the normalised
# correlation at the right delay is 1 in size, its angle is the turn; turns and shifts need no search. All delays at
# which half of the shorter recording overlaps are tried at once (fast Fourier transform, gaps masked: Padfield 2012,
# doi:10.1109/TIP.2011.2181402).


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
    # 0.002 m: centres of pressure that stay nearer than this (sd) tell no time
    if path[mask].std() < 0.002 if mask.any() else True:
        raise TrialRefused(
            "The centre of pressure hardly moves, so plate and encoders cannot be brought together. Record a motion "
            "that shifts the weight."
        )
    correlation, slope, first, second = _correlated(path, mask, other, np.isfinite(other))
    # Lag k of the list is k - (n - 1) samples, behind the difference of the clocks' starts.
    late = clock[0] - needed.time[0] + (np.arange(correlation.size) - (path.size - 1)) / rate
    size = np.where(np.abs(late) <= within, np.abs(correlation), 0.0)
    k = int(np.argmax(size))
    if size[k] == 0:
        raise TrialRefused(
            f"Plate and encoders overlap for less than half of {min(path.size, other.size) / rate:.1f} s."
        )
    part = _peak(size, k)
    lag = k - (path.size - 1) + part
    # A complex slope of unit size is the turn; what is beyond one is the scale.
    turn = slope[k] / abs(slope[k])
    # Means over the overlap: turned path plus shift.
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
    """Return the wrench (T, 6) at ``time`` (T,) s of the motion, in the first standing sole's frame, or NaN."""
    at = time + fit.delay
    seen = np.stack([np.interp(at, measured.time, one, left=np.nan, right=np.nan) for one in measured.value.T], axis=1)
    return from_plate(seen, fit.place, fit.yaw)


def from_plate(wrench: Array, place: tuple[float, float], yaw: float) -> Array:
    """Return a wrench (T, 6) about the lab origin in a frame at ``place`` m, turned by ``yaw`` rad about z."""
    # R' leads from the lab to the turned frame.
    return turned_wrench(wrench_about_point(wrench, np.array([*place, 0.0])), elementary_rotation("z", yaw).T)


def _path(wrench: Array) -> NDArray[np.complex128]:
    """Return the centre of pressure (T,) as x + i y, m; NaN where hardly anything presses."""
    force = wrench[:, 2]
    least = 0.2 * np.nanmedian(np.abs(force))
    path = np.full(force.size, complex(np.nan, np.nan))
    some = np.abs(force) > max(least, 1e-9)
    # Centre of pressure x = -My / Fz, y = Mx / Fz, as one complex number.
    path[some] = (-wrench[some, 4] + 1j * wrench[some, 3]) / force[some]
    return path


def _correlated(
    a: NDArray[np.complex128], a_mask: NDArray[np.bool_], b: NDArray[np.complex128], b_mask: NDArray[np.bool_]
) -> tuple[NDArray[np.complex128], ...]:
    """Return for every lag of b behind a: correlation, slope of b on a, and their means over the overlap."""
    # About their own means: less is lost by rounding in the sums of products.
    shift_a, shift_b = a[a_mask].mean(), b[b_mask].mean()
    x, y = (np.where(m, z - c, 0) for z, m, c in ((a, a_mask, shift_a), (b, b_mask, shift_b)))
    size = 1 << int(np.ceil(np.log2(a.size + b.size)))
    # No lag wraps round at a length of at least both together; negative lags lie at the end.
    lags = (np.arange(-(a.size - 1), b.size)) % size

    def sums(one: NDArray[Any], other: NDArray[Any]) -> NDArray[np.complex128]:
        product = np.conj(np.fft.fft(one, size)) * np.fft.fft(other, size)
        # sum over n of conj(one[n]) other[n + lag], for all lags at once.
        return np.asarray(np.fft.ifft(product)[lags])

    count = sums(a_mask * 1.0, b_mask * 1.0).real.round()
    n = np.maximum(count, 1)
    # Number, means and products over the frames that both have at this lag.
    mean_a, mean_b = np.conj(sums(x, b_mask * 1.0)) / n, sums(a_mask * 1.0, y) / n
    both = sums(x, y) / n - np.conj(mean_a) * mean_b
    own_a = sums(np.abs(x) ** 2, b_mask * 1.0).real / n - np.abs(mean_a) ** 2
    own_b = sums(a_mask * 1.0, np.abs(y) ** 2).real / n - np.abs(mean_b) ** 2
    # Share of the shorter recording that must overlap
    enough = (count >= 0.5 * min(a_mask.sum(), b_mask.sum())) & (own_a > 1e-8) & (own_b > 1e-8)
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
    return wrench_about_point(turned_wrench(wrench, elementary_rotation("z", fit.yaw)), -np.array([*fit.place, 0.0]))

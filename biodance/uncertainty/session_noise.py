"""What a session tells about its own instruments and skin: camera noise from the markers' fastest changes, plate noise
from the forces'; what camera noise does to the wrench that a motion needs; and how restless its skin is.

White noise of standard deviation s changes the fourth difference of its samples by sqrt(70) s, a movement of a few
hertz hardly at all. Least squares carries marker noise into the tangent of the posture with the covariance
s² (J'WJ)^-1 J'W²J (J'WJ)^-1 (J the marker Jacobian, W the markers' weights), differentiating twice multiplies it by
(2 pi f)^2, and the wrench is linear in accelerations.

Errors of soft tissue that go with the movement are looked for one by one (`sources`), all markers of a segment alike.
What goes its own way (waves of flesh, clothes, a strap that works loose) follows no column, and neither does flesh that
lags behind the acceleration where every marker of a segment lags otherwise: both can only be noise, and the markers
show how much of it there is, where, and how fast it is.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.parts import GRAVITY
from biodance.body.tables.error_sizes import error_size, joint_size
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import Poses, place_jacobian, poses
from biodance.records import CHANNELS, Array, Markers, Motion, Plate, Trial
from biodance.spatial import quaternion_matrix
from biodance.uncertainty.bands import BANDS, Noise
from biodance.uncertainty.tolerances import REFERENCE_PERSON, InstrumentNoise, Tolerances

_ORDER = 4
_GAIN = np.sqrt(70.0)
"""Standard deviation of the fourth difference of unit white noise: 1, -4, 6, -4, 1."""
NORMAL_OVER_MEDIAN = 1.4826
"""Standard deviation of normal numbers over the median of their absolute values."""
_ENOUGH = 50
"""Samples below which no noise is estimated."""
_COHERENT = 4.0
"""Times as large as independent noise counts what cameras add: the same noise is in the accelerations that loads and
segments are seen by, so that it looks like lighter segments (errors in variables). Without it nine of ten clean
sessions of an independent laboratory with cameras of 0.3 mm were unlike people; with it one of eight.
"""
_LEVER = 0.03
"""m: a joint whose markers move less than this per rad is not carried by them alone; its neighbours in time hold it."""


def white_noise(samples: Array) -> Array:
    """Return the standard deviation (...) of white noise in ``samples`` (T, ...), NaN = not seen; NaN where there are
    too few.
    """
    # Cubic movement vanishes in the fourth difference; white noise keeps sqrt(1 + 16 + 36 + 16 + 1) = sqrt(70).
    change = np.abs(np.diff(samples, n=_ORDER, axis=0))
    enough = np.isfinite(change).sum(axis=0) >= _ENOUGH
    value = np.full(samples.shape[1:], np.nan)
    if enough.any():
        # Median of absolute values, as sudden movement and exchanged labels are no noise.
        value[enough] = NORMAL_OVER_MEDIAN / _GAIN * np.nanmedian(change[:, enough], axis=0)
    return value


def camera_noise(trials: Iterable[Markers]) -> float:
    """Return the noise of one marker coordinate from frame to frame, m: the median over markers, axes and trials; 0
    where no marker is seen for long.
    """
    found = [np.empty(0)]
    for one in trials:
        long = np.isfinite(one.xyz).all(axis=2).sum(axis=0) >= _ENOUGH + _ORDER
        found.append(white_noise(one.xyz[:, long]).ravel())
    values = np.concatenate(found)
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size else 0.0


def plate_noise(plates: Iterable[Plate]) -> Array:
    """Return (6,) N, N·m per square root of Hz: noise density of the quietest plate and recording of ``plates`` as
    recorded (not filtered), moments about its centre; 0 without any that is long enough.
    """
    found = []
    for one in plates:
        time, value, centre = one.wrench.time, one.wrench.value, one.centre
        if time.size < _ENOUGH + _ORDER:
            continue
        # Moment about the plate's centre: M - c x F.
        local = np.concatenate([value[:, :3], value[:, 3:] - np.cross(centre, value[:, :3])], axis=1)
        # Density: variance over half the sampling rate, sd / sqrt(rate / 2) = sd sqrt(2 dt).
        found.append(white_noise(local) * np.sqrt(2 * float(np.median(np.diff(time)))))
    return np.min(np.nan_to_num(found), axis=0) if found else np.zeros(6)


def carried(body: Body, q: Array, about: Array) -> Array:
    """Return (3, M, 6, 6): covariance of the wrench about ``about`` (3,) m that each of the M markers adds in the
    posture ``q`` (nq,), per m² of independent noise: of what is displaced and has weight; per (rad/s)², of that beside
    what is accelerated (negative: a place and its second derivative are opposite); per (rad/s)⁴, of what is
    accelerated.
    """
    pose = poses(body, q[None])
    segment = list(body.markers.segment)
    points = pose.points(segment, body.markers.position)
    # Least squares with weights W: dq = (J'WJ)^-1 J'W x, with `_LEVER`² (m² per rad²) as a ridge.
    place = place_jacobian(body, pose, segment, points)
    weighted = np.repeat(np.asarray(body.markers.weight), 3)[:, None] * place[0]
    followed = np.linalg.inv(place[0].T @ weighted + _LEVER**2 * np.eye(body.nv)) @ weighted.T
    # (6, 3M) to (M, 6, 3): each marker's own covariance, its three coordinates independent.
    return _powers(*((one @ followed).reshape(6, -1, 3).swapaxes(0, 1) for one in _felt(body, q, about)))


def of_unseen_joints(body: Body, postures: Array, about: Array) -> Array:
    """Return (B, 6, 6): covariance of one coefficient per band that joints add which no marker shows (`Body.free`) and
    which the simulation holds still, the trunk upright: each is accelerated by the size ``unseen_joint`` of the table,
    rad/s² root mean square in the band, evenly over its frequencies (angles fall with the square of the frequency);
    mean over the ``postures`` (n, nq), each with the joints held, and bent as far as they are on average.

    The mean of a trial is left out: how far unseen matter lies from where it is taken for is among what is not known
    of the body (``unseen_com``).
    """
    hidden = [k for k, free in enumerate(body.free) if not free]
    out = np.zeros((len(BANDS), 6, 6))
    if not hidden:
        return out
    names, at = [body.joints[k].name for k in hidden], [body.n_root + k for k in hidden]
    bent = np.zeros(body.nq)
    bent[[body.nq - len(body.joints) + k for k in hidden]] = [_unseen(name, "mean") for name in names]
    # Bent both ways, so that the mean over postures has no side.
    every = np.concatenate([postures, postures + bent, postures - bent])
    felt = [[one[:, at].T[:, :, None] for one in _felt(body, q, about)] for q in every]
    each = np.mean([_powers(*one) for one in felt], axis=0)
    edges = 2 * np.pi * np.array(BANDS.edges[1:])
    # Acceleration a has the power a² at every frequency of the band: its angle a² / w⁴; mean
    # over the band of w^-4, w^-2 and 1.
    power = np.stack([np.diff(edges**-k) / -k / np.diff(edges) for k in (3, 1, -1)], axis=1)
    for b, (low, high) in enumerate(pairwise(BANDS.edges[1:])):
        sd = np.array([_unseen(name, f"{low:g} to {high:g} Hz") for name in names])
        # Orthonormal cosines: variance sd² in a band of width h - l over the rate / 2 of all
        # gives each coefficient so much.
        out[b + 1] = np.einsum("k,j,kjlm->lm", power[b], sd**2 * BANDS.rate / (2 * (high - low)), each)
    return out


def _unseen(joint: str, state: str) -> float:
    """Return how far an unseen joint is bent (``mean``), rad, or accelerated within a band, rad/s², about one axis."""
    return joint_size("unseen_joint", joint.rsplit("_", 1)[0], state=state)


def _felt(body: Body, q: Array, about: Array) -> tuple[Array, Array]:
    """Return (6, nv) twice: the wrench about ``about`` (3,) m per unit displaced (weight), and accelerated."""
    pose, turn = poses(body, q[None]), np.eye(body.nv)
    if body.n_root:
        # Pinocchio's root velocities are in the root's axes; the tangent here is in lab axes: R' brings them there.
        to_root = quaternion_matrix(q[None, 3:7])[0].T
        turn[:3, :3], turn[3:6, 3:6] = to_root, to_root
    # First row: no acceleration (the weight alone); then one unit of each coordinate.
    rows = np.vstack([np.zeros(body.nv), np.eye(body.nv)]) @ turn.T
    still = Motion(np.arange(len(rows)) / 100.0, np.tile(q, (len(rows), 1)), np.zeros_like(rows), rows)
    value = predict_wrench(body, still).value
    # Linear in accelerations at rest: less the weight, column i is the wrench per unit acceleration of i.
    return _hung(body, pose), Noise.unit(about, BANDS).shift @ (value[1:] - value[0]).T


def _powers(hung: Array, moved: Array) -> Array:
    """Return (3, n, 6, 6): covariance per power 0, 2, 4 of the angular frequency of n errors, as `_felt` tells them."""
    # Wrench H x + M x'', with x'' = -w² x: H H' - w² (H M' + M H') + w⁴ M M'.
    both = hung @ moved.swapaxes(1, 2)
    return np.stack([hung @ hung.swapaxes(1, 2), -(both + both.swapaxes(1, 2)), moved @ moved.swapaxes(1, 2)])


def _hung(body: Body, pose: Poses) -> Array:
    """Return (6, nv): what displacing the tangent of a posture adds to the wrench because every segment has weight."""
    every = list(range(len(body.segments)))
    centres = place_jacobian(body, pose, every, pose.points(every, body.sip.com))[0].reshape(len(every), 3, -1)
    # A displacement u moves the weight: moment u x (-m g) of what the ground must carry.
    lifted = np.cross(centres, -body.gravity, axisa=1, axisc=1)
    # Sum over segments s of m_s (u_s x -g); no force, as weight stays the same.
    return np.concatenate([np.zeros((3, centres.shape[2])), np.einsum("s,sij->ij", body.sip.mass, lifted)])


def of_marker_errors(body: Body, postures: Array, about: Array, power: Array) -> Array:
    """Return (B, 6, 6): covariance of one coefficient per band that markers add to the wrench residual which err by
    ``power`` (B, 3), or (B, 3, M) each by its own, per axis: m² times the powers 0, 2 and 4 of the angular frequency;
    mean over the ``postures`` (n, nq).
    """
    each = power.reshape(*power.shape[:2], -1) * np.ones(len(body.markers.names))
    # sum over powers k and markers m of power[b, k, m] covariance[k, m, i, j].
    return np.einsum("bkm,kmij->bij", each, np.mean([carried(body, q, about) for q in postures], axis=0))


def of_cameras(body: Body, postures: Array, about: Array, *, noise: float, rate: float) -> Array:
    """Return (B, 6, 6): covariance of one coefficient per band that marker noise of ``noise`` m at ``rate`` Hz adds to
    the wrench residual, mean over the ``postures`` (n, nq).
    """
    edges = 2 * np.pi * np.array(BANDS.edges)
    # Mean of w^0, w², w⁴ over a band: difference of w^k / k at its edges over its width.
    power = np.stack([np.diff(edges**k) / k / np.diff(edges) for k in (1, 3, 5)], axis=1)
    # Noise white up to rate / 2 keeps BANDS.rate / rate of its power below half of BANDS.rate.
    return of_marker_errors(body, postures, about, noise**2 * min(1.0, BANDS.rate / rate) * power)


def of_plates(density: Array, count: int) -> Array:
    """Return (6, 6): covariance of one coefficient from the noise of ``count`` plates of ``density`` (6,) N, N·m per
    root Hz each.
    """
    # Density² times half the rate: variance of each coefficient of white noise (orthonormal cosines).
    return np.diag(count * density**2 * BANDS.rate / 2)


def of_zeros(seconds: Sequence[float]) -> Array:
    """Return (B, 6, 6): covariance of one coefficient from plates whose zero is not quite the same in every run of so
    many ``seconds``: of the mean of a run alone, which longer runs make no surer.
    """
    out = np.zeros((len(BANDS), 6, 6))
    sd = np.repeat([error_size("plate_zero", "force"), error_size("plate_zero", "moment")], 3)
    if len(seconds):
        # A constant z over n samples has the first coefficient sqrt(n) z: variance n sd², n = seconds times rate.
        out[0] = float(np.mean(seconds)) * BANDS.rate * np.diag(sd**2)
    return out


def added_noise(
    body: Body, recorded: Iterable[Trial], postures: Array, about: Array, *, known: InstrumentNoise | None = None
) -> Array:
    """Return (B, 6, 6): how much larger the covariance of one coefficient is with the cameras and plates of the trials
    as ``recorded`` than with the ``known`` ones, where tolerances were learned; never smaller: what is quieter may be
    filtered.
    """
    trials = tuple(recorded)
    markers = [one.markers for one in trials if one.markers is not None and one.markers.time.size > 1]
    cameras, plates = camera_noise(markers), plate_noise(plate for one in trials for plate in one.plates)
    usual = known or InstrumentNoise()
    beyond = np.sqrt(max(0.0, cameras**2 - usual.camera**2))
    density = np.sqrt(np.maximum(0.0, plates**2 - np.array(usual.plate) ** 2))
    count = max((len(one.plates) for one in trials), default=1)
    out = np.tile(of_plates(density, count), (len(BANDS), 1, 1))
    if beyond > 0:
        rate = float(np.median([one.rate for one in markers]))
        # Only the camera noise beyond that of the sessions that the tolerances were learned on.
        out += _COHERENT * of_cameras(body, postures, about, noise=float(beyond), rate=rate)
    return np.asarray(out)


def with_zeros(known: Tolerances, zeros: Array, mass: float) -> Tolerances:
    """Return tolerances with the spread ``zeros`` (B, 6, 6) of the plates' zeros (`of_zeros`), for a person of ``mass``
    kg.
    """
    found = with_own_noise(known, zeros, mass)
    return replace(found, zeros=found.noise - known.noise)


def with_movement(known: Tolerances, needed: Array) -> Tolerances:
    """Return the tolerances with noise as it is where the movement needs forces of mean square ``needed`` (B, 6) per
    coefficient at `REFERENCE_PERSON`.

    The error of a simulated force is that of accelerations, and these err by a share of themselves: who walks, runs or
    jumps leaves so many times more as the movement needs more in that band than the movement that the noise was learned
    on (s_b^2 = mean over channels of needed / learned, at least 1). A mean force is weight, and a mean level moment
    where it stands, whatever the movement: there the other means count, and the vertical force keeps its noise.
    """
    ratio = needed / known.movement
    level = ratio[0, [CHANNELS.index(name) for name in ("Fx", "Fy", "Mz")]]
    more = np.sqrt(np.maximum(1.0, np.append(level.mean(), ratio[1:].mean(axis=1))))[:, None] * np.ones(len(CHANNELS))
    more[0, CHANNELS.index("Fz")] = 1.0
    # D N D with D = diag(more): every channel's standard deviation grows, correlations stay.
    return replace(known, noise=known.noise * more[:, :, None] * more[:, None, :])


def with_own_noise(known: Tolerances, added: Array, mass: float) -> Tolerances:
    """Return tolerances whose noise grows by ``added`` (B, 6, 6), for a person of ``mass`` kg: limits and adequacy
    follow.
    """
    # Noise is learned per person of the reference mass: covariances scale with the square of the mass.
    return replace(known, noise=known.noise + added * (REFERENCE_PERSON / mass) ** 2)


_RATE = 50.0
"""Hz at which markers are looked at: second differences of what is slower than 6 Hz are good to 10 %."""
_FEWEST = 10.0
"""Coefficients per band and axis, beside those that the movement explains, below which nothing is measured."""
_LOUDEST = 9.0
"""Times the power of the middle marker (three times its size) beyond which a marker is wrong rather than restless."""
_EXPLAINED = 1e-6
"""Share of a specific force beside the joint angles below which these explain it."""


@dataclass(frozen=True, eq=False)
class SkinUnrest:
    """What the markers do on the body per axis and coefficient, in every band: (B, 3, M) m², m²/s², m²/s⁴, the power
    times the powers 0, 2 and 4 of its angular frequency; zero in bands where too little is left to tell and for markers
    that tell nothing (weight zero, seen in less than half of the time).

    ``waves`` what neither joint angles nor the specific force at the marker explain; ``swing`` what the specific force
    explains beside the angles: flesh that lags behind the acceleration.
    """

    waves: Array
    swing: Array

    def sizes(self) -> tuple[Array, Array]:
        """Return (B,) m of the waves and of the swing: the middle marker, as one that is wrong tells nothing."""
        return np.sqrt(_middle(self.waves)[:, 0]), np.sqrt(_middle(self.swing)[:, 0])

    def excess(self, waves: tuple[float, ...], swing: tuple[float, ...]) -> Array:
        """Return (B, 3, M): power that is more than usual, where (B,) m of ``waves`` and ``swing`` are; of the waves
        none in the fastest band, where markers show the cameras.
        """
        own = _excess(self.waves, waves)
        own[-1] = 0.0
        return own + _excess(self.swing, swing)


@dataclass(frozen=True, eq=False)
class _Runs:
    """Coefficients of all runs: joint ``angles`` with a constant, places and ``specific`` force of markers."""

    angles: Array
    local: Array
    specific: Array
    frequency: Array


def skin_unrest(body: Body, moved: Iterable[tuple[Trial, Motion, NDArray[np.bool_]]]) -> SkinUnrest:
    """Return what the markers of ``body`` do on it in ``moved`` trials, with its motion and the frames (T,) to look at.

    Least squares take off what the joint angles explain, then what the specific force at the marker does, with the same
    coefficients in all trials.
    """
    found = [one for trial, motion, use in moved for one in _runs(body, trial, motion, use)]
    out = np.zeros((2, len(BANDS), 3, len(body.markers.names)))
    if found:
        every = _Runs(*(np.concatenate([getattr(one, part) for one in found]) for part in _Runs.__dataclass_fields__))
        for k in np.flatnonzero(np.asarray(body.markers.weight) > 0):
            out[..., k] = _left(every, int(k))
    return SkinUnrest(*out)


def _middle(power: Array) -> Array:
    """Return (B, 3): the median of ``power`` (B, 3, M) over the markers that tell anything."""
    told = power[:, :, power.any(axis=(0, 1))]
    return np.median(told, axis=2) if told.size else np.zeros(power.shape[:2])


def _excess(power: Array, usual: tuple[float, ...]) -> Array:
    """Return (B, 3, M): the share of every marker's ``power`` by which the middle one exceeds the ``usual`` (B,) m."""
    middle = _middle(power)
    # Share of the power beyond the usual: 1 - usual² / measured², as independent parts add in power.
    share = np.maximum(1 - np.square(usual) / np.maximum(middle[:, 0], 1e-12), 0.0)
    return np.asarray(share[:, None, None] * np.minimum(power, _LOUDEST * middle[:, :, None]))


def _runs(body: Body, trial: Trial, motion: Motion, use: NDArray[np.bool_]) -> Iterator[_Runs]:
    """Yield the coefficients of every run of the frames ``use`` (T,) of a trial."""
    markers, step = trial.markers, max(1, round(motion.rate / _RATE)) if np.isfinite(motion.rate) else 0
    if markers is None or not step:
        return
    q, rate = motion.q[::step], motion.rate / step
    worn = [k for k, name in enumerate(body.markers.names) if name in markers]
    pose, segment = poses(body, q), [body.markers.segment[k] for k in worn]
    place = pose.points(segment, body.markers.position[worn])
    shape = (len(q), len(body.markers.names), 3)
    local, specific = np.full(shape, np.nan), np.zeros(shape)
    turn = pose.rotation[:, segment]
    apart = markers.select(body.markers.names[k] for k in worn).xyz[::step] - place
    # R' (measured - model): sum over i of R[t, k, i, j] d[t, k, i].
    local[:, worn] = np.einsum("tkij,tki->tkj", turn, apart)
    if len(q) > 2:
        acceleration = np.gradient(np.gradient(place, 1 / rate, axis=0), 1 / rate, axis=0)
        # Specific force g - a in the segment's axes: what flesh is pulled by.
        specific[:, worn] = np.einsum("tkij,tki->tkj", turn, GRAVITY - acceleration)
    angles = np.column_stack([np.ones(len(q)), q[:, 7 if body.n_root else 0 :]])
    bands = BANDS.at(rate)
    for pick in bands.runs(use[::step], rate):
        # As in `Bands.of`: k half periods in the run.
        frequency = np.arange(pick.size) * bands.rate / (2 * pick.size)
        kept = bands.of(pick.size) >= 0
        cut = [bands.coefficients(one[pick])[kept] for one in (angles, local, specific)]
        yield _Runs(cut[0], cut[1], cut[2], frequency[kept])


def _left(every: _Runs, marker: int) -> Array:
    """Return (2, B, 3): waves and swing of one marker per axis and coefficient; zero if unseen half of the time."""
    out, seen = np.zeros((2, len(BANDS), 3)), np.isfinite(every.local[:, marker]).all(axis=1)
    if seen.mean() < 0.5:
        return out
    angles, specific, place = every.angles[seen], every.specific[seen, marker], every.local[seen, marker]
    speed = 2 * np.pi * every.frequency[seen]
    band = np.searchsorted(BANDS.edges, every.frequency[seen], side="right") - 1
    # Columns that never move are left out: QR of a zero column would still give it a direction.
    basis = np.linalg.qr(angles[:, angles.any(axis=0)])[0]
    # Q Q' projects on the angles; what is left of place and specific force is orthogonal to them (Frisch-Waugh).
    rest, beside = (one - basis @ (basis.T @ one) for one in (place, specific))
    told = np.linalg.norm(beside, axis=0) > _EXPLAINED * np.linalg.norm(specific, axis=0)
    slow, beside = band < len(BANDS) - 1, beside[:, told]
    # Fitted in slow bands alone, applied in all: in the fastest, cameras would look like lag.
    swing = beside @ np.linalg.lstsq(beside[slow], rest[slow], rcond=None)[0]
    # 1 - leverage: how many coefficients of a band the angles leave (its sum is n - p over all).
    free = 1 - np.sum(basis**2, axis=1)
    for b in range(len(BANDS)):
        here = band == b
        if free[here].sum() >= _FEWEST:
            for which, (one, count) in enumerate(((rest - swing, free[here].sum()), (swing, here.sum()))):
                square = np.mean(one[here] ** 2, axis=1)
                # Powers of the angular frequency: displacement, and what it becomes in velocity and acceleration.
                out[which, b] = [np.sum(square * speed[here] ** power) / count for power in (0, 2, 4)]
    return out

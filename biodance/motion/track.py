"""From the markers of a trial to the motion of a body: inverse kinematics frame by frame, then smoothing with the
trial's own cut-off.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dst
from scipy.interpolate import make_interp_spline
from scipy.ndimage import binary_dilation, uniform_filter1d

from biodance.body.body import Body
from biodance.body.parts import UPRIGHT
from biodance.body.tables.error_sizes import error_size
from biodance.errors import BiodanceError, TrialRefused
from biodance.lab.markers.time_axis import of_postures
from biodance.lab.prepare import USUAL_CUTOFF, LowPass, low_pass, motion_filter
from biodance.motion.ik.inverse_kinematics import (
    FrameStatus,
    InverseKinematics,
    determination,
    general_jacobian,
    solve_ik,
)
from biodance.motion.kinematics import Chart, Smooth, chart_of, continued, neighbours, poses
from biodance.records import AngleState, Array, Markers, Motion, Trial
from biodance.records.arrays import rate_of
from biodance.records.attention import Doubt
from biodance.spatial import (
    cross,
    elementary_rotation,
    quaternion_conjugate,
    quaternion_matrix,
    quaternion_product,
    zxy_angles,
)
from biodance.threads import one_thread

_DEGREE = 5  # Degree of the spline: continuous acceleration and jerk

_PERIODS = 3  # Periods of the cut-off by which the ends are continued

_LEAST_COSINE = 1e-3
"""Smallest |cos| of a ball joint's second angle that rates are divided by: bounded near the singularity."""


_BLOCK = 2048
"""Frames whose angles are taken from the smooth coordinates together: little memory, whatever the length."""


def smooth(body: Body, time: Array, q: Array, *, settings: LowPass | None = None) -> Motion:
    """Return the smoothed motion of ``body`` from the postures ``q`` (T, nq) at the times ``time`` (T,) s, evenly
    spaced.

    ``settings`` None: the default low-pass. A single frame, and each of frames that lie too far apart to tell a
    movement between them (`of_postures`), is a posture at rest: v and a are zero. Joint angles may leave their limits
    by what the filter rounds off; in the first and last half period of the cut-off v and a are less certain. Root v and
    a: linear, angular, in the root's own frame, a = dv/dt (Pinocchio's convention).

    Raises
    ------
    TrialRefused
        The frames are unevenly spaced, hold NaN, or are too few for the low-pass.
    """
    settings = settings or LowPass()
    _check(time, q, settings)
    names = tuple(joint.name for joint in body.joints)
    if len(time) == 1 or of_postures(time):
        rest = np.zeros((len(time), body.nv))
        return Motion(time, q, rest, rest, joint_names=names)
    chart = chart_of(body)
    rough = np.asarray(q).T
    even, first, second = _slow(chart, rough, rate_of(time), settings)
    posture, v, a = (np.empty((len(time), count)) for count in (body.nq, body.nv, body.nv))
    for start in range(0, len(time), _BLOCK):
        part = slice(start, start + _BLOCK)
        near, at = rough[len(rough) - chart.joint_count :, part], (one.at(part) for one in (even, first, second))
        posture[part], v[part], a[part] = _moving(chart, near, *at)
    for filled in (posture, v, a):
        filled.setflags(write=False)  # the record keeps them without a copy
    return Motion(time, posture, v, a, joint_names=names)


def _moving(chart: Chart, near: Array, at: Smooth, first: Smooth, second: Smooth) -> tuple[Array, Array, Array]:
    """Return posture (B, nq), v and a (B, nv) from ``chart`` coordinates; ``near`` (n, B) rad picks angles."""
    n_root, posture = chart.n_root, chart.posture(at, near)
    v, a = np.empty((2, n_root + chart.joint_count, near.shape[1]))
    v[n_root + chart.single], a[n_root + chart.single] = first.angle, second.angle
    angles = posture[len(posture) - chart.joint_count :][chart.ball]
    balls = n_root + chart.ball
    v[balls], a[balls] = _ball_rates(chart.sign, angles, at.ball, first.ball, second.ball)
    if n_root:
        v[:6], a[:6] = _root_rates(at, first, second)
    return posture.T, v.T, a.T


def _slow(chart: Chart, rough: Array, rate: float, settings: LowPass) -> tuple[Smooth, Smooth, Smooth]:
    """Return low-passed postures ``rough`` (nq, T) in the coordinates of ``chart``, and their two first derivatives."""
    # The ends are continued with their acceleration mirrored: point reflection, as of forces, would make it zero there,
    # which costs a walker half the body weight in the last frames.
    values = chart.smooth(rough).stacked()
    period = settings.shortest(rate)
    count = min(_PERIODS * period, values.shape[1] - 1)
    before, behind = (_beyond(side, period, count) for side in (values, values[:, ::-1]))
    even, span = np.hstack([before[:, ::-1], values, behind]), slice(count, count + values.shape[1])
    filtered = chart.split(low_pass(even.T, rate, settings).T)
    even = Smooth(filtered.place, continued(filtered.root), continued(filtered.ball), filtered.angle).stacked()
    del values, before, behind, filtered  # what is derived needs the memory
    time = np.arange(even.shape[1]) / rate
    ends = [(order, np.zeros(len(even))) for order in (3, 4)]  # natural: third and fourth derivative vanish
    spline = make_interp_spline(time, even.T, k=_DEGREE, bc_type=(ends, ends))
    first, second = spline(time, nu=1).T, spline(time, nu=2).T
    return chart.split(even[:, span]), chart.split(first[:, span]), chart.split(second[:, span])


def _beyond(values: Array, period: int, count: int) -> Array:
    """Return ``count`` samples (m, count) that come before ``values`` (m, T), the nearest first."""
    slope = np.polynomial.polynomial.polyfit(np.arange(min(period, values.shape[1])), values[:, :period].T, 3)[1]
    # x(-t) = x(t) - 2 slope t: the slope goes on, all else is mirrored, the acceleration too.
    return values[:, 1 : count + 1] - 2 * slope[:, None] * np.arange(1, count + 1)


def _check(time: Array, q: Array, settings: LowPass) -> None:
    """Refuse what cannot be smoothed."""
    bad = np.isnan(q).any(axis=1)
    if bad.any():
        raise TrialRefused(
            f"Frame {int(bad.argmax())} has no posture (NaN); smooth only frames that the inverse kinematics gave."
        )
    if len(time) < 2 or of_postures(time):
        return
    steps = np.diff(time)
    if np.ptp(steps) > 0.01 * steps.mean():
        frame = int(np.abs(steps - np.median(steps)).argmax())
        raise TrialRefused(
            f"The frames are not evenly spaced: {steps[frame]:g} s after frame {frame}, {np.median(steps):g} s usually."
        )
    need = max(settings.shortest(rate_of(time)), _DEGREE + 1)
    if len(time) < need:
        raise TrialRefused(
            f"{len(time)} frames at {rate_of(time):g} Hz are too few for velocities behind a low-pass at "
            f"{settings.cutoff:g} Hz: at least {need} are needed. Record longer, or use one frame as a static pose."
        )


def _root_rates(at: Smooth, first: Smooth, second: Smooth) -> tuple[Array, Array]:
    """Return v and a (6, T) of the root: linear, angular, in its own frame."""
    turn, back = quaternion_matrix(at.root.T), quaternion_conjugate(at.root.T)
    half = quaternion_product(back, first.root.T)
    omega = 2 * half[:, :3]
    # 2 q* q'' has the rate of the quaternion's size in it, which a spline does not keep
    # constant: 4 (q* q')_w taken off.
    alpha = 2 * quaternion_product(back, second.root.T)[:, :3] - 4 * half[:, 3:] * half[:, :3]
    linear = np.einsum("tji,jt->ti", turn, first.place)
    acceleration = np.einsum("tji,jt->ti", turn, second.place) - cross(omega, linear)
    return np.concatenate([linear, omega], axis=1).T, np.concatenate([acceleration, alpha], axis=1).T


def _ball_rates(sign: Array, angles: Array, at: Array, first: Array, second: Array) -> tuple[Array, Array]:
    """Return rates and accelerations (3, G, T) of ball joints' angles from quaternions (4, G, T)."""
    at, first, second = (np.moveaxis(one, 0, -1) for one in (at, first, second))
    back = quaternion_conjugate(at)
    half, change = (np.moveaxis(quaternion_product(one, back), -1, 0) for one in (first, second))
    omega = 2 * half[:3]
    alpha = 2 * change[:3] - 4 * half[3] * half[:3]
    sine, cosine = np.sin(sign * angles[1]), np.cos(sign * angles[1])
    cosine = np.where(np.abs(cosine) < _LEAST_COSINE, np.copysign(_LEAST_COSINE, cosine), cosine)
    w, dw = _before_first(sign * angles[0], omega), _before_first(sign * angles[0], alpha)
    # In the frame after the first angle w = (rate1 + sin t2 rate3, rate2, cos t2 rate3).
    rate3 = w[2] / cosine
    rate1 = w[0] - sine * rate3
    dw = dw - rate1 * np.stack([np.zeros_like(rate1), -w[2], w[1]])  # it turns with rate1 e1
    second3 = (dw[2] + sine * w[1] * rate3) / cosine
    second1 = dw[0] - cosine * w[1] * rate3 - sine * second3
    return sign * np.stack([rate1, w[1], rate3]), sign * np.stack([second1, dw[1], second3])


def _before_first(angle: Array, vector: Array) -> Array:
    """Return vectors (3, G, T) written in the frame that is turned about the first axis by ``angle`` (G, T) rad."""
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.stack([vector[0], cosine * vector[1] + sine * vector[2], cosine * vector[2] - sine * vector[1]])


_LARGEST_ADDED = np.radians(5.0)
"""rad, the largest standard deviation that missing markers may add to an angle: errors above 5 degrees mislead clinical
interpretation (review: McGinley et al. 2009, doi:10.1016/j.gaitpost.2008.09.003)."""
_ROOT = (1.0, np.pi / np.sqrt(3))
"""m and rad, standard deviations of the root before any marker is seen: anywhere in the laboratory, turned at will."""


def angle_states(
    body: Body, markers: Markers, status: NDArray[np.int8], low_pass: LowPass
) -> tuple[NDArray[np.bool_], NDArray[np.int8]]:
    """Return (T,) whether each frame's posture is determined, and (T, n) the `AngleState` of every joint angle.

    ``body`` with the joints held that the whole trial leaves open; their angles are not determined. ``status`` (T,)
    ``FrameStatus`` of the inverse kinematics: a frame that leans or was stopped is not determined. Without the root's
    turn, and in a stopped frame, no angle is; without any marker of a segment that the trial shows at other times, none
    of the joints at its ends is. The ``low_pass`` carries what is guessed half a period of its cut-off further.
    """
    names = tuple(name for name in body.markers.names if name in markers)
    columns, worn = [body.markers.names.index(name) for name in names], markers.select(names)
    given = _given(body, columns)
    segments = np.array([body.markers.segment[column] for column in columns], dtype=int)
    left = _open(given, body, segments, worn.seen, worn.seen)
    own = left if worn.measured is worn.seen else _open(given, body, segments, worn.measured, worn.seen)
    left[status == FrameStatus.STOPPED] = True
    if worn.time.size > 1:
        reach = round(worn.rate / (2 * low_pass.cutoff))
        left = binary_dilation(left, np.ones((2 * reach + 1, 1), dtype=bool))
    state = np.where(left, AngleState.NOT_DETERMINED, np.where(own, AngleState.FILLED, AngleState.MEASURED))
    determined = (status == FrameStatus.SOLVED) & ~left.any(axis=1)
    angles = state[:, body.n_root :].astype(np.int8)
    angles[:, ~body.free] = AngleState.NOT_DETERMINED
    return determined, angles


def _given(body: Body, columns: list[int]) -> tuple[Array, Array]:
    """Return what each marker tells of the posture (K, nv, nv), and what is known without: 1/m², 1/rad²."""
    jacobian = general_jacobian(body, columns) * np.concatenate([np.ones(body.n_root), body.free])
    weight = body.markers.weight[columns] / error_size("soft_tissue", "marker") ** 2
    told = weight[:, None, None] * (np.swapaxes(jacobian, 1, 2) @ jacobian)
    span = np.maximum(body.limits.upper - body.limits.lower, 1e-3) / np.sqrt(12)  # sd of a uniform density
    half = body.n_root // 2
    return told, np.concatenate([np.full(half, _ROOT[0]), np.full(half, _ROOT[1]), span]) ** -2


def _open(
    given: tuple[Array, Array],
    body: Body,
    segments: NDArray[np.intp],
    seen: NDArray[np.bool_],
    shown: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Return (T, nv) the coordinates to which markers not ``seen`` (T, K) add more than `_LARGEST_ADDED`."""
    told, before = given
    patterns, which = np.unique(seen, axis=0, return_inverse=True)
    ever = shown.any(axis=0)
    # Information of the markers seen, and of the prior; the last pattern has all markers that are ever shown.
    precision = np.tensordot(np.vstack([patterns, ever]).astype(float), told, axes=1) + np.diag(before)
    variance = np.diagonal(np.linalg.inv(precision), axis1=1, axis2=2)
    open_ = variance[:-1] - variance[-1] > _LARGEST_ADDED**2
    open_[:, : body.n_root // 2] = False  # m: where the root is, a single marker tells
    open_[:, body.n_root :] &= body.free
    ends = neighbours(body) > 0
    for segment in np.unique(segments[ever]):
        unseen = ~patterns[:, segments == segment].any(axis=1)
        open_[unseen, body.n_root // 2 : body.n_root] |= segment == 0
        open_[unseen, body.n_root :] |= ends[:, segment] & body.free
    open_[open_[:, : body.n_root].any(axis=1)] = True
    return np.asarray(open_[which.ravel()])


_STRIDE = 1.0
"""s over which the direction that the pelvis faces is averaged: about one stride, in which it turns to and fro."""


def upright_trunk(body: Body, q: Array, rate: float) -> Array:
    """Return postures q (T, nq) at ``rate`` Hz with the unseen trunk upright, facing as the pelvis does on average.

    The body is returned to as it is where the trunk is seen, or is no ball joint.
    """
    chain = [i for i, joint in enumerate(body.joints) if joint.name.rsplit("_", 1)[0] == "trunk"]
    if len(chain) != 3 or body.free[chain].any():
        return q
    pelvis = poses(body, q).rotation[:, 0]
    facing = np.unwrap(np.arctan2(pelvis[:, 1, 0], pelvis[:, 0, 0]))
    width = min(len(q), max(1, round(_STRIDE * rate)))
    heading = uniform_filter1d(facing, width, mode="nearest") if len(q) > 1 else facing
    relative = np.swapaxes(pelvis @ body.joints[chain[0]].rotation, 1, 2) @ (
        elementary_rotation("z", heading) @ UPRIGHT
    )
    out = np.array(q)
    first = body.nq - len(body.joints)
    signs = [float(body.joints[i].axis.sum()) for i in chain]
    for i, sign, angle in zip(chain, signs, zxy_angles(relative), strict=True):
        out[:, first + i] = sign * angle
    return out


@one_thread()
def track(body: Body, trial: Trial) -> Motion:
    """Return the motion of a body under the markers of a trial, matched by name, low-passed as ``trial.settings`` say.

    Parameters
    ----------
    body : Body
        Who moves, with its markers.
    trial : Trial
        With markers, best prepared (gaps filled).

    Returns
    -------
    Motion
        ``residual`` (T, K) m are the distances before smoothing, of the markers that both share; ``determined`` (T,) is
        False where a frame's own markers leave its posture open or do not let it settle; ``state`` (T, n) says it of
        every angle; ``notes`` say so.

    Raises
    ------
    TrialRefused
        The trial has no markers, no frame with enough of them (the missing ones are named), or too few or uneven frames
        to smooth.

    References
    ----------
    Multi-body optimisation: Lu & O'Connor 1999, doi:10.1016/S0021-9290(98)00158-4; docs/derivations.md.

    Examples
    --------
    >>> biodance.track(biodance.scale(session.subject, session["static"]), session["squat_1"])
    Motion(23 joint angles, 611 frames at 100 Hz, 6.10 s)
    """
    worn = trial.markers if trial.markers is not None else Markers((), np.empty(0), np.empty((0, 0, 3)))
    return Followed(body, worn).motion(trial)


@dataclass(frozen=True, eq=False)
class Followed:
    """A ``body`` under the ``markers`` of one trial; its postures are searched when they are first asked for."""

    body: Body
    markers: Markers

    @cached_property
    def held(self) -> tuple[Body, tuple[str, ...]]:
        """The body with the joints held that the markers leave open, and a warning that names them (`hold_open`)."""
        return hold_open(self.body, self.markers)

    @cached_property
    def found(self) -> InverseKinematics:
        """The postures nearest to the markers; raises `TrialRefused` where these determine none."""
        return solve_ik(self.held[0], self.markers)

    def motion(self, trial: Trial) -> Motion:
        """Return the motion, low-passed as the settings of the ``trial`` say, see `track`."""
        if not self.markers.time.size:
            raise TrialRefused(
                f"Trial {trial.name}: no markers were recorded, so there is no motion. Export the trial with its "
                "markers."
            )
        try:
            (body, warning), found = self.held, self.found
            rate = self.markers.rate if self.markers.time.size > 1 else 1.0
            postures = upright_trunk(body, found.q, rate)
            low_pass = motion_filter(trial.settings)
            motion = smooth(body, self.markers.time, postures, settings=low_pass)
        except TrialRefused as error:
            raise TrialRefused(f"Trial {trial.name}: {error}") from error
        determined, state = angle_states(body, self.markers, found.status, low_pass)
        return replace(
            motion,
            residual=found.residual,
            marker_names=found.marker_names,
            determined=determined,
            state=state,
            notes=(*_notes(self.body, found, self.markers.time), *warning),
        )


_LEGS = ("hip", "knee", "ankle")


def hold_open(body: Body, markers: Markers) -> tuple[Body, tuple[str, ...]]:
    """Return the body for one trial, joints of trunk and arms that its markers leave open held in the neutral posture,
    and a warning that names them; unchanged where pelvis or legs are open too.
    """
    columns = [k for k, name in enumerate(body.markers.names) if name in markers]
    seen = markers.select(body.markers.names[k] for k in columns).seen
    vague: set[str] = set()
    for _ in range(len(body.joints)):
        verdict = determination(body.holding(vague, body.neutral), columns, seen)
        more = {name for name in verdict.open_coordinates if not name.startswith("root")}
        if verdict.determined.any() or not more or len(more) < len(verdict.open_coordinates):
            break
        vague |= more
    if not vague or not verdict.determined.any() or any(name.split("_")[1] in _LEGS for name in vague):
        return body, ()
    listed = ", ".join(name.replace("_", " ") for name in sorted(vague))
    return body.holding(vague, body.neutral), (
        Doubt(f"the markers of this trial do not determine {listed}: held straight; what they do is not known"),
    )


def _notes(body: Body, found: InverseKinematics, time: Array) -> tuple[str, ...]:
    frames, names = len(found.q), found.marker_names
    rms = np.sqrt(np.nanmean(found.residual**2))
    frame, marker = np.unravel_index(np.nanargmax(found.residual), found.residual.shape)
    notes = [
        f"Inverse kinematics: {frames} frame{'s' * (frames != 1)}, {len(names)} markers, "
        f"RMS distance {1e3 * rms:.1f} mm, "
        f"largest {1e3 * found.residual[frame, marker]:.1f} mm ({names[marker]} at {time[frame]:.2f} s)."
    ]
    absent = [name for name in body.markers.names if name not in names]
    if absent:
        notes.append(f"Markers of the body that the trial does not have: {', '.join(absent)}.")
    for status, text in (
        (FrameStatus.LEANING, "lean on their neighbours, because their own markers leave the posture open"),
        (FrameStatus.STOPPED, "did not settle at a minimum; look at their residuals"),
    ):
        count = int((found.status == status).sum())
        if count:
            notes.append(
                f"{count} of {frames} frames {text} (first: at {time[(found.status == status).argmax()]:.2f} s)."
            )
    return tuple(notes)


# Winter's residual analysis takes what is fast for noise, and so misses what flesh, labels and stamps do at the
# frequencies of the movement. A body of rigid segments misses its markers at every frequency, and that is noise
# wherever it stands. With P the power of the markers' coordinates and N that of their noise per frequency f, both per
# coordinate, a low-pass of gain H leaves the expected square error
#
#     sum over f of  (1 - H)² (P - N) + H² N,
#
# what it takes from the movement and what it leaves of the noise (Stein's unbiased risk). The cut-off is the least of
# it. N is the power of the misfit, times 3 K / (3 K - n) for the n coordinates that K markers placed, plus a white part
# that all markers share (stamps that jitter move all of them alike, and no misfit shows it): what markers move more
# than they miss the body by in the fastest quarter of the spectrum, where nobody moves.

_FASTEST = 0.375  # Of the rate: from here to half of it lies the fastest quarter of the spectrum
_STEP = 0.1  # Hz between the cut-offs that are tried


def asked_cutoff(trial: Trial, at: Followed) -> float | None:
    """Return the cut-off (Hz) that the prepared markers of a ``trial`` as read ask for; None where a cut-off was set, a
    static posture is no movement, or the markers do not tell.
    """
    if trial.settings.filter.cutoff != "auto" or trial.role == "static":
        return None
    try:
        return own_cutoff(at, motion_filter(trial.settings))
    except BiodanceError:
        return None  # tracking meets the same markers, and says why


def with_cutoff(trial: Trial, cutoff: float) -> Trial:
    """Return a ``trial`` as read with the ``cutoff`` (Hz) that its markers ask for, and a sentence on it."""
    said = (
        f"Cut-off of the low-pass: {cutoff:g} Hz, where the filtered markers of this trial lie nearest to the path of "
        "rigid segments."
    )
    settings = trial.settings.changed({"filter.cutoff": cutoff})
    return replace(trial, settings=settings, history=(*trial.history, said))


def own_cutoff(at: Followed, settings: LowPass) -> float | None:
    """Return the cut-off (Hz) of a low-pass of the kind and order of ``settings`` at which the markers that a body
    follows are expected to err least; None where they are too few or too short to tell.

    No more than the usual 10 Hz: residuals are judged at 25 samples a second, which faster ones would upset.

    Raises
    ------
    TrialRefused
        The markers do not determine the posture.
    """
    body, markers = at.body, at.markers
    rate = markers.rate if markers.time.size > 1 else 0.0
    low, high = max(1.0, _PERIODS * rate / max(markers.time.size, 1)), min(USUAL_CUTOFF, _FASTEST * rate)
    if low >= high:
        return None
    followed, model = at.held[0], poses(at.held[0], at.found.q)
    worn = [k for k, name in enumerate(body.markers.names) if name in markers]
    seen = markers.select(body.markers.names[k] for k in worn).seen
    unseen = np.sum(~seen, axis=0)
    columns = [k for k, count in zip(worn, unseen, strict=True) if count <= np.median(unseen)]
    placed = followed.n_root + int(followed.free.sum())
    if 3 * len(columns) <= placed:
        return None
    path = markers.select(body.markers.names[k] for k in columns).xyz
    points = model.points([body.markers.segment[k] for k in columns], body.markers.position[columns])
    # Other markers tell another posture: where they come and go the misfit steps, and a step is no noise.
    _, which, counts = np.unique(seen, axis=0, return_inverse=True, return_counts=True)
    usual = which.ravel() == counts.argmax()
    usual |= 2 * counts.max() <= usual.size  # no set of markers tells most frames: all count
    power, misfit = _power(path), _power(np.where(usual[:, None, None], path - points, np.nan))
    missed = misfit * 3 * len(columns) / ((3 * len(columns) - placed) * usual.mean())
    frequency = np.arange(1, power.size + 1) * rate / (2 * (power.size + 1))
    fast = frequency > _FASTEST * rate
    noise = missed + max(0.0, float((power - missed)[fast].mean()))
    tried = np.arange(np.ceil(low / _STEP), np.floor(high / _STEP) + 1) * _STEP
    gains = (replace(settings, cutoff=float(cutoff)).gain(frequency, rate) for cutoff in tried)
    # (1 - H)² (P - N) + H² N = (1 - H)² P + (2 H - 1) N.
    error = [float(np.sum((1 - gain) ** 2 * power + (2 * gain - 1) * noise)) for gain in gains]
    return round(float(tried[int(np.argmin(error))]), 1)


def _power(values: Array) -> Array:
    """Return the mean power (T - 2,) of columns (T, ...) per frequency, by point reflection as the low-pass."""
    columns, frames = np.array(values).reshape(len(values), -1), np.arange(len(values))
    for column in columns.T:
        known = np.isfinite(column)
        column[~known] = np.interp(frames[~known], frames[known], column[known])
    share = np.linspace(0.0, 1.0, len(columns))[:, None]
    beside = columns - (1 - share) * columns[:1] - share * columns[-1:]
    return np.asarray(np.mean(dst(beside[1:-1], type=1, axis=0, norm="ortho") ** 2, axis=1))

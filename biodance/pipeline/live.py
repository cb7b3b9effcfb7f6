"""A recording as a stream: every frame tracked as it comes, the wrench watched, the body identified on the way.

Tracking has no delay. What needs the filter (velocities, forces, contact) follows after 0.3 s: the low-pass of the
house runs forwards and backwards over the last second, so that its middle is as in the batch. The work of a window is
cut into steps that different frames do, so that no frame waits for all of it.
"""

import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from biodance import display
from biodance.body.body import Body
from biodance.diagnosis import watch
from biodance.errors import SessionRefused, TrialRefused
from biodance.identification.identification import Identification, identify_body
from biodance.identification.knowledge import Knowability, RecursivePosterior, initial_posterior
from biodance.identification.statistics import Fit, believable
from biodance.lab.markers.sets import canonical, read_marker_set
from biodance.lab.prepare import at_marker_times, force_filter, highest_frequency, motion_filter
from biodance.lab.readers import read_trial
from biodance.lab.session.read import read_session
from biodance.motion.contact import Contact, contact_with_plates, feet_on_ground
from biodance.motion.dynamics import regressor
from biodance.motion.ik.inverse_kinematics import Follower
from biodance.motion.soles import soles_from_body
from biodance.motion.track import smooth, upright_trunk
from biodance.pipeline.body import body_of
from biodance.pipeline.still import asked_words
from biodance.pipeline.trial import Step, prepare_trial
from biodance.records import Array, Markers, Motion, Plate, Trial, Wrench
from biodance.spatial import wrench_about_point
from biodance.threads import one_thread
from biodance.uncertainty.caution import widened_prior

_WINDOW, _DELAY, _HOP = 1.0, 0.3, 0.1
"""s: what the filter sees, how long it waits for what follows, how often."""


@dataclass(frozen=True, eq=False)
class LiveState:
    """At ``time`` s: ``verdicts`` by segment, what is ``suspect``, ``advice`` to do, and the segment ``asked``."""

    time: float
    verdicts: Mapping[str, Knowability]
    suspect: tuple[str, ...]
    advice: str
    asked: str = ""


@dataclass(frozen=True, eq=False)
class LiveResult:
    """The end of a stream: the frames as used (``fit``, None without any), what they identify or the ``cause`` why not,
    ``warnings`` in time, s that each frame took of the processor (``frame_s``) and by the clock (``wall_s``), (T,)
    each, and the last ``state``.
    """

    fit: Fit | None
    identification: Identification | None
    cause: str
    warnings: tuple[watch.LiveWarning, ...]
    frame_s: Array
    wall_s: Array
    state: LiveState

    def __repr__(self) -> str:
        used = int(self.fit.use.sum()) if self.fit else 0
        return f"LiveResult({used} of {self.frame_s.size} frames used, {len(self.warnings)} warnings)"

    def _repr_html_(self) -> str:
        found = self.identification
        return display.card(repr(self), found.table() if found else None, [one.text for one in self.warnings])


class LiveSession:
    """A session while it is recorded: `push` one frame after the other, then `finish`.

    ``trial`` with its set's markers alone (see `replay`); only what lies before the frame that was pushed is looked
    at.
    """

    def __init__(self, body: Body, trial: Trial) -> None:
        assert trial.markers is not None
        self.body, self.trial, self.markers = body, trial, trial.markers
        rate = self.markers.rate
        self._window, self._delay, self._hop = (max(2, round(s * rate)) for s in (_WINDOW, _DELAY, _HOP))
        self._follower = Follower(body, self.markers.names)
        self._follower.warm_up()
        self._xyz = self.markers.select(self._follower.names).xyz
        self._q: list[Array] = []
        self._distance: list[Array] = []
        self._determined: list[bool] = []
        self._work: Iterator[None] | None = None
        self._done = 0
        self._taken: list[Fit] = []
        self._pressure = np.zeros(4)
        self.posterior: RecursivePosterior = initial_posterior(widened_prior(body.sip))
        self._weight = -float(body.gravity[2] * body.sip.mass.sum())
        self._watch = StreamWatch(trial, self._follower, weight=self._weight)
        # Load what the first window would wait for, by believing a body that stands in its neutral posture.
        time = np.arange(self._hop) / rate
        part = Motion(time, np.tile(body.neutral, (time.size, 1)), *np.zeros((2, time.size, body.nv)))
        stood = Wrench(time, np.asarray(regressor(body, part) @ body.sip.phi))
        self._believed(part, stood, np.ones(time.size, dtype=bool))

    @property
    def warnings(self) -> tuple[watch.LiveWarning, ...]:
        """All that was noticed, in time."""
        return tuple(self._watch.warnings)

    @property
    def _standing_point(self) -> Array:
        """(3,) m, mean centre of pressure so far; before any load the middle of all plates."""
        if self._pressure[3]:
            return np.asarray(self._pressure[:3] / self._pressure[3])
        return np.asarray(np.mean([plate.centre for plate in self.trial.plates], axis=0))

    @property
    def _now(self) -> float:
        return float(self.markers.time[max(len(self._q) - 1, 0)])  # s, of the last frame that came

    def push(self) -> tuple[watch.LiveWarning, ...]:
        """Take in the next frame and return what it gave reason to warn of."""
        frame, before = len(self._q), len(self.warnings)
        q, distance, determined = self._follower.follow(self._xyz[frame])
        self._q.append(q)
        self._distance.append(distance)
        self._determined.append(determined)
        if (frame + 1) % self._hop == 0:
            # s of markers that are judged at once
            recent = np.array(self._distance[-max(3, round(0.25 * self.markers.rate)) :])
            self._watch.look_at_markers(self._now, self._xyz[frame], recent)
        # a window is begun only when the one before is done: late work must not pile up
        if self._work is None and frame + 1 >= self._window and (frame + 1 - self._window) % self._hop == 0:
            self._work = self._take(frame + 1, frame + 1 - self._delay)
        if self._work is not None:
            self._work = self._work if next(self._work, self) is not self else None
        return tuple(self.warnings[before:])

    def state(self) -> LiveState:
        """Return what is known, suspect and to be done now."""
        verdicts = dict(self.posterior.verdicts())
        return LiveState(self._now, verdicts, self._watch.suspect, *self._advice(verdicts))

    def finish(self, frame_s: Array, wall_s: Array) -> LiveResult:
        """Take in what the filter still held back, and return all that was found."""
        for _ in self._work or ():
            pass
        count = len(self._q)
        for _ in self._take(count, count) if self._done < count else ():
            pass
        fit, found = self._fit(), None
        cause = "No frame had all its ground contact measured by the plates: nothing can be identified."
        if fit is not None and fit.use.any():
            try:
                found = identify_body(self.body, (fit,))
                cause = found.cause
            except TrialRefused as refused:
                cause = str(refused)
        return LiveResult(fit, found, cause, self.warnings, frame_s, wall_s, self.state())

    def _take(self, stop: int, until: int) -> Iterator[None]:
        """Do the work of the window that ends before frame ``stop`` for the frames not yet done before ``until``."""
        # a whole window, or further back where frames wait: the filter needs `_DELAY` of settled frames before them
        start = max(0, min(stop - self._window, self._done - self._delay))
        cut = slice(start, stop)
        q = upright_trunk(self.body, np.array(self._q[cut]), self.markers.rate)
        motion = smooth(self.body, self.markers.time[cut], q, settings=motion_filter(self.trial.settings))
        yield
        raw = self._cut(start, stop)
        low_pass = force_filter(self.trial.settings)
        filtered = replace(raw, plates=tuple(at_marker_times(plate, raw.markers, low_pass) for plate in raw.plates))
        yield
        soles = soles_from_body(self.body, motion)
        yield
        feet = feet_on_ground(filtered, soles, mass=self._weight / -self.body.gravity[2])
        yield
        contact = contact_with_plates(filtered, soles, feet)
        yield
        new = slice(self._done - start, until - start)
        self._done = until
        yield from self._fold(raw, filtered, contact, motion, new, start)

    def _cut(self, start: int, stop: int) -> Trial:
        """Return the frames ``start`` to ``stop`` as a trial, plates as they came."""
        time = self.markers.time[start:stop]
        markers = Markers(self.markers.names, time, self.markers.xyz[start:stop])
        plates = []
        for plate in self.trial.plates:
            at = plate.wrench.time
            step = 0.5 * float(at[1] - at[0]) if at.size > 1 else 0.0
            # half a sample further at both ends: clocks of plates and markers are rounded differently
            pick = slice(*np.searchsorted(at, [time[0] - step, time[-1] + step]))
            plates.append(replace(plate, wrench=Wrench(at[pick], plate.wrench.value[pick])))
        return replace(self.trial, markers=markers, plates=tuple(plates))

    def _fold(
        self, raw: Trial, filtered: Trial, contact: Contact, motion: Motion, new: slice, start: int
    ) -> Iterator[None]:
        """Watch the wrench of the frames ``new`` of the window and let those that are sound tell of the body."""
        cut = slice(start + new.start, start + new.stop)
        distance, names = np.array(self._distance[cut]), self._follower.names
        part = replace(motion.at(new), residual=distance, marker_names=names, joint_names=motion.joint_names)
        wrench = Wrench(part.time, filtered.wrench.value[new])
        W = regressor(self.body, part)
        measured = contact.measured[new] & np.array(self._determined[cut]) & np.isfinite(wrench.value).all(axis=1)
        self._watch.look_at_plates(self._now, raw, filtered.plates, contact.on_plate, until=new.stop)
        yield
        use = self._believed(part, wrench, measured)
        if use.any():
            point, seen = self._standing_point, (W[use], wrench.value[use])
            self._watch.look_at_wrench(self._now, *seen, self.posterior, point=point, step=self._hop)
        yield
        fit = Fit("stream", part, wrench, use & (not self._watch.suspect), self.trial.settings.outlier)
        if fit.use.any():  # the last used frame stands for all of the window: errors last longer than it
            last = int(np.flatnonzero(fit.use)[-1])
            # errors last about a second: one sample in ten is independent
            variance = 10.0 * self._watch.wrench.noise(self.posterior)
            self.posterior = self.posterior.updated(W[last], fit.wrench.value[last], variance)
        points = fit.wrench.cop()[fit.use]
        loaded = points[np.isfinite(points).all(axis=1)]  # their sum and number give the mean
        self._pressure = self._pressure + np.append(loaded.sum(axis=0), len(loaded))
        self._taken.append(fit)

    def _believed(self, part: Motion, wrench: Wrench, measured: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the measured frames without those that table and plates contradict, as the batch leaves them out."""
        if not measured.any():
            return measured
        fit = Fit("stream", part, wrench, measured, self.trial.settings.outlier)
        about = self._standing_point if self._pressure[3] else np.zeros(3)
        return believable(self.body, fit, about)[0].use

    def _advice(self, verdicts: Mapping[str, Knowability]) -> tuple[str, str]:
        """Return what to do next, and the segment that becomes better known by it."""
        if self._watch.suspect:
            return "Mend what is suspect first: frames do not count until then.", ""
        # share of the prior's variance that is left of every mass, the tenth parameter each
        before, now = (np.diag(one)[::10] for one in (self.posterior.prior.covariance, self.posterior.covariance))
        names, left = self.posterior.prior.segments, now / np.maximum(before, 1e-12)
        standing = {names[foot.segment] for foot in self.body.feet.values()}
        open_ = [i for i in np.argsort(-left) if verdicts[names[i]] != "known" and names[i] not in standing]
        if not open_:
            return "All masses but those of the feet are known well enough: the session can end.", ""
        return asked_words(names[open_[0]]), names[open_[0]]

    def _fit(self) -> Fit | None:
        """Return all frames that were taken in as one trial."""
        if not self._taken:
            return None
        parts = [fit.motion for fit in self._taken]
        time, q, v, a, residual = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("time", "q", "v", "a", "residual")
        )
        motion = Motion(time, q, v, a, residual, self._follower.names, joint_names=parts[0].joint_names)
        wrench = Wrench(time, np.concatenate([fit.wrench.value for fit in self._taken]))
        use, settings = np.concatenate([fit.use for fit in self._taken]), self.trial.settings
        return Fit("stream", motion, wrench, use, settings.outlier, cutoff=highest_frequency(settings))


class StreamWatch:
    """Looks at a stream as it comes. ``warnings`` all that was noticed, each once; ``suspect`` what is wrong now."""

    def __init__(self, trial: Trial, follower: Follower, *, weight: float) -> None:
        self.trial, self._follower, self._weight = trial, follower, weight
        self._markers = watch.MarkerWatch(np.zeros(len(follower.names)))
        self.wrench = watch.WrenchWatch(weight)
        self._sound = follower.q
        self._point: Array | None = None
        self._suspect: dict[str, watch.LiveWarning] = {}
        self.warnings: list[watch.LiveWarning] = []

    @property
    def suspect(self) -> tuple[str, ...]:
        """What is wrong now, in words."""
        return tuple(said.text for said in self._suspect.values())

    def look_at_markers(self, now: float, xyz: Array, distances: Array) -> None:
        """Look at ``distances`` (n, K) m of markers to the body, and the last frame ``xyz`` (K, 3) m."""
        off = self._markers.look(distances)
        if not off.any():
            self._sound = self._follower.q
            self._suspect.pop("markers", None)
            return
        if "markers" in self._suspect or np.isnan(self._sound).any():
            return
        # the five markers furthest from the body, of which two may have changed names
        last = np.nan_to_num(distances[-1])
        worst = [self._follower.names[i] for i in np.argsort(-last)[:5] if last[i] > 0]
        self._warn("markers", watch.said_of_markers(now, worst, self._follower.exchange(xyz, worst, self._sound)))

    def look_at_plates(
        self, now: float, raw: Trial, plates: Sequence[Plate], on_plate: NDArray[np.bool_], *, until: int
    ) -> None:
        """Look for a plate that fell silent, and for one that reads a load with nobody on it: channels ``raw`` and as
        filtered in ``plates``, feet ``on_plate`` (T, 2, P); frames from ``until`` on are not settled yet.
        """
        fell = watch.silent_plates(now, raw.plates, on_plate[-1].any(axis=0), self._weight)
        silent = {f"silent {said.target}": said for said in fell}
        # Nobody is on a plate that is called empty for 0.3 s: the filter forgets a foot that left in a tenth of that.
        count = max(3, round(0.3 * plates[0].wrench.rate))
        late = slice(max(0, until - count), until)
        gone = {said.target for said in self.warnings if said.effect == "plate_gone"}
        empty = {
            f"empty {plate.name}": said
            for index, plate in enumerate(plates)
            if until >= count
            and plate.name not in gone
            and not on_plate[late, :, index].any()
            and (said := watch.loaded_while_empty(now, plate, plate.wrench.value[late]))
        }
        still = {f"silent {plate.name}" for plate in raw.plates if not np.diff(plate.wrench.value, axis=0).any()}
        for key in [key for key in self._suspect if key.startswith(("silent", "empty"))]:
            if key not in silent | empty and key not in still:
                del self._suspect[key]
        for key, said in (silent | empty).items():
            self._warn(key, said)

    def look_at_wrench(
        self, now: float, W: Array, wrench: Array, posterior: RecursivePosterior, *, point: Array, step: int
    ) -> None:
        """Look for a jump of the measured ``wrench`` (T, 6) against what the ``posterior`` expects from the regressor
        ``W`` (T, 6, p), ``step`` frames at once, about the first standing ``point`` (3,) m that was given.
        """
        if any(key != "wrench" for key in self._suspect):
            return
        self._point = point if self._point is None else self._point
        # each column of W is the wrench of one parameter (kg, kg·m, kg·m²): it moves to the point as a wrench does
        turned = np.swapaxes(wrench_about_point(np.swapaxes(W, 1, 2), self._point), 1, 2)
        moved, found = wrench_about_point(wrench, self._point), None
        for first in range(0, len(W), step):
            cut = slice(first, first + step)
            found = self.wrench.look(turned[cut], moved[cut], posterior)
        if found is None:
            self._suspect.pop("wrench", None)
        elif "wrench" not in self._suspect:
            self._warn("wrench", watch.said_of_jump(now, self.trial.plates, self._point, *found))

    def _warn(self, key: str, said: watch.LiveWarning) -> None:
        known = {(w.effect, w.target) for w in self.warnings}
        self._suspect[key] = said
        if (said.effect, said.target) not in known:
            self.warnings.append(said)


@one_thread()
def body_and_stream(
    file: Path,
    *,
    static: Path | None = None,
    subject: str | None = None,
    markers: str | None = None,
    settings: Mapping[str, object] | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[Body, Trial]:
    """Return the body that moves in a recording, scaled on its ``static`` (by default that of its folder), and the
    recording with the markers of its set alone.

    Raises
    ------
    SessionRefused
        The recording is not there or was not read, or no static trial scales the body; the message says why.
    """
    if not file.is_file():
        what = "is a folder" if file.is_dir() else "there is no such file"
        raise SessionRefused(f"{file}: {what}. Give one recording of a session's folder.")
    session = read_session(file.parent, subject_name=subject, markers=markers, settings=settings, tell=tell)
    trial = next((one for one in session.trials if one.source.path.resolve() == file.resolve()), None)
    if trial is None:
        why = session.refused.get(file.name, "session.toml says skip, or it is no recording.")
        raise SessionRefused(f"{file}: cannot be streamed. {why}")
    worn = read_marker_set(markers or trial.marker_set) if markers or trial.marker_set else None
    statics = session.of_role("static")
    if static is not None:
        statics = (
            replace(read_trial(static, role="static", subject=subject, markers=worn), settings=session.settings),
        )
    if trial.markers is None:
        raise SessionRefused(
            f"{file}: has no markers, so no body can follow it. Give a recording of markers and plates."
        )
    if worn is None:
        raise SessionRefused(f"{file}: has no markers of a known set, so no body can follow it. Say --markers.")
    if not statics:  # a stream has no later to look at for a better body
        raise SessionRefused(
            f"{file}: its folder has no static trial, so nobody knows who moves. Give one with --static FILE."
        )
    steps: list[Step] = []
    body, _ = body_of(session.subject, tuple(map(prepare_trial, statics)), statics[0].settings, steps)
    if body is None or not any(step.name == "scale" and step.status == "done" for step in steps):
        why = " ".join(step.text for step in steps if step.status != "done" and step.name in ("subject", "scale"))
        raise SessionRefused(f"{file}: no body can be scaled for it. {why}")
    return body, replace(trial, markers=canonical(trial.markers, worn))


def stream_recording(
    file: Path | str,
    *,
    static: Path | str | None = None,
    subject: str | None = None,
    markers: str | None = None,
    tell: Callable[[LiveState], None] = lambda _: None,
) -> LiveResult:
    """Take a recording in frame by frame, as a laboratory would send it: track, watch for faults, identify.

    Parameters
    ----------
    file : path
        A recording with markers and force plates.
    static : path, optional
        The static trial; by default that of the folder in which the file lies.
    subject : str, optional
        The person, where C3D files hold several.
    markers : str, optional
        Marker set, where the file does not tell.
    tell : callable, optional
        Called with the `LiveState` after every second of the recording.

    Returns
    -------
    LiveResult
        What the stream told, and how long every frame took.

    Raises
    ------
    SessionRefused
        The recording is not there or was not read, or no static trial scales the body.
    TrialRefused
        The recording has no plates, or its first frame does not show the posture.

    Examples
    --------
    >>> streamed = biodance.stream_recording("visit/squat_1.c3d")
    >>> streamed.warnings
    ()
    """
    body, trial = body_and_stream(Path(file), static=Path(static) if static else None, subject=subject, markers=markers)
    return replay(body, trial, tell=tell)


@one_thread()
def replay(
    body: Body,
    trial: Trial,
    *,
    real_time: bool = False,
    tell: Callable[[LiveState], None] = lambda _: None,
    warn: Callable[[watch.LiveWarning], None] = lambda _: None,
) -> LiveResult:
    """Return what a stream of the frames of ``trial`` (of which only its own set's markers are kept) tells of ``body``.

    ``real_time`` waits for the rate of the recording; ``tell`` is called once a second of the recording, ``warn`` as
    soon as something is noticed.

    Raises
    ------
    TrialRefused
        The trial has no plates, or its first frame does not show the posture.
    """
    if trial.markers is None or not trial.plates:
        raise TrialRefused(f"Trial {trial.name}: a stream needs markers and force plates, and one of them is missing.")
    session, count = LiveSession(body, trial), trial.markers.time.size
    spent, wall = np.zeros(count), np.zeros(count)
    started, second = clock.perf_counter(), max(1, round(trial.markers.rate))
    for frame in range(count):
        if real_time:
            clock.sleep(max(0.0, started + frame / trial.markers.rate - clock.perf_counter()))
        began, mine = clock.perf_counter(), clock.thread_time()
        found = session.push()
        spent[frame], wall[frame] = clock.thread_time() - mine, clock.perf_counter() - began
        for said in found:
            warn(said)
        if frame % second == second - 1:
            tell(session.state())
    return session.finish(spent, wall)

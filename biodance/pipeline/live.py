"""A recording as a stream: every frame tracked as it comes, the wrench watched, the body identified on the way.

Tracking has no delay. What needs the filter (velocities, forces, contact) follows after 0.3 s: the low-pass of the
house runs forwards and backwards over the last second, so that its middle is as in the batch. The work of a window is
cut into steps that different frames do, so that no frame waits for all of it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.diagnosis.watch import (
    LiveWarning,
    MarkerWatch,
    WrenchWatch,
    loaded_while_empty,
    said_of_jump,
    said_of_markers,
    silent_plates,
)
from biodance.identification.identification import Identification
from biodance.identification.knowledge import Knowability
from biodance.identification.running import RunningBelief, belief_before
from biodance.identification.statistics import Fit, believable
from biodance.identification.streaming import Stream, begin
from biodance.lab.filters import force_filter, motion_filter
from biodance.lab.prepare import at_marker_times
from biodance.motion.contact.contact import Contact, ground_contact
from biodance.motion.contact.soles import soles_from_body
from biodance.motion.ik.follow import Follower
from biodance.motion.regressor import regressor
from biodance.motion.smoothing import smooth
from biodance.motion.upright import upright_trunk
from biodance.records import Array, Markers, Motion, Plate, Trial, Wrench
from biodance.spatial import wrench_about_point
from biodance.uncertainty.caution import widened

_WINDOW, _DELAY, _HOP = 1.0, 0.3, 0.1
"""s: what the filter sees, how long it waits for what follows, how often."""
_SILENT = 0.2
"""s without any change of a raw channel: no amplifier is so quiet."""
_SLOW = 10.0
"""Samples of the running belief count as if only so many-th of them were independent: errors last about a second."""


@dataclass(frozen=True, eq=False)
class LiveState:
    """What an operator sees: ``time`` s, ``verdicts`` segment -> how well its mass is known, ``suspect`` what is
    wrong now, in words, and ``advice`` what to do next.
    """

    time: float
    verdicts: Mapping[str, Knowability]
    suspect: tuple[str, ...]
    advice: str


@dataclass(frozen=True, eq=False)
class LiveResult:
    """The end of a stream: ``fit`` all frames as they were used; ``identification`` from them, None with ``cause`` why;
    ``warnings`` in time; ``frame_s`` (T,) s of processor time that each frame took, ``wall_s`` (T,) s by the clock.
    """

    fit: Fit | None
    identification: Identification | None
    cause: str
    warnings: tuple[LiveWarning, ...]
    frame_s: Array
    wall_s: Array
    state: LiveState


@dataclass
class _Emitted:
    motions: list[Motion] = field(default_factory=list)
    wrenches: list[Wrench] = field(default_factory=list)
    uses: list[NDArray[np.bool_]] = field(default_factory=list)


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
        self._done, self._out = 0, _Emitted()
        self.stream: Stream = begin(body, rate=rate, verdicts=False)
        self.belief: RunningBelief = belief_before(widened(body.sip))
        self._weight = -float(body.gravity[2] * body.sip.mass.sum())
        self._marker_watch = MarkerWatch(np.zeros(len(self._follower.names)))
        self._wrench_watch = WrenchWatch(self._weight)
        self._sound = self._follower.q
        self._point: Array | None = None
        self._suspect: dict[str, LiveWarning] = {}
        self.warnings: list[LiveWarning] = []

    @property
    def _now(self) -> float:
        """s, time of the last frame that came."""
        return float(self.markers.time[max(len(self._q) - 1, 0)])

    def push(self) -> tuple[LiveWarning, ...]:
        """Take in the next frame and return what it gave reason to warn of."""
        frame, before = len(self._q), len(self.warnings)
        q, distance, determined = self._follower.follow(self._xyz[frame])
        self._q.append(q)
        self._distance.append(distance)
        self._determined.append(determined)
        if (frame + 1) % self._hop == 0:
            self._watch_markers(frame)
        if self._work is None and frame + 1 >= self._window and (frame + 1 - self._window) % self._hop == 0:
            self._work = self._take(frame + 1, frame + 1 - self._delay)
        if self._work is not None:
            self._work = self._work if next(self._work, self) is not self else None
        return tuple(self.warnings[before:])

    def state(self) -> LiveState:
        """Return what is known, suspect and to be done now."""
        verdicts = dict(self.belief.verdicts())
        return LiveState(self._now, verdicts, tuple(w.text for w in self._suspect.values()), self._advice(verdicts))

    def finish(self, frame_s: Array, wall_s: Array) -> LiveResult:
        """Take in what the filter still held back, and return all that was found."""
        for _ in self._work or ():
            pass
        count, cause, fit, found = len(self._q), "", None, None
        if self._done < count:
            for _ in self._take(count, count):
                pass
        fit = self._fit()
        if fit is not None and fit.use.any():
            found = self.stream.identification((fit,))
            cause = found.cause
        else:
            cause = "No frame had all its ground contact measured by the plates: nothing can be identified."
        return LiveResult(fit, found, cause, tuple(self.warnings), frame_s, wall_s, self.state())

    def _watch_markers(self, frame: int) -> None:
        """Look at the markers of the last quarter of a second."""
        off = self._marker_watch.look(np.array(self._distance[-max(3, round(0.25 * self.markers.rate)) :]))
        if not off.any():
            self._sound = self._follower.q
            self._suspect.pop("markers", None)
            return
        if "markers" in self._suspect or np.isnan(self._sound).any():
            return
        now = np.nan_to_num(self._distance[-1])
        worst = [self._follower.names[i] for i in np.argsort(-now)[:5] if now[i] > 0]
        pair = self._follower.exchange(self._xyz[frame], worst, self._sound)
        self._warn("markers", said_of_markers(self._now, worst, pair))

    def _take(self, stop: int, until: int) -> Iterator[None]:
        """Do the work of the window that ends before frame ``stop`` for the frames not yet done before ``until``."""
        start = max(0, min(stop - self._window, self._done - self._delay))
        cut = slice(start, stop)
        q = upright_trunk(self.body, np.array(self._q[cut]), self.markers.rate)
        motion = smooth(self.body, self.markers.time[cut], q, settings=motion_filter(self.trial.settings))
        yield
        raw = self._cut(start, stop)
        low_pass = force_filter(self.trial.settings)
        filtered = replace(raw, plates=tuple(at_marker_times(plate, raw.markers, low_pass) for plate in raw.plates))
        yield
        contact = ground_contact(
            filtered, soles_from_body(self.body, motion), mass=self._weight / -self.body.gravity[2]
        )
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
            pick = slice(*np.searchsorted(at, [time[0] - step, time[-1] + step]))
            plates.append(replace(plate, wrench=Wrench(at[pick], plate.wrench.value[pick])))
        return replace(self.trial, markers=markers, plates=tuple(plates))

    def _fold(
        self, raw: Trial, filtered: Trial, contact: Contact, motion: Motion, new: slice, start: int
    ) -> Iterator[None]:
        """Watch the wrench of the frames ``new`` of the window and let those that are sound tell of the body."""
        cut = slice(start + new.start, start + new.stop)
        part = Motion(
            motion.time[new],
            motion.q[new],
            motion.v[new],
            motion.a[new],
            np.array(self._distance[cut]),
            self._follower.names,
            joint_names=motion.joint_names,
        )
        wrench = Wrench(part.time, filtered.wrench.value[new])
        W = regressor(self.body, part)
        measured = contact.measured[new] & np.array(self._determined[cut]) & np.isfinite(wrench.value).all(axis=1)
        self._watch_plates(raw, filtered, contact, W, wrench)
        yield
        use = self._believed(part, wrench, measured)
        if use.any():
            self._watch_wrench(W[use], wrench.value[use])
        yield
        if self._suspect:
            use = np.zeros_like(use)
        if use.any():
            last = int(np.flatnonzero(use)[-1])
            variance = _SLOW * self._wrench_watch.noise(self.belief)
            self.belief = self.belief.updated(W[last], wrench.value[last], variance)
        self.stream = self.stream.feed(part, wrench, use)
        self._out.motions.append(part)
        self._out.wrenches.append(wrench)
        self._out.uses.append(use)

    def _believed(self, part: Motion, wrench: Wrench, measured: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the measured frames without those that table and plates contradict, as the batch leaves them out."""
        if not measured.any():
            return measured
        fit = Fit("stream", part, wrench, measured, self.trial.settings.outlier)
        return believable(self.body, fit, self.stream.standing_point)[0].use

    def _watch_plates(self, raw: Trial, filtered: Trial, contact: Contact, W: Array, wrench: Wrench) -> None:
        """Look for a plate that fell silent, and for one that reads a load with nobody on it."""
        now, on = self._now, contact.on_plate
        missing = float((W[-1] @ self.belief.mean)[2] - np.nan_to_num(wrench.value[-1])[2])
        silent = {
            f"silent {said.target}": said
            for said in silent_plates(now, self._last(raw), on[-1].any(axis=0), missing, self._weight)
        }
        empty = {
            f"empty {plate.name}": said
            for index, plate in enumerate(filtered.plates)
            if len(on) >= self._window
            and not on[:, :, index].any()
            and (said := loaded_while_empty(now, plate, plate.wrench.value))
        }
        for key in [key for key in self._suspect if key.startswith(("silent", "empty"))]:
            if key not in silent | empty:
                del self._suspect[key]
        for key, said in (silent | empty).items():
            self._warn(key, said)

    def _last(self, raw: Trial) -> list[Plate]:
        """Return the plates over the last `_SILENT` s of a window, as they came."""
        cut = []
        for plate in raw.plates:
            count = max(3, round(_SILENT * plate.wrench.rate))
            cut.append(replace(plate, wrench=Wrench(plate.wrench.time[-count:], plate.wrench.value[-count:])))
        return cut

    def _watch_wrench(self, W: Array, wrench: Array) -> None:
        """Look for a jump of measured against expected wrench, about the first standing point."""
        if any(key != "wrench" for key in self._suspect):
            return
        if self._point is None:
            self._point = self.stream.standing_point if self.stream.pressure[3] else _middle(self.trial)
        about = self._point
        turned = np.swapaxes(wrench_about_point(np.swapaxes(W, 1, 2), about), 1, 2)
        moved, found = wrench_about_point(wrench, about), None
        for first in range(0, len(W), self._hop):
            cut = slice(first, first + self._hop)
            found = self._wrench_watch.look(turned[cut], moved[cut], self.belief)
        if found is None:
            self._suspect.pop("wrench", None)
        elif "wrench" not in self._suspect:
            self._warn("wrench", said_of_jump(self._now, self.trial.plates, about, *found))

    def _warn(self, key: str, said: LiveWarning) -> None:
        known = {(w.effect, w.target) for w in self.warnings}
        self._suspect[key] = said
        if (said.effect, said.target) not in known:
            self.warnings.append(said)

    def _advice(self, verdicts: Mapping[str, Knowability]) -> str:
        if self._suspect:
            return "Mend what is suspect first: frames do not count until then."
        rows = np.diag(self.belief.covariance)[::10] / np.maximum(np.diag(self.belief.prior.covariance)[::10], 1e-12)
        names = self.belief.prior.segments
        open_ = [i for i in np.argsort(-rows) if verdicts[names[i]] != "known"]
        if not open_:
            return "All masses are known well enough: the session can end."
        return f"Move the {names[open_[0]].replace('_', ' ')} further and faster, both feet on the plates."

    def _fit(self) -> Fit | None:
        """Return all frames that were taken in as one trial."""
        if not self._out.motions:
            return None
        parts = self._out.motions
        time, q, v, a, residual = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("time", "q", "v", "a", "residual")
        )
        motion = Motion(time, q, v, a, residual, self._follower.names, joint_names=parts[0].joint_names)
        wrench = Wrench(time, np.concatenate([one.value for one in self._out.wrenches]))
        return Fit("stream", motion, wrench, np.concatenate(self._out.uses), self.trial.settings.outlier)


def _middle(trial: Trial) -> Array:
    """Return the middle (3,) m of all plates."""
    return np.asarray(np.mean([plate.centre for plate in trial.plates], axis=0))

"""Identification while the subject still moves: frames go in as they come, what is known comes out, memory stays
constant.

The statistics of a session are sums over blocks of frames (see `statistics`), so that a stream needs to keep the sums
and the one block that is not full yet. At its end a stream holds the statistics of the batch, and `identification`
gives the batch's result. In between, `progress` says which segments are known well enough, for the operator to ask for
another posture or to end the session.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.errors import BiodanceError, TrialRefused
from biodance.identification.identification import Identification, conclude, conclude_trials
from biodance.identification.knowledge import KNOWN, PARTLY, Knowability, Known
from biodance.identification.learning import learn_noise
from biodance.identification.loads import may_carry
from biodance.identification.mismatch import SHORTEST, Mismatch, mismatch, nothing
from biodance.identification.statistics import Fit, Statistics, empty, layout_for, statistics
from biodance.records import Array, Motion, Sip, Wrench
from biodance.uncertainty.bands import BLOCK_SAMPLES
from biodance.uncertainty.caution import widened


@dataclass(frozen=True, eq=False)
class RunningBelief:
    """Gaussian belief: ``prior`` as given, ``mean`` (p,) and ``covariance`` (p, p) after the samples so far."""

    prior: Sip
    mean: Array
    covariance: Array

    def expected(self, W: Array) -> tuple[Array, Array]:
        """Return the expected wrench (..., 6) N, N·m for regressors ``W`` (..., 6, p), and its variance from what is
        not known of the parameters.
        """
        return W @ self.mean, np.einsum("...ij,jk,...ik->...i", W, self.covariance, W, optimize=True)

    def updated(self, W: Array, wrench: Array, variance: Array) -> "RunningBelief":
        """Return the belief after one sample: ``W`` (6, p), ``wrench`` (6,) N, N·m with noise of ``variance`` (6,).

        Source: Kalman 1960, doi:10.1115/1.3662552, with a state that stays.
        """
        seen = self.covariance @ W.T
        gain = np.linalg.solve(W @ seen + np.diag(variance), seen.T).T
        covariance = self.covariance - gain @ seen.T
        return replace(
            self,
            mean=self.mean + gain @ (wrench - W @ self.mean),
            covariance=(covariance + covariance.T) / 2,
        )

    def verdicts(self) -> dict[str, Knowability]:
        """Return for every segment how well its mass is known, as `knowledge` has it."""
        first, now = np.diag(self.prior.covariance)[::10], np.diag(self.covariance)[::10]
        share = 1 - np.divide(now, first, out=np.ones_like(now), where=first > 0)
        return {
            name: "known" if part >= KNOWN else "partly known" if part >= PARTLY else "cannot be known"
            for name, part in zip(self.prior.segments, share, strict=True)
        }


def belief_before(prior: Sip) -> RunningBelief:
    """Return the belief before the first sample."""
    return RunningBelief(prior, np.array(prior.phi), np.array(prior.covariance))


_ENOUGH = ("mass", "com x", "com y", "com z")
"""Quantities that must all be known before a segment is known well enough."""


@dataclass(frozen=True, eq=False)
class Stream:
    """A session that is being recorded.

    ``body`` with the table as prior; ``rate`` Hz of the frames; ``total`` statistics of all full blocks, about the
    lab origin; ``disturbed`` what twins and plates make of these blocks, each under the noise known when it was
    closed (so that verdicts on the way are as careful as the last one); ``pending`` (n < BLOCK_SAMPLES, 1 + nq + 2 nv
    + 6 + 1) thinned frames of the running block: time, q, v, a, wrench, RMS marker distance; ``pressure`` (4,) sum
    over the loaded frames of the centre of pressure m, and their number; ``run`` frames since the run of used frames
    began; ``last`` s, time of the last frame; ``verdicts`` False: disturbances are not followed on the way (`begin`).
    """

    body: Body
    rate: float
    total: Statistics
    disturbed: Mismatch
    pending: Array
    pressure: Array
    run: int = 0
    last: float = -np.inf
    verdicts: bool = True

    @property
    def statistics(self) -> Statistics:
        """All frames so far, the running block included, about the mean centre of pressure: what the batch would
        have of them.
        """
        return about(_close(self).total, self.standing_point)

    @property
    def standing_point(self) -> Array:
        """(3,) m, mean centre of pressure of the loaded frames so far."""
        return self.pressure[:3] / max(self.pressure[3], 1.0)

    def feed(self, motion: Motion, wrench: Wrench, use: NDArray[np.bool_]) -> "Stream":
        """Return the stream after some more frames (one or many): ``motion`` and ``wrench`` (lab origin) at the same
        times, ``use`` (T,).

        A time step unlike 1 / ``rate`` (another trial, lost frames) begins a new run. What the batch leaves out by
        itself (`believable`) must be left out of ``use`` here, too.

        Raises
        ------
        TrialRefused
            Motion, wrench and mask have different lengths, or a used wrench is NaN.
        """
        fit = Fit("stream", motion, wrench, use)
        rows = np.column_stack([motion.time, motion.q, motion.v, motion.a, wrench.value, _marker_rms(motion)])
        steps = np.diff(motion.time, prepend=self.last)
        broken = np.abs(steps * self.rate - 1) > 0.5
        stream = replace(self, pressure=self.pressure + summed_pressure(fit), last=float(motion.time[-1]))
        starts = np.flatnonzero(broken | ~use | np.append(True, ~use[:-1]))
        for first, stop in zip(starts, [*starts[1:], use.size], strict=True):
            if broken[first] or not use[first] or stream.run == 0:
                stream = replace(_settle(stream), run=0)
            if use[first]:
                stream = _extended(stream, rows[first:stop])
        return stream

    def progress(self) -> "Progress":
        """Return what is known after the frames so far, disturbances counted.

        Raises
        ------
        TrialRefused
            No frame could be used yet.
        """
        settled = _settle(self)
        found = settled.statistics
        if not found.count.any():
            raise TrialRefused(
                "No frame of this stream could be used yet: ground contact not measured, or markers hidden."
            )
        one = conclude(self.body, found, ("stream",), found=settled.disturbed if self.verdicts else None)
        if one.status == "failed":
            return Progress((), (), one.cause)
        open_ = {k.segment for k in one.known if k.quantity in _ENOUGH and k.verdict != "known"}
        return Progress(one.known, tuple(name for name in self.body.segments if name not in open_))

    def identification(self, fits: tuple[Fit, ...] = ()) -> Identification:
        """Return the identification from all frames so far: the batch's.

        ``fits`` are the recorded trials, for the disturbances that twins and plates make over them (see `mismatch`);
        without them the intervals count the noise alone, and the notes say so.
        """
        if fits:
            return conclude_trials(self.body, self.statistics, fits)
        return conclude(self.body, self.statistics, ("stream",))


@dataclass(frozen=True)
class Progress:
    """What a stream knows: every quantity with its interval, and the segments whose mass and centre of mass are known
    well enough.

    Both are empty where the frames so far contradict every possible body: ``cause`` then says why and what to do.
    """

    known: tuple[Known, ...]
    enough: tuple[str, ...]
    cause: str = ""

    @property
    def missing(self) -> tuple[tuple[str, str], ...]:
        """Segment and quantity of what is not known yet among mass and centre of mass, the least known first."""
        open_ = [k for k in self.known if k.quantity in _ENOUGH and k.verdict != "known"]
        return tuple((k.segment, k.quantity) for k in sorted(open_, key=lambda k: k.from_data))


def begin(body: Body, *, rate: float, verdicts: bool = True) -> Stream:
    """Return an empty stream for frames of ``body`` at ``rate`` Hz.

    ``verdicts`` False spares, at the end of every block, the work that `Stream.progress` needs for honest intervals on
    the way; the identification at the end is the same.

    Raises
    ------
    BiodanceError
        The rate is not a positive number.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise BiodanceError(f"A stream needs a frame rate over 0 Hz, got {rate}.")
    total = empty(10 * len(body.segments), layout_for(np.zeros(3)))
    return Stream(
        body, rate, total, nothing(body), np.empty((0, 8 + body.nq + 2 * body.nv)), np.zeros(4), verdicts=verdicts
    )


def about(found: Statistics, point: Array) -> Statistics:
    """Return the statistics with wrenches about another ``point`` (3,) m of the lab: an exact linear map of the
    channels.
    """
    layout = layout_for(point, found.layout.bands)
    move = layout.shift @ np.linalg.inv(found.layout.shift)
    return Statistics(np.einsum("ab,nbicj,dc->naidj", move, found.gram, move, optimize=True), found.count, layout)


def summed_pressure(fit: Fit) -> Array:
    """Return the summed centre of pressure (3,) m of the loaded used frames and their number."""
    points = fit.wrench.cop()[fit.use]
    loaded = points[np.isfinite(points).all(axis=1)]
    return np.append(loaded.sum(axis=0), len(loaded))


def _stride(stream: Stream) -> int:
    """Return how many frames the batch takes one of."""
    return stream.total.layout.bands.stride(stream.rate)


def _extended(stream: Stream, rows: Array) -> Stream:
    """Return the stream after ``rows`` of one unbroken run; full blocks are folded in."""
    stride = _stride(stream)
    thin = rows[-stream.run % stride :: stride]
    stream = replace(stream, run=stream.run + len(rows))
    while len(thin):
        room = BLOCK_SAMPLES - len(stream.pending)
        stream = replace(stream, pending=np.concatenate([stream.pending, thin[:room]]))
        thin = thin[room:]
        if len(stream.pending) == BLOCK_SAMPLES:
            stream = _settle(stream)
    return stream


def _marker_rms(motion: Motion) -> Array:
    """Return the RMS distance of the markers seen (T,) m; NaN where none is."""
    seen = np.isfinite(motion.residual)
    count, total = seen.sum(axis=1), np.where(seen, motion.residual, 0.0) ** 2
    return np.sqrt(np.divide(total.sum(axis=1), count, out=np.full(count.shape, np.nan), where=count > 0))


def _pending_fit(stream: Stream) -> Fit:
    """Return the pending frames as a trial, with a last frame that does not count, so that a block of one frame has
    a rate.
    """
    rows = np.concatenate([stream.pending, stream.pending[-1:]])
    nq, nv = stream.body.nq, stream.body.nv
    q, v, a, value, distance = np.split(rows[:, 1:], np.cumsum([nq, nv, nv, 6]), axis=1)
    time = rows[0, 0] + _stride(stream) / stream.rate * np.arange(len(rows))
    return Fit(
        "stream", Motion(time, q, v, a, distance, ("all",)), Wrench(time, value), np.arange(len(rows)) < len(rows) - 1
    )


def _close(stream: Stream) -> Stream:
    """Return the stream with its pending frames folded in as one block."""
    if not len(stream.pending):
        return stream
    block = statistics(stream.body, _pending_fit(stream), stream.total.layout)
    return replace(stream, total=stream.total + block, pending=stream.pending[:0])


def _settle(stream: Stream) -> Stream:
    """Return the closed stream, with what twins and plates make of the block."""
    closed = _close(stream)
    if len(stream.pending) < SHORTEST or not stream.verdicts:
        return closed
    prior = widened(stream.body.sip, stream.body.joint_errors)
    noise, _ = learn_noise(closed.statistics, may_carry(stream.body, prior))
    more = mismatch(stream.body, (_pending_fit(stream),), noise)
    old = stream.disturbed
    return replace(closed, disturbed=Mismatch(old.kinematics + more.kinematics, old.plates + more.plates))

"""Streaming: whatever the pieces in which frames come, the end is the batch's result."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from random_bodies import random_body
from scipy.interpolate import CubicSpline

from biodance.errors import BiodanceError, TrialRefused
from biodance.identification.identification import identify_body
from biodance.identification.statistics import Fit, layout_for, standing_point, statistics
from biodance.identification.streaming import about, begin
from biodance.motion.regressor import predict_wrench
from biodance.records import Motion, Sip, Wrench


def recording(*, frames: int = 9000, rate: float = 100.0, seed: int = 0, holes: bool = True):
    """Return a body and one long trial with holes in its mask (longer than two blocks, so that a block ends within a
    run).
    """
    rng = np.random.default_rng(seed)
    body = random_body(rng, n_segments=3)
    time = np.arange(frames) / rate
    knots = np.arange(0, time[-1] + 2, 0.6)
    curve = CubicSpline(knots, rng.normal(0, 0.5, (knots.size, len(body.joints))))
    q, v, a = np.tile(body.neutral, (frames, 1)), np.zeros((frames, body.nv)), np.zeros((frames, body.nv))
    q[:, 7:], v[:, 6:], a[:, 6:] = curve(time), curve(time, 1), curve(time, 2)
    motion = Motion(time, q, v, a)
    wrench = predict_wrench(body, motion).value + rng.normal(size=(frames, 6)) * [2, 2, 2, 0.5, 0.5, 0.5]
    use = np.ones(frames, dtype=bool)
    if holes:
        for first, stop in ((300, 301), (700, 950), (8701, 8705), (8706, 8707)):
            use[first:stop] = False
    wrench[~use] = np.nan
    return body, Fit("t", motion, Wrench(time, wrench), use)


def pieces(fit: Fit, cuts):
    for first, stop in pairwise(cuts):
        cut = slice(first, stop)
        m = fit.motion
        yield (
            Motion(m.time[cut], m.q[cut], m.v[cut], m.a[cut]),
            Wrench(m.time[cut], fit.wrench.value[cut]),
            fit.use[cut],
        )


def streamed(body, fit: Fit, cuts):
    stream = begin(body, rate=fit.motion.rate)
    for piece in pieces(fit, cuts):
        stream = stream.feed(*piece)
    return stream


@pytest.mark.parametrize("step", [37, 1024, 4096, 9000])
def test_the_end_of_a_stream_is_the_batch(step: int) -> None:
    body, fit = recording()
    stream = streamed(body, fit, [*range(0, 9000, step), 9000])
    point = standing_point((fit,))
    batch = statistics(body, fit, layout_for(point))
    assert stream.standing_point == pytest.approx(point, abs=1e-12)
    assert np.array_equal(stream.statistics.count, batch.count)
    scale = np.sqrt(np.einsum("bcici->ci", batch.gram))
    scale = scale[..., None, None] * scale + 1e-6
    assert np.abs((stream.statistics.gram - batch.gram) / scale).max() < 1e-10


def test_single_frames_give_the_batch_too() -> None:
    body, fit = recording(frames=400)
    stream = streamed(body, fit, range(401))
    batch = statistics(body, fit, layout_for(np.zeros(3)))
    np.testing.assert_allclose(about(stream.statistics, np.zeros(3)).gram, batch.gram, rtol=1e-9, atol=1e-6)
    assert np.array_equal(stream.statistics.count, batch.count)


def test_the_identification_is_that_of_the_batch() -> None:
    body, fit = recording()
    sd = 0.05 * np.abs(body.sip.phi) + 0.002
    wrong = body.sip.phi + sd * np.random.default_rng(1).normal(size=sd.size)
    body = replace(body, sip=Sip(body.segments, wrong, np.diag(sd**2)))
    stream, batch = streamed(body, fit, [*range(0, 9000, 501), 9000]), identify_body(body, (fit,))
    ours = stream.identification((fit,))
    sd = np.sqrt(np.diag(batch.sip.covariance))
    assert ours.trials == batch.trials
    assert np.abs((ours.sip.phi - batch.sip.phi) / sd).max() < 1e-5
    assert np.sqrt(np.diag(ours.sip.covariance)) == pytest.approx(sd, rel=1e-5)
    assert any("noise alone" in note for note in stream.identification().notes)


def test_verdicts_on_the_way_count_the_disturbances_of_the_batch() -> None:
    body, fit = recording()
    body = replace(body, sip=Sip(body.segments, body.sip.phi, np.diag((0.3 * np.abs(body.sip.phi) + 0.01) ** 2)))
    on_the_way, batch = streamed(body, fit, [*range(0, 9000, 900), 9000]).progress(), identify_body(body, (fit,))
    ratio = np.array([mine.sd / theirs.sd for mine, theirs in zip(on_the_way.known, batch.known, strict=True)])
    assert np.median(ratio) == pytest.approx(1.0, abs=0.15)


def test_two_trials_in_a_row_are_two_runs() -> None:
    body, fit = recording(frames=1500, holes=False)
    stream = streamed(body, fit, [0, 1500])
    twice = stream.feed(*next(pieces(fit, [0, 1500])))
    one = statistics(body, fit, layout_for(np.zeros(3)))
    np.testing.assert_allclose(about(twice.statistics, np.zeros(3)).gram, (one + one).gram, rtol=1e-9, atol=1e-6)


def test_memory_does_not_grow_and_knowledge_does() -> None:
    body, fit = recording(holes=False)
    body = replace(body, sip=Sip(body.segments, body.sip.phi, np.diag((0.3 * np.abs(body.sip.phi) + 0.01) ** 2)))
    early = streamed(body, fit, [0, 100])
    late = streamed(body, fit, [*range(0, 9000, 300), 9000])
    assert late.total.gram.nbytes == early.total.gram.nbytes
    assert len(late.pending) < 1024
    first, second = early.progress(), late.progress()
    assert sum(k.from_data for k in second.known) > sum(k.from_data for k in first.known)
    assert set(first.enough) <= set(second.enough)
    assert {segment for segment, _ in second.missing} | set(second.enough) == set(body.segments)


def test_nothing_used_yet_is_said() -> None:
    body, fit = recording(frames=10)
    motion, wrench, _ = next(pieces(fit, [0, 10]))
    with pytest.raises(TrialRefused, match="could be used yet"):
        begin(body, rate=100.0).feed(motion, wrench, np.zeros(10, dtype=bool)).progress()
    with pytest.raises(BiodanceError, match="rate"):
        begin(body, rate=0.0)

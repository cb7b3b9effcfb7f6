"""Skin that moves by itself: measured from the markers, and carried into the forces as it really is."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from diagnosed_sessions import CORNERS, body, known, motion, noise, windows
from inferred_sessions import inferred
from scipy.interpolate import make_interp_spline

from biodance.body.parts import GRAVITY
from biodance.diagnosis.own_tolerances import own_tolerances
from biodance.diagnosis.problem import TrialWindow
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import poses
from biodance.motion.track import track
from biodance.records import Array, Markers, Motion, Wrench
from biodance.spatial import wrench_about_origin, wrench_about_point
from biodance.uncertainty.bands import BANDS
from biodance.uncertainty.session_noise import SkinUnrest, of_marker_errors, skin_unrest

GENTLE = 0.3
"""Share of the synthetic movement that tracking follows from its own start."""


def worn(moving: Motion, local: Array) -> Markers:
    """Return the markers of the body in a motion, displaced by ``local`` (T, K, 3) m on their segments."""
    one = body()
    pose, segment = poses(one, moving.q), list(one.markers.segment)
    place = pose.points(segment, one.markers.position)
    return Markers(one.markers.names, moving.time, place + np.einsum("tkij,tkj->tki", pose.rotation[:, segment], local))


def waves(time: Array, seed: int, size: float, hertz: tuple[float, float] = (0.35, 0.95)) -> Array:
    """Return (T, K, 3) m: every axis of every marker at a frequency of its own."""
    rng, shape = np.random.default_rng(seed), (len(body().markers.names), 3)
    speed, phase = 2 * np.pi * rng.uniform(*hertz, shape), rng.uniform(0, 2 * np.pi, shape)
    return size * np.sin(speed * time[:, None, None] + phase)


def dressed(window: TrialWindow, local: Array) -> TrialWindow:
    """Return a look at the true motion, with markers displaced by ``local`` (T, K, 3) m."""
    return replace(window, trial=replace(window.trial, markers=worn(window.motion, local)))


def filmed(window: TrialWindow, local: Array) -> TrialWindow:
    """Return a look whose motion is tracked from markers displaced by ``local`` (T, K, 3) m."""
    one = dressed(window, local)
    return replace(one, motion=track(body(), one.trial))


def lagging(moving: Motion, lag: Array) -> Array:
    """Return (T, K, 3) m: markers that yield to the specific force at their place by ``lag`` (K,) s², as far as it
    changes.
    """
    pose, segment = poses(body(), moving.q), list(body().markers.segment)
    place = pose.points(segment, body().markers.position)
    force = GRAVITY - make_interp_spline(moving.time, place, k=5).derivative(2)(moving.time)
    local = np.einsum("tkij,tki->tkj", pose.rotation[:, segment], force)
    return np.asarray(lag[:, None] * (local - local.mean(axis=0)))


@cache
def restless(size: float = 0.0016) -> tuple[TrialWindow, ...]:
    """Return a session of a person who moves gently and whose skin waves by ``size`` m; nothing else is wrong."""
    found = []
    for k, window in enumerate(windows(5)):
        moving, rng = window.motion, np.random.default_rng(k)
        q = body().neutral + GENTLE * (moving.q - body().neutral)
        gentle = replace(moving, q=q, v=GENTLE * moving.v, a=GENTLE * moving.a)
        value = predict_wrench(body(), gentle).value
        value = value + wrench_about_origin(noise(rng, len(value)), CORNERS.mean(axis=0))
        plate = replace(window.trial.plates[0], wrench=Wrench(moving.time, value))
        one = replace(window, motion=gentle, trial=replace(window.trial, plates=(plate,)))
        found.append(filmed(one, waves(moving.time, k, size)))
    return tuple(found)


def unrest(some: tuple[TrialWindow, ...]) -> SkinUnrest:
    return skin_unrest(body(), ((one.trial, one.motion, one.use) for one in some))


def seen(some: tuple[TrialWindow, ...]) -> Array:
    """Return (B, 3): the waves of the middle marker."""
    return np.median(unrest(some).waves, axis=2)


def test_what_goes_with_the_movement_is_no_unrest() -> None:
    """A marker that has moved, skin that a joint pulls along and skin that sags tell nothing; a wave is told whole."""
    session = windows(3, trials=6)
    pulled = [0.02 * one.motion.q[:, 7:8, None] * np.ones((len(body().markers.names), 3)) + 0.03 for one in session]
    assert np.sqrt(seen(tuple(map(dressed, session, pulled)))[:, 0]).max() < 1e-9
    waving = [
        local + waves(one.motion.time, k, 0.004) for k, (one, local) in enumerate(zip(session, pulled, strict=True))
    ]
    power = seen(tuple(map(dressed, session, waving)))
    there = 0.5 * 0.004**2 * BANDS.rate / 2 / (BANDS.edges[3] - BANDS.edges[2])
    assert power[2, 0] == pytest.approx(there, rel=0.3)
    assert power[2, 1] / power[2, 0] == pytest.approx((2 * np.pi * 0.65) ** 2, rel=0.25)
    assert max(power[3:, 0]) < 0.1 * power[2, 0]


def test_markers_that_nobody_sees_and_trials_too_short_tell_nothing() -> None:
    one = restless()[0]
    silent = (replace(one, trial=replace(one.trial, markers=None)), replace(one, use=np.arange(one.use.size) < 40))
    for some in ((), silent[:1], silent[1:]):
        assert not unrest(some).waves.any()
        assert not unrest(some).excess((0.0,) * len(BANDS), (0.0,) * len(BANDS)).any()
    fewer = tuple(
        replace(some, trial=replace(some.trial, markers=some.trial.markers.select(some.trial.markers.names[:-3])))
        for some in restless()
    )
    assert not unrest(fewer).waves[:, :, -3:].any()
    np.testing.assert_array_equal(unrest(fewer).waves[:, :, :-3], unrest(restless()).waves[:, :, :-3])
    np.testing.assert_allclose(unrest(fewer).sizes()[0][2], unrest(restless()).sizes()[0][2], rtol=0.1)


@pytest.mark.parametrize("loud", [(), ("RTHI", "LTHI", "RKNE", "LKNE")])
def test_the_unrest_of_the_skin_reaches_the_forces_as_it_does_in_truth(loud: tuple[str, ...]) -> None:
    """A body that stands still under waving markers, all alike or some three times as loud: what tracking makes of it,
    in forces and moments.
    """
    one, window = body(), windows(3, trials=1)[0]
    quiet = replace(motion(3), q=np.tile(one.neutral, (600, 1)), v=np.zeros((600, one.nv)), a=np.zeros((600, one.nv)))
    size = np.where(np.isin(one.markers.names, loud), 0.006, 0.002 if loud else 0.004)[:, None]
    found = [filmed(replace(window, motion=quiet), size * waves(quiet.time, k, 1.0)) for k in range(4)]
    about = np.array([0.0, 0.0, 0.0])
    square, count = np.zeros(6), 0
    for some in found:
        wrench = predict_wrench(one, some.motion).value - predict_wrench(one, quiet).value
        rows = BANDS.coefficients(wrench_about_point(wrench, about)[::2])
        here = BANDS.of(len(rows)) == 2
        square, count = square + np.sum(rows[here] ** 2, axis=0), count + here.sum()
    power = unrest(tuple(found)).excess((0.0,) * len(BANDS), (0.0,) * len(BANDS))
    expected = np.diag(of_marker_errors(one, one.neutral[None], about, power)[2])
    ratio = np.sqrt(expected / (square / count))
    assert ratio.min() > 0.7, ratio
    assert ratio.max() < 1.5, ratio


def test_only_more_unrest_than_usual_makes_the_forces_louder() -> None:
    calm = own_tolerances(body(), windows(5), known=known()).tolerances
    here = own_tolerances(body(), restless(), known=known()).tolerances
    more = np.array([np.diag(b) for b in here.noise - calm.noise])
    assert (more[2] > 0.005).all()
    assert np.abs(more[4]).max() < 1e-12
    power = np.repeat(np.array([[1e-4, 1.0, 1.0]] * len(BANDS))[:, :, None], 5, axis=2)
    power[:, :, 0], power[:, :, 1] = 0.0, 1e3 * power[:, :, 1]  # one that nobody sees, one that is wrong
    both = SkinUnrest(power, power)
    assert not both.excess((0.011,) * len(BANDS), (0.011,) * len(BANDS)).any()
    share = both.excess((0.008,) * len(BANDS), (0.011,) * len(BANDS))[:, 0] / 1e-4
    np.testing.assert_allclose(share[:, 2], [0.36, 0.36, 0.36, 0.36, 0.0])
    np.testing.assert_allclose(share[:4, :2], [[0.0, 9 * 0.36]] * 4)
    lagging = both.excess((0.011,) * len(BANDS), (0.008,) * len(BANDS))[:, 0] / 1e-4
    np.testing.assert_allclose(lagging[:, 2], [0.36] * 5)


def test_flesh_that_lags_behind_is_swing_and_no_wave() -> None:
    """Markers displaced by 1, 2 or 3 times 1e-3 s² times the specific force, beside what the joint angles explain."""
    session = windows(3, trials=6)
    lag = 1e-3 * (1 + np.arange(len(body().markers.names)) % 3)
    found = unrest(tuple(dressed(window, lagging(window.motion, lag)) for window in session))
    assert found.sizes()[0][3] < 0.3 * found.sizes()[1][3]
    assert unrest(session).sizes()[1].max() < 1e-6
    size = np.sqrt(found.swing[3, 0])
    assert size[lag == 0.003].mean() / size[lag == 0.001].mean() == pytest.approx(3.0, rel=0.3)


def test_restless_skin_is_no_alarm() -> None:
    """Taken for as quiet as elsewhere, waves of 1.8 mm are forces that nothing explains."""
    session = restless(0.0018)
    alarmed = inferred(body(), session, tolerances=known()).diagnosis
    assert (alarmed.verdict, alarmed.findings) == ("unexplained", ())
    own = own_tolerances(body(), session, known=known()).tolerances
    calm = inferred(body(), session, tolerances=own).diagnosis
    assert (calm.verdict, calm.findings) == ("nothing wrong", ())

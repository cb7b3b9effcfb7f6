"""The noise of a session's own instruments: measured where it can be, added beyond what was learned."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import NOISE, body, known, motion, windows
from inferred_sessions import inferred

from biodance.body.tables.error_sizes import error_size
from biodance.diagnosis.own_tolerances import own_tolerances
from biodance.diagnosis.problem import problem
from biodance.diagnosis.spectrum import needed
from biodance.records import Markers, Plate, Wrench
from biodance.uncertainty.bands import BANDS
from biodance.uncertainty.session_noise import (
    added_noise,
    camera_noise,
    of_cameras,
    of_plates,
    of_zeros,
    plate_noise,
    white_noise,
    with_movement,
    with_own_noise,
)
from biodance.uncertainty.tolerances import REFERENCE_PERSON, InstrumentNoise

# 5 ---- noise from the session


def test_white_noise_is_measured_under_movement() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(0, 10, 0.01)
    course = 0.3 * np.sin(2 * np.pi * 1.0 * time) + 0.02 * np.sin(2 * np.pi * 3.0 * time)
    xyz = course[:, None, None] + rng.normal(0, 2e-4, (time.size, 5, 3))
    xyz[100:300, 0] = np.nan
    assert camera_noise([Markers(tuple("abcde"), time, xyz)]) == pytest.approx(2e-4, rel=0.05)
    assert np.isnan(white_noise(np.zeros((20, 2)))).all()
    assert camera_noise([Markers(("a",), time[:20], xyz[:20, 1:2])]) == 0.0


def test_plate_noise_is_a_density_about_the_plates_centre() -> None:
    rng = np.random.default_rng(4)
    time = np.arange(0, 4, 0.001)
    centre = np.array([3.0, 2.0, 0.0])
    local = rng.normal(0, 1.0, (time.size, 6)) * [0.5, 0.5, 1.0, 0.1, 0.1, 0.05]
    value = np.concatenate([local[:, :3], local[:, 3:] + np.cross(centre, local[:, :3])], axis=1)
    corners = centre + np.array([[0.2, 0.3, 0], [-0.2, 0.3, 0], [-0.2, -0.3, 0], [0.2, -0.3, 0]])
    found = plate_noise([Plate("plate1", 2, corners, Wrench(time, value))])
    np.testing.assert_allclose(found * np.sqrt(500), [0.5, 0.5, 1.0, 0.1, 0.1, 0.05], rtol=0.1)
    np.testing.assert_allclose(np.diag(of_plates(found, 2)), 2 * found**2 * 12.5)


def test_the_zero_of_a_run_is_the_same_however_long_it_is() -> None:
    rng, sd = np.random.default_rng(6), error_size("plate_zero", "force")
    for seconds in (4.0, 16.0):
        constant = np.ones(int(seconds * BANDS.rate))[:, None] * rng.normal(0, sd, 4000)
        spread = np.var(BANDS.coefficients(constant), axis=1)
        found = of_zeros([seconds, seconds])
        assert found[0, 1, 1] == pytest.approx(spread[0], rel=0.1)
        assert found[1:].max() == pytest.approx(spread[1:].max(), abs=1e-12) == 0.0
    assert not of_zeros([]).any()


def test_camera_noise_reaches_the_forces_as_it_does_in_truth() -> None:
    """Weighted least squares on noisy markers at rest, differentiated twice: the spread of a coefficient of Fz."""
    from biodance.motion.kinematics import jacobian, poses

    one, q, noise, rate = body(), motion(1).q[0], 3e-4, 100.0
    cov = of_cameras(one, q[None], np.zeros(3), noise=noise, rate=rate)
    rng, pose = np.random.default_rng(5), poses(one, q[None])
    places = pose.points(list(one.markers.segment), one.markers.position)
    J = jacobian(one, pose, list(one.markers.segment), places)[0][0]
    root = np.repeat(np.sqrt(one.markers.weight), 3)
    com = jacobian(one, pose, list(range(len(one.segments))), pose.points(list(range(len(one.segments))), one.sip.com))
    lift = (one.sip.mass @ com[0][0].reshape(-1, 3, one.nv)[:, 2]) @ np.linalg.pinv(root[:, None] * J) * root
    frames = 4096
    course = rng.normal(0, noise, (frames, J.shape[0])) @ lift
    spectrum = np.fft.rfft(course) * (2 * np.pi * np.fft.rfftfreq(frames, 1 / rate)) ** 2
    frequency = np.fft.rfftfreq(frames, 1 / rate)
    for band in (3, 4):
        here = (frequency >= BANDS.edges[band]) & (frequency < BANDS.edges[band + 1])
        per_coefficient = np.mean(np.abs(spectrum[here]) ** 2) / frames * BANDS.rate / rate
        assert cov[band, 2, 2] == pytest.approx(per_coefficient, rel=0.25)


def test_own_noise_is_added_beyond_what_was_learned_and_limits_follow() -> None:
    rng, time = np.random.default_rng(6), np.arange(0, 5, 0.01)
    trial = windows(1, trials=1)[0].trial

    def recorded(noise):
        xyz = rng.normal(0, noise, (time.size, 4, 3))
        return (replace(trial, markers=Markers(tuple("abcd"), time, xyz), plates=()),)

    q = motion(1).q[:1]
    assert not added_noise(body(), recorded(0.9 * InstrumentNoise().camera), q, np.zeros(3)).any()
    more = added_noise(body(), recorded(3e-4), q, np.zeros(3))
    expected = of_cameras(body(), q, np.zeros(3), noise=np.sqrt(9 - 1) * 1e-4, rate=100.0)
    np.testing.assert_allclose(more, 4 * expected, rtol=0.1, err_msg="columns have the same noise: four times")
    wider = with_own_noise(known(), more, 70.0)
    np.testing.assert_allclose(wider.noise - known().noise, more, atol=1e-12)
    seen = [inferred(body(), windows(1), tolerances=one, effects=("added_mass",)).diagnosis for one in (known(), wider)]
    assert min(row.limit for row in seen[1].limits) > min(row.limit for row in seen[0].limits)


def test_what_a_movement_needs_is_its_power_by_band_for_a_reference_person() -> None:
    """By Parseval's theorem the coefficients of a run hold the squares of its samples."""
    put = problem(body(), windows(1, trials=2))
    found, mass = needed(put.cases, put.spectrum), float(body().sip.mass.sum())
    count = np.bincount(put.spectrum.band, minlength=len(BANDS))
    runs = [
        case.predicted[pick, 0] for case, picks in zip(put.cases, put.spectrum.picks, strict=True) for pick in picks
    ]
    whole = sum(float(one @ one) for one in runs)
    kept = float(count @ found[:, 0]) * (mass / REFERENCE_PERSON) ** 2
    assert 0.97 * whole < kept <= whole * (1 + 1e-9)


@pytest.mark.parametrize("faster", [0.5, 1.0, 3.0])
def test_noise_grows_with_what_a_movement_needs_and_never_shrinks(faster: float) -> None:
    usual = replace(known(), movement=np.arange(1.0, 6 * len(BANDS) + 1).reshape(-1, 6))
    found = with_movement(usual, faster**2 * usual.movement)
    more = np.full((len(BANDS), 6), max(1.0, faster))
    more[0, 2] = 1.0  # the mean vertical force is weight, however fast
    np.testing.assert_allclose(found.noise, usual.noise * more[:, :, None] * more[:, None, :])


def test_a_faster_movement_is_held_against_its_own_noise() -> None:
    """Eight times the error that the tolerances know, of a person who needs eight times as much as anybody they were
    learned on: no unknown cause, and one where the noise does not grow.
    """
    rng, some = np.random.default_rng(5), []
    for window in windows(1, trials=3):
        plates = tuple(
            replace(p, wrench=Wrench(p.wrench.time, p.wrench.value + 8 * NOISE * rng.normal(size=p.wrench.value.shape)))
            for p in window.trial.plates
        )
        some.append(replace(window, trial=replace(window.trial, plates=plates)))
    put = problem(body(), tuple(some))
    slow = replace(known(), movement=needed(put.cases, put.spectrum) / 64)
    own = own_tolerances(body(), tuple(some), known=slow).tolerances
    as_is, grown = (inferred(body(), tuple(some), tolerances=one, effects=("plate_gain",)) for one in (slow, own))
    assert grown.posterior.unknown < 0.5 < as_is.posterior.unknown

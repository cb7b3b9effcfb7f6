"""Regression dilution: accelerations that nobody made shrink parameters; measured gains give that back."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import symmetric_root
from identify_trials import smooth_motion
from scipy.signal import butter, sosfiltfilt

from biodance.body.human.human import human
from biodance.identification.identification import identify_body
from biodance.identification.loads import compact_load
from biodance.identification.mismatch import gains_move_masses, undiluted
from biodance.identification.posterior import Information, find_posterior
from biodance.identification.statistics import PAIRS, Fit, Statistics, statistics
from biodance.motion.dynamics import predict_wrench
from biodance.records import Array, Motion, Sip, Subject, Wrench
from biodance.uncertainty.bands import BANDS, Noise
from biodance.uncertainty.caution import widened_prior

BODY = human(Subject(70.0, 1.75, "M"))
ABOUT = np.zeros(3)
FAST = np.array(BANDS.edges[:-1]) >= 1.0
TABLE = widened_prior(BODY.sip)
NOISE = Noise(np.tile(np.diag([9.0] * 3 + [4.0] * 3), (len(BANDS), 1, 1)), ABOUT, BANDS)


def recorded(shake: float, noise_n: float = 1.0) -> Statistics:
    """Return the statistics of a trial whose trunk is seen to shake by ``shake`` rad/s² rms beyond 1 Hz, while the
    plates feel the real movement, with noise of ``noise_n`` N and 0.3 of that in N·m.
    """
    rng = np.random.default_rng(7)
    real = smooth_motion(BODY, rng, frames=3000, size=0.3)
    wrench = predict_wrench(BODY, real).value + noise_n * rng.normal(size=(3000, 6)) * [1, 1, 1, 0.3, 0.3, 0.3]
    trunk = [6 + i for i, joint in enumerate(BODY.joints) if joint.name.startswith("trunk")]
    noise = sosfiltfilt(butter(4, (1.2, 5.5), "band", fs=100, output="sos"), rng.normal(size=(3000, 3)), axis=0)
    seen = real.a.copy()
    seen[:, trunk] += shake * noise / noise.std()
    motion = Motion(real.time, real.q, real.v, seen)
    fit = Fit("t", motion, Wrench(real.time, wrench), np.ones(3000, dtype=bool))
    return statistics(BODY, (fit,), Noise.unit(ABOUT))


@pytest.fixture(scope="module")
def shaken() -> Statistics:
    return recorded(2.0)


def left(total: Statistics, phi: Array) -> Array:
    """Return (B, 6): summed squares of what the parameters do not explain of the wrench."""
    z = np.append(-phi, 1.0)
    return np.asarray(np.einsum("i,bcij,j->bc", z, total.own, z))


def slopes(total: Statistics, phi: Array) -> tuple[Array, Array]:
    """Return (B, 6) twice: how much of the predicted wrench the plates show, and what is left of theirs beside that."""
    predicted, seen = np.append(phi, 0.0), np.eye(phi.size + 1)[-1]
    cross, size, power = (
        np.einsum("i,bcij,j->bc", one, total.own, other)
        for one, other in ((seen, predicted), (predicted, predicted), (seen, seen))
    )
    return cross / size, power - cross**2 / size


@pytest.mark.parametrize(("noise_n", "rtol"), [(0.1, 0.02), (0.01, 0.002), (0.0, 1e-6)])
def test_a_movement_seen_as_it_was_keeps_its_regressor(noise_n: float, rtol: float) -> None:
    """What is given back by mistake goes with the plates' noise, and is nothing without."""
    total, rng = recorded(0.0, noise_n=noise_n), np.random.default_rng(11)
    same = undiluted(total, BODY.sip.phi, total.information(NOISE), TABLE)
    for one in rng.normal(size=(5, TABLE.phi.size)):
        phi = TABLE.phi + symmetric_root(TABLE.covariance) @ one
        np.testing.assert_allclose(left(same, phi), left(total, phi), rtol=rtol)


def test_what_the_plates_do_not_show_is_taken_off_the_regressor(shaken: Statistics) -> None:
    phi = BODY.sip.phi
    real, (shown, beside) = undiluted(shaken, phi, shaken.information(NOISE), TABLE), slopes(shaken, phi)
    first, last = shown[FAST]
    assert first.min() < 0.9
    assert last.max() < 0.4
    assert (left(real, phi)[FAST] < 1.02 * beside[FAST]).all()
    assert (left(shaken, phi)[FAST][1] > 1.5 * beside[FAST][1]).all()
    np.testing.assert_array_equal(real.gram[~FAST], shaken.gram[~FAST])
    np.testing.assert_array_equal(real.count, shaken.count)


def test_no_gain_shows_to_which_side_of_a_joint_matter_belongs(shaken: Statistics) -> None:
    hip = next(i for i, joint in enumerate(BODY.joints) if joint.name.startswith("right_hip"))
    pelvis, place = BODY.place_on_segment(hip)
    point = np.array([1, *place, *(place @ place * np.eye(3) - np.outer(place, place))[np.tril_indices(3)]])
    moved = np.zeros(BODY.sip.phi.size)
    moved[10 * pelvis : 10 * pelvis + 10] = point
    alone, moved[10 * BODY.segment_index("right_thigh")] = moved.copy(), -1.0
    real = undiluted(shaken, BODY.sip.phi, shaken.information(NOISE), TABLE)
    seen = [np.einsum("i,bcij,j->bc", n, real.own[:, :, :-1, :-1], n).sum() for n in (moved, alone)]
    assert seen[0] < 1e-10 * seen[1]


def test_the_trunk_gets_its_inertia_back(shaken: Statistics) -> None:
    trunk = 10 * BODY.segment_index("trunk_head")
    before = find_posterior(shaken.information(NOISE), TABLE).mean
    after = find_posterior(undiluted(shaken, before, shaken.information(NOISE), TABLE).information(NOISE), TABLE).mean
    moment, true = slice(trunk + 4, trunk + 10), BODY.sip.phi
    off = [np.linalg.norm(phi[moment] - true[moment]) / np.linalg.norm(true[moment]) for phi in (before, after)]
    assert off[0] > 0.1
    assert off[1] < 0.5 * off[0]


@pytest.mark.parametrize(("sds", "carried"), [(0.55, False), (-0.65, True)])
def test_masses_may_move_by_part_of_what_is_uncertain(shaken: Statistics, sds: float, carried: bool) -> None:
    before = find_posterior(shaken.information(NOISE), TABLE)
    thigh = 10 * BODY.segment_index("right_thigh")
    moved = before.mean.copy()
    moved[thigh] += sds * np.sqrt(before.covariance[thigh, thigh])
    moved[thigh + 1] += 100.0
    assert gains_move_masses(before, replace(before, mean=moved)) is carried


def test_segments_of_no_person_are_left_alone(shaken: Statistics) -> None:
    table = replace(TABLE, segments=tuple(f"link_{i}" for i in range(len(BODY.segments))))
    same, size = (
        undiluted(shaken, BODY.sip.phi, shaken.information(NOISE), table),
        np.sqrt(np.einsum("bcii->bci", shaken.own)),
    )
    first, second = (size[:, pair] for pair in PAIRS)
    off = (same.gram - shaken.gram) / np.maximum(np.sqrt(first[..., None] * second[:, :, None]), 1e-9)
    np.testing.assert_allclose(off, 0.0, atol=1e-6)


def test_statistics_without_their_fastest_band_are_those_of_fewer_bands(shaken: Statistics) -> None:
    slower = shaken.slower()
    assert slower.layout.bands == replace(BANDS, edges=BANDS.edges[:-1])
    np.testing.assert_array_equal(slower.gram, shaken.gram[:-1])
    np.testing.assert_array_equal(slower.count, shaken.count[:-1])


@pytest.mark.parametrize("slow", [True, False])
def test_a_band_that_only_noise_fills_is_left_out_and_said(slow: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    real = smooth_motion(BODY, np.random.default_rng(3), frames=400, size=0.3)
    fit = Fit("t", real, predict_wrench(BODY, real), np.ones(400, dtype=bool))
    monkeypatch.setattr("biodance.identification.mismatch.gains_move_masses", lambda *_: slow)
    found = identify_body(BODY, (fit,))
    assert found.diluted is slow
    assert found.noise.bands.edges[-1] == (2.5 if slow else 6.0)
    assert any("faster than 2.5 Hz was left out" in note for note in found.notes) is slow


def test_gains_are_measured_under_the_load_that_the_data_show(monkeypatch: pytest.MonkeyPatch) -> None:
    real = smooth_motion(BODY, np.random.default_rng(5), frames=400, size=0.3)
    arm, seen = 10 * BODY.segment_index("left_forearm_hand"), []
    loaded = np.array(BODY.sip.phi)
    loaded[arm : arm + 10] += 2.4 * compact_load(loaded[arm + 1 : arm + 4] / loaded[arm])
    carrying = replace(BODY, sip=replace(BODY.sip, phi=loaded))
    fit = Fit("t", real, predict_wrench(carrying, real), np.ones(400, dtype=bool))

    def watched(total: Statistics, phi: Array, known: Information, table: Sip) -> Statistics:
        seen.append(phi[arm] - BODY.sip.phi[arm])
        return undiluted(total, phi, known, table)

    monkeypatch.setattr("biodance.identification.mismatch.undiluted", watched)
    posterior = identify_body(BODY, (fit,)).posterior
    kept = posterior.mean[arm] - BODY.sip.phi[arm]
    assert kept < 1.0, "the table keeps most of it from the arm"
    assert kept + 0.3 < seen[0] < 2.4

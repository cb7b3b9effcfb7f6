"""Identification of whole sessions, knowledge, comparison and validation, on bodies whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from identify_trials import noisy_fit, person, smooth_motion

from biodance.body.parts import pseudo_inertia, smallest_eigenvalues
from biodance.errors import BiodanceError, TrialRefused
from biodance.identification.identification import NOISE_ALONE, conclude, identify_body
from biodance.identification.knowledge import knowledge, segment_quantities
from biodance.identification.loads import compact_load, unknown_loads, with_room
from biodance.identification.sessions import differences
from biodance.identification.statistics import learn_noise, standing_point, statistics
from biodance.identification.validation import residual_ratio, validate
from biodance.motion.dynamics import predict_wrench
from biodance.records import Motion, Sip, Wrench
from biodance.uncertainty.bands import Noise
from biodance.uncertainty.caution import about_true_centres, widened_prior


def session(seed: int, *, frames: int = 1500):
    body, truth, rng = person(seed)
    return body, truth, (noisy_fit(body, smooth_motion(body, rng, frames=frames), truth, rng),)


def test_identify_beats_the_table_and_stays_possible() -> None:
    before, after = [], []
    for seed in range(3):
        body, truth, fits = session(seed)
        found = identify_body(body, fits)
        assert found.status == "solved"
        assert found.cause == ""
        assert np.all(smallest_eigenvalues(found.sip.phi) >= 0)
        before.append(np.abs(body.sip.phi - truth)[::10].mean())
        after.append(np.abs(found.sip.phi - truth)[::10].mean())
        assert found.identified.sip is found.sip
    assert np.mean(after) < 0.8 * np.mean(before)


def test_intervals_of_a_session_cover_the_truth() -> None:
    inside = []
    for seed in range(4):
        body, truth, fits = session(seed, frames=800)
        found = identify_body(body, fits)
        inside.append(np.abs(found.sip.phi - truth) < 1.96 * np.sqrt(np.diag(found.sip.covariance)))
    assert np.mean(inside) > 0.9


def test_a_body_at_rest_cannot_be_known() -> None:
    body, truth, rng = person(5)
    frames = 1500
    still = Motion(np.arange(frames) / 100, np.tile(body.neutral, (frames, 1)), *np.zeros((2, frames, body.nv)))
    found = identify_body(body, (noisy_fit(body, still, truth, rng),))
    inertias = [k for k in found.known if k.quantity.startswith("I")]
    assert all(k.verdict == "cannot be known" for k in inertias)
    assert min(k.sd / k.table_sd for k in inertias) > 0.7
    assert any("Cannot be known from this session" in note for note in found.notes)


@pytest.mark.parametrize(("size", "believed"), [(0.02, False), (0.5, True)])
def test_sway_that_may_be_skin_moves_no_mass(size: float, believed: bool) -> None:
    body, _, rng = person(5)
    moved = smooth_motion(body, rng, frames=1500, size=size)
    fit = noisy_fit(body, moved, body.sip.phi, rng, size=0.1)
    away = moved.q - body.neutral
    skin = Motion(moved.time, body.neutral + 1.5 * away, 1.5 * moved.v, 1.5 * moved.a)
    moved_mass = np.abs(identify_body(body, (replace(fit, motion=skin),)).sip.mass / body.sip.mass - 1).max()
    assert (moved_mass > 0.1) == believed
    assert (moved_mass < 0.02) == (not believed)


def test_statistics_alone_say_that_their_intervals_are_short() -> None:
    body, _, fits = session(1, frames=600)
    layout = Noise.unit(standing_point(fits))
    found = conclude(body, statistics(body, (fits[0],), layout), ("t",))
    assert NOISE_ALONE in found.notes


def test_a_session_without_usable_frames_is_refused() -> None:
    body, _, fits = session(2, frames=300)
    blind = replace(fits[0], use=np.zeros(300, dtype=bool))
    with pytest.raises(TrialRefused, match="None of 1 trials"):
        identify_body(body, (blind,))
    assert "Left out" in identify_body(body, (fits[0], replace(blind, name="blind"))).notes[0]


def test_quantities_and_their_slope() -> None:
    body, _, _ = person(3)
    phi = np.array(body.sip.phi[:10])
    value, slope = segment_quantities(phi)
    step = 1e-6
    numeric = np.array(
        [
            (segment_quantities(phi + step * e)[0] - segment_quantities(phi - step * e)[0]) / (2 * step)
            for e in np.eye(10)
        ]
    ).T
    np.testing.assert_allclose(slope, numeric, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(value[1:4], phi[1:4] / phi[0])
    rows = knowledge(body.sip, body.sip)
    assert len(rows) == 40
    assert all(row.verdict == "cannot be known" and row.from_data == 0 for row in rows)


def test_caution_widens_without_moving_or_breaking_the_scale() -> None:
    body, _, _ = person(4, spread=0.05)
    for change in (widened_prior, about_true_centres):
        wide = change(body.sip)
        np.testing.assert_array_equal(wide.phi, body.sip.phi)
        extra = wide.covariance - body.sip.covariance
        if change is about_true_centres:
            assert np.linalg.eigvalsh(extra).min() > -1e-12
        assert np.linalg.eigvalsh(wide.covariance).min() > -1e-12
    pinned = np.array(body.sip.covariance)
    total = np.tile(np.eye(10)[0], 4)
    g = pinned @ total
    pinned -= np.outer(g, g) / (total @ g + 0.01**2)
    wide = widened_prior(Sip(body.segments, body.sip.phi, pinned))
    assert np.sqrt(total @ wide.covariance @ total) < 0.25
    assert np.all(np.diag(wide.covariance)[::10] > np.diag(pinned)[::10])


def test_a_turned_frame_and_a_shifted_centre_to_first_order() -> None:
    from scipy.spatial.transform import Rotation

    from biodance.uncertainty.caution import _turn_slope, shift_slope
    from biodance.virtual_lab.person import of_parameters, parameters_of_inertia, place_inertia

    phi = np.array(person(6)[0].sip.phi[:10])
    J, step = of_parameters(phi), 1e-6
    turn = [
        (parameters_of_inertia(place_inertia(J, Rotation.from_rotvec(step * e).as_matrix(), np.zeros(3))) - phi) / step
        for e in np.eye(3)
    ]
    shift = [(parameters_of_inertia(place_inertia(J, np.eye(3), step * e)) - phi) / step for e in np.eye(3)]
    np.testing.assert_allclose(_turn_slope(phi), np.array(turn).T, atol=1e-4)
    np.testing.assert_allclose(shift_slope(phi), np.array(shift).T, atol=1e-4)
    np.testing.assert_allclose(pseudo_inertia(phi)[0], J, atol=1e-12)


def test_equal_sessions_do_not_differ() -> None:
    body, truth, rng = person(7)
    body = replace(body, boxes=np.tile([[-0.3] * 3, [0.3] * 3], (4, 1, 1)))
    first, second = (
        identify_body(body, (noisy_fit(body, smooth_motion(body, rng, frames=1000), truth, rng),)) for _ in range(2)
    )
    rows = differences(first, second)
    assert len(rows) == 40
    z = np.array([row.value / row.sd for row in rows if row.quantity in ("mass", "com x", "com y", "com z")])
    assert np.mean(np.abs(z) < 1.96) > 0.9
    assert all(row.value == 0 and row.p == 1 for row in differences(first, first))
    changed = truth.copy()
    changed[20:30] += 2.0 * compact_load(np.array([0.15, -0.2, 0.2]))
    third = identify_body(body, (noisy_fit(body, smooth_motion(body, rng, frames=1000), changed, rng),))
    for pair, sign in (((first, third), 1), ((third, first), -1)):
        masses = {row.segment: row for row in differences(*pair) if row.quantity == "mass"}
        assert min(masses.values(), key=lambda row: row.p).segment == "s2"
        assert abs(masses["s2"].value - 2.0 * sign) < 1.96 * masses["s2"].sd
        assert abs(masses["s2"].value - 2.0 * sign) < 0.3
        assert all(abs(row.value) < 0.3 for name, row in masses.items() if name != "s2")


@pytest.mark.parametrize("seed", [0, 2, 5, 6, 9, 12])
def test_what_changed_hangs_on_no_rounding(seed: int) -> None:
    body, truth, rng = person(seed)
    fits = [noisy_fit(body, smooth_motion(body, rng, frames=500), truth, rng) for _ in range(2)]
    moved = [
        replace(f, wrench=Wrench(f.wrench.time, f.wrench.value * (1 + 1e-12 * rng.normal(size=f.wrench.value.shape))))
        for f in fits
    ]
    sessions = [identify_body(body, (fit,)) for fit in (*fits, *moved)]
    for pair, shaken in ((sessions[:2], sessions[2:]), ((sessions[0], sessions[0]), (sessions[2], sessions[0]))):
        for one, other in zip(differences(*pair), differences(*shaken), strict=True):
            assert abs(one.value - other.value) < 1e-3 * one.sd
            assert one.sd == pytest.approx(other.sd, rel=1e-4)
            assert one.known == other.known


def test_gain_has_the_known_ratio_in_its_interval() -> None:
    body, truth, rng = person(8)
    fit = noisy_fit(body, smooth_motion(body, rng, frames=2000), truth, rng, size=0.0)
    table = predict_wrench(body, fit.motion).value - fit.wrench.value
    halved = Wrench(fit.motion.time, predict_wrench(body, fit.motion).value - 2 * table)
    half = replace(fit, wrench=halved)
    assert half.wrench.value.shape == fit.wrench.value.shape
    true_body = replace(body, sip=Sip(body.segments, truth, body.sip.covariance))
    result = residual_ratio((validate(body, true_body, half, about=np.zeros(3)),))
    assert result.force == pytest.approx(2.0)
    assert result.moment == pytest.approx(2.0)
    assert result.force_interval[0] <= 2.0 + 1e-9
    assert result.force_interval[1] >= 2.0 - 1e-9
    with pytest.raises(BiodanceError, match="blocks"):
        residual_ratio(
            (
                validate(
                    body,
                    true_body,
                    noisy_fit(body, smooth_motion(body, rng, frames=120), truth, rng),
                    about=np.zeros(3),
                ),
            )
        )


def test_learned_noise_is_used_when_given() -> None:
    body, _, fits = session(9, frames=600)
    total = statistics(body, (fits[0],), Noise.unit(standing_point(fits)))
    noise = learn_noise(total, with_room(widened_prior(body.sip), unknown_loads(body)))
    np.testing.assert_allclose(
        conclude(body, total, ("t",), noise=noise).sip.phi, conclude(body, total, ("t",)).sip.phi
    )


def test_a_posture_that_jumps_is_left_out_and_said() -> None:
    body, truth, fits = session(11, frames=1000)
    spoilt = np.array(fits[0].motion.a)
    spoilt[500:510] += 400.0
    jumping = replace(fits[0], motion=replace(fits[0].motion, a=spoilt))
    found = identify_body(body, (jumping,))
    assert any("posture that jumps" in note for note in found.notes)
    clean = identify_body(body, fits)
    assert np.abs(found.sip.phi - truth)[::10].mean() < 1.5 * np.abs(clean.sip.phi - truth)[::10].mean() + 0.05
    assert not any("posture that jumps" in note for note in clean.notes)
    with pytest.raises(TrialRefused, match="No frame is left"):
        identify_body(body, (replace(fits[0], motion=replace(fits[0].motion, a=fits[0].motion.a + 400.0)),))

"""Kinematics and plates in the equations: sizes by evidence, information that is discounted as the formula says."""

from dataclasses import replace

import numpy as np
import pytest
from direct_information import whiten
from identify_trials import noisy_fit, person, smooth_motion

from biodance.body.human.human import human
from biodance.body.human.skeleton import with_optional
from biodance.body.parts import JointError, shift_matter
from biodance.body.tables.error_sizes import error_size
from biodance.identification.mismatch import (
    Mismatch,
    Sizes,
    evident_sizes,
    mismatch,
    nothing,
    share_errors,
    temper,
)
from biodance.identification.posterior import Information, find_posterior
from biodance.identification.statistics import statistics
from biodance.motion.kinematics import chains, jacobian, neighbours, poses
from biodance.records import CHANNELS, Subject
from biodance.uncertainty.bands import Bands, Noise
from biodance.uncertainty.plates import PLATE_SOURCES, around_zero, plate_sources
from biodance.uncertainty.sources import deviations, joint_of, of_markers

BANDS = Bands((0.0, 1.0, 10.0), 25.0)


def test_jacobian_is_the_derivative_of_the_places() -> None:
    body, _, rng = person(0)
    motion = smooth_motion(body, rng, frames=5)
    segment = list(body.markers.segment)
    place, _ = jacobian(
        body, poses(body, motion.q), segment, poses(body, motion.q).points(segment, body.markers.position)
    )
    step = 1e-6
    for j in range(len(body.joints)):
        q = motion.q.copy()
        q[:, 7 + j] += step
        change = poses(body, q).points(segment, body.markers.position) - poses(body, motion.q).points(
            segment, body.markers.position
        )
        np.testing.assert_allclose(place[:, :, 6 + j], change.reshape(5, -1) / step, atol=1e-5)


@pytest.mark.parametrize("frames", [8, 9, 17])
def test_a_short_run_tells_how_far_markers_should_be_off(frames: int) -> None:
    body, _, rng = person(2)
    fit = noisy_fit(body, smooth_motion(body, rng, frames=4 * frames), body.sip.phi, rng)
    names = body.markers.names
    motion = replace(fit.motion, residual=np.full((4 * frames, len(names)), 0.02), marker_names=names)
    found = mismatch(body, (replace(fit, motion=motion),), Noise.unit(np.zeros(3), BANDS))
    assert np.isfinite(found.kinematics).all()


def test_neighbours_are_at_the_ends() -> None:
    body, _, _ = person(4)
    table = neighbours(body)
    assert np.all(table.sum(axis=1) == 2)
    assert sum(len(chain) for chain in chains(body)) == len(body.joints)


def test_a_part_has_its_own_joints_beside_it() -> None:
    body = with_optional(human(Subject(70.0, 1.75, "M", 30.0)), "neck", {})
    table, head = neighbours(body), len(body.segments)
    own = [i for i, joint in enumerate(body.joints) if joint.parent >= 0 and joint.name.startswith(("neck", "head"))]
    assert table.shape == (len(body.joints), head + 1)
    assert own
    np.testing.assert_array_equal(np.flatnonzero(table[:, head]), own)


def test_without_disturbance_nothing_is_discounted() -> None:
    rng = np.random.default_rng(0)
    data = Information(np.triu(rng.normal(size=(41, 41))) + 5 * np.eye(41), 100)
    none = Mismatch(np.zeros((40, 8)), np.zeros((40, 8)))
    body, _, _ = person(5)
    for noise in (1.0, 4.0):
        mild = temper(data, none, Sizes(1.0, noise))
        np.testing.assert_allclose(
            mild.triangle.T @ mild.triangle, data.triangle.T @ data.triangle / noise, rtol=1e-6, atol=1e-9
        )
        weaker = find_posterior(mild, body.sip)
        np.testing.assert_array_less(
            find_posterior(data, body.sip).covariance.trace() - 1e-12, weaker.covariance.trace()
        )


def test_tempered_data_give_the_textbook_posterior() -> None:
    rng = np.random.default_rng(1)
    data = Information(np.triu(rng.normal(size=(41, 41))) + 5 * np.eye(41), 100)
    found = Mismatch(rng.normal(size=(40, 60)), rng.normal(size=(40, 60)))
    body, _, _ = person(6)
    H = data.triangle.T @ data.triangle
    C = 2.0 * H + found.kinematics @ found.kinematics.T + found.plates @ found.plates.T
    W = H @ np.linalg.inv(C)
    precision = np.linalg.inv(body.sip.covariance) + W @ H
    mean = np.linalg.solve(
        precision, np.linalg.inv(body.sip.covariance) @ body.sip.phi + W @ data.triangle.T @ data.target
    )
    got = find_posterior(temper(data, found, Sizes(1.0, 2.0)), body.sip)
    np.testing.assert_allclose(got.mean, mean, rtol=1e-6, atol=1e-8)


def test_evidence_finds_the_size_of_the_noise() -> None:
    rng = np.random.default_rng(2)
    body, _truth, _ = person(7)
    rows = rng.normal(size=(40, 40)) * 20
    none = Mismatch(1e-9 * rng.normal(size=(40, 8)), 1e-9 * rng.normal(size=(40, 8)))
    chosen = []
    for _ in range(20):
        drawn = body.sip.phi + np.sqrt(np.diag(body.sip.covariance)) * rng.normal(size=40)
        y = rows @ drawn + 2.0 * rng.normal(size=40)
        R = np.zeros((41, 41))
        triangle = np.linalg.qr(np.column_stack([rows, y]), mode="r")
        R[: len(triangle)] = triangle
        data = Information(R, 40)
        chosen.append(evident_sizes(data, none, body.sip).noise)
    assert 3.0 <= np.median(chosen) <= 7.0


def test_mismatch_is_reproducible_and_scaled_to_the_markers() -> None:
    body, truth, rng = person(8)
    fit = noisy_fit(body, smooth_motion(body, rng, frames=400), truth, rng)
    noise = Noise.unit(np.zeros(3), BANDS)
    plain = mismatch(body, (fit,), noise)
    np.testing.assert_array_equal(plain.kinematics, mismatch(body, (fit,), noise).kinematics)

    def with_residual(size: float):
        motion = replace(fit.motion, residual=np.full((400, 3), size), marker_names=("m0", "m1", "m2"))
        return mismatch(body, (replace(fit, motion=motion),), noise).kinematics

    rigid = sum(len(source.groups) for source in of_markers(body)[2:])
    first, second = with_residual(0.1), with_residual(0.2)
    np.testing.assert_allclose(second[:, :-rigid], 2 * first[:, :-rigid], rtol=1e-9)
    np.testing.assert_array_equal(second[:, -rigid:], first[:, -rigid:])
    np.testing.assert_array_equal(with_residual(1e-6), plain.kinematics)


def test_weighted_rows_are_whitened_twice() -> None:
    rng = np.random.default_rng(4)
    factor = rng.normal(size=(2, 6, 6)) + 4 * np.eye(6)
    rows, other = rng.normal(size=(2, 80, 6, 3))
    for noise in (
        Noise(factor @ np.swapaxes(factor, 1, 2), np.array([0.2, 0.1, 0.0]), Bands((0.0, 1.0, 8.0), 25.0)),
        Noise(factor[:1] @ np.swapaxes(factor[:1], 1, 2), np.array([0.2, 0.1, 0.0])),
    ):
        white = [whiten(noise, x).reshape(-1, 3) for x in (rows, other)]
        np.testing.assert_allclose(
            np.einsum("tci,tcj->ij", other, noise.weighted(rows)), white[1].T @ white[0], rtol=1e-9
        )


def test_no_frames_make_no_scores() -> None:
    body, truth, rng = person(10)
    fit = noisy_fit(body, smooth_motion(body, rng, frames=100), truth, rng)
    some = mismatch(body, (fit,), Noise.unit(np.zeros(3), BANDS))
    none = nothing(body)
    assert none.kinematics.shape == some.kinematics.shape
    assert none.plates.shape == some.plates.shape
    assert np.abs(some.kinematics).max() > 0
    short = replace(fit, use=np.arange(100) < 5)
    assert not np.any(mismatch(body, (short,), Noise.unit(np.zeros(3), BANDS)).kinematics)


def test_a_heavy_head_that_nods_does_not_make_a_heavy_trunk() -> None:
    body, rng = with_optional(human(Subject(70.0, 1.75, "M", 30.0)), "neck", {}), np.random.default_rng(9)
    errors, trunk, (head,) = share_errors(body), body.segment_index("trunk_head"), body.parts
    assert share_errors(human(Subject(70.0, 1.75, "M", 30.0))).shape == (120, 0)
    _, neck = body.place_on_segment(body.segment_joint[-1])
    np.testing.assert_allclose(shift_matter(neck) @ errors[120:] + errors[10 * trunk : 10 * trunk + 10], 0, atol=1e-12)
    np.testing.assert_allclose(
        errors[120, 0], error_size("segment_mass", "floor") * head.share[0] * body.sip.mass[trunk]
    )
    heavy = replace(body, parts=(replace(head, share=1.3 * head.share),))
    fit = noisy_fit(heavy, smooth_motion(body, rng, frames=600, size=0.3), body.sip.phi, rng)
    noise = Noise.unit(np.zeros(3))
    total = statistics(body, (fit,), noise)
    noise = replace(noise, covariance=noise.covariance * np.outer([2.0] * 3 + [0.5] * 3, [2.0] * 3 + [0.5] * 3))
    found = mismatch(body, (fit,), noise)
    off = [
        find_posterior(temper(total.information(noise), some, Sizes(0.0, 1.7)), body.sip).mean[10 * trunk]
        - body.sip.mass[trunk]
        for some in (found, replace(found, plates=found.plates[:, :PLATE_SOURCES]))
    ]
    assert abs(off[0]) < 0.25 * abs(off[1]), off
    assert abs(off[1]) > 1.0, "a constant share makes the whole trunk as much heavier as its head"


def test_plates_have_the_sizes_of_the_table() -> None:
    plates = plate_sources()
    whole = np.sqrt((plates.mixing**2).sum(axis=0))
    assert whole[2, 2] == pytest.approx(error_size("plate_gain", "Fz"))
    place, talk = error_size("plate_position", "z"), error_size("plate_crosstalk", "Fy->Mx")
    assert whole[3, 1] == pytest.approx(np.hypot(place, talk))
    np.testing.assert_allclose(
        np.sqrt((plates.offset**2).sum(axis=0)), [around_zero(f"plate_offset {c}", "offset") for c in CHANNELS]
    )
    assert around_zero("plate_offset Fz", "offset") > error_size("plate_offset", "Fz"), (
        "what all plates show counts as well"
    )
    assert plates.delay.max() == pytest.approx(error_size("time_delay", "session"))
    faults = (plates.mixing != 0).any(axis=(1, 2)).astype(int) + (plates.offset != 0).any(axis=1) + (plates.delay != 0)
    np.testing.assert_array_equal(faults, 1)


def test_errors_have_the_sizes_of_the_table_or_of_the_calibrated_joint() -> None:
    body = human(Subject(70.0, 1.75, "M", 30.0))
    placed = replace(body, joint_errors=(JointError("right_knee", 0.003, 0.04), JointError("trunk", 0.013, 0.0)))
    sources = of_markers(body)
    names = [(group, joint) for source in sources for group, joint in zip(source.groups, source.joints, strict=True)]
    plain, now = (dict(zip(names, deviations(one, sources), strict=True)) for one in (body, placed))
    assert plain["joint_centre trunk", "trunk"] == error_size("joint_centre", "trunk", state="before") == 0.040
    assert plain["joint_centre hip", "left_hip"] == 0.012
    assert plain["tilt knee", "right_knee"] == plain["tilt knee", "left_knee"] == 0.07
    assert plain["slide thigh", ""] == error_size("slide", "marker")
    assert plain["flesh thigh", ""] == error_size("flesh", "thigh")
    changed = {pair: sd for pair, sd in now.items() if sd != plain[pair]}
    knee, hinge, trunk = (
        ("joint_centre knee", "right_knee"),
        ("tilt knee", "right_knee"),
        ("joint_centre trunk", "trunk"),
    )
    assert changed == {knee: 0.003, hinge: 0.04, trunk: 0.013}


def test_joints_of_other_bodies_have_the_size_of_others() -> None:
    body, _, _ = person(11)
    found = deviations(body, of_markers(body)[2:])
    assert set(np.round(found, 6)) <= {
        error_size("joint_centre", "other", state="before"),
        error_size("tilt", "other", state="before"),
    }
    assert {joint_of(body, chain) for chain in chains(body)} == {
        joint for source in of_markers(body)[2:] for joint in source.joints
    }

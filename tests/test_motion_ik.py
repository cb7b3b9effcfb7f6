"""Inverse kinematics: known postures come back, noisy ones end where scipy's least squares end, and nothing unseen
has a say.
"""

from dataclasses import replace

import numpy as np
import pytest
from marker_trials import apart, dance, markers_of, noisy_dance, points
from random_bodies import random_body
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.errors import BiodanceError, TrialRefused
from biodance.motion.ik.inverse_kinematics import FrameStatus, solve_ik
from biodance.records import Array, Markers, Subject

WOMAN = human(Subject(58.3, 1.64, "F", 31.0))


def trees() -> list:
    """The human, and random trees with limits so narrow that the random axes leave one solution between them."""
    found = [pytest.param(WOMAN, 0, id="human")]
    for seed in (1, 2, 3, 5, 8, 11, 21, 27):
        root = "free_flyer" if seed % 3 else "fixed"
        body = random_body(np.random.default_rng(seed), n_segments=5, root=root)
        narrow = replace(body.limits, lower=0.3 * body.limits.lower, upper=0.3 * body.limits.upper)
        found.append(pytest.param(replace(body, limits=narrow), seed, id=f"{root}{seed}"))
    return found


def scipy_residual(body: Body, xyz: Array, start: Array) -> tuple[float, Array]:
    """Return the optimal cost (m²) and the marker distances (K,) m that scipy reaches from ``start`` (nq,), limits
    as bounds.
    """
    turn, root_weight = Rotation.from_quat(start[3:7]), np.sqrt(body.markers.weight)[:, None]

    def posture(x: Array) -> Array:
        return np.concatenate([x[:3], (Rotation.from_rotvec(x[3:6]) * turn).as_quat(), x[6:]])

    def weighted(x: Array) -> Array:
        return (root_weight * (points(body, posture(x)[None])[0] - xyz)).ravel()

    free = np.full(6, np.inf)
    bounds = np.concatenate([-free, body.limits.lower]), np.concatenate([free, body.limits.upper])
    x = np.clip(np.concatenate([start[:3], np.zeros(3), start[7:]]), bounds[0] + 1e-3, bounds[1] - 1e-3)
    found = least_squares(weighted, x, bounds=bounds, jac="3-point", xtol=1e-14, ftol=1e-14, gtol=1e-12, max_nfev=300)
    return float(found.cost), np.linalg.norm(weighted(found.x).reshape(-1, 3) / root_weight, axis=1)


@pytest.mark.parametrize(("body", "seed"), trees())
def test_postures_come_back_from_their_markers(body, seed):
    q = dance(body, 120, np.random.default_rng(seed))
    found = solve_ik(body, markers_of(body, q), tolerance=1e-11)
    assert (found.status == FrameStatus.SOLVED).all()
    assert apart(found.q, q, body.n_root).max() < 1e-6
    assert found.residual.max() < 1e-7


def test_noisy_markers_end_at_the_optimum_of_scipy():
    q, markers = noisy_dance(WOMAN, 20, seed=4)
    found = solve_ik(WOMAN, markers)
    weight = WOMAN.markers.weight
    for frame in range(len(q)):
        cost, distance = scipy_residual(WOMAN, markers.xyz[frame], q[frame])
        assert 0.5 * weight @ found.residual[frame] ** 2 <= cost * (1 + 1e-9)
        np.testing.assert_allclose(found.residual[frame], distance, atol=1e-6)
    assert np.all(found.residual.mean(axis=1) > 0.002)  # the markers do not fit, so the second derivatives matter


def test_a_joint_beyond_its_limit_stays_at_it_and_the_rest_is_optimal():
    rng = np.random.default_rng(7)
    q = dance(WOMAN, 6, rng, reach=0.6)
    beyond = np.zeros((6, len(WOMAN.joints)), dtype=bool)
    hinges = [
        WOMAN.joint_index(f"{side}_{joint}")
        for side in ("left", "right")
        for joint in ("knee_flexion", "elbow_flexion", "ankle_inversion")
    ]
    for frame in range(6):
        beyond[frame, hinges[frame]] = True
    q[:, 7:] = np.where(beyond, WOMAN.limits.upper + 0.3, q[:, 7:])
    found = solve_ik(WOMAN, markers_of(WOMAN, q))
    angles = found.q[:, 7:]
    assert (angles >= WOMAN.limits.lower).all()
    assert (angles <= WOMAN.limits.upper).all()
    assert (np.broadcast_to(WOMAN.limits.upper, beyond.shape)[beyond] == angles[beyond]).all()
    for frame in range(6):
        near = found.q[frame] + np.concatenate([np.zeros(7), rng.uniform(-0.05, 0.05, len(WOMAN.joints))])
        cost, distance = scipy_residual(WOMAN, points(WOMAN, q)[frame], near)
        assert 0.5 * WOMAN.markers.weight @ found.residual[frame] ** 2 <= cost * (1 + 1e-6)
        np.testing.assert_allclose(found.residual[frame], distance, atol=2e-5)  # scipy stays inside its bounds


def test_a_hidden_marker_has_no_influence():
    _, markers = noisy_dance(WOMAN, 60, seed=5)
    xyz = markers.xyz.copy()
    gone = [markers.names.index(name) for name in ("LKNE", "RELB", "C7")]
    xyz[:, gone] = np.nan
    hidden = solve_ik(WOMAN, replace(markers, xyz=xyz), tolerance=1e-11)
    absent = solve_ik(
        WOMAN, markers.select(name for name in markers.names if name not in ("LKNE", "RELB", "C7")), tolerance=1e-11
    )
    np.testing.assert_allclose(hidden.q, absent.q, atol=1e-9)
    assert np.isnan(hidden.residual[:, gone]).all()
    assert np.isfinite(np.delete(hidden.residual, gone, axis=1)).all()
    assert np.abs(hidden.q - solve_ik(WOMAN, markers).q).max() > 1e-4  # they had influence when seen


def test_a_marker_hidden_for_some_frames_leaves_the_others_as_they_were():
    _, markers = noisy_dance(WOMAN, 60, seed=6)
    xyz = markers.xyz.copy()
    xyz[20:30, markers.names.index("LANK")] = np.nan
    all_seen, some = solve_ik(WOMAN, markers), solve_ik(WOMAN, replace(markers, xyz=xyz))
    rest = np.r_[:20, 30:60]
    assert apart(some.q[rest], all_seen.q[rest], 6).max() < 1e-4
    assert apart(some.q[20:30], all_seen.q[20:30], 6).max() > 1e-3
    assert (some.status == FrameStatus.SOLVED).all()


def test_the_order_and_the_choice_of_frames_do_not_matter():
    _, markers = noisy_dance(WOMAN, 150, seed=5)
    whole = solve_ik(WOMAN, markers).residual
    for part in (slice(None, None, -1), slice(40, 110), slice(None, None, 3)):
        some = Markers(markers.names, np.arange(len(whole[part])) / 100, markers.xyz[part])
        np.testing.assert_allclose(solve_ik(WOMAN, some).residual, whole[part], atol=1e-6)


def test_the_order_and_the_number_of_markers_do_not_matter():
    _, markers = noisy_dance(WOMAN, 30, seed=9)
    names = ("not on the body", *reversed(markers.names))
    xyz = np.concatenate([np.full((30, 1, 3), 7.0), markers.xyz[:, ::-1]], axis=1)
    one, other = solve_ik(WOMAN, markers), solve_ik(WOMAN, Markers(names, markers.time, xyz))
    assert other.marker_names == one.marker_names == WOMAN.markers.names
    np.testing.assert_allclose(other.q, one.q, atol=1e-9)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0.0, 0.8)])
def test_a_start_turned_by_half_a_turn_finds_the_posture(axis):
    q = dance(WOMAN, 10, np.random.default_rng(10), reach=0.5)
    markers = markers_of(WOMAN, q)
    start = q.copy()
    start[:, 3:7] = (Rotation.from_rotvec(np.pi * np.array(axis)) * Rotation.from_quat(q[:, 3:7])).as_quat()
    start[:, :3] += [2.0, -3.0, 1.0]
    assert np.linalg.norm(points(WOMAN, start) - markers.xyz, axis=2).mean() > 1.0
    found = solve_ik(WOMAN, markers, guess=start)
    assert (found.status == FrameStatus.SOLVED).all()
    assert found.residual.max() < 1e-6


def test_a_body_that_lies_or_stands_on_its_hands_is_found():
    rng = np.random.default_rng(11)
    q = dance(WOMAN, 40, rng)
    for turn in ([np.pi, 0, 0], [0, np.pi / 2, 0], [0, -np.pi / 2, 0], [0, 0, np.pi]):
        turned = q.copy()
        turned[:, 3:7] = (Rotation.from_rotvec(turn) * Rotation.from_quat(q[:, 3:7])).as_quat()
        assert solve_ik(WOMAN, markers_of(WOMAN, turned)).residual.max() < 1e-5


def test_a_frame_with_too_few_markers_leans_on_its_neighbours():
    q, markers = noisy_dance(WOMAN, 60, seed=12)
    xyz = markers.xyz.copy()
    legless = [markers.names.index(name) for name in ("LKNE", "LTIB", "LANK", "LHEE", "LTOE", "LTHI")]
    xyz[10:14, legless], xyz[30], xyz[59, 3:] = np.nan, np.nan, np.nan
    found = solve_ik(WOMAN, replace(markers, xyz=xyz))
    leaning = np.isin(np.arange(60), [10, 11, 12, 13, 30, 59])
    assert (found.status[leaning] == FrameStatus.LEANING).all()
    assert (found.status[~leaning] == FrameStatus.SOLVED).all()
    assert np.isfinite(found.q).all()
    assert (np.isnan(found.residual) == np.isnan(xyz).any(axis=2)).all()
    assert apart(found.q, q, 6)[[10, 11, 12, 13, 30]].max() < 0.5  # near the truth, which the neighbours tell
    assert np.linalg.norm(points(WOMAN, found.q) - points(WOMAN, q), axis=2)[10:14].max() < 0.05
    np.testing.assert_allclose(np.linalg.norm(found.q[:, 3:7], axis=1), 1.0, atol=1e-12)


def test_no_frame_with_enough_markers_names_what_is_missing():
    _, markers = noisy_dance(WOMAN, 5, seed=13)
    legs = tuple(
        name for name in markers.names if name[0] == "L" and name[1:] in ("KNE", "TIB", "ANK", "HEE", "TOE", "THI")
    )
    few = markers.select(name for name in markers.names if name not in legs)
    with pytest.raises(TrialRefused, match=r"at best 33 of its 39 .*left_knee_flexion.*LKNE"):
        solve_ik(WOMAN, few)


@pytest.mark.parametrize("guess", [np.zeros((5, 29)), np.zeros((4, 30)), np.full((5, 30), np.nan)])
def test_a_guess_that_does_not_fit_is_refused(guess):
    _, markers = noisy_dance(WOMAN, 5, seed=14)
    with pytest.raises(BiodanceError, match=r"guess has shape .* expected \(5, 30\), all finite"):
        solve_ik(WOMAN, markers, guess=guess)


def test_one_frame_is_enough():
    _, markers = noisy_dance(WOMAN, 8, seed=15)
    together = solve_ik(WOMAN, markers)
    for frame in range(8):
        alone = solve_ik(WOMAN, Markers(markers.names, [0.0], markers.xyz[frame : frame + 1]))
        np.testing.assert_allclose(alone.residual[0], together.residual[frame], atol=1e-6)

"""The parts of the diagnosis against brute force: evidence, limits, kinematic errors, rows, tolerances."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from diagnosed_sessions import body, known, windows

from biodance.body.parts import JointError
from biodance.diagnosis.candidates import Candidate, candidates, changes, local_basis, log_priors, removed, slopes
from biodance.diagnosis.consequence import NAMED
from biodance.diagnosis.learning import Null, learn_tolerances
from biodance.diagnosis.problem import problem
from biodance.effects import Effect, Parameter, effect
from biodance.inference.observability import (
    Visibility,
    after_calibration,
    detection_limits,
    placing_leaves,
    smallest_detectable,
    surely_reached,
    unit_directions,
    visibility,
)
from biodance.inference.rows import rows_of
from biodance.inference.scales import nominal
from biodance.inference.sets import Search, at_scales, hypothesis
from biodance.uncertainty.tolerances import Tolerances, key_of, read_tolerances, shipped, to_toml


def log_bayes_factor(s: np.ndarray, G: np.ndarray) -> float:
    """Return the evidence for coefficients of unit normal prior from their score and its information."""
    inner = np.eye(len(s)) + G
    return 0.5 * float(s @ np.linalg.solve(inner, s)) - 0.5 * float(np.linalg.slogdet(inner)[1])


@pytest.mark.parametrize("width", [1, 3])
def test_the_smallest_size_is_found_in_95_of_100_recordings(width: int) -> None:
    rng = np.random.default_rng(1)
    X, Z = rng.normal(size=(200, 8)), 0.3 * rng.normal(size=(200, width))
    # With u of X and the noise unit normal: y ~ N(size Z way, C).
    free = Z.T @ np.linalg.inv(np.eye(200) + X @ X.T)
    G = free @ Z
    way = np.ones(width)
    size = smallest_detectable(G, way, 6.0)
    assert surely_reached(G, size * G @ way) == pytest.approx(6.0)
    found = 0
    for _ in range(2000):
        y = X @ rng.normal(size=8) + rng.normal(size=200) + size * Z @ way
        found += log_bayes_factor(free @ y, G) > 6.0
    assert found / 2000 == pytest.approx(0.95, abs=0.03)
    assert smallest_detectable(np.zeros((1, 1)), np.ones(1), 6.0) == float("inf")


@pytest.fixture(scope="module")
def put():
    return problem(body(), windows(3, trials=2))


def searched(put, causes):
    """Return the search for ``causes`` without observations."""
    return Search.of(rows_of(put, causes, known(), None), causes)


def test_rows_are_white_under_the_noise_they_were_made_with(put) -> None:
    search = searched(put, candidates(put, ("plate_offset",)))
    left = at_scales(search, hypothesis(search, ()), nominal(search.rows)).left[: put.wrench_rows]
    assert np.mean(left**2) == pytest.approx(0.9, abs=0.15)


def test_what_comes_and_goes_bears_a_trial_of_which_too_little_is_measured() -> None:
    whole, other = windows(3, trials=2)
    short = problem(body(), (whole, replace(other, use=other.motion.time < 0.35)))
    columns = local_basis(short, replace(effect("external_contact"), target="left_forearm_hand"))
    assert columns.shape[0] == short.wrench_rows
    seen = columns.any(axis=0)
    assert seen[: len(seen) // 2].any()
    assert not seen[len(seen) // 2 :].any()


def test_differences_of_a_cause_agree_with_its_columns(put) -> None:
    late = effect("time_delay")
    columns = put.columns([late])[0]
    np.testing.assert_allclose(slopes(put, late, np.zeros(1)), columns, atol=0.02 * np.abs(columns).max())
    np.testing.assert_allclose(changes(put, late, np.zeros(1)), 0.0, atol=1e-9)
    assert not late.linear


def test_a_linear_cause_is_its_columns(put) -> None:
    gain = replace(effect("plate_gain"), target="Fz")
    assert gain.linear
    size = np.array([0.03])
    expected = put.spectrum.rows(tuple(gain.added(case, size)[:, :, None] for case in put.cases)).ravel()
    for rows in (changes(put, gain, size), removed(put, gain, size), slopes(put, gain, size) @ size):
        np.testing.assert_allclose(rows[: expected.size], expected, atol=1e-9 * np.abs(expected).max())


def test_a_load_is_spanned_by_mass_and_place(put) -> None:
    (one,) = [c for c in candidates(put, ("added_mass",)) if c.effect.target == "left_forearm_hand"]
    assert one.silent == (False, True, True, True)
    load = changes(put, one.effect, np.array([1.5, 0.03, -0.04, 0.02]))
    left = load - one.basis @ np.linalg.lstsq(one.basis, load, rcond=None)[0]
    assert np.linalg.norm(left) < 0.03 * np.linalg.norm(load)


def test_no_limit_lies_below_what_changes_the_wrench(put) -> None:
    causes = candidates(put, ("plate_gain",))
    search = searched(put, causes)
    seen = visibility(search, nominal(search.rows))
    limits = {row.target: row.limit for row in detection_limits(seen, put.cases[0].body)}
    for one in causes:
        size = np.array([limits[one.effect.target]])
        added = np.concatenate([one.effect.added(case, size) for case in put.cases])
        root = np.sqrt(np.mean(added**2, axis=0))
        assert max(root[:3].max() / 1.0, root[3:].max() / 0.3) > 0.99, one.names


def test_what_placing_has_repaired_needs_a_larger_fault_to_be_seen() -> None:
    rng = np.random.default_rng(4)
    kinds = (
        ("joint_centre", "right_shoulder", 3),
        ("joint_centre", "left_ankle", 3),
        ("marker_misplaced", "RSHO", 3),
        ("plate_offset", "Fz", 1),
    )
    Z = [rng.normal(size=(400, width)) for *_, width in kinds]
    Z[2] = 0.9 * Z[0] + 0.1 * Z[2]  # a marker beside the joint looks much like its centre
    causes = tuple(
        Candidate(replace(effect(name), target=target), z, (False,) * z.shape[1])
        for (name, target, _), z in zip(kinds, Z, strict=True)
    )
    cuts = (slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 10))
    whole = np.concatenate(Z, axis=1)
    seen = Visibility(causes, whole.T @ whole, cuts)
    error = JointError("right_shoulder", 0.0095, 0.0)
    share = placing_leaves(error)
    assert share == pytest.approx((0.0095**2 - 0.008**2) / 0.015**2)
    shoulder = replace(body(), joint_errors=(error,))
    after = after_calibration(seen, shoulder)
    np.testing.assert_allclose(np.diag(after.G)[cuts[0]] / np.diag(seen.G)[cuts[0]], share, rtol=0.1)
    plain, now = ({row.target: row.limit for row in detection_limits(seen, one)} for one in (body(), shoulder))
    assert now["right_shoulder"] > 2 * plain["right_shoulder"]
    assert now["RSHO"] > 1.5 * plain["RSHO"]
    assert now["left_ankle"] == pytest.approx(plain["left_ankle"], rel=0.05)
    assert now["Fz"] == plain["Fz"]


@dataclass(frozen=True)
class Saturating(Effect):
    """Adds a / (1 + a / most) newton to Fz."""

    name = "saturating"
    parameters = (Parameter("a", "N", 5.0, "a test"),)
    most = 40.0

    def transform(self, case, theta):
        a = float(theta[0])
        change = np.zeros((case.motion.time.size, 6))
        change[:, 2] = a / (1 + a / self.most) * np.sin(4 * case.motion.time)
        return case.with_added(case.trial.plates[0], change)


def test_the_limit_of_what_saturates_lies_where_it_is_seen(put) -> None:
    """A cause of size a acts like a / (1 + a / most) of one in proportion, and never like more than ``most``."""
    for most in (1e6, 4.0, 0.01):
        (cause,) = candidates(put, {"saturating": type("Saturating", (Saturating,), {"most": most})()})
        search = searched(put, (cause,))
        seen = visibility(search, nominal(search.rows))
        need = float(np.log(NAMED / (1 - NAMED))) - log_priors((cause,))[cause.names]
        straight = smallest_detectable(seen.G, unit_directions(cause)[0], need)
        true = straight / (1 - straight / most) if straight < most else np.inf
        assert seen.seen(0) == pytest.approx(true, rel=0.3)


def test_learning_finds_the_sizes_that_made_the_nulls() -> None:
    rng = np.random.default_rng(5)
    bands = len(shipped().noise)
    band = np.repeat(np.arange(bands), 12)
    truth = {"slide a": 0.5, "gain b": 2.0}
    nulls = []
    for _ in range(40):
        columns = rng.normal(size=(6 * band.size, 8))
        keys = ("slide a",) * 5 + ("gain b",) * 3
        theta = np.array([truth[key] for key in keys]) * rng.normal(size=8)
        nulls.append(
            Null(
                columns @ theta + 1.5 * rng.normal(size=len(columns)),
                columns,
                keys,
                band,
                (),
                70.0,
                np.ones((bands, 6)),
            )
        )
    start = Tolerances(
        {"slide a": 1.0, "gain b": 1.0},
        np.tile(np.eye(6), (bands, 1, 1)),
        np.ones((bands, 6)),
    )
    found = learn_tolerances(nulls, start, rounds=8)
    assert found.size("slide a") == pytest.approx(0.5, rel=0.15)
    assert found.size("gain b") == pytest.approx(2.0, rel=0.15)
    np.testing.assert_allclose(np.sqrt(np.trace(found.noise, axis1=1, axis2=2) / 6), 1.5, rtol=0.1)


def test_tolerances_survive_their_file() -> None:
    first = shipped()
    again = read_tolerances(to_toml(first))
    assert again.sizes == pytest.approx(dict(first.sizes))
    np.testing.assert_allclose(again.noise, first.noise, rtol=1e-3)
    for matrix, covariance in zip(first.whiteners(70.0), first.noise, strict=True):
        np.testing.assert_allclose(matrix @ covariance @ matrix.T, np.eye(6), atol=1e-6)


def test_plates_and_sides_share_their_tolerances() -> None:
    assert key_of("plate_gain", "plate2:Fz") == key_of("plate_gain", "Fz") == "plate_gain Fz"
    assert key_of("joint_centre", "left_hip") == key_of("joint_centre", "right_hip") == "joint_centre hip"
    assert key_of("marker_misplaced", "LASI") == "marker_misplaced ASI"
    assert key_of("marker_misplaced", "C7") == "marker_misplaced C7"
    assert key_of("time_delay", "") == "time_delay"

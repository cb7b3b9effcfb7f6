"""One contract for every file in effects/: identity at zero, columns equal to differences, units, sources, signature
and look-alikes.
"""

import subprocess
import sys
from dataclasses import astuple

import numpy as np
import pytest
from effect_cases import CASES

from biodance.effects import Case, Effect, effect, effects, wrench_about_origin, wrench_about_point
from biodance.errors import UnknownName
from biodance.motion.kinematics import poses
from biodance.records import Motion

ALL = [(name, plates) for name in sorted(effects()) for plates in CASES]


@pytest.mark.parametrize(("name", "plates"), ALL)
def test_zero_changes_nothing(name: str, plates: int | str) -> None:
    case = CASES[plates]
    for target in effect(name).targets(case):
        found = effect(name).at(target, case)
        still = found.transform(case, np.zeros(len(found.parameters)))
        np.testing.assert_allclose(still.residual, case.residual, atol=1e-9)


@pytest.mark.parametrize(("name", "plates"), ALL)
def test_columns_are_the_differences_of_transform(name: str, plates: int | str) -> None:
    case = CASES[plates]
    for target in effect(name).targets(case)[:12]:
        found = effect(name).at(target, case)
        columns = found.columns(case)
        assert columns.shape == (120, 6, len(found.parameters))
        rows = found.marker_columns(case)
        assert rows is None or rows.shape == (len(case.marker_columns), 3, len(found.parameters))
        for k, size in enumerate(found.typical):
            step = 1e-3 * size * np.eye(len(found.parameters))[k]
            slope = (found.transform(case, step).residual - found.transform(case, -step).residual) / (2e-3 * size)
            scale = np.abs(columns).max()
            np.testing.assert_allclose(columns[:, :, k], slope, atol=2e-4 * max(scale, 1e-9))


@pytest.mark.parametrize("name", sorted(effects()))
def test_every_effect_says_what_it_is(name: str) -> None:
    kind = effect(name)
    assert kind.name == name
    assert isinstance(kind, Effect)
    assert kind.parameters
    for words in (kind.separated_by, kind.advice):
        assert words.endswith(".")
        assert len(words) > 20
    for parameter in kind.parameters:
        assert parameter.unit
        assert parameter.typical > 0
        assert len(parameter.source) > 10
    assert all(sentence.endswith(".") for sentence in astuple(kind.about)), name
    assert kind.words is not None
    for parameter in kind.parameters:
        for target in kind.targets(CASES[1]):
            assert min(parameter.least_at(target), parameter.usual_at(target), parameter.alike) >= 0, target


@pytest.mark.parametrize("name", sorted(effects()))
def test_typical_size_is_seen_in_the_residual(name: str) -> None:
    case = CASES[1] if effect(name).targets(CASES[1]) else CASES["human"]
    found = effect(name).at(effect(name).targets(case)[-1], case)
    change = found.transform(case, found.typical).residual - case.residual
    assert np.abs(change).max() > 1e-3


def test_what_a_cause_is_needs_no_docstrings() -> None:
    """Under ``python -OO`` the page once lost what a cause is, its signature and its look-alikes."""
    told = "from biodance.effects import causes; print(all(one.about.signature for one in causes().values()))"
    out = subprocess.run([sys.executable, "-OO", "-c", told], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "True"


def test_shifted_plate_moves_the_centre_of_pressure() -> None:
    case = CASES[1]
    moved = effect("plate_position").at("plate1:x", case).transform(case, np.array([0.02]))
    shift = (moved.trial.wrench.cop() - case.trial.wrench.cop())[:, 0]
    np.testing.assert_allclose(np.nanmedian(shift), 0.02, atol=1e-3)


def test_late_forces_are_late() -> None:
    case = CASES[1]
    late = effect("time_delay").at("", case).transform(case, np.array([0.05]))
    added = late.residual - case.residual + case.predicted
    np.testing.assert_allclose(added[5:], case.predicted[:-5], atol=1e-8 * np.abs(case.predicted).max())


def test_added_mass_weighs_what_it_says() -> None:
    case = CASES[1]
    loaded = effect("added_mass").at("s2", case).transform(case, np.array([2.4, 0, 0, 0]))
    still = Motion(case.motion.time, case.motion.q, 0 * case.motion.v, 0 * case.motion.a)
    standing = Case(case.body, case.trial, still, case.phi, case.session_time)
    change = (
        effect("added_mass").at("s2", standing).transform(standing, np.array([2.4, 0, 0, 0])).residual
        - standing.residual
    )
    np.testing.assert_allclose(change[:, 2], 2.4 * 9.80665, rtol=1e-9)
    assert np.abs((loaded.residual - case.residual)[:, 2]).max() > 2.4 * 9.8


def test_a_load_pulls_at_its_place_from_the_centre_of_mass() -> None:
    case, index = CASES[1], CASES[1].body.segment_index("s2")
    place = np.array([0.03, -0.05, 0.02])
    phi = case.phi[10 * index : 10 * index + 10]
    still = Motion(case.motion.time, case.motion.q, 0 * case.motion.v, 0 * case.motion.a)
    standing = Case(case.body, case.trial, still, case.phi, case.session_time)
    change = (
        effect("added_mass").at("s2", standing).transform(standing, np.array([2.4, *place])).residual
        - standing.residual
    )
    lever = poses(case.body, case.motion.q).points([index], (phi[1:4] / phi[0] + place)[None])[:, 0]
    assert np.linalg.norm(phi[1:4] / phi[0]) > 0.02, (
        "the centre of mass must not lie at the joint, or this test sees nothing"
    )
    weight = np.array([0, 0, 2.4 * 9.80665])
    np.testing.assert_allclose(change[:, 3:], np.cross(lever, weight), atol=1e-9)


def test_wrong_target_lists_the_legal_ones() -> None:
    with pytest.raises(UnknownName, match="plate1:z"):
        effect("plate_position").at("plate9:x", CASES[1])
    with pytest.raises(UnknownName, match=r"'plate_gian' is not an effect\. Did you mean 'plate_gain'"):
        effect("plate_gian")


def test_moving_a_wrench_there_and_back_is_nothing() -> None:
    value, point = CASES[1].predicted, np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(wrench_about_origin(wrench_about_point(value, point), point), value, atol=1e-9)

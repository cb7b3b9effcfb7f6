"""Added mass on bodies whose load is known: which segment, how heavy, where, how sure, and silence without a load."""

from dataclasses import replace

import numpy as np
import pytest
from identify_trials import noisy_fit, person, smooth_motion

from biodance.identification.added_mass import (
    MASSES,
    LoadCandidate,
    LoadPosterior,
    LoadSearch,
    added_mass,
    whiten_innovation,
)
from biodance.identification.identification import Identification, identify_body
from biodance.identification.loads import compact_load, load_moments, unknown_loads, with_room
from biodance.identification.statistics import learn_noise, standing_point, statistics
from biodance.records import Sip
from biodance.spatial import point_mass
from biodance.uncertainty.bands import Noise

PLACE = np.array([0.15, -0.2, 0.2])


def visits(
    seed: int, *, segment: int | None = None, mass: float = 2.0, frames: int = 1200
) -> tuple[Identification, Identification]:
    """Return a session without and one with a load on a segment (None: both without)."""
    body, truth, rng = person(seed)
    body = replace(body, boxes=np.tile([[-0.3] * 3, [0.3] * 3], (4, 1, 1)))
    loaded = truth.copy()
    if segment is not None:
        loaded[10 * segment : 10 * segment + 10] += mass * compact_load(PLACE)
    first, second = (
        identify_body(body, (noisy_fit(body, smooth_motion(body, rng, frames=frames), phi, rng),))
        for phi in (truth, loaded)
    )
    return first, second


@pytest.mark.parametrize("segment", [1, 2, 3])
def test_a_load_is_found_where_it_is(segment: int) -> None:
    before, after = visits(segment, segment=segment)
    found = added_mass(after, reference=before)
    assert found.found
    assert found.best.segment == f"s{segment}"
    assert found.best.interval[0] < 2.0 < found.best.interval[1]
    assert found.best.mass == pytest.approx(2.0, abs=0.3)
    assert np.all(np.abs(found.best.place - PLACE) < 4 * found.best.place_sd + 0.02)
    assert sum(s.probability for s in found.suspects) + found.p_no_load == pytest.approx(1.0)
    assert found.set[0] == found.best.segment


def test_without_a_load_nothing_is_announced() -> None:
    for seed in range(4):
        before, after = visits(10 + seed)
        found = added_mass(after, reference=before)
        assert not found.found
        assert found.p_no_load > 0.5
        assert added_mass(after).reference == "the table"


def test_surprise_has_unit_variance_when_nothing_was_added() -> None:
    values = []
    for seed in range(6):
        _, after = visits(30 + seed, frames=600)
        values.append(whiten_innovation(after.data, after.posterior.prior)[1][:20])
    assert np.sqrt(np.mean(np.square(values))) < 1.3


def test_point_mass_and_its_moments() -> None:
    np.testing.assert_allclose(point_mass(1.0, np.array([0.0, 2.0, 0.0])), [1, 0, 2, 0, 4, 0, 0, 0, 0, 4])
    U = load_moments(person(0)[0], 1)
    assert U.shape[0] == 10
    assert np.sqrt((U @ U.T)[0, 0]) == pytest.approx(2.0)


def test_an_undeclared_load_is_not_learned_as_noise() -> None:
    body, truth, rng = person(40)
    total = np.tile(np.eye(10)[0], 4)
    cov = np.array(body.sip.covariance)
    gain = cov @ total
    body = replace(body, sip=Sip(body.segments, body.sip.phi, cov - np.outer(gain, gain) / (total @ gain + 0.01**2)))
    motion, slow = smooth_motion(body, rng, frames=1200), []
    for mass in (0.0, 3.0):
        loaded = truth.copy()
        loaded[10:20] += mass * compact_load(PLACE)
        fit = noisy_fit(body, motion, loaded, np.random.default_rng(1))
        data = statistics(body, (fit,), Noise.unit(standing_point((fit,))))
        slow.append(
            [
                learn_noise(data, prior).covariance[0][2, 2]
                for prior in (with_room(body.sip, unknown_loads(body)), body.sip)
            ]
        )
    assert slow[1][0] < 3 * slow[0][0]
    assert slow[1][1] > 3 * slow[1][0]


def test_without_any_data_a_load_is_as_likely_as_none() -> None:
    """Four segments are four ways to be wrong: together they have the half that they had before the data."""
    _, after = visits(50, frames=300)
    blank = replace(after.data, R=np.zeros_like(after.data.R))
    found = added_mass(replace(after, data=blank))
    assert found.p_no_load == pytest.approx(0.5)
    assert [suspect.probability for suspect in found.suspects] == pytest.approx([0.125] * 4)
    assert not found.found


@pytest.mark.parametrize(
    ("p_no_load", "smallest", "doubts", "status"),
    [
        (0.009, 0.5, (), "found"),
        (0.011, 0.5, (), "cannot tell"),
        (0.0, 3.0, (), "cannot tell"),
        (0.0, 0.5, ("No scale.",), "cannot tell"),
        (0.51, 0.5, (), "none"),
    ],
)
def test_a_load_is_announced_below_one_per_cent_where_the_session_can_see_it(
    p_no_load: float, smallest: float, doubts: tuple[str, ...], status: str
) -> None:
    nowhere, weight = np.full(3, np.nan), np.where(np.arange(MASSES.size) == np.argmin(np.abs(MASSES - 2.0)), 1.0, 0.0)
    posterior = LoadPosterior(p_no_load, (1 - p_no_load) * weight)
    suspect = LoadCandidate("s1", posterior, nowhere, nowhere, 5.0, 1 - p_no_load, smallest)
    assert LoadSearch((suspect,), p_no_load, "the table", doubts).status == status

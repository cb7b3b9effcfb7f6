"""Static postures: exchanged among all found, more exciting than any one search, the same for the same seed, refused
by name.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.dance.limits import family
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.excitation import condition, excitation_blocks, extremes, smooth_condition
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.nlp import no_objective
from biodance.dance.problem.person import PersonLimits, limit_body
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import holding, seat, stance
from biodance.dance.search import postures
from biodance.dance.search.postures import (
    KEPT,
    Posture,
    exchange,
    image_feet,
    initial_guess,
    mirror_posture,
    mirror_vectors,
    posture_at,
    solve,
    symmetric,
)
from biodance.errors import BiodanceError
from biodance.records import Subject

BODY = human(Subject(65.0, 1.75, "F", 33.0))
CHAIN = Chain(BODY)
BLOCKS = excitation_blocks(BODY)
FEET = stance(BODY, "parallel")


@pytest.mark.parametrize("sharpness", [2, 8, 64])
def test_the_smooth_condition_number_and_its_slope(sharpness):
    rng = np.random.default_rng(sharpness)
    root, towards = rng.normal(size=(6, 3)), rng.normal(size=(3, 3))
    gram, towards = root.T @ root, towards + towards.T
    value, slope = smooth_condition(gram, sharpness=sharpness)
    up, down = (smooth_condition(gram + sign * 1e-6 * towards, sharpness=sharpness)[0] for sign in (1, -1))
    assert np.sum(slope * towards) == pytest.approx((up - down) / 2e-6, rel=1e-5)
    assert 1 < value <= condition(gram)[0]
    assert smooth_condition(np.eye(3), sharpness=sharpness)[0] == pytest.approx(1.0)
    assert smooth_condition(gram, sharpness=4096)[0] == pytest.approx(condition(gram)[0], rel=2e-3)


def test_postures_are_exchanged_until_none_of_all_found_helps():
    rng = np.random.default_rng(0)
    up = rng.normal(size=(40, 12, 3))
    found = [Posture(np.full(1, k), u / np.linalg.norm(u, axis=1, keepdims=True)) for k, u in enumerate(up)]
    pool = [found[k::4] for k in range(4)]
    chosen = exchange(BLOCKS, (FEET,) * 4, pool)
    best = criterion(chosen)
    assert best < criterion([search[0] for search in pool])
    for k in range(4):
        for other in found:
            if other not in chosen:
                assert criterion([*chosen[:k], other, *chosen[k + 1 :]]) >= best - 1e-9


def test_no_posture_is_taken_twice():
    up = np.random.default_rng(2).normal(size=(12, 12, 3))
    up /= np.linalg.norm(up, axis=2, keepdims=True)
    found = [
        Posture(np.full(1, (k // 3) + 0.01 * (k % 3)), u) for k, u in enumerate(up)
    ]  # four postures, each three times
    chosen = exchange(BLOCKS, (FEET,) * 4, [found[:3], found[:6], found[3:9], found])
    assert sorted(int(p.x[0]) for p in chosen) == [0, 1, 2, 3]


def test_feet_keep_their_own_postures_when_exchanged():
    rng = np.random.default_rng(1)
    here, there = FEET.on(0), FEET.on(1)
    up = rng.normal(size=(4, 5, 12, 3))
    up /= np.linalg.norm(up, axis=3, keepdims=True)
    pool = [[Posture(np.full(1, side), one) for one in up[k]] for k, side in enumerate((0, 1, 0, 1))]
    chosen = exchange(BLOCKS, (here, there, here, there), pool)
    assert [p.x[0] for p in chosen] == [0, 1, 0, 1]


def criterion(postures):
    up = np.array([p.up for p in postures])
    gram = len(up) * np.eye(3) - np.einsum("pni,pnj->nij", up, up)
    pairs = zip(BLOCKS.weight, BLOCKS.first, gram, strict=True)
    return sum(w * np.linalg.cond(g[np.ix_(pick, pick)]) ** 0.5 for w, pick, g in pairs)


def test_a_search_lowers_the_criterion_and_the_same_seed_gives_the_same_postures(monkeypatch):
    for name, sweeps in (("SWEEPS", ((4, 8),)), ("FRESH", ((8, 8),)), ("POLISH", ((8, 4),))):
        monkeypatch.setattr(postures, name, sweeps)
    stances = (FEET, FEET.on(0), FEET.on(1))
    with ThreadPoolExecutor(1) as workers:
        found = postures.find_postures(CHAIN, BLOCKS, stances, family(), seed=3, workers=workers)
        twice = postures.find_postures(CHAIN, BLOCKS, stances, family(), seed=3, workers=workers)
    np.testing.assert_array_equal(found, twice)
    rng = np.random.default_rng(0)
    anywhere = [posture_at(CHAIN, s, initial_guess(CHAIN, s, rng)) for s in stances]
    bound = BODY.sip.mass.sum()
    assert bound < criterion([posture_at(CHAIN, *one) for one in zip(stances, found, strict=True)])
    assert criterion([posture_at(CHAIN, *one) for one in zip(stances, found, strict=True)]) < 0.7 * criterion(anywhere)


def test_a_seated_person_keeps_the_pelvis_still_and_the_knees_up():
    stool = seat(BODY)
    found = solve(
        CHAIN, stool, initial_guess(CHAIN, stool, np.random.default_rng(0)), no_objective, family(), iterations=30
    )
    assert found.violation <= KEPT
    np.testing.assert_allclose(found.x[:6], [0, 0, stool.seat, 0, 0, 0], atol=1e-12)


def test_a_person_too_weak_to_stand_is_refused_by_the_name_of_the_limit(monkeypatch):
    monkeypatch.setattr(postures, "ATTEMPTS", 2)
    limits = BODY.limits
    weak = replace(
        BODY, limits=replace(limits, torque_lower=0.02 * limits.torque_lower, torque_upper=0.02 * limits.torque_upper)
    )
    with ThreadPoolExecutor(1) as workers, pytest.raises(BiodanceError, match="joint torque"):
        postures.find_postures(Chain(weak), BLOCKS, (FEET,), family(), seed=0, workers=workers)


def test_extreme_eigenvalues_in_closed_form():
    rng = np.random.default_rng(3)
    x = rng.normal(size=(200, 20, 3))
    x[0, :, 2] = x[0, :, 0]  # singular
    some = np.concatenate([np.einsum("kpi,kpj->kij", x, x), np.eye(3)[None], np.diag([1.0, 1.0, 5.0])[None]])
    values = np.linalg.eigvalsh(some)
    least, most = extremes(some)
    np.testing.assert_allclose(least, values[:, 0], atol=1e-6)
    np.testing.assert_allclose(most, values[:, -1], rtol=1e-9)


# ---- Mirror images of postures

STANCES = ("parallel", "right_forward", "single_right", "single_left")
ALL_FEET = tuple(s for s in support_sequence(BODY, Plan("all", tuple((name, 1) for name in STANCES))) if s.over is None)


@pytest.mark.parametrize("place", [0, 2, 3])
def test_an_image_keeps_every_limit_as_well_as_its_posture(place):
    here, there = ALL_FEET[place], ALL_FEET[image_feet(ALL_FEET[place], ALL_FEET)]
    posture = solve(
        CHAIN, here, initial_guess(CHAIN, here, np.random.default_rng(place)), no_objective, family(), iterations=8
    )
    image = solve(CHAIN, there, mirror_posture(CHAIN, posture.x, here, there), no_objective, family(), iterations=0)
    assert image.violation == pytest.approx(posture.violation, abs=1e-9)
    np.testing.assert_allclose(image.up, mirror_vectors(BODY, posture.up), atol=1e-12)
    assert np.abs(image.x[ROOT:] - posture.x[ROOT:]).max() > 0.1
    np.testing.assert_allclose(mirror_posture(CHAIN, image.x, there, here), posture.x, atol=1e-12)


def test_images_stand_on_their_own_feet():
    assert [image_feet(feet, ALL_FEET) for feet in ALL_FEET] == [0, None, 3, 2]
    assert image_feet(ALL_FEET[2], ALL_FEET[:3]) is None
    held = tuple(holding(feet, BODY, ("right",)) for feet in ALL_FEET)
    assert image_feet(held[0], held) is None


@pytest.mark.parametrize(
    "person",
    [PersonLimits(strengths=(("left_knee", 0.5),)), PersonLimits(range_shares=(("left_shoulder", 0.5),))],
    ids=["strength", "range"],
)
def test_whoever_differs_from_side_to_side_has_no_images(person):
    assert symmetric(BODY)
    assert not symmetric(replace(BODY, limits=limit_body(BODY, person)))

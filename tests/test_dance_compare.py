"""Comparing criteria: each wins on its own score, and data never make anything less known."""

import numpy as np

from biodance.body.planar import planar_chain
from biodance.dance.compare import compare_criteria
from biodance.dance.criteria import criteria
from biodance.dance.planar import MOVABLE, VIA, planar_problem


def test_each_criterion_wins_on_its_own_score() -> None:
    body = planar_chain()
    start = np.random.default_rng(0).uniform(body.limits.lower, body.limits.upper, (VIA + 2, 3))
    found = compare_criteria(lambda name: planar_problem(body, name), (start,), movable=MOVABLE)
    assert found.names == tuple(criteria())
    lost = dict(zip(found.names, np.diag(found.lost), strict=True))
    for name, value in lost.items():
        least = 1.0 if name in ("condition", "mass_weighted") else 0.0
        assert value <= least + 0.02, (name, value)
    assert np.all(found.sd_after <= found.sd_before * (1 + 1e-9))
    assert len(found.table().splitlines()) == len(found.names) + 1

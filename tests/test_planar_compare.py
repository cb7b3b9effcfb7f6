"""Comparing criteria: each wins on its own score, and data never make anything less known."""

import numpy as np
from criteria import CRITERIA
from planar_chain import planar_chain
from series import compared


def test_each_criterion_wins_on_its_own_score() -> None:
    found = compared(planar_chain())
    assert found.names == tuple(CRITERIA)
    lost = dict(zip(found.names, np.diag(found.lost), strict=True))
    for name, value in lost.items():
        least = 1.0 if name in ("condition", "mass_weighted") else 0.0
        assert value <= least + 0.02, (name, value)
    assert np.all(found.sd_after <= found.sd_before * (1 + 1e-9))
    assert len(found.table().splitlines()) == len(found.names) + 1

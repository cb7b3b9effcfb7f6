"""Comparing criteria: each wins on its own score, and data never make anything less known."""

import json

import numpy as np
import pytest

from biodance.body.planar import planar_chain
from biodance.cli import run
from biodance.dance.criteria import criteria
from biodance.dance.planar import compared


def test_each_criterion_wins_on_its_own_score() -> None:
    found = compared(planar_chain())
    assert found.names == tuple(criteria())
    lost = dict(zip(found.names, np.diag(found.lost), strict=True))
    for name, value in lost.items():
        least = 1.0 if name in ("condition", "mass_weighted") else 0.0
        assert value <= least + 0.02, (name, value)
    assert np.all(found.sd_after <= found.sd_before * (1 + 1e-9))
    assert len(found.table().splitlines()) == len(found.names) + 1


def test_the_command_prints_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["criteria", "--ranges", "equal", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found["score"]) == set(criteria())
    assert run(["criteria", "--ranges", "narrow"]) == 2
    assert "frontal" in capsys.readouterr().err

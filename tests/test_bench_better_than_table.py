"""How many sessions are better than the table, and how many would be by chance (benchmarks/people.py)."""

import numpy as np
import pytest

from benchmarks.people import better, better_than_table, expected_better
from biodance.identification.posterior import Information, find_posterior
from biodance.records import Sip
from biodance.spatial import point_mass

PLACE = np.array([[0.02, -0.2, 0.01], [0.0, 0.1, -0.03]])


def table_of(sd: float) -> Sip:
    """Return a table of two segments of 5 and 8 kg, whose parameters are unsure by ``sd`` of a share each."""
    phi = np.concatenate([kg * point_mass(1.0, place, radius=0.1) for kg, place in zip((5.0, 8.0), PLACE, strict=True)])
    root = np.diag(np.abs(phi) + 0.02) @ np.random.default_rng(3).normal(size=(20, 20)) * sd
    return Sip(("one", "two"), phi, root @ root.T)


def off(phi: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return the errors (2,) of mass and of CoM, to first order, about the table of the test."""
    mass, moment = (x.reshape(2, 10) for x in (phi - true, phi - true))
    own = np.array([5.0, 8.0])
    com = (moment[:, 1:4] - mass[:, :1] * PLACE) / own[:, None]
    return np.array([np.linalg.norm(mass[:, 0]), np.linalg.norm(com)])


@pytest.mark.parametrize("noise", [0.5, 3.0])
def test_chance_is_the_share_of_people_drawn_from_the_table_whom_data_bring_nearer(noise):
    table, rng = table_of(0.1), np.random.default_rng(1)
    rows, root = rng.normal(size=(12, 20)) / noise, np.linalg.cholesky(table.covariance)
    nearer = []
    for _ in range(3000):
        true = table.phi + root @ rng.normal(size=20)
        R = np.zeros((21, 21))
        R[:12, :20], R[:12, 20] = rows, rows @ true + rng.normal(size=12)
        found = find_posterior(Information(R, 12), table)
        nearer.append(off(found.mean, true) < off(table.phi, true))
    share = np.append(np.mean(nearer, axis=0), np.mean(np.all(nearer, axis=1)))
    assert expected_better(found) == pytest.approx(share, abs=0.03)
    assert 0.5 < share[2] < 0.99


def row(identified: float, com: float, **more) -> dict:
    """Return a row whose masses and CoM are off by so much, the table's by 1 kg and 0.01 m."""
    true = {"mass": np.full(2, 4.0), "com": PLACE}
    words = {"identified": (identified, com), "table": (1.0, 0.01)}
    return {"true": true} | {k: {"mass": true["mass"] + a, "com": PLACE + b} for k, (a, b) in words.items()} | more


def test_a_session_is_better_by_all_its_segments_together():
    assert better(row(-0.5, 0.02)).tolist() == [True, False, False]
    assert better(row(0.5, -0.005)).tolist() == [True, True, True]
    assert better_than_table([row(0.5, 0.0, chance=[0.8, 0.9, 0.75])]) == "1, 1, 1 of 1 (expected 80, 90, 75 %)"

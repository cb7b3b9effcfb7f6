"""What the benchmark of a dance's worth tells: shares of what the free dance removes, and how sure they are."""

from typing import Any

import numpy as np

from benchmarks.chain import lines, shares, shares_by_chance, squares, stated


def _row(mass: float, com: float) -> dict[str, Any]:
    """Return a session of two segments off by ``mass`` kg and ``com`` m along y; the table by 1 kg and 20 mm."""
    along = np.array([0.0, 1.0, 0.0])
    zero = {"mass": np.zeros(2), "com": np.zeros((2, 3)), "own_com": np.zeros((2, 3))}
    return {
        "true": zero,
        "table": {"mass": np.ones(2), "com": np.tile(0.02 * along, (2, 1))},
        "identified": {"mass": np.full(2, mass), "com": np.tile(com * along, (2, 1))},
        "sd": np.tile([0.5, 0.003, 0.003, 0.003], (2, 1)),
        "chance": [0.8, 0.9, 0.75],
    }


def _session(mass: float, com: float) -> dict[str, dict[str, Any]]:
    return {"followable": _row(mass, com), "free": _row(0.5, 0.010)}


def test_share_of_people_who_are_alike_is_certain() -> None:
    """0.4 of 0.5 kg and 6 of 10 mm, however people are drawn."""
    found = squares([_session(0.6, 0.014)] * 3)
    assert np.allclose(shares(found, "followable", np.arange(3)), [0.8, 0.6])
    assert np.allclose(shares_by_chance(found, "followable"), [[0.8, 0.6]] * 2)


def test_interval_holds_what_people_who_differ_give() -> None:
    found = squares([_session(0.6, 0.014), _session(0.9, 0.018), _session(0.5, 0.010)])
    low, high = shares_by_chance(found, "followable")
    middle = shares(found, "followable", np.arange(3))
    assert np.allclose(low, [0.2, 0.2], atol=0.05)
    assert np.allclose(high, 1.0, atol=0.05)
    assert np.all((low < middle) & (middle < high))


def test_table_of_a_laboratory_tells_share_interval_and_stated_deviations() -> None:
    sessions = [_session(0.6, 0.014)] * 2
    assert np.allclose(stated(sessions, "free"), [0.5, 3 * np.sqrt(3.0)])
    text = "\n".join(lines("own", sessions))
    assert "| own, 2 | table | 1.000 |" in text
    assert "| 0.600 | 0.500 | 0.400 | 80 % (80 to 80) | 14.0 | 5.2 | 6.0 | 60 % (60 to 60) |" in text

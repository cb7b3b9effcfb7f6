"""What the gates took out of a trial is counted by its reason and stands beside what was judged."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hidden_faults import SUBJECT, examined

from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.results import SessionResult
from biodance.records import LeftOut
from biodance.records.attention import Judged, seconds_left_out
from biodance.report.tables.diagnosis import JUDGED_ROW
from biodance.virtual_lab.causes import parse_cause
from biodance.virtual_lab.movement import read_protocol
from biodance.virtual_lab.simulate import simulate_session


def test_a_frame_counts_once_at_the_first_gate() -> None:
    beside, unlike = np.zeros(100, dtype=bool), np.zeros(100, dtype=bool)
    beside[:40], unlike[30:60] = True, True
    found = seconds_left_out({LeftOut.FORCES_DIFFER: unlike, LeftOut.FOOT_BESIDE: beside}, 100.0)
    assert found == {LeftOut.FOOT_BESIDE: 0.4, LeftOut.FORCES_DIFFER: 0.2}
    assert seconds_left_out({LeftOut.NO_LOAD: np.zeros(100, dtype=bool)}, 100.0) == {}
    (row,) = JUDGED_ROW.rows([Judged("walk", 0.4, left_out=found)])
    assert row == {
        "trial": "walk",
        "seconds": 0.4,
        "left_out_s": pytest.approx(0.6),
        "why_not": None,
        "missed": False,
        "left_out": {"foot_beside": 0.4, "forces_differ": 0.2},
    }


def test_squats_whose_forces_come_late_are_not_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Forces that are 0.2 s late are taken out by the gate of forces: these seconds are not judged, and it is said."""
    plan = read_protocol("squat")
    late = (parse_cause("time_delay:delay=0.2"),)
    folder = simulate_session(SUBJECT, plan, tmp_path / "late", seed=3, hidden=late)
    result = examined(folder, monkeypatch)
    rows = {row.trial: row for row in diagnose_session(result, effects=("time_delay",)).diagnosis.judged}
    squats = [one for one in result.trials if one.name.startswith("squat")]
    assert squats
    for one in squats:
        row, long = rows[one.name], one.motion.time.size / one.motion.rate
        assert row.left_out[LeftOut.FORCES_DIFFER] > 0.5 * long
        assert one.compared_s + row.left_out_s == pytest.approx(long, abs=0.015)
    slow = rows["slow_squat"]
    assert 0.0 < slow.seconds == result["slow_squat"].compared_s


def test_every_second_of_a_real_walk_is_judged_or_left_out_for_a_reason(
    recording: Callable[[str], SessionResult],
) -> None:
    result = recording("biomechzoo/HC050A")
    for one in result.trials:
        left = sum(one.left_out.values())
        assert one.compared_s + left == pytest.approx(one.motion.time.size / one.motion.rate, abs=0.015)
    walk = result["HC050A11"].left_out
    assert walk[LeftOut.FOOT_BESIDE] > 0.3
    assert walk[LeftOut.NO_LOAD] > 0.5

"""results.json: the keys and units that others rely on, and no number that is not one."""

import json

import numpy as np
import pytest
from example_results import full_session, refused_session

from biodance.pipeline.provenance import provenance
from biodance.report.tables.schema import plain_values, to_text
from biodance.report.tables.session import results_document


def read_back(result):
    return json.loads(to_text(results_document(result, provenance(result, created="2026-01-01T00:00:00Z"))))


def test_a_trial_has_the_keys_that_others_rely_on():
    result = full_session()
    trial = read_back(result)["trials"][0]
    assert (trial["name"], trial["role"], trial["status"], trial["reason"]) == (
        "walk <1>",
        "fit",
        "warning",
        "Gaps: 3.1 %, should be at most 2 %.",
    )
    assert (trial["marker_rms_m"], trial["marker_max_m"]) == (0.011, 0.044)
    assert trial["wrench"]["identified"] is None
    np.testing.assert_array_equal(trial["wrench"]["table"]["rms"], result.trials[0].comparison.rms)
    np.testing.assert_array_equal(trial["wrench"]["table"]["cc"], result.trials[0].comparison.correlation)
    assert trial["markers"][5] == {"name": "M06", "rms_m": None, "max_m": None}
    assert [gap["marker"] for gap in trial["gaps"]] == ["M04", "M06"]


def test_the_session_has_the_keys_that_others_rely_on():
    found = read_back(full_session())
    assert found["subject"] == {"name": "S01", "mass_kg": 65.0, "height_m": 1.7, "sex": "F", "age": 31.0, "guessed": []}
    assert found["mass_check"]["mass_on_plates_kg"] == 65.2
    assert found["mass_check"]["difference_percent"] == pytest.approx(100 * 0.2 / 65)
    assert found["provenance"]["inputs_sha256"] == {"walk <1>.c3d": "ab" * 32}
    assert found["provenance"]["versions"]["biodance"]
    for later in ("identification", "added_mass", "diagnosis"):
        assert found[later] is None


def test_a_refused_session_says_null_and_why():
    found = read_back(refused_session())
    assert found["refused"] == {"broken.c3d": "broken.c3d: is empty."}
    assert found["subject"]["mass_kg"] is None
    assert found["trials"][0]["status"] == "refused"
    assert found["trials"][0]["wrench"] is None
    assert set(found["mass_check"].values()) == {None}


@pytest.mark.parametrize("value", [float("nan"), float("inf"), np.float64("nan"), np.array(np.nan)])
def test_a_number_that_is_not_finite_becomes_null(value):
    assert json.loads(to_text({"x": value})) == {"x": None}


def test_numpy_values_become_plain_ones():
    assert plain_values((np.int64(3), np.bool_(True), np.arange(2.0))) == [3, True, [0.0, 1.0]]

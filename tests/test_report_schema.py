"""A schema says one record the same way to programs and to people."""

import json
from dataclasses import dataclass

import numpy as np
import pytest
from example_results import full_session, refused_session

from biodance.pipeline.saved_results import provenance
from biodance.report.pages.template import html_table
from biodance.report.tables.schema import Schema, markdown_table, plain_values, shown, to_text
from biodance.report.tables.session import results_document


@dataclass(frozen=True)
class Load:
    segment: str
    mass: float
    interval: tuple[float, float]
    trials: tuple[str, ...] = ()
    inside: "Load | None" = None


BAG = Load("left_forearm_hand", 2.44, (2.0, 2.9), ("a", "b"), Load("<i>", float("nan"), (0.0, 0.0)))
ROW = Schema(
    "segment kg=mass low=interval.0 both=interval.1,interval.0 count=#trials in_kg=inside.mass "
    "deeper=inside.inside.mass",
    {"heavy": lambda load: load.mass > 1, "inside": Schema("segment")},
    "segment: {segment:name} | mass (kg): {kg:1} | least: {low:2 kg} | inside: {in_kg:1 kg} | both: {both:0}",
)


def test_a_row_has_every_key_with_what_stands_in_its_place():
    assert ROW.row(BAG) == {
        "segment": "left_forearm_hand",
        "kg": 2.44,
        "low": 2.0,
        "both": [2.9, 2.0],
        "count": 2,
        "in_kg": pytest.approx(float("nan"), nan_ok=True),
        "deeper": None,
        "heavy": True,
        "inside": {"segment": "<i>"},
    }
    assert set(ROW.row(BAG)) == set(ROW.places)


def test_behind_nothing_is_nothing_and_a_wrong_name_is_no_silent_none():
    assert Schema("a=b.c d").row(None) == {"a": None, "d": None}
    assert Schema("a").told(None) is None
    with pytest.raises(AttributeError):
        Schema("weight").row(BAG)


def test_several_are_rows_in_order_and_say_what_they_are_about():
    assert set(Schema("kg=mass").at("inside")(BAG)) == {"kg"}
    assert Schema("kg=mass").rows((BAG, BAG), trial="walk") == [{"trial": "walk", "kg": 2.44}] * 2
    table = Schema("kg=mass deeper=inside.inside.mass").frame((BAG, BAG))
    assert list(table.columns) == ["kg", "deeper"]
    assert table.deeper.isna().all()


def test_page_terminal_and_markdown_show_the_same_cells():
    row = ROW.row(BAG)
    cells = ["left forearm with hand", "2.4", "2.00 kg", "–", "3, 2"]
    assert ROW.cells(row) == cells
    assert markdown_table(ROW, [row]).splitlines()[2] == f"| {' | '.join(cells)} |"
    page = html_table(ROW, [row | {"segment": "<b>"}], "a < b", only=("segment", "mass (kg)"))
    assert '<th scope="row">&lt;b&gt;</th><td class="n">2.4</td></tr>' in page
    assert "<caption>a &lt; b</caption>" in page


@pytest.mark.parametrize(
    ("said", "row", "text"),
    [
        ("{x:mm1 mm}", {"x": -0.0123}, "−12.3 mm"),
        ("{x:%0 %}", {"x": 0.127}, "13 %"),
        ("{x:deg1}", {"x": np.pi}, "180.0"),
        ("{x:ms0}", {"x": 0.0214}, "21"),
        ("{x:size}", {"x": 0.02, "unit": "m"}, "20 mm"),
        ("{x:p}", {"x": 0.0002}, "below 0.001"),
        ("{x[y][2]:1}", {"x": {"y": [0.0, 1.0, 2.0]}}, "2.0"),
        ("{x[y][2]:1 N}", {"x": None}, "–"),
        ("{x:count}", {"x": [1, 2, 3]}, "3"),
        ("{a:name} {b:name}", {"a": "plate_crosstalk", "b": "Fz->My"}, "plate crosstalk Fz into My"),
        ("{a:name} {b:name}", {"a": "time_delay", "b": ""}, "time delay"),
    ],
)
def test_a_number_has_the_unit_of_people(said, row, text):
    assert shown(said, row) == text


def test_a_document_is_json_without_what_json_cannot_say():
    document = {"a": np.array([1.0, np.nan]), "b": np.bool_(True), "c": (np.int64(2), float("inf"))}
    assert json.loads(to_text(document)) == {"a": [1.0, None], "b": True, "c": [2, None]}


# ---- results.json


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
    said = {"name": "S01", "mass_kg": 65.0, "height_m": 1.7, "sex": "F", "age": 31.0, "guessed": []}
    assert found["subject"] == {**said, "prosthesis": "", "devices_kg": {}}
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

"""The section on how a person moved, its JSON, and the healthy reference that it is told against."""

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from made_cycles import curve, cycle, level_gait, trial

from biodance.cycles.curves import CycleCurve, group_curves
from biodance.cycles.scores import SCORE_ANGLES
from biodance.cycles.summary import repetitions_of
from biodance.pipeline.lab_file import read_lab
from biodance.pipeline.learn import MeasuredWalk, healthy_reference, learn_laboratory
from biodance.pipeline.movement import SessionMovement
from biodance.report.figures.session import pressure_figure
from biodance.report.pages.movement import _beside, movement_section
from biodance.report.tables.schema import plain_values
from biodance.report.tables.session import gait_document

SHAPE = np.sin(np.linspace(0, np.pi, 101))


def walked(**more: object) -> SessionMovement:
    """Two trials, the second one longer; the right knee bends to 60, the left one to 50 degrees."""
    trials = []
    for name, count in (("first", 1), ("second", 4)):
        curves: list[CycleCurve] = []
        for k in range(count):
            right, left = cycle(k, trial=name), cycle(k + 0.5, "left", trial=name)
            curves += [*level_gait(right), *level_gait(left)]
            curves += [curve(right, (60 + k) * SHAPE, "hip_adduction"), curve(left, 50 * SHAPE, "hip_adduction")]
        shared = (cycle(0, trial=name),)
        trials.append(
            trial(name, [one for one in curves if one.value.any() or one.quantity != "hip_adduction"], shared=shared)
        )
    return SessionMovement("visit", tuple(trials), "table", 60.0, {}, **more)  # type: ignore[arg-type]


def test_the_way_of_the_pressure_is_drawn_though_most_steps_are_beside_the_plates() -> None:
    places = {"pressure_ahead": 0.2 * SHAPE, "pressure_outward": 0.01 * SHAPE}
    curves = [
        curve(cycle(k), value if k == 0 else np.nan, name, "m") for k in range(3) for name, value in places.items()
    ]
    drawn = pressure_figure(repetitions_of("gait", [trial("walk", curves)]))
    assert "<path" in drawn
    assert ">200<" in drawn
    assert pressure_figure(repetitions_of("gait", [trial("walk", curves[2:])])) == ""


def test_events_at_the_same_time_are_said_to_be() -> None:
    assert [_beside(late) for late in (0.0002, 0.006, -0.006)] == ["at the same time", "6 ms later", "6 ms earlier"]


def test_the_section_shows_all_cycles_of_all_trials_and_how_to_get_a_reference() -> None:
    text = movement_section(walked())
    assert "5 right, 5 left gait cycles of 2 trials" in text
    assert "In 2 both feet may have been on one plate for a part, which has no loads: first, second." in text
    assert "biodance learn --healthy" in re.sub(r"\s+", " ", text)
    assert "No moments and powers" in text
    panel = next(one for one in text.split('<div class="cell">') if "hip adduction (deg)" in one)
    assert panel.count('class="each"') == 10
    assert panel.count('class="line"') == 2
    assert panel.count('stroke-dasharray="5 3" d="M2400 0v4000"') == 1  # the left foot leaves at 60 %


def test_one_cycle_is_one_cycle() -> None:
    moved = SessionMovement("visit", (trial("walk", [*level_gait(cycle(0, trial="walk"))]),), "table", 60.0, {})
    assert "1 right gait cycle of 1 trial." in movement_section(moved)


def test_the_trials_of_a_session_are_beside_each_other() -> None:
    text = movement_section(walked())
    assert "1: first" in text
    assert "2: second" in text


def test_the_numbers_of_both_sides_stand_in_the_document() -> None:
    found = plain_values(gait_document(walked()))
    assert found["cycles"] == {"right": 5, "left": 5}
    assert found["scores"] is None
    keys = {(one["quantity"], one["key"]): one for one in found["key_values"]}
    largest = keys["hip_adduction", "maximum"]
    assert largest["right"]["mean"] == pytest.approx((60 + 60 + 61 + 62 + 63) / 5)
    assert largest["left"] == {"mean": pytest.approx(50.0), "sd": pytest.approx(0.0, abs=1e-9), "count": 5}
    assert largest["difference"] == pytest.approx(11.2)
    assert {one["because"] for one in found["left_out"]} == {"shared_plate"}
    assert found["foot_off_percent"]["left"]["mean"] == pytest.approx(60.0)
    assert all(len(one["mean"]) == 101 for one in found["curves"])


def test_nobody_who_stands_still_has_a_gait() -> None:
    assert gait_document(SessionMovement("visit", (), "table", 60.0, {})) is None
    assert gait_document(None) is None


def person(name: str, size: float, count: int = 3) -> MeasuredWalk:
    """Somebody whose nine angles are all ``size`` degrees."""
    curves = [one for k in range(count) for one in level_gait(cycle(k), **dict.fromkeys(SCORE_ANGLES, size))]
    curves += [one for k in range(count) for one in level_gait(cycle(k, "left"), **dict.fromkeys(SCORE_ANGLES, size))]
    rows = np.full((count, 459), size) + np.random.default_rng(int(size)).normal(0, 0.1, (count, 459))
    return MeasuredWalk(name, name, group_curves(curves), (), {"right": rows, "left": rows})


def test_the_reference_is_of_the_healthy_alone_and_each_person_counts_once(tmp_path) -> None:
    healthy = [person("a", 1.0), person("b", 2.0, count=9), person("c", 6.0)]
    found = healthy_reference(healthy, [*healthy, person("patient", 40.0)])
    knee = next(one for one in found.normal if one.quantity == "knee_flexion")
    assert (knee.people, knee.mean[50], knee.sd[50]) == (3, pytest.approx(3.0), pytest.approx(np.sqrt(7.0)))
    assert found.deviation is not None
    assert found.deviation.basis.shape == (15, 459)


def test_too_few_healthy_legs_give_no_deviation_index() -> None:
    healthy = [person("a", 1.0, 20), person("b", 2.0, 20)]
    assert healthy_reference(healthy, healthy).deviation is None


def test_the_scores_stand_on_the_page_beside_their_reference() -> None:
    healthy = [person("a", 1.0), person("b", 2.0), person("c", 6.0)]
    found = healthy_reference(healthy, healthy)
    text = movement_section(walked(healthy=found))
    assert "Distance from the healthy mean of 3 people" in text
    assert "gait deviation index (100 = healthy)" in text
    assert "normal, 3 people" in text


def test_scores_of_plug_in_gait_are_of_the_steps_that_the_files_hold() -> None:
    """HC031A: of one of two steps the file's pelvis is told against another axis; 1.8 deg, by the other step alone."""
    healthy = [person("a", 1.0), person("b", 2.0), person("c", 6.0)]
    found = healthy_reference(healthy, healthy)
    first, second = cycle(0), cycle(1)
    three, nine = (dict.fromkeys(SCORE_ANGLES, size) for size in (6.0, 12.0))
    here = (*level_gait(first, **three), *level_gait(second, **nine))
    walk = replace(trial("walk", [*here]), file_curves=here[: len(SCORE_ANGLES)], conventional_curves=here)
    reference = replace(found, beside=found.normal)
    scores = SessionMovement("visit", (walk,), "table", 60.0, {}, healthy=reference).scores
    assert [one.gps["right"].count for one in scores] == [2, 1, 1]
    assert scores[1].gps["right"].mean == scores[2].gps["right"].mean == pytest.approx(3.0)
    walk = replace(walk, file_curves=())
    assert SessionMovement("visit", (walk,), "table", 60.0, {}, healthy=reference).scores[2].gps["right"].count == 2


def test_a_session_that_is_not_there_is_named_with_those_that_are(tmp_path) -> None:
    from biodance.errors import UnknownName

    for name in ("S01", "S02", "S03"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "walk.c3d").write_bytes(b"\x02P")
    with pytest.raises(UnknownName, match="S01"):
        learn_laboratory(tmp_path, healthy=["S1"])


def test_what_a_laboratory_learned_of_healthy_people_comes_back_from_its_file(tmp_path) -> None:
    from biodance.pipeline.learn import learned_together
    from biodance.report.laboratory import lab_file_text

    healthy = [person("a", 1.0), person("b", 2.0), person("c", 6.0)]
    found = learned_together(tmp_path, [], {"S99": "a check failed"}, healthy_reference(healthy, healthy))
    path = tmp_path / "lab.toml"
    path.write_text(lab_file_text(found))
    assert "tolerances" not in tomllib.loads(path.read_text())
    back = read_lab(path)
    assert back.tolerances is None
    assert {one.quantity for one in back.normal} == set(SCORE_ANGLES)
    assert back.deviation is not None
    assert back.deviation.sd == pytest.approx(found.healthy.deviation.sd, rel=1e-4)  # type: ignore[union-attr]

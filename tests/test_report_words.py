"""How sizes, times, causes and many trials are put before a person: no senseless digits, no sign before nothing."""

from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from example_results import full_session, html_of
from found_loads import GAIN, NOTHING, OWN, found
from identified_sessions import session_result

from biodance.diagnosis.diagnosis import Verdict
from biodance.pipeline.diagnosis import as_diagnosed
from biodance.pipeline.trial import Check
from biodance.pipeline.words import say_load
from biodance.records.attention import Attention, told_together
from biodance.report import wording
from biodance.report.figures.vector import round_ticks
from biodance.report.pages.movement import _beside
from biodance.report.wording import (
    DIAGNOSED,
    IN_SHORT,
    causes_by_effect,
    changed,
    moment,
    share_of,
    signed,
    size_seen,
    sized,
)
from biodance.report.write import CLAUSES, REFERENCES, methods_text


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (100.0, "N", "100 N"),
        (11.159, "N", "11.2 N"),
        (0.354, "kg", "0.35 kg"),
        (0.0, "kg", "0.00 kg"),
        (0.2, "m", "200 mm"),
        (float("inf"), "m", "no size"),
    ],
)
def test_a_size_has_three_significant_digits_at_most(value, unit, text):
    assert sized(value, unit) == text


def test_a_size_beyond_what_occurs_is_never_seen():
    assert size_seen(0.29, 0.01, "m") == "290 mm"
    assert size_seen(35.387, 0.01, "m") == "never"
    assert size_seen(None, 0.01, "m") == "never"


def test_small_shares_are_not_nothing_and_nothing_has_no_sign():
    assert [share_of(part) for part in (0.0, 0.004, 0.24, 1.0)] == ["0 %", "less than 1 %", "24 %", "100 %"]
    assert [signed(value) for value in (0.04, -0.04, 1.26, -1.26)] == ["0.0", "0.0", "+1.3", "−1.3"]
    assert moment("2026-11-25T18:51:33Z") == "2026-11-25 18:51 UTC"
    assert [_beside(late) for late in (-0.0062, 0.002)] == ["6 ms earlier", "2 ms later"]


def test_a_change_has_its_sign_its_unit_and_no_more_digits_than_it_deserves():
    told = [changed(*one) for one in ((0.016, "m"), (-0.00911, "m"), (1.637, "kg"), (0.00123, "kg·m²"))]
    assert told == ["+16 mm", "−9 mm", "+1.64 kg", "+0.0012 kg·m²"]


def test_causes_are_told_by_effect_and_counted_beyond_the_sixth():
    causes = [("plate_crosstalk", f"F{k}->Mz") for k in range(8)] + [("clock_drift", "")]
    said = causes_by_effect(causes)
    assert said.startswith("plate crosstalk (F0 into Mz, F1 into Mz")
    assert said.endswith("and 2 more); clock drift")


def test_many_trials_of_one_check_are_told_by_their_range():
    values = ["5.6", "5.5", "6.7", "5.9", "10.2"]
    rows = [
        Attention("warn", f"{value} % of weight, should be at most 5 %.", f"walk_{k}", "force")
        for k, value in enumerate(values)
    ]
    (one,) = told_together(rows)
    assert one.text == "5 trials, 5.5 (walk_1) to 10.2 % of weight (walk_4), should be at most 5 %."
    (four,) = told_together(rows[:4])
    assert four.text.startswith("walk_0 5.6 % of weight, walk_1 5.5 % of weight")
    groups = [replace(row, text=row.text.replace("% of weight", f"mm, part {k}")) for k, row in enumerate(rows)]
    (every,) = told_together(groups)
    assert every.text.count("mm, part") == 5


@pytest.mark.parametrize(("low", "high"), [(-13.0, 12.0), (-0.9, 0.4), (3.0, 9.6), (-41.0, -17.0), (0.99, 1.99)])
@pytest.mark.parametrize("count", [2, 3, 6])
def test_an_axis_has_two_numbers_at_least(low, high, count):
    ticks = round_ticks(low, high, count)
    assert 2 <= len(ticks) <= 8
    assert len({text for _, text in ticks}) == len(ticks)
    assert all(low <= value <= high for value, _ in ticks)
    assert [float(text.replace("−", "-")) for _, text in ticks] == pytest.approx([value for value, _ in ticks])


def test_standing_still_has_no_correlation_on_the_page():
    result = full_session()
    still = replace(result.trials[0], trial=replace(result.trials[0].trial, role="static"))
    moving, standing = (
        html_of(replace(result, trials=(trial, *result.trials[1:]))).split(">correlation</th>")[1]
        for trial in (result.trials[0], still)
    )
    assert standing.partition("</tr>")[0].count(">–<") == 6
    assert moving.partition("</tr>")[0].count(">–<") == 0


def test_a_doubt_about_a_load_points_to_the_cause_that_was_found():
    heavy = Check(
        "mass on the plates against declared",
        "static",
        "5.6 %",
        "at most 2 %",
        False,
        "Weigh again, or check the zero.",
    )
    doubt = f"{heavy.what}, static: 5.6 % (at most 2 %). {heavy.advice}"
    result = session_result()
    search = found(("left_foot", 0.9), doubts=(doubt, "Markers are far."))
    session = replace(result, checks=(heavy,), identification=replace(result.identification, search=search))
    assert as_diagnosed(session, NOTHING) is session
    told = say_load(as_diagnosed(session, replace(NOTHING, findings=(GAIN,))).identification.search)
    assert "5.6 % (at most 2 %). Plate gain Fz, which was found, may explain it." in told
    assert "Weigh again" not in told
    assert "Markers are far." in told
    assert "which was found" not in say_load(
        as_diagnosed(session, replace(NOTHING, findings=(OWN,))).identification.search
    )


def test_pelvis_markers_lean_backwards_by_a_positive_angle():
    from human_cases import human_case

    from biodance.body.human.skeleton import standing_tilt, widen_limits

    body = human_case().body
    q = np.array(body.neutral)
    notes = {}
    for turn in (-0.35, 0.35):
        leaning = q.copy()
        leaning[3:7] = [0.0, np.sin(turn / 2), 0.0, np.cos(turn / 2)]
        notes[np.sign(standing_tilt(leaning))] = widen_limits(body, leaning)[1][0]
    assert "20 degrees forwards" in notes[1.0]
    assert "20 degrees backwards" in notes[-1.0]


def test_joints_that_stay_are_not_said_to_be_placed(monkeypatch):
    from types import SimpleNamespace

    from biodance.motion.ik.functional_joints import PLACED
    from biodance.pipeline import body as module

    static = SimpleNamespace(name="static", role="static")
    walk = SimpleNamespace(name="walk", role="fit", markers=())
    read = (SimpleNamespace(trial=static, usable=True), SimpleNamespace(trial=walk, usable=True))
    subject = SimpleNamespace(require=lambda *_: None)
    settings = SimpleNamespace(joints="functional", table="de_leva_1996")
    said = []
    for notes in ((f"{PLACED} (150 postures)",), ("Joints that the movement does not show, kept: trunk.",)):
        scaling = SimpleNamespace(notes=notes, body=lambda: (None,))
        monkeypatch.setattr(module, "measure_static", lambda *_, made=scaling: made)
        monkeypatch.setattr(module, "calibrate_joints", lambda *_, made=scaling: made)
        said.append(module.body_of(subject, read, settings, [])[1])
    assert "joints placed by movement" in said[0]
    assert "joints where it shows them" in said[1]


# ---- Every clause of methods.md says a value of results.json, and goes with it

AGREEMENT = {"rms": [5.0, 6.0, 19.5, 4.0, 3.0, 1.0], "cc": [0.9] * 6}
GAIT = {"trial": "walk", "cycles": [{"kind": "gait"}] * 3 + [{"kind": "squat"}]}
DOCUMENT = {
    "subject": {"mass_kg": 45.8, "height_m": 1.48},
    "trials": [{"status": "ok", "rate_hz": 100.0, "plates": [{}, {}]}, {"status": "refused"}],
    "mass_check": {"mass_on_plates_kg": 45.9, "difference_percent": 0.2},
    "identification": {
        "segments": [{}] * 12,
        "trials": ["dance_1"],
        "base_parameters": {"count": 101, "rank": 96},
        "validation": [{"table": AGREEMENT, "identified": AGREEMENT | {"rms": [5.0, 6.0, 12.5, 4.0, 3.0, 1.0]}}],
    },
    "filter": {
        "trials": [
            {"trial": "dance_1", "markers_hz": 10.0, "forces_hz": 10.0, "chosen_by": "trial"},
            {"trial": "squat_1", "markers_hz": 6.5, "forces_hz": 6.5, "chosen_by": "trial"},
        ]
    },
    "movement": {"parameters": "identified", "mass_kg": 45.7, "trials": [GAIT]},
    "diagnosis": {"verdict": "nothing wrong"},
    "provenance": {
        "commit": "0123456789abcdef",
        "versions": {"biodance": "0.1.0", "pin": "4.1.0"},
        "settings": {
            "table": "de_leva_1996",
            "hip": "harrington",
            "joints": "functional",
            "filter.kind": "critically_damped",
            "filter.order": 5,
        },
    },
}
SAID = [
    "biodance 0.1.0 (commit 0123456789ab)",
    "1 trial with markers at 100 Hz and 2 force plates",
    "45.8 kg and the stature 1.48 m",
    "carried 45.9 kg, +0.2 %",
    "de_leva_1996",
    "corrected by the movement",
    "critically damped, order 5 in each direction, 6.5 to 10 Hz, in each trial where",
    "Pinocchio 4.1.0",
    "12 segments were identified from the ground reaction wrench of dance_1",
    "19.5 N with the table and 12.5 N",
    "3 gait cycles, 1 squat",
    "the identified parameters and divided by 45.7 kg",
    "diagnosis of the recording found nothing wrong",
]
KEYS = [(number, path) for number, clause in enumerate(CLAUSES) for path in clause.keys]


def without(path):
    document = deepcopy(DOCUMENT)
    place = document
    for key in path[:-1]:
        place = place[key]
    del place[path[-1]]
    return document


def test_every_clause_is_said_in_order():
    text = methods_text(DOCUMENT)
    places = [text.index(words) for words in SAID]
    assert places == sorted(places)
    assert len(SAID) == len(CLAUSES)
    for name in ("Bonnet", "de Leva", "Harrington", "Robertson", "Wu", "Zeni", "Baker", "Carpentier", "Wensing"):
        assert REFERENCES[name] in text
    assert REFERENCES["Davis"] not in text


@pytest.mark.parametrize(("number", "path"), KEYS, ids=[".".join(path) for _, path in KEYS])
def test_without_its_key_a_clause_goes_and_only_those_of_that_key(number, path):
    text = methods_text(without(path))
    for k, clause in enumerate(CLAUSES):
        assert (SAID[k] in text) == (path not in clause.keys), SAID[k]
    assert SAID[number] not in text


def test_every_verdict_is_said_in_words():
    assert sorted(DIAGNOSED) == sorted(get_args(Verdict))
    window = (Path(wording.__file__).parents[1] / "app" / "static" / "dom.js").read_text().replace('"', "")
    assert all(f"{verdict}: [{said}," in window for verdict, said in IN_SHORT.items())
    text = methods_text({"diagnosis": {"verdict": "named, incomplete"}})
    assert "named causes of some of what it found, and left other differences without a cause." in text


def test_references_go_with_the_clauses_that_cite_them():
    assert REFERENCES["Zeni"] not in methods_text(without(("movement", "trials")))
    assert REFERENCES["Bonnet"] not in methods_text(without(("identification", "segments")))


def test_the_results_of_identify_have_it_at_the_top():
    alone = {"provenance": DOCUMENT["provenance"], **DOCUMENT["identification"]}
    text = methods_text(alone)
    assert "identified from the ground reaction wrench of dance_1" in text
    assert "45.8 kg" not in text

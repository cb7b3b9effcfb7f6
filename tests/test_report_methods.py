"""Every clause of methods.md says a value of results.json, and goes with it."""

from copy import deepcopy

import pytest

from biodance.report.methods import CLAUSES, REFERENCES, methods_text

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
    "“nothing wrong”",
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


def test_references_go_with_the_clauses_that_cite_them():
    assert REFERENCES["Zeni"] not in methods_text(without(("movement", "trials")))
    assert REFERENCES["Bonnet"] not in methods_text(without(("identification", "segments")))


def test_the_results_of_identify_have_it_at_the_top():
    alone = {"provenance": DOCUMENT["provenance"], **DOCUMENT["identification"]}
    text = methods_text(alone)
    assert "identified from the ground reaction wrench of dance_1" in text
    assert "45.8 kg" not in text

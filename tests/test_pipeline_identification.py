"""Identification in the pipeline, its numbers for programs and its pages, on a session whose truth is known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from identified_sessions import body, session_result, truth

from biodance.display import spaced
from biodance.errors import SessionRefused, TrialRefused
from biodance.motion.dynamics import joint_torques
from biodance.pipeline.identification import can_identify, identify_trials
from biodance.pipeline.saved_results import provenance
from biodance.pipeline.session import identification_of
from biodance.records import Plate, Wrench
from biodance.report.pages.identification import identification_section
from biodance.report.pages.session import page
from biodance.report.tables.identification import identification_document
from biodance.report.tables.schema import plain_values, to_text
from biodance.report.tables.session import results_document


@pytest.fixture(scope="module")
def found():
    return session_result().identification


@pytest.fixture(scope="module")
def numbers(found):
    return json.loads(to_text(identification_document(found)))


def test_the_masses_come_nearer_to_the_truth_and_the_kept_trial_shows_it(found):
    right, table = truth()[::10], body().sip.mass
    assert np.linalg.norm(found.identification.sip.mass - right) < 0.6 * np.linalg.norm(table - right)
    assert [trial.name for trial in found.validations] == ["validate_1"]
    assert [trial.name for trial in found.fitted] == ["fit_0"]
    assert found.gain.force_interval[0] > 1
    assert found.gain.moment_interval[0] > 1
    assert set(found.agreements) == {"fit_0", "validate_1"}
    assert not found.search.found


def test_the_document_has_the_keys_that_programs_rely_on(numbers, found):
    assert numbers["status"] == "solved"
    assert [row["name"] for row in numbers["segments"]] == list(body().segments)
    for row in numbers["segments"]:
        assert {"mass_kg", "mass_sd_kg", "mass_prior_kg", "com_m", "com_sd_m", "inertia_kgm2", "information"} <= set(
            row
        )
        assert [len(row[key]) for key in ("com_m", "com_sd_m", "inertia_kgm2")] == [3, 3, 6]
        assert 0 <= row["information"] <= 1
    assert set(numbers["base_parameters"]) == {"count", "well_known", "rank"}
    assert numbers["base_parameters"]["count"] == 101
    (trial,) = numbers["validation"]
    assert trial["trial"] == "validate_1"
    assert [len(trial[who][key]) for who in ("table", "identified") for key in ("rms", "cc")] == [6] * 4
    assert numbers["added_mass"] is None
    assert sum(row["mass_kg"] for row in numbers["segments"]) == pytest.approx(found.identification.sip.mass.sum())


def test_inertia_in_the_document_is_about_the_centre_of_mass(numbers, found):
    from biodance.body.parts import rigid_inertia

    lump = rigid_inertia(found.identification.sip.of("left_thigh"))
    row = numbers["segments"][body().segment_index("left_thigh")]
    assert row["inertia_kgm2"] == pytest.approx(lump.inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]], rel=1e-9)
    assert row["com_m"] == pytest.approx(lump.com, rel=1e-9)


def test_a_load_is_found_against_the_unloaded_session():
    loaded, bare = session_result(load=1.5, seed=5), session_result()
    compared = identify_trials(body(), loaded.trials, name="S02", reference=bare.identification)
    search = compared.search
    assert search.reference == "session S01"
    changes = {(row.segment, row.quantity): row for row in compared.changes}
    assert changes["left_forearm_hand", "mass"].interval[0] > 0
    text = identification_section(compared)
    assert "What changed since session S01" in text
    alone = "The added mass above stands all the same"
    assert alone not in text
    vague = replace(compared, changes=tuple(replace(row, p=1.0) for row in compared.changes))
    assert alone in identification_section(vague)
    assert alone not in identification_section(replace(vague, search=bare.identification.search))
    assert any("kg more than the identified body" in note for note in compared.notes)
    assert not any("than the identified body" in note for note in bare.identification.notes)
    assert search.found
    assert search.best.segment == "left_forearm_hand"
    assert search.best.interval[0] < 1.5 < search.best.interval[1]
    told = identification_document(loaded.identification)["added_mass_search"]["segments"]
    assert {row["segment"] for row in told} == set(body().segments)


def test_page_and_numbers_say_what_pelvis_and_its_neighbours_are_known_together(found, numbers):
    told, sip = numbers["known_together"], found.identification.sip
    assert ["pelvis", "right_thigh", "left_thigh"] in [one["segments"] for one in told]
    for one in told:
        at = [10 * sip.segments.index(name) for name in one["segments"]]
        own = np.sqrt(np.diag(sip.covariance)[at])
        assert one["mass_sd_kg"] < np.linalg.norm(own)
        assert one["mass_ci95_kg"][0] < sip.phi[at].sum() < one["mass_ci95_kg"][1]
    assert "are known together, not apart" in identification_section(found)


def test_without_a_kept_trial_the_gain_is_not_claimed():
    alone = session_result(roles=("fit",)).identification
    assert alone.gain is None
    assert any("not proven" in note for note in alone.notes)
    assert "fit_0" in identification_section(alone)


def test_nothing_to_fit_is_refused_with_what_to_do():
    result = session_result(roles=("validate",))
    assert not can_identify(result.trials)
    with pytest.raises(TrialRefused, match="role fit"):
        identify_trials(body(), result.trials, name="S01")
    with pytest.raises(SessionRefused, match=r"session\.toml"):
        identification_of(result)


def test_the_section_shows_every_segment(found):
    text = identification_section(found)
    assert all(f'<th scope="row">{spaced(name)}</th>' in text for name in body().segments)
    assert text.count('class="panel"') == 8  # masses (heavy, light), centres and inertias along three axes
    for word in ("validate_1", "From the data", "cannot be known", "No load is found beyond the table"):
        assert word in text


@pytest.mark.parametrize("roles", [("fit", "validate"), ("validate",)])
def test_the_report_holds_identification_where_there_is_one(roles, monkeypatch):
    monkeypatch.setattr("biodance.report.pages.session.identification_section", lambda _: "<p>What it weighs</p>")
    result, there = session_result(roles=roles), "fit" in roles
    made = provenance(result, created="2026-01-01T00:00:00Z")
    told = plain_values(results_document(result, made))
    assert (told["identification"] is not None) is there
    assert ("<p>What it weighs</p>" in page(result, made)) is there
    assert all((trial["wrench"]["identified"] is not None) is there for trial in told["trials"])


def test_a_load_on_the_page_has_segment_size_and_interval():
    text = identification_section(session_result(load=2.4, seed=5).identification)
    assert "Beyond the table the subject carries 2." in text
    assert "kg on the left forearm with hand (95 % interval" in text


def test_joint_torques_of_the_kept_trial_are_told_with_their_band():
    fitted, kept = session_result().trials
    corners = np.array([[0.5, 0.5, 0], [-0.5, 0.5, 0], [-0.5, -0.5, 0], [0.5, -0.5, 0]])
    plate = Plate("plate1", 2, corners, Wrench(kept.comparison.time, kept.comparison.measured))
    one = identify_trials(body(), (fitted, replace(kept, trial=replace(kept.trial, plates=(plate,)))), name="S03")
    bands, elbow = one.torques, body().joint_index("left_elbow_flexion")
    assert bands.trial == kept.trial.name
    expected = joint_torques(one.identification.identified, kept.motion, {}).torque[:, elbow]
    np.testing.assert_allclose(bands.torque[:, elbow], expected, atol=1e-9)
    assert np.all(bands.sd > 0)
    rows = {row["joint"]: row for row in identification_document(one)["joint_torques"]["joints"]}
    assert rows["left_elbow_flexion"]["peak_Nm"] == pytest.approx(max(bands.torque[bands.use, elbow], key=abs))
    low, high = rows["left_elbow_flexion"]["peak_ci95_Nm"]
    assert low < rows["left_elbow_flexion"]["peak_Nm"] < high
    assert "Joint moments" in identification_section(one)
    assert session_result().identification.torques is None
    assert identification_document(session_result().identification)["joint_torques"] is None

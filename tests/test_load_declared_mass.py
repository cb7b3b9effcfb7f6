"""A load is the same whether the scale weighed it or not, and people without load raise no alarm."""

from dataclasses import replace

import pytest
from identified_sessions import body, declared, session_result

from biodance.identification.added_mass import added_mass, scaled_to_mass
from biodance.identification.sessions import differences
from biodance.pipeline.identification import SessionIdentification, identify_trials, load_doubts
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial import Check
from biodance.report.tables.identification import identification_document

LOAD = 2.4


def heavier(result: SessionResult) -> SessionIdentification:
    """Return a loaded session whose scale weighed the load, against the unloaded one."""
    moved = replace(body(), sip=scaled_to_mass(body().sip, 62.0 + LOAD))
    return identify_trials(moved, result.trials, name="S02", reference=session_result().identification)


def test_the_load_is_the_same_whichever_mass_is_declared() -> None:
    loaded, bare = session_result(load=LOAD, seed=5), session_result().identification
    assert bare is not None
    found = [added_mass(declared(loaded, mass), reference=bare.identification) for mass in (62.0, 62.0 + LOAD)]
    for one in found:
        assert one.found
        assert one.best.segment == "left_forearm_hand"
        assert one.best.interval[0] < LOAD < one.best.interval[1]
    assert found[0].best.mass == pytest.approx(found[1].best.mass, abs=0.05)


def test_what_changed_is_the_arm_alone_also_where_the_scale_weighed_the_load() -> None:
    bare = session_result().identification
    assert bare is not None
    later = declared(session_result(load=LOAD, seed=5), 62.0 + LOAD)
    masses = {one.segment: one for one in differences(bare.identification, later) if one.quantity == "mass"}
    assert masses["left_forearm_hand"].value == pytest.approx(LOAD, abs=0.3)
    assert all(abs(one.value) < 0.5 for name, one in masses.items() if name != "left_forearm_hand")


def test_declared_and_carried_mass_are_said_where_they_differ() -> None:
    told = [note for note in heavier(session_result(load=LOAD, seed=5)).notes if "the plates carry" in note]
    assert len(told) == 1
    assert "Declared are 62.0 kg in session S01 and 64.4 kg here (+2.40 ±" in told[0]
    again = identify_trials(
        body(), session_result(seed=9).trials, name="S03", reference=session_result().identification
    )
    assert not any("the plates carry" in note for note in again.notes)


def test_the_smallest_load_is_smaller_with_a_reference() -> None:
    before, after = (session_result(seed=seed).identification for seed in (0, 5))
    assert before is not None
    assert after is not None
    searches = [added_mass(after.identification, reference=one) for one in (before.identification, None)]
    known, alone = ({one.segment: one.smallest for one in search.suspects} for search in searches)
    assert all(0 < known[segment] < alone[segment] for segment in alone)


def test_a_failed_check_of_a_fitted_trial_silences_the_load() -> None:
    loaded, bare = session_result(load=LOAD, seed=5), session_result().identification
    far = Check("marker distance, RMS", "fit_0", "31.0 mm", "at most 20 mm", False, "See the markers.")
    trials = tuple(replace(one, checks=(far,)) if one.trial.role == "fit" else one for one in loaded.trials)
    told = identify_trials(body(), trials, name="S02", reference=bare)
    assert not told.search.found
    document = identification_document(told)
    assert document["added_mass"] is None
    assert document["added_mass_search"]["status"] == "cannot tell"
    assert "marker distance, RMS, fit_0: 31.0 mm (at most 20 mm)" in document["added_mass_search"]["text"]


@pytest.mark.parametrize(("weighed", "doubts"), [(True, 0), (False, 1)])
def test_a_weight_other_than_declared_needs_a_reference(weighed: bool, doubts: int) -> None:
    heavy = Check("mass on the plates against declared", "static", "3.9 %", "at most 2 %", False, "Weigh again.")
    off = Check("markers not seen", "dance_1", "40.0 %", "at most 10 %", False, "Fill the gaps.")
    assert len(load_doubts((heavy, off, replace(heavy, inside=True)), weighed=weighed)) == doubts

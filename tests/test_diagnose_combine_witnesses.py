"""Findings of the simulation and of the witnesses together: each fault once, and none that the other excludes."""

from dataclasses import replace

import numpy as np
import pytest

from biodance.diagnosis import witness_evidence
from biodance.diagnosis.combine_witnesses import combine_findings
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding, Unobservable
from biodance.diagnosis.witness_inference import WitnessFindings
from biodance.witnesses import Observation
from biodance.witnesses._causes import Alteration


def finding(effect: str, target: str, value: float, unit: str, *alike: tuple[str, str]) -> Finding:
    aliases = tuple(Alias(*names, 30.0) for names in ((effect, target), *alike))
    return Finding(effect, target, (Estimate("size", value, 0.05 * abs(value), unit),), aliases, 0.5)


NAMES = ("plate_position", "plate1:y")

HEARD = witness_evidence.WitnessEvidence((), {}, {}, {})

LOAD = finding("added_mass", "right_forearm_hand", 2.4, "kg")

WEIGHT = finding("body_mass", "", 2.5, "kg", ("plate_gain", "Fz"))

BY_SIMULATION = Diagnosis("named, complete", (LOAD,), limits=(Unobservable("body_mass", "", 1.6, "kg"),))


def test_the_weight_of_a_load_that_the_simulation_names_is_no_second_cause() -> None:
    one = combine_findings(BY_SIMULATION, WitnessFindings((WEIGHT,), HEARD), HEARD, judged=True)
    assert (one.verdict, one.findings, one.resembles) == ("named, complete", (LOAD,), (WEIGHT,))


@pytest.mark.parametrize(("limit", "verdict"), [(3.0, "named, complete"), (1.6, "nothing wrong")])
def test_a_witness_is_believed_where_the_simulation_is_blind_or_finds_nothing_wrong(limit: float, verdict: str) -> None:
    limits = (Unobservable("body_mass", "", limit, "kg"),)
    simulation = replace(BY_SIMULATION, verdict=verdict, findings=(), limits=limits)
    one = combine_findings(simulation, WitnessFindings((WEIGHT,), HEARD), HEARD, judged=True)
    assert [f.effect for f in one.findings] == ["body_mass"]


@pytest.mark.parametrize(
    ("witness", "bayes", "named"),
    [("standing_place", -1.6, False), ("standing_place", 1.6, True), ("foot_across", -1.6, True)],
)
def test_who_stands_beside_the_middle_has_no_plate_beside_its_place(witness: str, bayes: float, named: bool) -> None:
    """The movement, which sees 8 mm, shows nothing wrong and nothing of 21 mm; feet have their own say."""
    cause = Alteration(*NAMES, "shift", "m", 0.005, lambda seen, size: seen)
    there = Observation(witness, "pressure to the left", "static", 0.021, 0.003, 0.0, "m")
    said = witness_evidence.WitnessEvidence((there,), {NAMES: cause}, {NAMES: np.ones(1)})
    limits, candidates = (Unobservable(*NAMES, 0.008, "m"),), (Alias(*NAMES, bayes),)
    simulation = Diagnosis("nothing wrong", (), limits=limits, candidates=candidates)
    place = finding(*NAMES, 0.021, "m")
    one = combine_findings(simulation, WitnessFindings((place,), said), said, judged=True)
    assert one.findings == ((place,) if named else ())
    assert one.verdict == ("named, complete" if named else "nothing wrong")
    assert any("plate position of plate1:y" in note for note in one.notes) is not named


@pytest.mark.parametrize(("bayes", "named"), [(-1.6, False), (1.6, True)])
def test_forces_that_fit_the_whole_movement_come_not_late_at_one_step(bayes: float, named: bool) -> None:
    """The movement, which sees 5 ms, shows nothing wrong and nothing of 62 ms."""
    clock = ("time_delay", "")
    cause = Alteration(*clock, "delay", "s", 0.004, lambda seen, size: seen)
    there = Observation("force_end", "left foot on plate2 at 0.5 s", "stand", 0.038, 0.01, -0.024, "s")
    said = witness_evidence.WitnessEvidence((there,), {clock: cause}, {clock: np.ones(1)})
    limits, candidates = (Unobservable(*clock, 0.005, "s"),), (Alias(*clock, bayes),)
    simulation = Diagnosis("nothing wrong", (), limits=limits, candidates=candidates)
    late = finding(*clock, 0.062, "s")
    one = combine_findings(simulation, WitnessFindings((late,), said), said, judged=True)
    assert one.findings == ((late,) if named else ())
    assert any("look like a time delay;" in note for note in one.notes) is not named


def test_exchanged_labels_explain_nothing_that_plates_infer_causes() -> None:
    labels = Finding("labels_swapped", "LWRA/LWRB", (), (Alias("labels_swapped", "LWRA/LWRB", 30.0),), 1.0)
    simulation = replace(BY_SIMULATION, verdict="named, incomplete", findings=(labels,))
    one = combine_findings(simulation, WitnessFindings((WEIGHT,), HEARD), HEARD, judged=True)
    assert (one.verdict, one.findings) == ("named, incomplete", (WEIGHT, labels))


def test_what_the_simulation_tells_from_its_look_alikes_keeps_its_name() -> None:
    gain = finding("plate_gain", "Fz", 0.05, "1")
    one = combine_findings(
        replace(BY_SIMULATION, findings=(gain,)), WitnessFindings((WEIGHT,), HEARD), HEARD, judged=True
    )
    assert one.findings == (gain,)
    assert one.verdict == "named, complete"


def test_what_two_witnesses_say_of_one_finding_names_it_once() -> None:
    """The gain of one plate weighs like a heavier body, and the foot of the other plate says so again."""
    gain = finding("plate_gain", "plate2:Fz", 0.057, "1")
    again = finding("plate_gain", "plate1:Fz", -0.05, "1", ("plate_gain", "plate2:Fz"))
    heavier = finding("body_mass", "", 2.5, "kg", ("plate_gain", "plate2:Fz"))
    simulation = replace(BY_SIMULATION, findings=(gain,))
    one = combine_findings(simulation, WitnessFindings((heavier, again), HEARD), HEARD, judged=True)
    assert one.findings == (gain,)

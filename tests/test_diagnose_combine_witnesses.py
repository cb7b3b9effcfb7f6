"""Findings of the simulation and of the witnesses together: each fault once, and none that the other excludes."""

from dataclasses import replace

import numpy as np
import pytest

from biodance.diagnosis import witness_evidence
from biodance.diagnosis.combine_witnesses import SimulatedSize, combine_findings
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding, Unobservable
from biodance.diagnosis.reasons import Reason
from biodance.diagnosis.witness_inference import WitnessFindings
from biodance.observations import ObservableCause, Observation

NECK = {Reason.UNDESCRIBED_JOINTS: ("neck",)}


def finding(effect: str, target: str, value: float, unit: str, *alike: tuple[str, str]) -> Finding:
    aliases = tuple(Alias(*names, 30.0) for names in ((effect, target), *alike))
    return Finding(effect, target, (Estimate("size", value, 0.05 * abs(value), unit),), aliases, 0.5)


NAMES = ("plate_position", "plate1:y")

HEARD = witness_evidence.ObservedEvidence((), {}, {}, {})

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


def heard(names: tuple[str, str], witness: str, value: float, sd: float) -> witness_evidence.ObservedEvidence:
    """Return one observation that shows a cause of size ``value``, and its look-alike `OTHER` one to one."""
    step, unit = (0.004, "s") if names[0] == "time_delay" else (0.005, "m")
    there = Observation(witness, "somewhere", "static", value, sd, 0.0, unit)
    causes = {one: ObservableCause(*one, "size", unit, step) for one in (names, OTHER)}
    return witness_evidence.ObservedEvidence((there,), causes, dict.fromkeys(causes, np.ones(1)))


OTHER = ("plate_position", "plate2:y")
PLACE = replace(finding(*NAMES, 0.071, "m", OTHER), parameters=(Estimate("shift", 0.071, 0.017, "m"),))
LATE = replace(finding("time_delay", "", 0.062, "s"), parameters=(Estimate("delay", 0.062, 0.01, "s"),))
NONE = float("nan")


@pytest.mark.parametrize(
    ("said", "witness", "limit", "moved", "other", "named"),
    [
        (PLACE, "standing_place", 0.009, (0.0077, 0.0017), (0.001, 0.0018), False),
        (PLACE, "foot_across", 0.009, (0.0077, 0.0017), (0.001, 0.0018), False),
        (PLACE, "foot_across", 0.009, (0.0137, 0.0017), (0.001, 0.0018), False),  # another one of 14 mm
        (PLACE, "foot_across", 0.009, (0.060, 0.0017), (0.001, 0.0018), True),  # both show it
        (PLACE, "foot_across", 0.009, (0.0077, 0.0017), (0.069, 0.0018), True),  # its look-alike is what moves
        (PLACE, "foot_across", 0.080, (0.0077, 0.0017), (0.001, 0.0018), True),  # the movement would not show it
        (PLACE, "foot_across", 0.009, (0.0077, NONE), (0.001, 0.0018), True),  # nor measures it
        (PLACE, "foot_across", 0.009, (0.0001, 0.018), (0.001, 0.0018), True),  # or worse than the feet
        (LATE, "force_end", 0.005, (0.001, 0.001), (0.0, NONE), False),
        (LATE, "force_end", 0.005, (0.055, 0.001), (0.0, NONE), True),
    ],
)
def test_a_size_that_the_movement_excludes_is_not_named(
    said: Finding,
    witness: str,
    limit: float,
    moved: tuple[float, float],
    other: tuple[float, float],
    named: bool,
) -> None:
    """A person who stands off centre, feet that are lifted: the movement measures the same cause, eight times surer."""
    names, own = (said.effect, said.target), said.parameters[0]
    evidence = heard(names, witness, own.value, own.sd)
    simulation = Diagnosis("nothing wrong", (), limits=(Unobservable(*names, limit, own.unit),))
    measured = {names: SimulatedSize(*moved, 0.0), OTHER: SimulatedSize(*other, 0.0)}
    one = combine_findings(simulation, WitnessFindings((said,), evidence), evidence, judged=True, measured=measured)
    assert one.findings == ((said,) if named else ())
    assert one.verdict == ("named, complete" if named else "nothing wrong")
    assert any("the movement, which would show it" in note for note in one.notes) is not named


def test_two_sizes_that_agree_must_be_more_than_laboratories_have() -> None:
    """Feet say 18 ± 5 mm and the movement 6 ± 1.5 mm: together 7 mm, which laboratories have without a fault."""
    said = replace(PLACE, parameters=(Estimate("shift", 0.018, 0.005, "m"),), set=PLACE.set[:1])
    evidence = heard(NAMES, "foot_across", 0.018, 0.005)
    simulation = Diagnosis("nothing wrong", (), limits=(Unobservable(*NAMES, 0.009, "m"),))
    for moved, named in (((0.006, 0.0015), False), ((0.016, 0.0015), True)):
        one = combine_findings(
            simulation,
            WitnessFindings((said,), evidence),
            evidence,
            judged=True,
            measured={NAMES: SimulatedSize(*moved, 0.0)},
        )
        assert bool(one.findings) is named


def test_the_set_of_what_both_found_is_the_movements() -> None:
    """A trunk load, a wrong mass and a gain weigh the same: the movement tells the gain from it, and not the load."""
    moved = finding("body_mass", "", 2.4, "kg", ("added_mass", "trunk_head"))
    evidence = heard(("body_mass", ""), "standing_force", 2.5, 0.125)
    simulation = replace(BY_SIMULATION, findings=(moved,))
    (one,) = combine_findings(simulation, WitnessFindings((WEIGHT,), evidence), evidence, judged=True).findings
    assert one.set == (Alias("body_mass", "", 60.0), Alias("added_mass", "trunk_head", 30.0))
    assert 2.4 < one.parameters[0].value < 2.5


@pytest.mark.parametrize(("lacking", "named"), [(29.0, True), (31.0, False)])
def test_two_sources_carry_a_name_together(lacking: float, named: bool) -> None:
    """Feet (log evidence 30) and movement agree on 16 mm; the movement, which measures them better, asks for more."""
    said = replace(PLACE, parameters=(Estimate("shift", 0.018, 0.005, "m"),), set=PLACE.set[:1])
    evidence = heard(NAMES, "foot_across", 0.018, 0.005)
    simulation = Diagnosis("nothing wrong", (), limits=(Unobservable(*NAMES, 0.009, "m"),))
    measured = {NAMES: SimulatedSize(0.016, 0.0015, lacking)}
    one = combine_findings(simulation, WitnessFindings((said,), evidence), evidence, judged=True, measured=measured)
    assert bool(one.findings) is named


@pytest.mark.parametrize(
    ("said", "witness", "why", "named"),
    [
        (WEIGHT, "standing_force", (Reason.UNUSUAL_BODY,), False),
        (WEIGHT, "standing_force", (), True),  # the body with that mass is as people are
        (LATE, "force_onset", (Reason.UNUSUAL_BODY,), True),  # no mass that lies elsewhere makes forces late
    ],
)
def test_weighing_twice_is_one_opinion(said: Finding, witness: str, why: tuple[Reason, ...], named: bool) -> None:
    """2.4 kg on a forearm that nobody looks for weigh like a wrong declared mass, and make an arm that nobody has."""
    names, own = (said.effect, said.target), said.parameters[0]
    evidence = heard(names, witness, own.value, own.sd)
    limits = (Unobservable(*names, 0.6 * own.value, own.unit),)
    simulation = Diagnosis("unexplained", (), limits=limits, resembles=(said,), why=NECK | dict.fromkeys(why, ()))
    one = combine_findings(simulation, WitnessFindings((said,), evidence), evidence, judged=True)
    assert [f.effect for f in one.findings] == ([said.effect] if named else [])


WEIGHED = replace(WEIGHT, parameters=(Estimate("error", 2.5, 0.125, "kg"),))


@pytest.mark.parametrize(
    ("said", "witness", "moved", "named"),
    [
        (WEIGHED, "standing_force", SimulatedSize(2.4, 0.05, 29.0), True),  # both show it, with the evidence of both
        (WEIGHED, "standing_force", SimulatedSize(2.4, 0.05, 31.0), False),
        (WEIGHED, "standing_force", SimulatedSize(1.4, 0.05, 0.0), False),  # another mass of 1.4 kg
        (WEIGHED, "standing_force", SimulatedSize(1.4, 0.5, 31.0), True),  # the movement measures it worse
        (WEIGHED, "standing_force", None, True),  # or nothing, as in quiet standing
        (PLACE, "standing_place", SimulatedSize(0.007, 0.002, 0.0), False),  # somebody leans
        (PLACE, "foot_across", SimulatedSize(0.007, 0.002, 0.0), True),  # steps are more than a mean
    ],
)
def test_joints_that_nobody_knows_change_no_mean_wrench(
    said: Finding, witness: str, moved: SimulatedSize | None, named: bool
) -> None:
    """Forces of a body with a neck fit only a gain nine standard deviations large, which nobody looks for."""
    names, own = (said.effect, said.target), said.parameters[0]
    said = replace(said, set=said.set[:1])
    evidence = heard(names, witness, own.value, own.sd)
    limits = (Unobservable(*names, 0.6 * own.value, own.unit),)
    simulation = Diagnosis("unexplained", (), limits=limits, why=NECK)
    measured = {names: moved} if moved else {}
    one = combine_findings(simulation, WitnessFindings((said,), evidence), evidence, judged=True, measured=measured)
    assert one.findings == ((said,) if named else ())
    assert one.resembles == (() if named else (said,))
    assert one.verdict == ("named, incomplete" if named else "unexplained")


@pytest.mark.parametrize("why", [(Reason.SEVERAL_CROSSTALKS,), ()])
def test_feet_name_no_crosstalk_of_several(why: tuple[Reason, ...]) -> None:
    """A plate 30 mm beside its place, which nobody looks for, looks like two cross-talks at once."""
    crossed = finding("plate_crosstalk", "Fz->My", 0.033, "m", ("plate_offset", "My"))
    evidence = heard(("plate_crosstalk", "Fz->My"), "standing_place", 0.033, 0.009)
    simulation = Diagnosis("unexplained", (), resembles=(crossed,), why=NECK | dict.fromkeys(why, ()))
    one = combine_findings(simulation, WitnessFindings((crossed,), evidence), evidence, judged=True)
    assert bool(one.findings) is (why == ())


def test_standing_alone_excludes_no_size() -> None:
    """Forces are 62 ms late at every step; in the three seconds that could be compared nobody moved."""
    evidence = heard(("time_delay", ""), "force_onset", 0.062, 0.01)
    simulation = Diagnosis(
        "nothing wrong", (), limits=(Unobservable("time_delay", "", 0.03, "s"),), why={Reason.ONLY_STANDING: ()}
    )
    measured = {("time_delay", ""): SimulatedSize(0.002, 0.005, 0.0)}
    one = combine_findings(simulation, WitnessFindings((LATE,), evidence), evidence, judged=True, measured=measured)
    assert one.findings == (LATE,)


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

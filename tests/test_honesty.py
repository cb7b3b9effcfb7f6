"""No verdict says more than its evidence carries: closed-form cases of every rule, a test over all verdicts and
checks, and real recordings without fault (BIODANCE_DATA).
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import RATE, body, known, looks, motion, offset
from example_results import full_session

from biodance.diagnosis.adequacy import adequacy, largest_z, verdict
from biodance.diagnosis.consequence import LEAST_FORCE, LEAST_MOMENT, Adequacy, least, matters
from biodance.diagnosis.diagnosis import ABOUT, Alias, Diagnosis, Estimate, Finding
from biodance.diagnosis.engine import diagnose_trials
from biodance.diagnosis.model import NamedCause
from biodance.diagnosis.naming import build_model, drop_weak_causes, is_significant, required_evidence, settle
from biodance.diagnosis.problem import problem
from biodance.effects import Case, Gate, effects
from biodance.motion.regressor import predict_wrench
from biodance.pipeline.attention import headline, identified_attention, is_well, session_attention, told
from biodance.pipeline.finding_words import EXPLAINS, in_words
from biodance.pipeline.trial_result import Check
from biodance.records import Motion, Wrench
from biodance.records.attention import Attention, Judged, strongest_first
from biodance.uncertainty.tolerances import shipped, table_sizes, without_habits

FAST = ("plate_gain", "plate_offset", "plate_drift", "time_delay", "body_mass", "added_mass")
FOUND = Finding("plate_gain", "Fz", (Estimate("gain", 0.06, 0.002, "1"),), (Alias("plate_gain", "Fz", 80.0),), 0.9)
GOOD = Check("marker distance, RMS", "walk", "8.0 mm", "at most 20 mm", True)
BAD = replace(GOOD, value="31.0 mm", inside=False)
HEAVY = Check("mass on the plates against declared", "static", "6.0 %", "at most 2 %", False, "Weigh again.")
WALK = Judged("walk", 0.0, "no 1 s of contact. More.", missed=True)
STATIC = Judged("static", 3.0)


# 1 ---- what names need


def standing_looks(shift: float):
    """Return quiet standing with ``shift`` N too much of Fx."""
    look = looks(1, trials=1)[0]
    moving, frames = motion(3), int(4 * RATE)
    zero = np.zeros((frames, moving.v.shape[1]))
    still = Motion(np.arange(frames) / RATE, np.repeat(moving.q[:1], frames, axis=0), zero, zero)
    value = predict_wrench(body(), still).value + shift * np.eye(6)[0]
    plate = replace(look.trial.plates[0], wrench=Wrench(still.time, value))
    quiet = replace(look.trial, role="fit", plates=(plate,))
    return (replace(look, trial=quiet, motion=still, use=np.ones(frames, dtype=bool)),)


def test_standing_alone_names_nothing_however_large() -> None:
    moving = diagnose_trials(body(), looks(1, hidden=offset(40.0)), tolerances=known(), effects=FAST)
    assert [one.effect for one in moving.diagnosis.findings] == ["plate_offset"]
    quiet = diagnose_trials(body(), standing_looks(40.0), tolerances=known(), effects=FAST).diagnosis
    assert (quiet.findings, quiet.resembles) == ((), ())
    assert quiet.doubt


def test_a_name_that_another_one_takes_back_is_taken_back() -> None:
    """Offset and nothing else is hidden: a delay named beside it has no size of its own and falls, the offset stays."""
    put = problem(body(), looks(2, hidden=offset(12.0)), chosen=FAST)
    found, causes = build_model(put, known(), FAST)
    one = {cause.names: cause for cause in causes}
    start = tuple(
        NamedCause(one[name].effect, one[name].effect.typical, np.eye(1))
        for name in (("time_delay", ""), ("plate_offset", "Fx"))
    )
    both = settle(found, start)

    def round_of(name):
        from biodance.diagnosis.naming import Round
        from biodance.diagnosis.screening import ScoredCandidate

        return Round((ScoredCandidate(one[name].effect, 50.0, 50.0, np.zeros(1), 0.9),))

    kept, rounds = drop_weak_causes(both, (round_of(("time_delay", "")), round_of(("plate_offset", "Fx"))))
    assert [cause.effect.name for cause in kept.named] == ["plate_offset"]
    assert len(rounds) == 1
    assert kept.named[0].theta[0] == pytest.approx(12.0, abs=1.0)


def test_a_size_below_two_standard_deviations_or_above_what_can_be_does_not_stand() -> None:
    found, _ = build_model(problem(body(), looks(1), chosen=("wobbling_mass", "plate_offset")), known(), FAST)
    offset_fx = effects()["plate_offset"].at("Fx", found.problem.cases[0])
    assert not is_significant(found, NamedCause(offset_fx, np.array([5.9]), np.array([[9.0]])))
    assert is_significant(found, NamedCause(offset_fx, np.array([-6.1]), np.array([[9.0]])))
    wobbling = effects()["wobbling_mass"].at("right_shank", found.problem.cases[0])
    own = float(body().sip.mass[body().segment_index("right_shank")])
    assert is_significant(found, NamedCause(wobbling, np.array([0.9 * own]), np.array([[1e-4]])))
    assert not is_significant(found, NamedCause(wobbling, np.array([1.1 * own]), np.array([[1e-4]])))
    assert not is_significant(found, NamedCause(wobbling, np.array([-1.0]), np.array([[1e-4]])))


def test_what_hides_needs_overwhelming_evidence() -> None:
    found, _ = build_model(problem(body(), looks(1), chosen=("plate_offset",)), known(), ("plate_offset",))
    assert required_evidence(found, 0.2) == found.tolerances.threshold
    assert required_evidence(found, 0.19) == 3 * found.tolerances.threshold


# 2 ---- no expected mean that is no physics


def test_only_what_is_physics_keeps_a_mean_and_the_rest_is_spread() -> None:
    one = replace(known(), sizes={"wobbling_mass thigh": 3.0, "time_delay": 0.3}, means={
        "wobbling_mass left_thigh mass": -4.0, "wobbling_mass right_thigh mass": -4.0, "time_delay delay": 0.4,
        "sag thigh": -3e-5, "clock_drift stretch": 0.1,
    })  # fmt: skip
    free = without_habits(one)
    assert dict(free.means) == {"sag thigh": -3e-5}
    assert dict(free.sizes) == pytest.approx({"wobbling_mass thigh": 5.0, "time_delay": 0.5})
    assert all(key.startswith("sag ") for key in shipped().means)
    assert all(shipped().sizes[key] >= size for key, size in table_sizes().items())


def test_a_habit_that_the_markers_show_widens_the_other_rows_alone() -> None:
    sizes = {"head_joint": 0.02, "shown head_joint": 0.01}
    free = without_habits(replace(known(), sizes=sizes, means={"head_joint angle": 0.04, "head_joint beyond": -0.03}))
    assert dict(free.sizes) == pytest.approx({**sizes, "habit head_joint": np.sqrt((0.04**2 + 0.03**2) / 2)})


# 3, 6 ---- verdicts and sentences


def sessions():
    """Yield every verdict beside every check and trial, as `told` says it."""
    result = full_session()
    left = (Adequacy("Fx", (0.3, 1.0), 12.0, "walk", 1.0, 5.0),)
    whole = Diagnosis("nothing wrong", ())
    some = (
        whole,
        replace(whole, verdict="named, complete", findings=(FOUND,)),
        replace(whole, verdict="named, incomplete", findings=(FOUND,), adequacy=left),
        replace(whole, verdict="unexplained", adequacy=left),
        replace(whole, verdict="unexplained", adequacy=left, resembles=(FOUND,)),
        replace(whole, verdict="unexplained", adequacy=left, doubt="standing alone tells no cause"),
        replace(whole, verdict="unexplained"),
    )
    for one, check, row in itertools.product(some, (GOOD, BAD, HEAVY), ((STATIC,), (STATIC, WALK), (WALK,))):
        trials = tuple(replace(trial, checks=()) for trial in result.trials)
        yield one, check, row, told(one, replace(result, trials=trials, checks=(check,)), row)


def test_no_verdict_contradicts_a_check_or_an_unjudged_trial() -> None:
    count = 0
    for before, check, rows, one in sessions():
        said = next(line for line in one.attention if line.about == ABOUT)
        whole = check.inside and not any(row.missed for row in rows)
        count += 1
        assert one.verdict != "named, complete" or whole
        if one.verdict == "nothing wrong":
            assert ("what could be judged" in said.text) == (not whole)
            assert (said.level == "note") == whole == is_well(one)
        if not check.inside:
            assert check.what in said.text
        if WALK in rows:
            assert "not judged: walk" in said.text
        if one.verdict == "unexplained":
            assert not one.findings
            told_nothing = bool(before.doubt) or STATIC not in rows or not before.adequacy
            assert said.text.startswith("Cannot tell") == told_nothing
        assert not is_well(one) or whole
        assert list(one.attention) == list(strongest_first(one.attention))
        assert one.judged == rows
    assert count == 63


def test_forces_that_fit_a_doubtful_body_do_not_end_as_nothing_wrong() -> None:
    result = full_session()
    trials = tuple(replace(trial, checks=()) for trial in result.trials)
    odd = replace(body(), notes=("Warning: the right thigh is 38 mm shorter than the left thigh: check the markers.",))
    doubtful = replace(result, trials=trials, checks=(), body=odd)
    one = told(Diagnosis("nothing wrong", ()), doubtful, (STATIC,))
    assert one.verdict == "unexplained"
    assert one.attention[0].text.startswith("Cannot tell")
    assert "thigh is 38 mm shorter" in one.attention[0].text
    assert told(Diagnosis("named, complete", (FOUND,)), doubtful, (STATIC,)).verdict == "named, incomplete"
    thigh = replace(FOUND, effect="segment_length", target="right_thigh")
    assert told(Diagnosis("named, complete", (thigh,)), doubtful, (STATIC,)).verdict == "named, complete"


def test_a_session_whose_walks_were_all_left_out_cannot_tell() -> None:
    full = full_session()
    result = replace(full, trials=tuple(replace(trial, checks=()) for trial in full.trials), checks=())
    assert told(Diagnosis("nothing wrong", ()), result, (STATIC,)).verdict == "nothing wrong"
    one = told(Diagnosis("nothing wrong", ()), result, (replace(STATIC, seconds=0.0), WALK))
    assert one.verdict == "unexplained"
    assert one.attention[0].text.startswith("Cannot tell")
    assert not is_well(one)


def test_a_check_points_to_the_cause_that_was_found() -> None:
    result = replace(full_session(), checks=(HEAVY,))
    plain = next(one for one in session_attention(result) if one.about == HEAVY.what)
    named = next(one for one in session_attention(result, [FOUND]) if one.about == HEAVY.what)
    assert plain.level == "warn"
    assert "Weigh again." in plain.text
    assert named.level == "note"
    assert "Plate gain Fz" in named.text
    assert "Weigh again." not in named.text
    family = {name for causes in EXPLAINS.values() for name in causes}
    from biodance.effects import discrete_effects

    assert family <= {*effects(), *discrete_effects()}


def test_sentences_come_strongest_first_and_once() -> None:
    note, fail = Attention("note", "a"), Attention("fail", "b")
    assert strongest_first([note, fail, note]) == (fail, note)


def test_a_size_that_is_hardly_known_says_so() -> None:
    shaky = replace(FOUND, parameters=(Estimate("gain", 0.06, 0.05, "1"),))
    line = headline(Diagnosis("named, complete", (shaky,)), "80 s of movement", (STATIC,), ())
    assert "hardly known" in line.text
    assert "hardly known" not in headline(Diagnosis("named, complete", (FOUND,)), "80 s", (STATIC,), ()).text


@pytest.mark.parametrize(("late", "told"), [(0.034, "forces late"), (-0.034, "forces early")])
def test_a_delay_says_in_words_which_way_it_goes(late: float, told: str) -> None:
    delayed = Finding("time_delay", "", (Estimate("delay", late, 0.004, "s"),), (Alias("time_delay", "", 80.0),), 0.9)
    assert in_words(delayed) == f"time delay (delay {1000 * late:.0f} ± 4 ms; {told})"
    unsure = replace(delayed, parameters=(Estimate("delay", late, 0.03, "s"),))
    assert told not in in_words(unsure)


def test_a_poor_model_resembles_and_is_no_finding() -> None:
    def knocked(wrench, session, moving):
        knock = 40.0 * np.sin(2 * np.pi * 4.0 * moving.time) * (np.abs(moving.time - 6.0) < 1.0)
        return offset(12.0)(wrench + knock[:, None] * (np.arange(6) == 1), session, moving)

    one = diagnose_trials(body(), looks(1, hidden=knocked), tolerances=known(), effects=FAST).diagnosis
    assert one.verdict == "unexplained"
    assert one.findings == ()
    assert "plate_offset" in {finding.effect for finding in one.resembles}


# 4 ---- what matters


@pytest.mark.parametrize(
    ("name", "target", "small", "large"),
    [
        ("time_delay", "", [0.0029], [-0.0031]),
        ("plate_drift", "Fx", [1.9], [2.1]),
        ("plate_drift", "Mx", [-0.99], [1.01]),
        ("plate_crosstalk", "Fz->My", [0.0009], [0.0011]),
        ("plate_crosstalk", "Fz->Fx", [0.0019], [0.0021]),
        ("external_contact", "left_foot", [1.1, 1.1, 1.1], [1.2, 1.2, 1.2]),
    ],
)
def test_a_cause_matters_from_its_least_size_on(name, target, small, large) -> None:
    look = looks(1, trials=1)[0]
    case = Case(body(), look.trial, look.motion, body().sip.phi, np.linspace(0, 1, look.motion.time.size))
    one = effects()[name].at(target, case)
    assert not matters(one, np.array(small))
    assert matters(one, np.array(large))


def test_a_cause_within_any_tolerance_is_told_but_no_finding() -> None:
    one = diagnose_trials(body(), looks(1, hidden=offset(1.9)), tolerances=replace(known(), sizes={}), effects=FAST)
    assert one.diagnosis.verdict == "nothing wrong"
    assert one.diagnosis.findings == ()
    assert [finding.effect for finding in one.diagnosis.tolerated] == ["plate_offset"]
    limit = next(row for row in one.diagnosis.limits if (row.effect, row.target) == ("plate_offset", "Fx"))
    assert limit.limit >= least(effects()["plate_offset"].at("Fx", one.naming.first.problem.cases[0]))["offset"]


def test_an_alarm_must_matter_physically() -> None:
    small, large = (Adequacy("Mx", (0.0, 0.04), 12.0, size=size) for size in (0.9 * LEAST_MOMENT, 1.1 * LEAST_MOMENT))
    force = Adequacy("Fz", (0.0, 0.04), 5.0, size=1.1 * LEAST_FORCE)
    assert largest_z((small,)) == 0.0
    assert largest_z((small, force)) == 5.0
    assert largest_z((small, large)) == 12.0
    assert verdict(0, largest_z((small,)), ()) == "nothing wrong"
    assert verdict(1, largest_z((large,)), (Gate("x", True, ""),)) == "unexplained"


def test_the_size_of_what_is_left_is_in_newton() -> None:
    """A beat of 6 N amplitude, 4.2 N RMS, at 1.5 Hz that nothing describes is left in its band, in N."""

    def beaten(wrench, session, moving):
        return wrench + 6.0 * np.sin(2 * np.pi * 1.5 * moving.time)[:, None] * (np.arange(6) == 0)

    found, _ = build_model(
        problem(body(), looks(1, hidden=beaten), chosen=("plate_offset",)), known(), ("plate_offset",)
    )
    row = next(one for one in adequacy(found) if (one.channel, one.band_hz) == ("Fx", (1.0, 2.5)))
    assert row.size == pytest.approx(6.0 / np.sqrt(2), rel=0.15)
    assert row.unit == "N"


def test_identify_says_first_what_the_checks_of_the_recordings_found() -> None:
    gate = Gate("labels of the markers", False, "A and B carry each other's names in walk.", "labels_swapped", "A/B")
    full = full_session()
    first, *others = identified_attention(full, [gate])
    assert (first.level, first.about) == ("fail", ABOUT)
    assert first.text == "Found: labels swapped A/B. A and B carry each other's names in walk."
    assert ABOUT not in [one.about for one in others]
    assert identified_attention(full, []) == session_attention(full)

"""Sessions whose only fault is known: it is named with its size, nothing is named without one, and what no cause
describes is unexplained.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from diagnosed_sessions import body, delay, gain, known, nothing, offset, pull, windows
from inferred_sessions import inferred
from walking import session, standing, walk

from biodance.diagnosis.accept import accept, case_fit, gain_by_naming, residuals_of
from biodance.diagnosis.witness_evidence import collect_evidence
from biodance.effects import Case, Effect, Parameter
from biodance.errors import BiodanceError, TrialRefused, UnknownName
from biodance.identification.statistics import standing_point
from biodance.motion.dynamics import predict_wrench
from biodance.records import Sip, Wrench

FAST = (
    "plate_gain",
    "plate_offset",
    "plate_position",
    "plate_rotation",
    "time_delay",
    "body_mass",
    "added_mass",
    "plate_drift",
)
ZERO = np.array([15.0, 0.0, 0.0])
"""N that an empty plate reads."""


def found(hidden, *, seed: int = 1, chosen=FAST):
    return inferred(body(), windows(seed, hidden=hidden), tolerances=known(), effects=chosen)


@dataclass(frozen=True)
class Cable(Effect):
    """A cable pulls sideways in the beat of ``beat`` Hz, one metre over the lab's origin; an effect as a user writes
    it.
    """

    beat: float = 1.0
    name = "cable"
    parameters = (Parameter("pull", "N", 5.0, "a spring balance"),)

    def columns(self, case):
        force = np.sin(2 * np.pi * self.beat * case.motion.time)
        zero = np.zeros_like(force)
        return np.stack([zero, force, zero, -force, zero, zero], axis=1)[:, :, None]


@pytest.mark.parametrize("effects", [[Cable(beat=1.3), *FAST], [Cable(beat=1.3)]])
def test_a_users_own_effect_is_found_beside_the_family(effects) -> None:
    diagnosis = found(pull, chosen=effects).diagnosis
    (finding,) = diagnosis.findings
    assert (finding.effect, finding.target) == ("cable", "")
    assert finding.parameters[0].value == pytest.approx(8.0, rel=0.1)
    assert ("plate_gain", "Fz") in {(one.effect, one.target) for one in diagnosis.candidates}


@pytest.mark.parametrize("seed", [1, 2])
def test_without_fault_nothing_is_named(seed: int) -> None:
    diagnosis = found(nothing, seed=seed).diagnosis
    assert diagnosis.verdict == "nothing wrong"
    assert not diagnosis.findings


@pytest.mark.parametrize(
    ("hidden", "effect", "target", "parameter", "size"),
    [
        (gain(0.05), "plate_gain", "Fz", "gain", 0.05),
        (offset(12.0), "plate_offset", "Fx", "offset", 12.0),
        (delay, "time_delay", "", "delay", 0.02),
    ],
)
def test_a_hidden_fault_is_named_and_sized(hidden, effect, target, parameter, size) -> None:
    diagnosis = found(hidden).diagnosis
    assert diagnosis.verdict == "named, complete"
    (finding,) = diagnosis.findings
    assert (finding.effect, finding.target) == (effect, target)
    (estimate,) = finding.parameters
    assert estimate.name == parameter
    assert estimate.value == pytest.approx(size, rel=0.1)
    assert estimate.interval[0] < size * 1.02
    assert estimate.interval[1] > size * 0.98
    assert finding.probability > 0.99
    assert finding.log_bayes_factor > 10
    assert 0 < finding.visible_fraction <= 1


def test_the_size_told_holds_what_the_cause_s_own_tolerance_took() -> None:
    """Gains that differ by 1.5 % in every laboratory share 8 % with the name: told is what is there."""
    mine = replace(known(), sizes={**known().sizes, "plate_gain Fz": 0.015})
    found = inferred(body(), windows(2, hidden=gain(0.08)), tolerances=mine, effects=("plate_gain", "time_delay"))
    (cause,), (finding,) = found.best.causes, found.diagnosis.findings
    assert abs(cause.theta[0] - 0.08) > 1.5e-3
    assert finding.parameters[0].value == pytest.approx(0.08, rel=0.01)
    assert found.named[0].theta[0] == finding.parameters[0].value, "accepted as it is told"


def test_a_delay_is_told_whole_where_clocks_differ() -> None:
    """Clocks that differ by 3 ms in every laboratory take nothing of 20 ms: the tolerance holds for small delays."""
    mine = replace(known(), sizes={**known().sizes, "time_delay": 0.003})
    found = inferred(body(), windows(2, hidden=delay), tolerances=mine, effects=FAST)
    (cause,), (finding,) = found.best.causes, found.diagnosis.findings
    assert cause.theta[0] == pytest.approx(0.02, rel=0.01)
    assert found.named[0].theta[0] == finding.parameters[0].value, "accepted as it is told"


def test_two_faults_are_both_named() -> None:
    def both(wrench, session, moving):
        return delay(offset(12.0)(wrench, session, moving), session, moving)

    diagnosis = found(both).diagnosis
    assert {f.effect for f in diagnosis.findings} == {"plate_offset", "time_delay"}


def test_what_no_cause_describes_is_unexplained_and_located() -> None:
    diagnosis = found(knocked).diagnosis
    assert diagnosis.verdict == "unexplained"
    worst = diagnosis.adequacy[0]
    assert (worst.channel, worst.band_hz, worst.trial) == ("Fy", (2.5, 6.0), "t2")
    assert worst.second == pytest.approx(6.0, abs=1.0)


def test_an_absent_culprit_is_never_complete() -> None:
    diagnosis = found(delay, chosen=tuple(name for name in FAST if name != "time_delay")).diagnosis
    assert diagnosis.verdict in ("unexplained", "named, incomplete")


def test_a_load_is_named_with_mass_and_place() -> None:
    from biodance.identification.loads import compact_load

    index = body().segment_index("left_forearm_hand")
    place = body().sip.com[index] + [0.0, -0.05, 0.03]
    load = np.zeros(120)
    load[10 * index : 10 * index + 10] = 2.4 * compact_load(place)
    diagnosis = found(lambda wrench, session, moving: wrench + predict_wrench(body(), moving, load).value).diagnosis
    finding = diagnosis.findings[0]
    assert (finding.effect, finding.target) == ("added_mass", "left_forearm_hand")
    assert finding.parameters[0].value == pytest.approx(2.4, abs=0.35)


def test_accepting_a_fault_gains_on_trials_that_were_not_used() -> None:
    looked_at = windows(1, trials=6, hidden=gain(0.05))
    examined = inferred(body(), looked_at[:4], tolerances=known(), effects=FAST)
    bare = next(one for one in examined.posterior.hypotheses if not one.causes)
    kept = looked_at[4:]
    cases = [
        Case(
            body(),
            window.trial,
            window.motion,
            body().sip.phi,
            np.linspace(window.start, window.end, window.motion.time.size),
        )
        for window in kept
    ]
    as_is = tuple(case_fit(case, window.use) for case, window in zip(cases, kept, strict=True))
    mended = tuple(case_fit(accept(case, examined.named), window.use) for case, window in zip(cases, kept, strict=True))
    about = standing_point(as_is)
    before = residuals_of(identified(bare.phi), as_is, about)
    after = residuals_of(identified(examined.phi), mended, about)
    measured = gain_by_naming(before, after, fitted=(before, after))
    assert measured.proven
    assert measured.rms_after[2] < 0.6 * measured.rms_before[2]
    assert measured.score > 2 * measured.score_se > 0
    share = 1 - measured.rms_after / measured.rms_before
    assert ((measured.channels[:, 0] <= share + 1e-12) & (share <= measured.channels[:, 1] + 1e-12)).all()
    assert measured.channels[2, 0] > 0.9, "the channel with the fault"
    assert measured.ci95[0] > 0.5, "all channels, in units of what is left"


def identified(phi):
    return replace(body(), sip=Sip(body().sip.segments, phi, body().sip.covariance))


def test_a_gain_needs_three_blocks() -> None:
    window = windows(1, trials=1)[0]
    use = window.use & (window.motion.time < 1.5)
    fit = case_fit(
        Case(body(), window.trial, window.motion, body().sip.phi, np.linspace(0, 1, window.motion.time.size)), use
    )
    one = residuals_of(body(), (fit,), np.zeros(3))
    with pytest.raises(BiodanceError, match="needs 3"):
        gain_by_naming(one, one, fitted=(one, one))


def test_too_short_trials_are_refused() -> None:
    (window,) = windows(1, trials=1)
    short = replace(window, use=window.motion.time < 0.35)
    with pytest.raises(TrialRefused, match=r"0\.4 s of fully measured"):
        inferred(body(), (short,), tolerances=known())


@pytest.mark.parametrize(("hidden", "size"), [(nothing, 0.0), (offset(12.0), 12.0)])
def test_steps_over_one_plate_are_compared(hidden, size: float) -> None:
    """In walking the plates measure all of the ground for half a second at a time."""
    whole = windows(1, hidden=hidden)
    steps = tuple(replace(one, use=np.mod(one.motion.time, 1.2) < 0.5) for one in whole)
    named = inferred(body(), steps, tolerances=known(), effects=FAST).diagnosis.findings
    assert [(one.effect, one.target) for one in named] == [("plate_offset", "Fx")] * bool(size)
    for low, high in (one.parameters[0].interval for one in named):
        assert low <= size <= high


def test_a_zero_that_only_an_empty_plate_shows_is_named_beside_the_simulation() -> None:
    """It is taken off, so that the forces that are compared do not show it."""
    evidence = collect_evidence(session(standing(), walk(), walk(name="again")), FAST)
    seen = tuple(
        replace(one, value=one.value + 15.0) if one.what == "plate2 Fx, taken off" else one
        for one in evidence.observations
    )
    found = inferred(
        body(), tuple(map(two_plates, windows(1))), tolerances=known(), effects=FAST,
        evidence=replace(evidence, observations=seen),
    )  # fmt: skip
    assert ("plate_offset", "plate2:Fx") in {(one.effect, one.target) for one in found.diagnosis.findings}


def test_what_laboratories_have_is_known_without_a_name() -> None:
    """Eight milliseconds are no fault where laboratories differ by six, and may be taken off all the same."""
    usual = replace(known(), sizes={**known().sizes, "time_delay": 0.006})
    found = inferred(body(), windows(1, hidden=lambda *some: delay(*some, late=0.008)), tolerances=usual, effects=FAST)
    assert found.diagnosis.findings == ()
    (one,) = found.known_tolerances()
    assert (one.effect, one.parameters[0].value) == ("time_delay", pytest.approx(0.008, rel=0.05))
    assert 0.002 <= one.parameters[0].sd < 0.003, "no surer than careful laboratories are alike"
    assert inferred(body(), windows(1), tolerances=usual, effects=FAST).known_tolerances() == ()


def two_plates(window):
    """Return the window with a second plate, on which nobody stands, and the zeros of both taken off."""
    (one,) = window.trial.plates
    empty = replace(one, name="plate2", zero=ZERO, wrench=Wrench(one.wrench.time, np.zeros_like(one.wrench.value)))
    return replace(window, trial=replace(window.trial, plates=(replace(one, zero=ZERO), empty)))


def test_a_cause_that_is_not_in_the_family_is_refused() -> None:
    with pytest.raises(UnknownName, match="plate_gain"):
        inferred(body(), windows(1, trials=1), tolerances=known(), effects=("plate_gian",))


def knocked(wrench, session, moving):
    """Hide what no cause is like: for a second in the middle of the third trial, sideways and 4 times a second."""
    knock = 40.0 * np.sin(2 * np.pi * 4.0 * moving.time) * (np.abs(moving.time - 6.0) < 1.0)
    return wrench + knock[:, None] * (np.arange(6) == 1) * (session[0] == 0.5)


def test_limits_are_those_of_the_posterior_that_decides() -> None:
    """A named fault leaves them nearly as they are; beside an unknown cause a fault as small as they were is not named,
    and they say so.
    """
    clean, wrong, unknown = (
        {(row.effect, row.target): row.limit for row in found(hidden).diagnosis.limits}
        for hidden in (nothing, offset(12.0), knocked)
    )
    assert clean.keys() == wrong.keys() == unknown.keys()
    for key, limit in clean.items():
        assert limit == pytest.approx(wrong[key], rel=0.15), key
    usual, larger = (one["plate_gain", "Fz"] for one in (clean, unknown))
    assert larger > 1.5 * usual

    def both(share):
        return lambda wrench, session, moving: gain(share)(knocked(wrench, session, moving), session, moving)

    named = [[f.effect for f in found(both(share)).diagnosis.findings] for share in (1.1 * usual, 2 * larger)]
    assert named == [[], ["plate_gain"]]

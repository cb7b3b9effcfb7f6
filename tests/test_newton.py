"""Newton: the total force against the trunk, on sessions of other laboratories, and on squats without any error."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from two_plates import changed, late, session

from biodance.effects import Recorded
from biodance.effects.plate_offset import PlateOffset
from biodance.effects.plates_exchanged import PlatesExchanged
from biodance.effects.time_delay import TimeDelay
from biodance.lab.session.read import read_session
from biodance.motion.newton import newton_of
from biodance.observations import observe, recording
from biodance.pipeline.identification import WeighedBy, weigh, with_weighed_mass
from biodance.records import Session, Wrench

CLEAN = {
    "biomechzoo/HC030A": ("HC030A05", "HC030A22"),
    "biomechzoo/HC044A": ("HC044A15", "HC044A29"),
    "c3d_parser_QCMAS": ("QCMAS.dynamic",),
    "opensim_models/raj_walk": ("walk",),
    "rbds/S001": ("runT25",),
    "subject4": ("squats1", "walking1"),
}
"""Trials of six laboratories whose clocks are right."""


@cache
def recorded(folder: Path) -> Session:
    """Return a session, which nobody changes, read once."""
    return read_session(folder)


def told(trial, mass=float("nan")):
    return newton_of(trial, mass=mass)


def moved(trial, seconds):
    """Write a delay into a recording: every sample is what was recorded so much earlier."""
    plates = []
    for plate in trial.plates:
        count = round(seconds / float(np.median(np.diff(plate.wrench.time))))
        value = np.concatenate([np.repeat(plate.wrench.value[:1], count, axis=0), plate.wrench.value[:-count]])
        plates.append(replace(plate, wrench=Wrench(plate.wrench.time, value)))
    return replace(trial, plates=tuple(plates))


@pytest.mark.parametrize("folder", CLEAN)
def test_clean_recordings_go_with_the_trunk_to_within_12_ms(folder, data):
    one = recorded(data / folder)
    for name in CLEAN[folder]:
        found = told(one[name], one.subject.mass)
        assert abs(found.lag) < 0.012, name
        assert found.correlation > 0.85


def test_30_ms_written_in_are_seen_as_30(data):
    for folder in ("biomechzoo/HC044A", "c3d_parser_QCMAS", "subject4"):
        one = recorded(data / folder)
        trial = one[CLEAN[folder][0]]
        assert told(moved(trial, 0.03)).lag - told(trial).lag == pytest.approx(0.03, abs=0.002)


@pytest.mark.parametrize("folder", ["c3d_parser_FMC", "c3d_parser_Sydney"])
def test_half_a_step_names_no_large_delay(folder, data):
    """Less than 0.4 s on the plates, 0.2 to 0.4 s late: other bends of the force go with the trunk, 0.1 s early."""
    for trial in recorded(data / folder).trials:
        for seconds in (0.2, 0.3, 0.4):
            found = told(moved(trial, seconds))
            if found is not None and abs(found.lag) > 0.06:
                assert found.lag == pytest.approx(seconds, abs=0.02), (trial.name, seconds)


def test_a_chair_that_carries_along_says_by_itself_that_nothing_can_be_told(data):
    one = recorded(data / "subject4")
    for name in ("STS1", "STSAsym1", "STSweakLegs1"):
        found = told(one[name])
        assert found.correlation < 0.7
        assert np.isnan([found.lag, found.mass]).all()


def test_squats_weigh_what_the_plates_weigh_in_standing(data):
    one = recorded(data / "subject4")
    found = told(one["squats1"])
    assert found.mass == pytest.approx(60.05, abs=0.2)
    assert 0.1 < found.mass_sd < 0.3


def test_who_hardly_moves_shows_no_instant():
    found = told(session()["static"], 62.0)
    assert np.isnan(found.lag)
    assert found.mass == pytest.approx(62.0, abs=0.05)


def test_a_delay_is_read_between_the_lags_that_are_tried():
    here = told(session()["squat_1"]).lag
    for seconds in (0.001, 0.003, 0.013):  # by the top of the parabola through three correlations
        there = told(changed(session(), late(seconds))["squat_1"]).lag
        assert there - here == pytest.approx(seconds, abs=2e-4)


def test_the_witness_sees_a_delay_and_a_weight():
    seen = recording(changed(session(), late(0.03))["squat_1"], mass=62.0)
    lag, mass = (one for one in observe(seen) if one.observer == "newton")
    assert lag.value == pytest.approx(0.03, abs=0.002)
    assert mass.value == pytest.approx(62.0, abs=3 * mass.sd)


@pytest.mark.parametrize(
    ("folder", "mass", "by"),
    [
        ("rbds/S005", 56.1, WeighedBy.STRIDES),
        ("c3d_parser_FMC", 78.3, WeighedBy.STRIDES),
        ("c3d_parser_Sydney", 53.8, WeighedBy.STRIDES),
    ],
)
def test_strides_weigh_who_never_stands_still(folder, mass, by, data):
    """S005 is declared 60.0 and FMC 81.0 kg: both weigh less, by two speeds of a belt and by two walks."""
    found = weigh(recorded(data / folder), None)
    assert found.mass == pytest.approx(mass, abs=0.4)
    assert found.by is by
    assert 0.2 < found.sd < 0.6


def test_squats_alone_weigh_by_newton():
    found = weigh(replace(session(), trials=session().trials[1:]), None)
    assert found.by is WeighedBy.NEWTON
    assert found.mass == pytest.approx(62.0, abs=3 * found.sd)


def test_who_declared_no_mass_and_never_stands_still_is_weighed_while_moving():
    squats = replace(session(), trials=session().trials[1:])
    unknown = replace(squats, subject=replace(squats.subject, mass=float("nan"), guessed=("mass",)))
    found = with_weighed_mass(unknown)
    assert found.subject.mass == weigh(unknown, None).mass == pytest.approx(62.0, rel=0.02)
    assert "kg were weighed by the force against the trunk in" in found.notes[-1]
    assert with_weighed_mass(squats) is squats
    nobody = replace(unknown, trials=tuple(replace(one, plates=()) for one in unknown.trials))
    assert with_weighed_mass(nobody) is nobody


@pytest.mark.parametrize(("folder", "mass"), [("gait10", 72.6), ("raj_walk", 85.0), ("raj_run", 72.84)])
def test_real_people_without_a_mass_are_weighed(folder, mass, data):
    """A walk, another one, a run; the masses as their publishers give them, of raj_walk by the strides."""
    found = with_weighed_mass(recorded(data / "opensim_models" / folder)).subject
    assert found.mass == pytest.approx(mass, rel=0.006)
    assert "mass" in found.guessed


def test_every_flight_is_a_zero_of_every_channel(data):
    """S017: 38 N in the static trial and 19 N in every flight; S009: 15 N in every flight."""
    checks = PlateOffset.check(Recorded(recorded(data / "rbds/S017")))
    found = {(one.target, one.trials): one.size for one in checks if not one.ok}
    assert found[("Fy", ("runT25", "runT35"))] == pytest.approx(-19, abs=1)
    assert found[("Fy", ("static",))] == pytest.approx(-38, abs=1)
    assert len(found) == 2
    (nine,) = (one for one in PlateOffset.check(Recorded(recorded(data / "rbds/S009"))) if not one.ok)
    assert (nine.target, nine.size) == ("Fy", pytest.approx(15.5, abs=1.5))


def test_what_is_taken_off_leaves_flights_at_zero(data):
    one = recorded(data / "rbds/S017")
    failed = next(check for check in PlateOffset.check(Recorded(one)) if not check.ok and "runT25" in check.trials)
    right = replace(one, trials=tuple(PlateOffset.undone(trial, failed) for trial in one.trials))
    assert all("runT25" not in check.trials for check in PlateOffset.check(Recorded(right)) if not check.ok)


@pytest.mark.parametrize("folder", ["rbds/S001", "subject4", "opensim_models/raj_run"])
def test_plates_that_read_zero_are_not_accused(folder, data):
    assert all(check.ok for check in PlateOffset.check(Recorded(recorded(data / folder))))


@pytest.mark.parametrize("folder", ["biomechzoo/HC030A", "c3d_parser_FMC", "gaitalytics", "pycgm"])
def test_no_clean_recording_is_late_or_has_exchanged_plates(folder, data):
    seen = Recorded(recorded(data / folder))
    assert all(check.ok for check in (*TimeDelay.check(seen), *PlatesExchanged.check(seen)))

"""What each observer sees of a trial: steps, pressure in the foot, clocks, weights, empty plates."""

import json
from dataclasses import replace

import numpy as np
import pytest
from inferred_sessions import heard
from walkers import WEIGHT, Stand, plate, walker
from walking import FOOT, MASS, Wrong, place, session, standing, walk

from biodance.diagnosis.witness_evidence import collect_evidence
from biodance.lab.markers.sets import GUESSED
from biodance.observations import (
    Observation,
    observe,
    recording,
    sensitivities,
)
from biodance.records import SIDES, Trial, Wrench


def seen(trial: Trial, observer: str, mass: float = MASS) -> dict[str, Observation]:
    return {one.what: one for one in observe(recording(trial, mass=mass), [observer])}


def values(trial: Trial, observer: str, ending: str = "") -> list[float]:
    return [one.value for what, one in seen(trial, observer).items() if what.endswith(ending)]


def test_steps_are_found_from_markers_whatever_the_plates_say() -> None:
    for wrong in (Wrong(), Wrong(late=0.03), Wrong(moved=(0, 0.02)), Wrong(signs=(-1, -1, 1, -1, -1, -1))):
        steps = recording(walk(wrong)).steps
        assert [(step.side, step.plate, step.heel_first) for step in steps] == [
            ("right", "plate1", True),
            ("left", "plate2", True),
        ]


def test_a_foot_half_beside_its_plate_is_no_step() -> None:
    trial = walk()
    near = [replace(plate, corners=plate.corners + np.array([0.27, 0, 0])) for plate in trial.plates]
    assert recording(replace(trial, plates=tuple(near))).steps == ()


def test_two_feet_on_one_plate_are_no_step() -> None:
    trial = walk()
    wide = replace(trial.plates[0], corners=trial.plates[0].corners * [4, 4, 0] - [1.5, 0, 0])
    assert not [step for step in recording(replace(trial, plates=(wide,))).steps if step.side == "left"]


def test_pressure_in_the_foot_is_where_it_was_put() -> None:
    found = walk(outwards=0.007)
    np.testing.assert_allclose(values(found, "foot_across"), 0.007, atol=1e-4)
    early = np.array(values(found, "foot_along", "early"))
    np.testing.assert_allclose(early, FOOT * (0.22 + 0.73 * 0.07), atol=0.002)
    np.testing.assert_allclose(values(found, "foot_along", "late"), FOOT * (0.22 + 0.73 * 0.86), atol=0.002)
    assert values(found, "foot_outline") == [0.0, 0.0]
    np.testing.assert_allclose(values(found, "sides"), 0.0, atol=1e-4)


def test_a_moved_plate_moves_the_pressure_in_its_foot_only() -> None:
    right, left = values(walk(Wrong(moved=(0.0, 0.02))), "foot_across", "early")
    assert right == pytest.approx(-0.02, abs=1e-3)
    assert left == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("observer", ["force_onset", "force_end"])
def test_clocks_run_late_by_what_was_made(observer: str) -> None:
    before, after = (np.array(values(walk(Wrong(late=late)), observer)) for late in (0.0, 0.03))
    assert len(before) == 2
    np.testing.assert_allclose(after - before, 0.03, atol=0.0015)
    if observer == "force_onset":
        np.testing.assert_allclose(before, 0.0, atol=0.006)
    else:
        np.testing.assert_allclose(before, -0.025, atol=0.01)


@pytest.mark.parametrize("observer", ["force_onset", "force_end", "foot_across"])
def test_a_foot_that_is_lifted_and_put_down_in_place_is_no_step(observer: str) -> None:
    """As in a stand on one leg: what its markers do most is anywhere, and the pressure lies where balance needs it."""
    trial = walk()
    xyz, time = np.array(trial.markers.xyz), trial.markers.time
    for name, x in (("RHEE", place("right")[0]), ("RTOE", place("right")[0] + FOOT)):
        xyz[:, trial.markers.names.index(name), 0] = x + 0.01 * np.sin(2 * np.pi * 3.3 * time)
    lifted = replace(trial, markers=replace(trial.markers, xyz=xyz))
    assert [step.side for step in recording(lifted).steps] == ["right", "left"]
    assert {what.split()[0] for what in seen(trial, observer)} == {"right", "left"}
    assert {what.split()[0] for what in seen(lifted, observer)} == {"left"}


def test_strides_weigh_the_person_and_each_plate() -> None:
    whole = [
        one.value for what, one in seen(walk(), "stride_force").items() if "step from" in what and one.unit == "kg"
    ]
    assert whole == [pytest.approx(MASS, rel=0.004)]
    alone, other = values(walk(Wrong(gain=0.05)), "stride_force", "alone")
    clean, same = values(walk(), "stride_force", "alone")
    assert alone / clean == pytest.approx(1.05, abs=1e-6)
    assert other == pytest.approx(same)
    assert values(walk(Wrong(gain=0.05)), "double_support")[0] == pytest.approx(0.05 * clean + clean - same, abs=0.01)


def test_a_foot_beside_another_that_stands_on_a_plate_weighs_nobody() -> None:
    """Half of the weight is on the other plate all the time: neither foot is alone."""
    made = walk()
    ground = [replace(plate, wrench=Wrench(plate.wrench.time, plate.wrench.value + 300.0 * np.eye(6)[2])) for plate in
              made.plates[1:]]  # fmt: skip
    assert len(values(made, "stride_force", "alone")) == 2
    assert len(values(replace(made, plates=(made.plates[0], *ground)), "stride_force", "alone")) < 2


def test_shear_brakes_first_and_pushes_then() -> None:
    trial = seen(walk(), "shear")
    braking, pushing = (
        [one.value for what, one in trial.items() if what.endswith(end)] for end in ("braking", "pushing")
    )
    assert max(braking) < 0 < min(pushing)
    slant = [one.value for what, one in trial.items() if what.endswith("slant")]
    np.testing.assert_allclose(slant, 0.0, atol=1e-6)


def test_standing_weighs_pushes_and_lies_under_the_pelvis() -> None:
    found = seen(standing(push=4.0, weight=62.0), "standing_force")
    assert found["mass"].value == pytest.approx(62.0)
    assert found["mean Fx"].value == pytest.approx(4.0)
    assert found["mean Fy"].value == pytest.approx(0.0)
    np.testing.assert_allclose(values(standing(), "standing_place"), 0.0, atol=1e-9)


def test_a_plate_that_is_not_under_the_person_tells_no_place() -> None:
    """Exchanged plates of a real laboratory: 0.75 m aside, of which 0.07 m ahead were named as the shift of a plate."""
    near = values(standing(Wrong(moved=(0.07, 0.0))), "standing_place")
    assert sorted(map(abs, near)) == pytest.approx([0.0, 0.07])
    assert values(standing(Wrong(moved=(0.07, 0.75))), "standing_place") == []


def test_empty_plates_tell_what_was_taken_off() -> None:
    found = seen(walk(Wrong(zero=(3.0, -2.0, 12.0))), "empty_plate")
    assert [found[f"plate1 {c}, taken off"].value for c in ("Fx", "Fy", "Fz")] == [3.0, -2.0, 12.0]
    assert found["plate2 Fz, after less before"].value == pytest.approx(0.0)


def lifted(fall: float) -> Trial:
    """Return a walk with both feet 0.3 m up for 0.3 s at its end, of a body that falls with so many m/s² then; Fy of
    plate1 reads 7 N.
    """
    trial = walk()
    up, late = np.array(trial.markers.xyz), trial.markers.time - 2.45
    frames = np.abs(late) < 0.15
    up[frames, :, 2] -= fall / 2 * late[frames, None] ** 2
    feet = [trial.markers.names.index(name) for name in ("LHEE", "RHEE", "LTOE", "RTOE")]
    up[np.ix_(frames, feet, [2])] = 0.3 - fall / 2 * late[frames, None, None] ** 2
    left = np.array(trial.plates[0].wrench.value)
    left[trial.plates[0].wrench.time > 2.2, 1] = 7.0
    plate = replace(trial.plates[0], wrench=replace(trial.plates[0].wrench, value=left))
    return replace(trial, markers=replace(trial.markers, xyz=up), plates=(plate, trial.plates[1]))


def test_flight_reads_what_a_plate_leaves() -> None:
    found = seen(lifted(9.8), "flight")
    assert found["plate1 Fy in flight"].value == pytest.approx(7.0)
    assert found["plate2 Fz in flight"].value == pytest.approx(0.0)


def test_who_sits_and_lifts_both_feet_does_not_fly() -> None:
    assert not seen(lifted(0.0), "flight"), "a stool on the plates read 700 N in its flight"


@pytest.mark.parametrize(
    ("names", "parameter", "small", "size"),
    [
        (("plate_position", "plate1:y"), "shift", Wrong(moved=(0, 0.01)), 0.01),
        (("plate_gain", "plate1:Fz"), "gain", Wrong(gain=0.02), 0.02),
        (("time_delay", ""), "delay", Wrong(late=0.005), 0.005),
        (("plate_offset", "plate1:Fx"), "offset", Wrong(zero=(6, 0, 0)), 6.0),
    ],
)
def test_sensitivities_are_what_a_recording_made_wrong_shows(
    names: tuple[str, str], parameter: str, small: Wrong, size: float
) -> None:
    here = recording(walk(), mass=MASS)
    found = observe(here)
    made = {one.key: one.value - one.expected for one in observe(replace(here, trial=walk(small)))}
    change = np.array([made[one.key] - one.value + one.expected for one in found])
    if names[0] == "plate_offset":  # made on both plates
        change = np.where([one.plate == "plate2" for one in found], 0.0, change)
    assert np.abs(change).max() > 0
    sd = np.array([one.sd for one in found])
    np.testing.assert_allclose(size * sensitivities(here, found, *names, parameter) / sd, change / sd, atol=0.2)


def test_a_toe_marker_at_one_edge_says_nothing_of_the_plate_s_place() -> None:
    trial = walk()
    for toe, counts in (("toe", True), ("toe_lateral", False)):
        places = {"HEE": "heel", "TOE": toe}
        given = {side[0].upper() + label: f"{side}_{place}" for side in SIDES for label, place in places.items()}
        found = observe(
            recording(replace(trial, marker_set=GUESSED + json.dumps(given)), mass=MASS), ["foot_across", "foot_along"]
        )
        assert {one.counts for one in found} == {counts}


def test_an_unknown_mass_and_missing_feet_are_silence_not_an_error() -> None:
    evidence = collect_evidence(session(walk(), mass=float("nan")))
    assert "stride_force" not in {one.observer for one in evidence.observations}
    trial = walk()
    bare = replace(trial, markers=trial.markers.select(["SACR"]))
    assert {one.observer for one in observe(recording(bare, mass=MASS))} == {"empty_plate"}
    assert heard(session(replace(bare, markers=None))).diagnosis.findings == ()


def test_a_foot_across_two_belts_is_judged_by_both_together() -> None:
    """One foot stands 60 % on one belt and 40 % on the next while the other one swings."""
    belts = [plate("plate1", (0.0, 0.5), (-0.5, 0.5)), plate("plate2", (-0.5, 0.0), (-0.5, 0.5))]
    turned = np.pi / 2
    right = [Stand(0.0, 0.3, (0.02, -0.5, 0.0), turned), Stand(0.7, 1.5, (0.02, 0.0, 0.0), turned),
             Stand(1.9, 2.5, (0.02, 0.5, 0.0), turned)]  # fmt: skip
    left = [Stand(0.0, 0.8, (-0.12, -0.2, 0.0), turned), Stand(1.4, 2.5, (-0.12, 0.3, 0.0), turned)]
    trial, *_ = walker(right, left, belts, duration=2.5)
    shares = {"plate1": 0.6, "plate2": 0.4}
    whole = sum(one.wrench.value for one in trial.plates)
    here = (trial.plates[0].wrench.time >= 0.7) & (trial.plates[0].wrench.time <= 1.5)
    shared = tuple(
        replace(one, wrench=Wrench(one.wrench.time, np.where(here[:, None], shares[one.name] * whole, 0.0)))
        for one in trial.plates
    )
    seen = recording(replace(trial, plates=shared), mass=WEIGHT / 9.80665)
    step = next(one for one in seen.steps if one.side == "right" and 0.7 < one.middle < 1.5)
    assert {step.plate, *step.beside} == {"plate1", "plate2"}
    assert step.overhang == 0.0
    middle = (seen.plate(step.plate).wrench.time > 0.9) & (seen.plate(step.plate).wrench.time < 1.3)
    np.testing.assert_allclose(sum(seen.under(step, middle).values())[:, 2], WEIGHT, rtol=1e-9)

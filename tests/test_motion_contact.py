"""Ground contact of constructed trials whose truth is known, and of real ones."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from walkers import WEIGHT, Stand, plate, walker

from biodance.body.human.human import human
from biodance.errors import BiodanceError, TrialRefused
from biodance.lab.markers.sets import read_marker_set
from biodance.lab.prepare import prepare
from biodance.lab.session.read import read_session
from biodance.motion.contact import foot_wrenches, ground_contact
from biodance.motion.soles import Soles, soles_from_body, soles_from_markers
from biodance.records import Markers, Motion, Subject, Wrench

MASS = WEIGHT / 9.80665
TWO = [plate("plate1", (0.0, 0.5), (-0.3, 0.3)), plate("plate2", (0.5, 1.0), (-0.3, 0.3))]


def walk(gap: float = 0.0) -> tuple:
    """Return floor, plate1, plate2, floor, floor as in level walking; plate2 begins ``gap`` m behind plate1."""
    plates = [TWO[0], plate("plate2", (0.5 + gap, 1.0 + gap), (-0.3, 0.3))]
    right = [Stand(0.0, 0.7, (-0.5, -0.1, 0)), Stand(1.1, 1.8, (0.58 + gap, -0.1, 0)), Stand(2.2, 3.0, (1.6, -0.1, 0))]
    left = [Stand(0.0, 0.2, (-1.0, 0.1, 0)), Stand(0.6, 1.25, (0.05, 0.1, 0)), Stand(1.7, 3.0, (1.2, 0.1, 0))]
    return walker(right, left, plates, duration=3.0)


def test_walking_over_two_plates_leaves_only_frames_on_the_plates() -> None:
    trial, soles, true, carried = walk()
    contact = ground_contact(trial, soles, mass=MASS)
    unmeasured = (true & ~carried).any(axis=1) | ~true.any(axis=1)
    assert not (contact.measured & unmeasured).any()
    assert contact.measured.sum() > 0.75 * (~unmeasured).sum()
    assert np.all(contact.touching[true])
    assert contact.notes[0] == f"{contact.measured.sum()} of 301 frames are fully measured by the plates."
    assert any("the right foot may touch the ground beside the plates" in note for note in contact.notes)


def test_centres_of_pressure_are_inside_the_feet_and_a_mirrored_plate_is_noticed() -> None:
    trial, soles, *_ = walk()
    contact = ground_contact(trial, soles)
    known = contact.cop_outside[~np.isnan(contact.cop_outside)]
    assert known.size > 50
    assert known.max() == 0
    value = trial.plates[0].wrench.value.copy()
    middle = np.cross(trial.plates[0].centre, value[:, :3])
    value[:, 3:] = middle - (value[:, 3:] - middle)
    mirrored = replace(trial, plates=(replace(trial.plates[0], wrench=Wrench(soles.time, value)), trial.plates[1]))
    notes = ground_contact(mirrored, soles).notes
    assert any("plate1: the centre of pressure lies" in note and "outside the foot" in note for note in notes)


@pytest.mark.parametrize(("gap", "measured"), [(0.0, True), (0.07, False)])
def test_a_foot_across_two_plates_is_measured_if_there_is_no_gap(gap: float, measured: bool) -> None:
    plates = [TWO[0], plate("plate2", (0.5 + gap, 1.0 + gap), (-0.3, 0.3))]
    trial, soles, *_ = walker([Stand(0, 1, (0.42, -0.1, 0))], [Stand(0, 1, (0.1, 0.1, 0))], plates, duration=1.0)
    assert ground_contact(trial, soles).measured.all() == measured


@pytest.mark.parametrize(("heel", "measured"), [(0.1, True), (0.2, True), (0.3, False), (-0.1, False)])
def test_a_foot_half_on_the_edge_is_not_measured(heel: float, measured: bool) -> None:
    trial, soles, *_ = walker([Stand(0, 1, (heel, -0.1, 0))], [Stand(0, 1, (0.1, 0.1, 0))], TWO[:1], duration=1.0)
    contact = ground_contact(trial, soles)
    assert contact.measured.all() == measured
    assert any("right foot may stand partly" in note for note in contact.notes) != measured
    beyond = 1000 * max(0.0 - soles.outline[0, 0, :, 0].min(), soles.outline[0, 0, :, 0].max() - 0.5)
    said = f"the right foot reaches {beyond:.0f} mm beyond their edge"
    assert any(said in note for note in contact.notes) != measured


@pytest.mark.parametrize(
    ("moved", "bears", "seated"),
    [((0.0, 0.0, 0.10), 1.0, True), ((0.0, 0.0, 0.10), 0.8, False), ((0.0, 0.0, 0.0), 1.0, False),
     ((-0.4, 0.0, 0.10), 1.0, False)],
    ids=["feet hang", "something else carries, too", "feet are down", "the load is under the feet"],
)  # fmt: skip
def test_who_sits_on_the_plate_is_fully_measured(moved: tuple, bears: float, seated: bool) -> None:
    plates = [plate("plate1", (-0.6, 0.4), (-0.3, 0.3))]
    trial, soles, *_ = walker([Stand(0, 2, (-0.1, -0.1, 0))], [Stand(0, 2, (-0.1, 0.1, 0))], plates, duration=2.0)
    value, ahead = bears * trial.plates[0].wrench.value, np.array([0.5, 0.0, 0.0])
    there = replace(trial, plates=(replace(trial.plates[0], wrench=Wrench(soles.time, value)),))
    feet = Soles(soles.time, soles.outline + ahead + moved)
    contact = ground_contact(there, feet, mass=MASS)
    assert contact.seated.all() == contact.seated.any() == seated
    assert contact.measured.all() == (seated or moved[0] < 0)
    if seated:
        assert not contact.touching.any()
        assert contact.told.all()
        assert any("sits on something that stands on the plates in 201 of 201 frames" in one for one in contact.notes)
        assert all(not one.value.any() for one in foot_wrenches(there, contact, feet).values())
    assert not ground_contact(there, feet).seated.any()  # of unknown weight


def on_a_belt(speed: float) -> tuple:
    """Return a walk over one long plate, everything carried backwards by its belt at ``speed`` m/s."""
    long = [plate("plate1", (-3.0, 6.0), (-0.3, 0.3))]
    right = [Stand(k, k + 0.6, (1.2 * k, -0.1, 0)) for k in range(4)]
    left = [Stand(0.0, 0.1, (-0.6, 0.1, 0)), *(Stand(k + 0.5, k + 1.1, (1.2 * k + 0.6, 0.1, 0)) for k in range(4))]
    trial, _, true, _ = walker(right, left, long, duration=3.5)
    time, back = trial.markers.time, speed * trial.markers.time[:, None] * np.array([-1.0, 0, 0])
    force = trial.plates[0].wrench.value[:, :3]
    value = trial.plates[0].wrench.value + np.hstack([0 * force, np.cross(back, force)])
    trial = replace(
        trial,
        markers=Markers(trial.markers.names, time, trial.markers.xyz + back[:, None]),
        plates=(replace(trial.plates[0], wrench=Wrench(time, value)),),
    )
    return trial, soles_from_markers(trial.markers, read_marker_set("plug_in_gait")), true


def test_soles_that_move_with_a_belt_stand_on_it() -> None:
    trial, soles, true = on_a_belt(1.2)
    contact = ground_contact(trial, soles, mass=MASS)
    assert np.all(contact.touching[true])
    assert contact.measured[true.any(axis=1)].mean() > 0.97
    assert contact.touching.mean() < true.mean() + 0.25  # swings are still seen
    said = next(note for note in contact.notes if "a belt" in note)
    assert float(said.split(" at ")[1].split()[0]) == pytest.approx(1.2, abs=0.01)
    assert not any("a belt" in note for note in ground_contact(*on_a_belt(0.0)[:2], mass=MASS).notes)


def on_split_belts(right: float, left: float, *, placed: bool) -> tuple:
    """Return a walk on the spot over two belts of ``right`` and ``left`` m/s: a foot on each. With plates that are not
    ``placed``, rectangles drawn round their pressures overlap, as those of the columns of a .mot do.
    """
    two = [plate("plate1", (-3.0, 6.0), (-0.3, 0.0)), plate("plate2", (-3.0, 6.0), (0.0, 0.3))]
    rights = [Stand(k, k + 0.6, (right * k, -0.1, 0)) for k in range(4)]
    lefts = [Stand(0.0, 0.1, (-0.5 * left, 0.1, 0))]
    lefts += [Stand(k + 0.5, k + 1.1, (left * (k + 0.5), 0.1, 0)) for k in range(4)]
    trial, _, true, _ = walker(rights, lefts, two, duration=3.5)
    time, xyz, plates = trial.markers.time, trial.markers.xyz.copy(), []
    for name, one, speed in zip("RL", trial.plates, (right, left), strict=True):
        back = speed * time[:, None] * np.array([-1.0, 0, 0])
        own = [label.startswith(name) for label in trial.markers.names]
        xyz[:, own] += back[:, None]
        value = one.wrench.value + np.hstack([0 * back, np.cross(back, one.wrench.force)])
        wider = np.array([[0.0, 0.2, 0.0], [0.0, 0.2, 0.0], [0.0, -0.2, 0.0], [0.0, -0.2, 0.0]])
        corners = one.corners if placed else np.clip(one.corners, -0.5, 0.8) + wider
        plates.append(replace(one, wrench=Wrench(time, value), corners=corners, placed=placed))
    trial = replace(trial, markers=Markers(trial.markers.names, time, xyz), plates=tuple(plates))
    return trial, soles_from_markers(trial.markers, read_marker_set("plug_in_gait")), true


@pytest.mark.parametrize("placed", [True, False])
@pytest.mark.parametrize(("right", "left"), [(1.2, 1.2), (1.2, 0.6)])
def test_a_split_belt_is_taken_off_once_and_by_the_plate_under_the_foot(
    right: float, left: float, placed: bool
) -> None:
    trial, soles, true = on_split_belts(right, left, placed=placed)
    contact = ground_contact(trial, soles, mass=MASS)
    said = [float(note.split(" at ")[1].split()[0]) for note in contact.notes if "a belt" in note]
    assert said == pytest.approx([right, left], abs=0.02)
    assert np.all(contact.touching[true])
    assert contact.touching.mean() < true.mean() + 0.25  # swings are still seen
    assert contact.measured.mean() > 0.94  # taken off twice: 0.0 and 0.56; a made swing starts too slowly
    assert (contact.on_plate.any(axis=0).sum(axis=0) > 0).all()
    on = contact.on_plate[true.all(axis=1)]
    assert on[:, 0, 0].all()
    assert on[:, 1, 1].all()
    assert not on[:, 0, 1].any()
    assert not on[:, 1, 0].any()


def test_nothing_is_lost_of_a_walk_on_a_real_split_belt(data: Path) -> None:
    """Gait2354's subject01 on two belts at 1.15 m/s, whose rectangles overlap: 151 frames; taken off twice, a standing
    foot moves at 1.15 m/s.
    """
    session = read_session(data / "opensim_models" / "gait10")
    trial = prepare(next(one for one in session.trials if one.plates))
    soles = soles_from_markers(trial.markers, read_marker_set(trial.marker_set))
    contact = ground_contact(trial, soles, mass=72.6)
    assert contact.measured.sum() == 151
    assert sum("at 1.1" in note for note in contact.notes) == 2


@pytest.mark.parametrize("name", ["runT25", "runT35"])
def test_flights_of_a_runner_marked_on_the_legs_alone_are_measured(name: str, data: Path) -> None:
    """A quarter of this run nobody touches the belt; the mean of markers on legs that swing falls at 0.1 to 0.6 g, the
    pelvis at 1.0 to 1.1.
    """
    session = read_session(data / "rbds" / "S001")
    trial = prepare(next(one for one in session.trials if one.name == name))
    soles = soles_from_markers(trial.markers, read_marker_set(trial.marker_set))
    contact = ground_contact(trial, soles, mass=70.0)
    unloaded = trial.wrench.force[:, 2] < 50.0
    assert 0.2 < unloaded.mean() < 0.4
    assert contact.measured.mean() > 0.99


@pytest.mark.parametrize(("falls", "measured"), [(1.0, True), (0.0, False)])
def test_a_flight_is_measured_where_the_markers_fall_freely(falls: float, measured: bool) -> None:
    floor = [plate("plate1", (-1.0, 3.0), (-0.3, 0.3))]
    right = [Stand(0.0, 0.4, (0.0, -0.1, 0)), Stand(0.9, 1.2, (1.4, -0.1, 0))]
    left = [Stand(0.0, 0.3, (0.0, 0.1, 0)), Stand(0.8, 1.2, (1.2, 0.1, 0))]
    trial, soles, true, _ = walker(right, left, floor, duration=1.2)
    time = trial.markers.time
    body = np.zeros((time.size, 30, 3)) + np.array([0.5, 0.0, 1.0])
    body[..., 2] -= falls * (9.81 / 2 * np.clip(np.abs(time - 0.6), 0, 0.22) ** 2)[:, None]
    names = (*trial.markers.names, *(f"B{i}" for i in range(30)))
    markers = Markers(names, time, np.concatenate([trial.markers.xyz, body], axis=1))
    contact = ground_contact(replace(trial, markers=markers), soles, mass=MASS)
    airborne = np.logical_not(contact.touching.any(axis=1))
    assert airborne.sum() > 8
    assert not airborne[true.any(axis=1)].any()
    assert contact.measured[airborne].all() == measured
    assert contact.measured[airborne].any() == measured


@pytest.mark.parametrize(("share", "measured"), [(1.0, True), (0.64, False), (0.9, True), (0.4536, True)])
def test_a_chair_that_carries_a_third_is_not_fully_measured(share: float, measured: bool) -> None:
    trial, soles, *_ = walker([Stand(0, 2, (0.1, -0.1, 0))], [Stand(0, 2, (0.1, 0.1, 0))], TWO[:1], duration=2.0)
    time = trial.markers.time
    part = np.where(time < 1.0, share, 1.0)[:, None] if share != 0.4536 else np.full((time.size, 1), share)
    seated = replace(
        trial, plates=(replace(trial.plates[0], wrench=Wrench(time, part * trial.plates[0].wrench.value)),)
    )
    contact = ground_contact(seated, soles, mass=MASS)
    assert contact.measured[time < 0.99].all() == measured
    assert contact.measured[time > 1.01].all()
    assert any("a chair or a hand" in note for note in contact.notes) != measured


def test_plates_of_unknown_place_measure_the_feet_over_their_pressure() -> None:
    trial, soles, true, carried = walk()
    somewhere = tuple(
        replace(one, corners=one.corners + np.array([0.2, 0.0, 0.0]), placed=False) for one in trial.plates
    )
    contact = ground_contact(replace(trial, plates=somewhere), soles, mass=MASS)
    unmeasured = (true & ~carried).any(axis=1) | ~true.any(axis=1)
    assert not (contact.measured & unmeasured).any()
    assert contact.measured.sum() > 0.6 * (~unmeasured).sum()
    assert any("seen only by the weight that is lacking" in note for note in contact.notes)


def test_stairs_hang_over_the_edges_of_raised_plates() -> None:
    steps = [plate(f"plate{i + 1}", (0.3 * i, 0.3 * (i + 1)), (-0.3, 0.3), 0.19 * (i + 1)) for i in range(3)]
    right = [Stand(0.0, 1.0, (-0.6, -0.1, 0)), Stand(1.4, 2.6, (0.33, -0.1, 0.38)), Stand(3.0, 4.0, (1.0, -0.1, 0.76))]
    left = [
        Stand(0.0, 0.2, (-0.9, 0.1, 0)),
        Stand(0.6, 1.8, (0.1, 0.1, 0.19)),
        Stand(2.2, 3.4, (0.62, 0.1, 0.57)),
        Stand(3.8, 4.0, (1.1, 0.1, 0.76)),
    ]
    trial, soles, true, carried = walker(right, left, steps, duration=4.0)
    contact = ground_contact(trial, soles, mass=MASS)
    unmeasured = (true & ~carried).any(axis=1) | ~true.any(axis=1)
    assert not (contact.measured & unmeasured).any()
    assert contact.measured.sum() > 0.75 * (~unmeasured).sum()
    assert any("on a surface at 0.76 m" in note for note in contact.notes)


def one_leg(air: tuple[str, ...]) -> tuple:
    right = [Stand(0, 3, (0.1, -0.1, 0))]
    left = [Stand(0, 0.5, (0.1, 0.1, 0)), Stand(1.2, 2.0, (-0.4, 0.2, 0.35)), Stand(2.6, 3.0, (0.1, 0.1, 0))]
    trial, soles, *_ = walker(right, left, TWO[:1], duration=3.0)
    if air:
        force = np.tile(trial.plates[0].wrench.value[:1], (301, 1))
        force[:, 2] = WEIGHT
        held = replace(trial, plates=(replace(trial.plates[0], wrench=Wrench(soles.time, force)),))
        return held, soles
    return trial, soles


def test_a_foot_held_in_the_air_is_told_from_a_foot_on_a_box_by_the_weight() -> None:
    held = slice(125, 195)
    trial, soles = one_leg(("left",))
    contact = ground_contact(trial, soles, mass=MASS)
    assert contact.measured.all()
    assert "The left foot rests in the air (1 time): the plates carry the weight meanwhile." in contact.notes
    assert not ground_contact(trial, soles).measured[held].any()
    trial, soles = one_leg(())
    boxed = ground_contact(trial, soles, mass=MASS)
    assert not boxed.measured[held].any()
    assert boxed.measured[:40].all()
    assert any("on a surface at 0.35 m" in note for note in boxed.notes)


def test_a_plate_that_reads_nothing_is_not_trusted() -> None:
    trial, soles, *_ = walk()
    dead = replace(trial.plates[1], wrench=Wrench(soles.time, np.zeros((301, 6))))
    contact = ground_contact(replace(trial, plates=(trial.plates[0], dead)), soles, mass=MASS)
    assert not contact.measured[112:180].any()
    assert any("plate2, which reads nothing" in note or "no plate is loaded" in note for note in contact.notes)


def test_a_plate_loaded_by_nobody_is_not_trusted() -> None:
    trial, soles, *_ = walker([Stand(0, 1, (0.1, -0.1, 0))], [Stand(0, 1, (0.1, 0.1, 0))], TWO, duration=1.0)
    other = replace(trial.plates[1], wrench=trial.plates[0].wrench)
    contact = ground_contact(replace(trial, plates=(trial.plates[0], other)), soles)
    assert not contact.measured.any()
    assert any("plate2 is loaded but no foot is over it" in note for note in contact.notes)


def test_unseen_feet_and_unknown_forces_are_left_out() -> None:
    trial, soles, *_ = walker([Stand(0, 1, (0.1, -0.1, 0))], [Stand(0, 1, (0.1, 0.1, 0))], TWO[:1], duration=1.0)
    outline = soles.outline.copy()
    outline[20:30, 1] = np.nan
    contact = ground_contact(trial, Soles(soles.time, outline))
    assert np.flatnonzero(~contact.measured).tolist() == list(range(20, 30))
    assert "Left out, 10 of 101: the left foot was not seen." in contact.notes
    value = trial.plates[0].wrench.value.copy()
    value[50] = np.nan
    unknown = replace(trial, plates=(replace(trial.plates[0], wrench=Wrench(soles.time, value)),))
    assert 50 in np.flatnonzero(~ground_contact(unknown, soles).measured)


def test_a_single_frame_is_enough() -> None:
    trial, soles, *_ = walker([Stand(0, 0, (0.1, -0.1, 0))], [Stand(0, 0, (0.1, 0.1, 0))], TWO[:1], duration=0.0)
    assert ground_contact(trial, soles).measured.tolist() == [True]


def test_what_cannot_be_done_is_refused() -> None:
    trial, soles, *_ = walk()
    with pytest.raises(TrialRefused, match="no force plate"):
        ground_contact(replace(trial, plates=()), soles)
    with pytest.raises(BiodanceError, match="Prepare the trial first"):
        ground_contact(trial, Soles(soles.time[:50], soles.outline[:50]))
    with pytest.raises(TrialRefused, match="left foot has no heel or no toe"):
        soles_from_markers(trial.markers.select(("RHEE", "RTOE", "LHEE")), read_marker_set("plug_in_gait"))


def test_the_feet_share_what_the_plates_measure() -> None:
    trial, soles, *_ = walk()
    contact = ground_contact(trial, soles, mass=MASS)
    feet = foot_wrenches(trial, contact, soles)
    right, left = feet["right_foot"], feet["left_foot"]
    assert right.value + left.value == pytest.approx(trial.wrench.value, abs=1e-9)
    assert left.value[80:100] == pytest.approx(trial.plates[0].wrench.value[80:100])
    assert right.value[115:124] == pytest.approx(trial.plates[1].wrench.value[115:124])


def test_the_soles_of_a_tracked_body_serve_as_well() -> None:
    body = human(Subject(65.0, 1.75, "F"))
    q = np.tile(body.neutral, (50, 1))
    q[:, :3] = [0.1, 0.0, 0.95]
    still = np.zeros((50, body.nv))
    soles = soles_from_body(body, Motion(np.arange(50) / 100, q, still, still))
    assert soles.centre[0, 0, 1] < 0 < soles.centre[0, 1, 1]
    force = np.tile([0, 0, WEIGHT, 0, -WEIGHT * 0.15, 0], (50, 1))
    trial, *_ = walk()
    on = replace(trial, plates=(replace(TWO[0], wrench=Wrench(soles.time, force)),))
    contact = ground_contact(on, soles)
    assert contact.measured.all()
    assert contact.cop_outside.max() == 0
    with pytest.raises(TrialRefused, match="lacks two feet"):
        soles_from_body(replace(body, feet={}), Motion(soles.time, q, still, still))


@pytest.mark.parametrize(
    ("file", "mass", "least"),
    [
        ("pycgm/Movement_trial.c3d", 85.0, 150),
        ("adl_gait/2014001_C1_01.c3d", 67.0, 150),
        ("biomechzoo/HC030A/HC030A05.c3d", 45.8, 70),
        ("biomechzoo/HC032A/HC032A03.c3d", 60.3, 70),
        ("biomechzoo/HC038A/HC038A11.c3d", 56.8, 70),
        ("biomechzoo/HC032A/HC032A01.c3d", 60.3, 300),
    ],
)
def test_real_trials(file: str, mass: float, least: int, data: Path) -> None:
    from biodance.lab.prepare import prepare
    from biodance.lab.readers import read_trial

    trial = prepare(read_trial(data / file))
    assert trial.markers is not None
    contact = ground_contact(trial, soles_from_markers(trial.markers, read_marker_set(trial.marker_set)), mass=mass)
    assert least <= contact.measured.sum()
    assert not any("no foot is over it" in note for note in contact.notes)
    outside = contact.cop_outside[contact.measured]
    assert np.nanpercentile(outside, 95) < 0.02
    assert trial.wrench.force[contact.measured, 2].min() > 0.5 * mass * 9.8

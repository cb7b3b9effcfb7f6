"""The third laboratory itself: force is the rate of momentum, files say what was measured, seeds repeat."""

import ezc3d
import numpy as np
import pytest
from scipy.interpolate import BSpline

from benchmarks.third_lab import make_session
from benchmarks.third_lab.faults import Fault
from benchmarks.third_lab.movement import Plan, check_feet, find_zmp, realize
from benchmarks.third_lab.people import Person, draw_person
from benchmarks.third_lab.plates import draw_plates, find_corners
from benchmarks.third_lab.session import LENGTHS
from benchmarks.third_lab.skeleton import GRAVITY, NAMES, find_wrench, pose_segments
from benchmarks.third_lab.tissue import draw_tissue, swing
from benchmarks.third_lab.trials import plan_trial
from benchmarks.third_lab.weigh import FORCE_RATE, share_ground, weigh_trial
from benchmarks.third_lab.write import UP_Y, Room, lump, write_c3d

ROOM = Room("", UP_Y, "y", 100.0, 1000.0, 0.0, 0.0, "pig")


@pytest.fixture(scope="module")
def performed() -> tuple[Person, Plan, BSpline]:
    """A person who lifts the left knee for a moment."""
    rng = np.random.default_rng(5)
    person = draw_person(rng)
    plan = plan_trial(rng, person, "left_knee", 8.0, 0.27)
    return person, plan, realize(person, plan, rounds=2)


def momentum(person: Person, path: BSpline, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Linear and angular momentum about the world's origin from two poses a little apart, without pinocchio."""
    step = 1e-4
    (turn_0, place_0), (turn_1, place_1) = (pose_segments(person, path(times + s)) for s in (-step, step))
    linear, angular = np.zeros((2, len(times), 3))
    for name in NAMES:
        before, after = (p[name] + r[name] @ person.coms[name] for r, p in ((turn_0, place_0), (turn_1, place_1)))
        velocity = (after - before) / (2 * step)
        spin = np.einsum("nij,nkj->nik", (turn_1[name] - turn_0[name]) / (2 * step), (turn_1[name] + turn_0[name]) / 2)
        omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        middle = (turn_1[name] + turn_0[name]) / 2
        turned = np.einsum("nij,jk,nlk,nl->ni", middle, person.inertias[name], middle, omega)
        linear += person.masses[name] * velocity
        angular += np.cross((before + after) / 2, person.masses[name] * velocity) + turned
    return linear, angular


def test_the_ground_gives_the_rate_of_momentum(performed):
    person, _, path = performed
    times, step = np.linspace(1.0, 7.0, 41), 1e-3
    forces, moments = find_wrench(person, path, times)
    (p_0, l_0), (p_1, l_1) = (momentum(person, path, times + s) for s in (-step, step))
    rotations, places = pose_segments(person, path(times))
    weight = np.zeros((2, len(times), 3))
    for name in NAMES:
        com = places[name] + rotations[name] @ person.coms[name]
        weight += person.masses[name] * np.array([np.broadcast_to(GRAVITY, com.shape), np.cross(com, GRAVITY)])
    assert np.abs(forces - ((p_1 - p_0) / (2 * step) - weight[0])).max() < 0.01
    assert np.abs(moments - ((l_1 - l_0) / (2 * step) - weight[1])).max() < 0.01
    assert np.ptp(forces[:, 2]) > 5  # something did move


def test_feet_that_stand_stay_and_balance_is_kept(performed):
    person, plan, path = performed
    assert check_feet(person, path, plan) < 1e-9
    between = np.linspace(0.2, 7.8, 333)
    _, places = pose_segments(person, path(between))
    assert np.ptp(places["right_foot"], axis=0).max() < 1e-4
    assert places["right_foot"][:, 2].mean() == pytest.approx(person.sizes["ankle"], abs=1e-5)
    wanted = plan.share[:, None] * plan.centres["right"] + (1 - plan.share[:, None]) * plan.centres["left"] + plan.sway
    assert np.abs(find_zmp(person, path, plan.times) - wanted).max() < 0.02
    assert np.ptp(places["left_foot"][:, 2]) > 0.05


def test_feet_share_what_the_ground_gives(performed):
    person, plan, path = performed
    times = np.arange(0, 8.0, 0.02)
    forces, moments = find_wrench(person, path, times)
    feet = share_ground(np.random.default_rng(0), person, plan, times, forces, moments)
    assert np.allclose(feet["right"][0] + feet["left"][0], forces, atol=1e-9)
    assert np.allclose(feet["right"][1] + feet["left"][1], moments, atol=1e-9)
    lifted = plan.ankles["left"][:, 2] > plan.ankles["left"][0, 2] + 0.01
    assert np.abs(feet["left"][0][np.interp(times, plan.times, lifted) > 0.5]).max() < 1e-6


@pytest.mark.parametrize("make", ["amti", "kistler"])
def test_files_read_back_as_measured(performed, tmp_path, make):
    person, plan, path = performed
    rng = np.random.default_rng(8)
    plates, tissue = draw_plates(rng, make), draw_tissue(rng)
    room = Room(make, UP_Y, "y", 100.0, 1000.0, 0.0, 0.0, "pig")
    wrenches = weigh_trial(rng, person, tissue, path, plan, room, Fault(), "dance_left_knee")
    wrenches = [[part[3000:4500] for part in wrench] for wrench in wrenches]  # one foot is lifted
    read = tuple(ideal(plate, *wrench) for plate, wrench in zip(plates, wrenches, strict=True))
    frames = len(read[0]) // 10
    markers = {"LASI": rng.normal(0, 1, (frames, 3)), "RASI": rng.normal(0, 1, (frames, 3))}
    markers["RASI"][5:9] = np.nan
    write_c3d(tmp_path / "t.c3d", room, markers, plates, read)
    c3d = ezc3d.c3d(str(tmp_path / "t.c3d"), extract_forceplat_data=True)
    back = c3d["data"]["points"][:3].transpose(1, 2, 0) @ UP_Y / 1e3
    assert np.allclose(back, list(markers.values()), atol=1e-6, equal_nan=True)
    for platform, (force, moment) in zip(c3d["data"]["platform"], wrenches, strict=True):
        assert np.allclose(UP_Y.T @ platform["force"], force.T, atol=1e-3)
        loaded = force[:, 2] > 100
        cop = np.stack([-moment[:, 1], moment[:, 0]])[:, loaded] / force[loaded, 2]
        assert np.allclose((UP_Y.T @ platform["center_of_pressure"])[:2, loaded], 1e3 * cop, atol=0.05)


def ideal(plate, forces, moments):
    """What a faultless plate reads: the wrench about its origin in its axes."""
    lever = plate.deep if plate.make == "amti" else np.array([0, 0, plate.deep[2]])
    origin = find_corners(plate).mean(axis=1) - plate.turn @ lever
    return np.hstack([forces @ plate.turn, (moments - np.cross(origin, forces)) @ plate.turn])


def test_people_add_up_and_their_pelvis_varies():
    people = [draw_person(np.random.default_rng(seed)) for seed in range(40)]
    for person in people:
        assert sum(part["mass_kg"] for part in lump(person).values()) == pytest.approx(person.mass)
        for name in NAMES:
            a, b, c = np.linalg.eigvalsh(person.inertias[name])
            assert a > 0
            assert a + b > c, name
    shares = [person.masses["pelvis"] / person.mass for person in people]
    assert 0.11 <= min(shares) < 0.13
    assert 0.18 < max(shares) <= 0.20
    assert np.corrcoef(shares, [p.masses["right_thigh"] / p.mass for p in people])[0, 1] < -0.3


def test_tissue_sags_by_what_its_spring_yields():
    pull = np.where(np.arange(1000) < 100, 0.0, 3.0)[:, None]
    moved = swing(pull, FORCE_RATE, 6.0, 0.3)
    assert moved[99, 0] == 0
    assert moved[-1, 0] == pytest.approx(-3.0 / (2 * np.pi * 6.0) ** 2, rel=1e-6)


def test_the_same_seed_makes_the_same_files(tmp_path, monkeypatch):
    monkeypatch.setitem(LENGTHS, "static01", 1.6)
    for name in ("one", "two"):
        make_session(tmp_path / name, seed=4, kind="plate_place", only=("static01",))
    assert (tmp_path / "one/static01.c3d").read_bytes() == (tmp_path / "two/static01.c3d").read_bytes()
    assert (tmp_path / "one.truth.json").read_text() == (tmp_path / "two.truth.json").read_text()
    assert not list((tmp_path / "one").glob("*truth*"))


def test_an_unknown_fault_is_refused_with_the_legal_ones(tmp_path):
    with pytest.raises(ValueError, match="plate_yaw"):
        make_session(tmp_path / "x", seed=1, kind="gremlins")

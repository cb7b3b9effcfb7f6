"""Directions that the file does not say: a standing person's sway and the foot markers find corners that are listed
wrongly.
"""

import numpy as np
import pytest
from plate_emulator import RATE, Emulated, channels, raw_file, step, yaw

from biodance.lab.plates.read import read_plates
from biodance.lab.plates.sense import sway_sign
from biodance.records import Markers

HEIGHT, MASS = 0.95, 70.0


def standing(plate, *, seconds=8.0, seed=0):
    """A standing person as an inverted pendulum: wrench (S, 6) about the lab origin, its centre of pressure, and the
    foot markers.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 1 / RATE)
    cop = np.array([0.04, -0.06]) + sum(
        rng.uniform(0.001, 0.003, 2) * np.sin(2 * np.pi * f * time[:, None] + rng.uniform(0, 6, 2))
        for f in (0.7, 1.1, 1.7, 2.3)
    )
    com = cop.mean(axis=0)
    shear = -MASS * 9.81 / HEIGHT * (cop - com)
    force = np.column_stack([shear, np.full(time.size, MASS * 9.81)])
    point = np.column_stack([cop, np.zeros(time.size)]) + plate.centre
    feet = point.mean(axis=0) + np.array(
        [[-0.09, -0.1, 0.03], [0.14, -0.1, 0.02], [0.14, 0.1, 0.02], [-0.09, 0.1, 0.03], [0, 0, 1.0]]
    )
    at = np.arange(0, seconds, 0.01)
    markers = Markers(("A", "B", "C", "D", "HEAD"), at, np.broadcast_to(feet, (at.size, 5, 3)))
    return np.hstack([force, np.cross(point, force)]), point, markers


def file_of(plate, truth, order):
    """The plate's file with its corners listed in another order."""
    raw = raw_file([plate], [channels(plate, truth)])
    raw.parameters["FORCE_PLATFORM"]["CORNERS"] = raw.parameters["FORCE_PLATFORM"]["CORNERS"][:, order]
    return raw


def test_sway_tells_reaction_from_load():
    plate = Emulated(centre=np.zeros(3), rotation=np.eye(3))
    truth, point, _ = standing(plate)
    force = truth[:, :3]
    assert sway_sign(force, point, RATE) == 1
    assert sway_sign(-force, point, RATE) == -1
    assert sway_sign(force * [1, -1, -1], point, RATE) == 0  # x and y disagree
    assert sway_sign(force[: int(2.2 * RATE)], point[: int(2.2 * RATE)], RATE) == 0
    assert sway_sign(np.zeros((4000, 3)), np.zeros((4000, 3)), RATE) == 0


def test_sway_is_not_seen_where_nobody_sways():
    rng = np.random.default_rng(0)
    for _ in range(20):
        force = np.column_stack([rng.normal(0, 2, (4000, 2)), np.full(4000, 700.0)])
        assert sway_sign(force, rng.normal(0, 2 / 700, (4000, 3)), RATE) == 0


@pytest.mark.parametrize("seconds", [2.6, 5.0])
def test_sway_that_agrees_by_chance_tells_no_sign(seconds):
    """Shear and pressure drawn apart, in the band of sway, in 400 short standings."""
    rng, told, count = np.random.default_rng(1), 0, int(seconds * RATE)
    low = np.fft.rfftfreq(count, 1 / RATE)
    for _ in range(400):
        spectrum = rng.normal(size=(4, low.size)) + 1j * rng.normal(size=(4, low.size))
        spectrum[:, (low < 0.5) | (low > 5.0)] = 0
        noise = np.fft.irfft(spectrum, count)
        shear, cop = (part / part.std(axis=1, keepdims=True) for part in (noise[:2], noise[2:]))
        force = np.column_stack([*(2.0 * shear), np.full(count, 700.0)])
        told += sway_sign(force, np.column_stack([*(0.002 * cop), np.zeros(count)]), RATE) != 0
    assert told <= 2


@pytest.mark.parametrize("reaction", [True, False])
def test_sway_confirms_a_sound_plate(reaction):
    plate = Emulated(3, half=np.array([0.3, 0.45]), origin=np.array([0.21, 0.35, -0.058]), reaction=reaction)
    truth, _, _ = standing(plate)
    plates, warnings, *_ = read_plates(file_of(plate, truth, [0, 1, 2, 3]), metres=0.001)
    assert warnings == ()
    np.testing.assert_allclose(plates[0].wrench.value, truth, atol=1e-6)
    assert any("confirms" in said for said in plates[0].decisions)


@pytest.mark.parametrize("reaction", [True, False])
@pytest.mark.parametrize(("order", "mirror"), [([3, 2, 1, 0], [1, -1, 1]), ([1, 0, 3, 2], [-1, 1, 1])])
def test_corners_listed_the_wrong_way_round_without_markers_give_a_mirrored_lab(reaction, order, mirror):
    plate = Emulated(
        3, centre=np.zeros(3), half=np.array([0.3, 0.45]), origin=np.array([0.21, 0.35, -0.058]), reaction=reaction
    )
    truth, point, _ = standing(plate)
    plates, warnings, *_ = read_plates(file_of(plate, truth, order), metres=0.001)
    assert "the corners run the wrong way round" in warnings[0]
    wrench = plates[0].wrench
    np.testing.assert_allclose(wrench.force, truth[:, :3] * mirror, atol=1e-6)
    np.testing.assert_allclose(wrench.cop(), point * mirror, atol=1e-9)


@pytest.mark.parametrize("order", [[3, 2, 1, 0], [1, 0, 3, 2]])
def test_the_foot_markers_say_which_axis_to_turn(order):
    plate = Emulated(
        2, centre=np.array([1.0, 2.0, 0.0]), half=np.array([0.3, 0.45]), rotation=yaw(0.3) @ np.diag([1.0, -1.0, -1.0])
    )
    plate.origin[:2] = 0
    truth, _, markers = standing(plate)
    truth[:, 3:] += np.cross([0.12, -0.2, 0], truth[:, :3])
    markers = Markers(markers.names, markers.time, markers.xyz + np.array([0.12, -0.2, 0.0]))
    plates, warnings, *_ = read_plates(file_of(plate, truth, order), metres=0.001, markers=markers)
    np.testing.assert_allclose(plates[0].wrench.value, truth, atol=1e-6)
    assert "which puts the load under the feet" in warnings[0]


def test_without_a_verdict_of_the_markers_the_plate_is_left_out():
    plate = Emulated(2, centre=np.array([1.0, 2.0, 0.0]))
    truth, _, markers = standing(plate)
    away = Markers(markers.names, markers.time, markers.xyz + np.array([5.0, 0, 0]))
    plates, warnings, *_ = read_plates(file_of(plate, truth, [3, 2, 1, 0]), metres=0.001, markers=away)
    assert plates == ()
    assert "do not tell which axis" in warnings[0]


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_corners_counted_from_another_one_are_found_by_the_markers(turns):
    plate = Emulated(2, centre=np.array([1.0, 2.0, 0.2]), half=np.array([0.45, 0.45]))
    rng = np.random.default_rng(0)
    shift = np.array([0.2, 0.05, 0.0])
    truth, point = step(rng, plate)
    truth[:, 3:] += np.cross(shift, truth[:, :3])
    point = point + shift
    at = np.arange(0, 4, 0.01)
    sample = np.clip((at * RATE).astype(int), 0, len(point) - 1)
    feet = point[sample][:, None] + np.array([[-0.08, -0.04, 0.03], [0.12, 0.03, 0.02], [0.1, -0.04, 0.03]])
    markers = Markers(("HEEL", "TOE", "TOE2"), at, feet)
    order = list(np.roll(range(4), turns))
    raw = raw_file([plate], [channels(plate, truth)])
    sound, warnings, *_ = read_plates(raw, metres=0.001, markers=markers)
    assert warnings == ()
    assert any("from the feet that the markers show" in said for said in sound[0].decisions)
    found, warnings, *_ = read_plates(file_of(plate, truth, order), metres=0.001, markers=markers)
    assert f"turned by {90 * turns} degrees" in warnings[0] or f"turned by {360 - 90 * turns} degrees" in warnings[0]
    np.testing.assert_allclose(found[0].wrench.value, truth, atol=1e-6)


def test_load_far_from_the_feet_is_warned_about():
    plate = Emulated(2, centre=np.zeros(3), half=np.array([0.4, 0.4]), rotation=np.diag([1.0, -1.0, -1.0]))
    truth, _, markers = standing(plate)
    elsewhere = Markers(markers.names, markers.time, markers.xyz + np.array([0.25, -0.3, 0.0]))
    _, warnings, *_ = read_plates(file_of(plate, truth, [0, 1, 2, 3]), metres=0.001, markers=elsewhere)
    assert "from the feet that the markers show" in warnings[0]


@pytest.mark.parametrize("reaction", [True, False])
def test_a_knock_against_a_plate_does_not_turn_the_weight_of_a_person(reaction):
    """Somebody of 700 N stands for 2 s; before, a hoist pulls the plate up with 2.5 kN for 0.3 s."""
    plate = Emulated(reaction=reaction)
    truth, _ = step(np.random.default_rng(0), plate)
    time = np.arange(len(truth)) / RATE
    force = np.where((time > 0.4)[:, None] & (time < 0.7)[:, None], [0.0, 0.0, -2500.0], truth[:, :3])
    pulled = np.hstack([force, np.where(force[:, 2:] < 0, np.cross(plate.centre, force), truth[:, 3:])])
    plates, *_ = read_plates(raw_file([plate], [channels(plate, pulled)]), metres=0.001)
    np.testing.assert_allclose(plates[0].wrench.value, pulled, atol=1e-6)


def test_shear_of_the_wrong_sign_is_warned_about():
    plate = Emulated(2, centre=np.zeros(3))
    plate.origin = np.zeros(3)
    truth, _, _ = standing(plate)
    signals = channels(plate, truth)
    signals[:, :2] *= -1
    _, warnings, *_ = read_plates(raw_file([plate], [signals]), metres=0.001)
    assert "wrong sign" in warnings[0]

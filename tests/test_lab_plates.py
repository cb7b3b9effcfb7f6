"""Every plate TYPE against a plate run backwards: the wrench that went in must come out, whatever pose, sign, unit,
zero or corner order.
"""

import numpy as np
import pytest
from plate_emulator import RATE, Emulated, channels, random_pose, raw_file, step, yaw

from biodance.lab.plates import PLATE_TYPES, declared_plates, plate_type
from biodance.lab.plates.read import decode_plates, read_plates
from biodance.lab.plates.sense import pressure_point
from biodance.records import Markers

POLYNOMIAL = np.array([[1e-17, -5e-12, 3e-7, -2e-12, 4e-7, -1e-2], [2e-17, -2e-12, -7e-7, -1e-12, 5e-7, 2e-2]])
MATRICES = {4: (6, 6), 5: (6, 8), 6: (12, 12), 7: (8, 8)}


def made(kind, rng, *, reaction=True, z_up=False, polynomial=None):
    """A random plate of a TYPE; the sensor lies below the surface whichever way the plate's z points."""
    half = rng.uniform(0.2, 0.45, 2)
    depth = rng.uniform(0.02, 0.06) * (1 if z_up else -1)
    origin = np.append(rng.uniform(0.6, 0.9, 2) * half if kind in (3, 6, 7) else rng.uniform(-0.005, 0.005, 2), depth)
    matrix = None
    if kind in MATRICES:
        rows, columns = MATRICES[kind]
        matrix = 100 * (np.eye(rows, columns) + rng.uniform(-0.02, 0.02, (rows, columns)))
    return Emulated(
        kind, random_pose(rng, z_up=z_up), rng.uniform(-2, 2, 3), half, origin, reaction, matrix, polynomial
    )


def largest_error(plates, truth):
    return np.abs(sum(plate.wrench.value for plate in plates) - truth).max()


@pytest.mark.parametrize("kind", [1, 2, 3, 4, 5, 6, 7])
@pytest.mark.parametrize("reaction", [True, False])
@pytest.mark.parametrize("z_up", [False, True])
def test_the_wrench_that_went_in_comes_out(kind, reaction, z_up):
    rng = np.random.default_rng(kind)
    for metres in (0.001, 1.0):
        plate = made(kind, rng, reaction=reaction, z_up=z_up)
        truth, _ = step(rng, plate)
        plates, warnings, *_ = read_plates(raw_file([plate], [channels(plate, truth)], metres=metres), metres=metres)
        assert ["shear may have the wrong sign" in w for w in warnings] == [True] * (z_up and kind in (3, 7))
        assert largest_error(plates, truth) < 1e-6
        assert plates[0].type == kind
        assert plates[0].wrench.rate == pytest.approx(RATE)
        np.testing.assert_allclose(plates[0].corners, plate.corners, atol=1e-9)
        assert ("kept" if reaction else "turned round") in plates[0].decisions[-1]


def test_a_new_type_is_one_entry(monkeypatch):
    """Four sensors again, but each vertical force first: nothing else of biodance knows how many TYPEs there are."""
    order, rng = (4, 5, 6, 7, 0, 1, 2, 3), np.random.default_rng(5)
    plate = made(3, rng)
    truth, _ = step(rng, plate)
    recorded = channels(plate, truth)[:, order]
    raw = raw_file([plate], [recorded], TYPE=np.array([9]))
    assert read_plates(raw, metres=0.001).plates == ()
    monkeypatch.setitem(PLATE_TYPES, 9, plate_type(*(PLATE_TYPES[3].outputs[k] for k in order)))
    assert largest_error(read_plates(raw, metres=0.001).plates, truth) < 1e-6


def test_the_centre_of_pressure_lies_where_the_person_stood():
    rng = np.random.default_rng(1)
    plate = made(2, rng)
    plate.rotation = yaw(0.7) @ np.diag([1.0, -1.0, -1.0])
    truth, point = step(rng, plate)
    plates, _, *_ = read_plates(raw_file([plate], [channels(plate, truth)]), metres=0.001)
    cop = plates[0].wrench.cop(height=plates[0].height, threshold=100)
    loaded = np.isfinite(cop[:, 0])
    assert loaded.sum() > 500
    np.testing.assert_allclose(cop[loaded], point[loaded], atol=1e-9)


def test_kistlers_polynomial_is_taken_off():
    rng = np.random.default_rng(3)
    plate = made(3, rng, polynomial=POLYNOMIAL)
    plate.half, plate.origin = np.array([0.3, 0.45]), np.array([0.21, 0.35, -0.058])
    truth, _ = step(rng, plate)
    recorded = channels(plate, truth)
    assert largest_error(read_plates(raw_file([plate], [recorded]), metres=0.001)[0], truth) < 1e-6
    uncorrected, _, *_ = read_plates(raw_file([plate], [recorded], FPCOPPOLY=None), metres=0.001)
    assert largest_error(uncorrected, truth) > 1.0


def test_several_plates_of_different_types_add_up():
    rng = np.random.default_rng(4)
    plates = [made(kind, rng, reaction=kind != 3) for kind in (2, 3, 4)]
    truths = [step(rng, plate)[0] for plate in plates]
    raw = raw_file(plates, [channels(p, t) for p, t in zip(plates, truths, strict=True)])
    read, warnings, *_ = read_plates(raw, metres=0.001)
    assert [said[:29] for said in warnings] == ["Two signs in one laboratory: "]
    assert "plate 2 holds the force" in warnings[0]
    assert "plates 1, 3 hold the force" in warnings[0]
    assert [p.name for p in read] == ["plate1", "plate2", "plate3"]
    assert largest_error(read, sum(truths)) < 1e-6


@pytest.mark.parametrize("seen", [False, True])
def test_a_treadmills_origin_from_the_surface_to_the_sensor_is_turned(seen):
    rng = np.random.default_rng(14)
    belts = [made(2, rng), made(2, rng)]
    for belt, x in zip(belts, (0.25, -0.25), strict=True):
        belt.origin = np.array([x, 0.0, belt.origin[2]])
    truths = [step(rng, belt) for belt in belts]
    raw = raw_file(belts, [channels(belt, truth) for belt, (truth, _) in zip(belts, truths, strict=True)])
    raw.parameters["FORCE_PLATFORM"]["ORIGIN"][0] *= -1
    time = np.arange(0, 4, 0.01)
    point = truths[0][1][:: len(truths[0][1]) // time.size]
    feet = np.stack([point + np.array([0.05, 0.02, 0.03]), point - [0.05, 0.02, -0.03]], axis=1)
    read, warnings, *_ = read_plates(raw, metres=0.001, markers=Markers(("A", "B"), time, feet) if seen else None)
    assert largest_error(read, sum(truth for truth, _ in truths)) < 1e-6
    assert sum("they were turned" in said for said in warnings) == 2


def test_a_y_up_lab_is_turned():
    rng = np.random.default_rng(5)
    plate = made(2, rng)
    truth, _ = step(rng, plate)
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], dtype=float)
    raw = raw_file([plate], [channels(plate, truth)])
    group = raw.parameters["FORCE_PLATFORM"]
    group["CORNERS"] = np.einsum("ij,jkn->ikn", turn.T, group["CORNERS"])
    assert largest_error(read_plates(raw, metres=0.001, turn=turn)[0], truth) < 1e-6


@pytest.mark.parametrize("kind", [2, 3, 4])
@pytest.mark.parametrize("z_up", [False, True])
def test_an_origin_with_the_wrong_sign_of_z_is_mended(kind, z_up):
    rng = np.random.default_rng(6)
    plate = made(kind, rng, z_up=z_up)
    truth, _ = step(rng, plate)
    raw = raw_file([plate], [channels(plate, truth)])
    raw.parameters["FORCE_PLATFORM"]["ORIGIN"][2] *= -1
    read, _, *_ = read_plates(raw, metres=0.001)
    assert largest_error(read, truth) < 1e-6
    assert any("its sign was turned" in said for said in read[0].decisions)


def test_units_are_read_per_channel():
    rng = np.random.default_rng(7)
    plate = made(2, rng)
    truth, _ = step(rng, plate)
    inch_pound = 4.4482216152605 * 0.0254
    for scale, text in (
        ([4.4482216152605] * 3 + [inch_pound] * 3, ["lbf", "lb", "LBF", "in-lb", "inlbf", "lbf.in"]),
        ([1, 1000, 1, 1, 1e-3, 1e-3], ["N", "kN", "Newton", "N.m", "N-mm", "ntmm"]),
    ):
        raw = raw_file([plate], [channels(plate, truth)], units=[(scale, text)])
        read, warnings, *_ = read_plates(raw, metres=0.001)
        assert warnings == ()
        assert largest_error(read, truth) < 1e-6


def test_missing_units_are_taken_as_the_files_own_and_said():
    rng = np.random.default_rng(8)
    plate = made(2, rng)
    truth, _ = step(rng, plate)
    raw = raw_file([plate], [channels(plate, truth)], units=[([1, 1, 1, 1e-3, 1e-3, 1e-3], [""] * 3 + ["V"] * 3)])
    read, _, *_ = read_plates(raw, metres=0.001)
    assert largest_error(read, truth) < 1e-6
    assert sum("says nothing" in said for said in read[0].decisions) == 2


@pytest.mark.parametrize(("scale", "text"), [(1e-3, "Nm"), (1.0, "Nmm")])
def test_moments_in_another_unit_than_declared_are_found_and_warned_about(scale, text):
    rng = np.random.default_rng(9)
    plate = made(2, rng)
    truth, _ = step(rng, plate)
    raw = raw_file([plate], [channels(plate, truth)], units=[([1, 1, 1] + [scale] * 3, ["N"] * 3 + [text] * 3)])
    read, warnings, *_ = read_plates(raw, metres=0.001)
    assert largest_error(read, truth) < 1e-6
    assert any("Check the units" in warning for warning in warnings)


def test_corners_and_origin_in_another_unit_than_the_points():
    rng = np.random.default_rng(10)
    plate = made(2, rng)
    truth, _ = step(rng, plate)
    raw = raw_file([plate], [channels(plate, truth)], metres=0.001)
    read, _, *_ = read_plates(raw, metres=1.0)
    assert largest_error(read, truth) < 1e-6
    assert any("the only unit that fits a plate" in said for said in read[0].decisions)


def test_time_runs_on_the_clock_of_the_markers():
    rng = np.random.default_rng(11)
    plate = made(2, rng)
    raw = raw_file([plate], [channels(plate, step(rng, plate)[0])])
    markers = Markers(("A",), 5.0 + np.arange(400) / 100, np.ones((400, 1, 3)))
    read, _, *_ = read_plates(raw, metres=0.001, markers=markers)
    assert read[0].wrench.time[0] == 5.0


def test_weight_is_compared_with_the_declared_mass():
    plate = Emulated()
    force = np.tile(np.append([0, 0, 686.4655], np.cross([0.33, 0.18, 0], [0, 0, 686.4655])), (1000, 1))
    raw = raw_file([plate], [channels(plate, force)])
    assert read_plates(raw, metres=0.001, body_mass=70.5)[1] == ()
    assert "70.00 kg" in read_plates(raw, metres=0.001, body_mass=80.0)[1][0]
    assert "pounds" in read_plates(raw, metres=0.001, body_mass=70 * 4.4482)[1][0]


def test_an_unloaded_plate_takes_the_sign_of_the_others():
    rng = np.random.default_rng(12)
    stood, empty = made(2, rng, reaction=False), made(2, rng, reaction=False)
    truth, _ = step(rng, stood)
    light = np.random.default_rng(1).normal(0, 0.5, (len(truth), 6))
    light[500:800] += [0, 0, 8, 0, 0, 0]
    raw = raw_file([stood, empty], [channels(stood, truth), channels(empty, light)])
    read, _, *_ = read_plates(raw, metres=0.001)
    np.testing.assert_allclose(read[1].wrench.force[500:800, 2].mean(), 8, atol=0.5)
    assert "Never loaded" in read[1].decisions[-1]


def test_centre_of_pressure_is_unknown_without_load():
    plate = Emulated()
    raw = raw_file([plate], [np.zeros((50, 6))])
    turn = np.eye(3)
    declared, *_ = declared_plates(raw, {}, metres=0.001, turn=turn)
    ((reading,), _, _) = decode_plates(raw, declared, metres=0.001, turn=turn, mass=None)
    assert np.isnan(pressure_point(reading)).all()

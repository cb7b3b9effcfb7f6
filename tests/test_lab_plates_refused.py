"""Plates that contradict themselves: left out with a sentence, while the others go through; and garbage of every kind
without a traceback.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from plate_emulator import Emulated, channels, raw_file, step

from biodance.lab.plates.decode import corners_in_lab, plate_axes
from biodance.lab.plates.read import read_plates
from biodance.records import Markers

GOOD = Emulated(centre=np.array([1.0, 1.0, 0.0]))


def two_plates(first=None, **changes):
    """Plate 1 may be spoilt through ``changes``; plate 2 is sound. Returns the raw file and what plate 2 measured."""
    rng = np.random.default_rng(0)
    first = first or Emulated()
    truths = [step(rng, plate)[0] for plate in (first, GOOD)]
    raw = raw_file([first, GOOD], [channels(p, t) for p, t in zip((first, GOOD), truths, strict=True)])
    for name, spoil in changes.items():
        spoil(raw.parameters["FORCE_PLATFORM"][name])
    return raw, truths[1]


def warning_of_the_first(raw, truth):
    """Return the one warning about plate 1, which was left out, after plate 2 was found to read what it should."""
    plates, warnings, *_ = read_plates(raw, metres=0.001)
    assert [p.name for p in plates] == ["plate2"]
    np.testing.assert_allclose(plates[0].wrench.value, truth, atol=1e-6)
    assert len(warnings) == 1
    assert warnings[0].startswith("Plate 1 was left out")
    assert "missing from the total" in warnings[0]
    return warnings[0]


def swap(i, j):
    def spoil(corners):
        corners[:, [i, j], 0] = corners[:, [j, i], 0]

    return spoil


def put(index, value):
    def spoil(array):
        array[index] = value

    return spoil


def scaled(factor):
    def spoil(corners):
        corners[:, :, 0] *= factor

    return spoil


@pytest.mark.parametrize(
    ("order", "word"), [((2, 3), "3 and 4"), ((0, 1), "3 and 4"), ((1, 2), "2 and 3"), ((0, 3), "2 and 3")]
)
def test_a_bow_tie_is_refused_and_says_which_corners(order, word):
    assert word in warning_of_the_first(*two_plates(CORNERS=swap(*order)))
    assert "bow-tie" in read_plates(two_plates(CORNERS=swap(*order))[0], metres=0.001)[1][0]


@pytest.mark.parametrize(
    ("name", "spoil", "word"),
    [
        ("CORNERS", put((slice(None), slice(None), 0), 0.0), "all four"),
        ("CORNERS", put((0, 0, 0), 1e23), "no place in a laboratory"),
        ("CORNERS", put((0, 0, 0), np.nan), "not a number"),
        ("CORNERS", scaled(0.3), "legal are sides"),
        ("CORNERS", scaled(11.0), "legal are sides"),
        ("CORNERS", put((0, 0, 0), 560.0), "no rectangle"),
        ("CORNERS", put((slice(None), 0, 0), [600.0, 600.0, 900.0]), "no rectangle"),
        ("ORIGIN", put((2, 0), 4000.0), "no plate of 0.40 x 0.60 m"),
        ("ORIGIN", put((1, 0), np.inf), "not a number"),
        ("CHANNEL", put((3, 0), 99.0), "analog channel 99, but the file holds 14"),
        ("CHANNEL", put((3, 0), 0.0), "analog channel 0"),
        ("CHANNEL", put((3, 0), 3.0), "twice"),
        ("TYPE", put(0, 11), "split-belt treadmill"),
        ("TYPE", put(0, 21), "AMTI stairs"),
        ("TYPE", put(0, 4), "needs a CAL_MATRIX of 6 x 6"),
        ("TYPE", put(0, 3), "lists 6 channels, TYPE 3 needs 8"),
        ("TYPE", put(0, -2), "TYPE -2"),
    ],
)
def test_the_other_plate_still_goes_through(name, spoil, word):
    assert word in warning_of_the_first(*two_plates(**{name: spoil}))


def test_a_steep_plate_is_refused():
    tilted = Emulated(rotation=np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))
    assert "degrees steep" in warning_of_the_first(*two_plates(first=tilted))


def test_the_sensors_of_an_eight_channel_plate_must_lie_inside():
    plate = Emulated(3, origin=np.array([0.15, 0.25, -0.05]))
    raw = raw_file([plate], [channels(plate, step(np.random.default_rng(0), plate)[0])])
    raw.parameters["FORCE_PLATFORM"]["ORIGIN"][0] = 2500.0
    plates, warnings, *_ = read_plates(raw, metres=0.001)
    assert plates == ()
    assert "half distances of the sensors" in warnings[0]


def test_samples_that_are_no_numbers_are_masked_and_nothing_else():
    raw, truth = two_plates()
    whole, _, *_ = read_plates(raw, metres=0.001)
    raw.analog[7, 4] = np.nan
    raw.analog[-30:, 6] = np.inf
    plates, warnings, *_ = read_plates(raw, metres=0.001)
    lost = np.isin(np.arange(len(truth)), [7, *range(len(truth) - 30, len(truth))])
    np.testing.assert_array_equal(np.isnan(plates[0].wrench.value).all(axis=1), lost)
    np.testing.assert_allclose(plates[0].wrench.value[~lost], whole[0].wrench.value[~lost], atol=1e-9)
    np.testing.assert_array_equal(plates[1].wrench.value, whole[1].wrench.value)
    assert "31 of 2000 samples are unknown, the first: analog channel 5 is not a number at sample 8" in warnings[0]


def test_a_channel_without_any_number_is_refused():
    raw, truth = two_plates()
    raw.analog[:, 4] = np.nan
    assert "analog channel 5 is not a number at sample 1" in warning_of_the_first(raw, truth)


def test_forces_that_no_plate_measures_are_refused():
    raw, truth = two_plates()
    raw.analog[50, 2] = 1e16
    assert "Fx reads up to 9.98e+15 N; no plate measures more than 30000" in warning_of_the_first(raw, truth)


def test_a_plate_that_never_changes_while_somebody_walks_is_refused():
    raw, _ = two_plates()
    raw.analog[:, 2:8] = [0.3, -0.2, 1448.0, 200.0, 100.0, 0.0]
    time = np.arange(0, 2, 0.01)
    walk = np.zeros((time.size, 4, 3)) + np.array([9.0, 9.0, 1.0])
    walk[..., 0] += time[:, None]
    plates, _, history, _ = read_plates(raw, metres=0.001, markers=Markers(("A", "B", "C", "D"), time, walk))
    assert [plate.name for plate in plates] == ["plate2"]
    assert "it reads a constant 1448 N" in history[0]


def test_load_beside_the_plate_is_warned_about_and_refused_without_units():
    plate = Emulated()
    far = Emulated(centre=plate.centre + np.array([1.0, 0, 0]))
    truth, _ = step(np.random.default_rng(1), far)
    for text, left in (("N", 1), ("", 0)):
        raw = raw_file(
            [plate],
            [channels(plate, truth)],
            units=[([1, 1, 1, 1, 1, 1], [text] * 3 + [text and "Nm"] * 3)],
            metres=1.0,
        )
        plates, warnings, *_ = read_plates(raw, metres=1.0)
        assert len(plates) == left
        assert "in only 0 % of the loaded samples" in warnings[0]


@pytest.mark.parametrize(
    ("changes", "count", "word"),
    [
        ({"USED": np.array([0])}, 0, "TYPE lists 2"),
        ({"USED": None}, 2, "USED is missing"),
        ({"USED": np.array([1])}, 1, "says 1 plates, TYPE lists 2"),
        ({"USED": np.array([3])}, 2, "Plate 3 was left out"),
        ({"USED": np.array([-1])}, 0, "legal is a whole number"),
        ({"USED": np.array([[2]]), "TYPE": np.array([[2], [2]])}, 2, None),
        ({"CORNERS": None}, 0, "CORNERS holds values for 0 plates"),
        ({"TYPE": ["a", "b"]}, 0, "TYPE holds values for 0 plates"),
    ],
)
def test_counts_that_contradict_each_other(changes, count, word):
    rng = np.random.default_rng(0)
    signals = [channels(p, step(rng, p)[0]) for p in (Emulated(), GOOD)]
    plates, warnings, *_ = read_plates(raw_file([Emulated(), GOOD], signals, **changes), metres=0.001)
    assert len(plates) == count
    assert warnings == () if word is None else any(word in w for w in warnings)


def test_no_plates_no_analog_no_rate():
    raw = raw_file([GOOD], [channels(GOOD, step(np.random.default_rng(0), GOOD)[0])], rate=float("nan"))
    assert "rate" in read_plates(raw, metres=0.001)[1][0]
    raw = raw_file([GOOD], [np.zeros((0, 6))])
    assert "no analog samples" in read_plates(raw, metres=0.001)[1][0]
    raw.parameters.clear()
    assert read_plates(raw, metres=0.001)[:2] == ((), ())


@pytest.mark.parametrize(("askew", "said"), [(0.004, False), (0.006, True)])
def test_a_belt_is_as_crooked_as_its_short_side_is_askew(askew, said):
    """Of 0.4 by 1.8 m: the ends of the short sides are moved along the long ones, against each other."""
    corners = np.array([[0.2, 0.9, 0.0], [-0.2, 0.9, 0.0], [-0.2, -0.9, 0.0], [0.2, -0.9, 0.0]])
    corners[[0, 3], 1] += askew
    _, decided = corners_in_lab(corners, metres=1.0, turn=np.eye(3))
    assert any("deviate from a rectangle" in one for one in decided) is said


def test_slightly_crooked_corners_are_used_and_said():
    corners = Emulated().corners
    corners[0] += [0.004, 0.003, 0]
    corners[2] += [0.003, 0.003, 0]
    lab, said = corners_in_lab(corners, metres=1.0, turn=np.eye(3))
    np.testing.assert_allclose(lab, corners)
    assert "deviate from a rectangle" in said[0]
    axes = plate_axes(lab)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)


@pytest.mark.parametrize(("degrees", "stands"), [(0, True), (25, True), (70, False), (80, False)])
def test_a_ramp_is_a_plate_and_a_wall_is_none(degrees, stands):
    """Nobody walks up 70 degrees: such corners are in other axes than the markers, and so is the force."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    slope = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    plate = Emulated(rotation=slope @ np.diag([1.0, -1.0, -1.0]))
    truth, _ = step(np.random.default_rng(0), plate)
    plates, warnings, *_ = read_plates(raw_file([plate], [channels(plate, truth)]), metres=0.001)
    if stands:
        np.testing.assert_allclose(plates[0].wrench.value, truth, atol=1e-6)
    else:
        assert plates == ()
        assert f"{degrees} degrees steep" in warnings[0]


@pytest.mark.parametrize(("newton", "measured"), [(700.0, True), (15e3, True), (70e3, False)])
def test_a_landing_is_believed_and_a_person_of_seven_tonnes_is_not(newton, measured):
    """15 kN: 15 times the weight of 100 kg. 70 kN: a person of 700 N whose channels are a hundred times too large."""
    plate = Emulated()
    truth, _ = step(np.random.default_rng(0), plate, weight=newton)
    plates, warnings, *_ = read_plates(raw_file([plate], [channels(plate, truth)]), metres=0.001)
    if measured:
        np.testing.assert_allclose(plates[0].wrench.value, truth, atol=1e-6)
    else:
        assert plates == ()
        assert "no plate measures more" in warnings[0]


NUMBERS = st.floats(allow_nan=True, allow_infinity=True, width=32) | st.sampled_from(
    [0.0, 1.0, 2.0, 3.0, 4.0, 1e30, -1.0]
)
SHAPES = st.sampled_from(
    [(0,), (1,), (2,), (3,), (3, 1), (6, 1), (3, 4), (3, 4, 1), (6, 6, 1), (8, 1), (12,), (1, 1, 1, 1)]
)
VALUE = SHAPES.flatmap(lambda shape: arrays.arrays(np.float64, shape, elements=NUMBERS)) | st.lists(
    st.text(max_size=4), max_size=3
)
NAMES = ("USED", "TYPE", "ZERO", "CORNERS", "ORIGIN", "CHANNEL", "CAL_MATRIX", "FPCOPPOLY", "MATRIX_STORE")


@settings(max_examples=150, deadline=None, derandomize=True)
@given(changes=st.dictionaries(st.sampled_from(NAMES), VALUE, min_size=1, max_size=4))
def test_garbage_parameters_never_pass_for_a_measurement(changes):
    truth, _ = step(np.random.default_rng(0), GOOD, seconds=2.5)
    raw = raw_file([GOOD], [channels(GOOD, truth)])
    raw.parameters["FORCE_PLATFORM"].update(changes)
    plates, warnings, *_ = read_plates(raw, metres=0.001)
    for plate in plates:
        assert np.isfinite(plate.wrench.value).all()
    group = raw.parameters["FORCE_PLATFORM"]
    used, kinds, listed = (
        np.size(group[name]) if isinstance(group[name], np.ndarray) else 0 for name in ("USED", "TYPE", "CHANNEL")
    )
    declares_none = (used and np.ravel(group["USED"])[0] == 0 and not kinds) or not (used or kinds or listed)
    assert plates or warnings or declares_none


@settings(max_examples=60, deadline=None, derandomize=True)
@given(signal=arrays.arrays(np.float64, (60, 6), elements=st.floats(-1e9, 1e9, width=32)), z_up=st.booleans())
def test_any_signal_gives_finite_numbers_or_a_sentence(signal, z_up):
    plate = Emulated(rotation=np.eye(3) if z_up else np.diag([1.0, -1.0, -1.0]))
    plates, warnings, *_ = read_plates(raw_file([plate], [signal], rate=50.0), metres=0.001, body_mass=70.0)
    assert plates or warnings
    assert all(np.isfinite(p.wrench.value).all() for p in plates)

"""The bytes of a C3D file: byte orders, storage, contradictions, damage."""

import numpy as np
import pytest
from c3d_files import DEC, INTEL, MIPS, File, real, text, whole

from biodance.errors import FileRefused
from biodance.lab.c3d.raw import read_raw

FRAMES, POINTS, CHANNELS, SAMPLES = 6, 3, 2, 5


@pytest.fixture
def numbers():
    """Smooth points (T, K, 4) mm and analog (S, C), all whole numbers that 16 bits hold."""
    time = np.arange(FRAMES)[:, None, None]
    points = np.concatenate(
        [100.0 * np.arange(1, 10).reshape(1, POINTS, 3) + 7 * time, np.zeros((FRAMES, POINTS, 1))], axis=2
    )
    analog = np.arange(FRAMES * SAMPLES * CHANNELS).reshape(-1, CHANNELS) - 20.0
    return points, analog


def save(tmp_path, file):
    path = tmp_path / "trial.c3d"
    path.write_bytes(file if isinstance(file, bytes) else file.bytes())
    return path


@pytest.mark.parametrize("processor", [INTEL, DEC, MIPS])
@pytest.mark.parametrize("scale", [-0.1, 0.5])
def test_every_byte_order_and_storage_gives_the_numbers_written(tmp_path, numbers, processor, scale):
    points, analog = numbers
    raw = read_raw(save(tmp_path, File(points, analog, processor=processor, scale=scale)))
    factor = scale if scale > 0 else 1.0
    np.testing.assert_array_equal(raw.points, factor * points[..., :3])
    np.testing.assert_array_equal(raw.analog, analog)
    assert (raw.rate, raw.analog_rate, raw.first_frame, raw.warnings) == (100.0, 500.0, 1, ())
    assert raw.labels == ("M0", "M1", "M2")
    assert raw.analog_units == ("V", "V")


@pytest.mark.parametrize("processor", [INTEL, DEC, MIPS])
@pytest.mark.parametrize("scale", [-0.1, 0.5])
def test_gain_and_offset_are_applied_as_the_file_says(tmp_path, numbers, processor, scale):
    points, analog = numbers
    transform = {"GEN_SCALE": real(0.5), "SCALE": real(2.0, -3.0), "OFFSET": whole(4, -6)}
    raw = read_raw(
        save(tmp_path, File(points, analog, processor=processor, scale=scale, parameters={"ANALOG": transform}))
    )
    np.testing.assert_allclose(raw.analog, (analog - [4, -6]) * [1.0, -1.5], rtol=1e-6)


def test_unsigned_analog_numbers(tmp_path, numbers):
    points, analog = numbers
    unsigned = analog + 40000
    transform = {"FORMAT": text("UNSIGNED"), "OFFSET": whole(32768 - 65536, 40000 - 65536)}
    raw = read_raw(save(tmp_path, File(points, unsigned, scale=0.5, parameters={"ANALOG": transform})))
    np.testing.assert_array_equal(raw.analog, unsigned - [32768, 40000])


def test_offset_that_is_no_integer(tmp_path, numbers):
    points, analog = numbers
    raw = read_raw(save(tmp_path, File(points, analog, parameters={"ANALOG": {"OFFSET": real(0.5, 1.5)}})))
    np.testing.assert_array_equal(raw.analog, analog - [0.5, 1.5])


@pytest.mark.parametrize("processor", [INTEL, MIPS])
@pytest.mark.parametrize("hidden", [[1.0, 2.0, 3.0, -1.0], [0.0, 0.0, 0.0, 0.0], [np.nan, 2.0, 3.0, 0.0]])
def test_a_point_that_was_not_seen_is_nan(tmp_path, numbers, processor, hidden):
    points, analog = numbers
    points[2, 1] = hidden
    raw = read_raw(save(tmp_path, File(points, analog, processor=processor)))
    assert np.argwhere(np.isnan(raw.points).any(axis=2)).tolist() == [[2, 1]]


def test_a_negative_residual_hides_integer_points_too(tmp_path, numbers):
    points, analog = numbers
    points[2, 1, 3] = -1
    raw = read_raw(save(tmp_path, File(points, analog, scale=0.5)))
    assert np.argwhere(np.isnan(raw.points).any(axis=2)).tolist() == [[2, 1]]


def test_more_than_255_labels(tmp_path):
    points = np.ones((2, 300, 4))
    labels = [f"M{i}" for i in range(300)]
    file = File(points, parameters={"POINT": {"LABELS": text(*labels[:255]), "LABELS2": text(*labels[255:])}})
    assert read_raw(save(tmp_path, file)).labels == tuple(labels)


def test_more_than_255_analog_channels(tmp_path):
    analog = np.arange(600.0).reshape(2, 300)
    transform = {name: whole(*[value] * 255) for name, value in (("OFFSET", 0), ("SCALE", 2))}
    transform |= {name: whole(*[value] * 45) for name, value in (("OFFSET2", 0), ("SCALE2", 3))}
    file = File(
        np.ones((2, 1, 4)), analog, parameters={"ANALOG": transform | {"LABELS": text("A"), "UNITS": text("V")}}
    )
    np.testing.assert_array_equal(read_raw(save(tmp_path, file)).analog, analog * np.repeat([2, 3], [255, 45]))


def test_parameters_keep_their_dimensions_and_flat_ones_stored_as_tables_are_understood(tmp_path, numbers):
    points, analog = numbers
    file = File(
        points,
        analog,
        parameters={
            "ANALOG": {"USED": whole(2, shape=(1, 1)), "SCALE": real(2.0, 3.0, shape=(2, 1))},
            "FORCE_PLATFORM": {"CORNERS": real(*range(24), shape=(3, 4, 2)), "TYPE": whole(2, 2, shape=(2, 1))},
        },
    )
    raw = read_raw(save(tmp_path, file))
    np.testing.assert_array_equal(raw.analog, analog * [2, 3])
    assert raw.parameters["FORCE_PLATFORM"]["CORNERS"][:, 1, 1].tolist() == [15, 16, 17]


def test_points_without_analog_and_analog_without_points(tmp_path, numbers):
    points, analog = numbers
    alone = read_raw(save(tmp_path, File(points)))
    assert (alone.points.shape, alone.analog.shape, np.isnan(alone.analog_rate)) == ((FRAMES, POINTS, 3), (0, 0), True)
    plate = File(
        np.empty((len(analog), 0, 4)),
        analog,
        rate=1000.0,
        header={"rate": 0.0},
        parameters={"POINT": {"RATE": real(0.0)}},
    )
    other = read_raw(save(tmp_path, plate))
    assert (other.points.shape, other.analog_rate) == ((len(analog), 0, 3), 1000.0)
    np.testing.assert_array_equal(other.analog, analog)


def test_first_frame_and_long_recordings(tmp_path):
    points = np.ones((70000, 1, 4))
    trial = {"ACTUAL_START_FIELD": whole(5, 0), "ACTUAL_END_FIELD": whole(70004 - 65536, 1)}
    file = File(points, first=5, header={"last": 65535}, parameters={"POINT": {"FRAMES": whole(65535)}, "TRIAL": trial})
    raw = read_raw(save(tmp_path, file))
    assert (len(raw.points), raw.first_frame, raw.warnings) == (70000, 5, ())
    assert read_raw(save(tmp_path, File(np.ones((40000, 1, 4)), first=695))).first_frame == 695


def test_a_rate_that_one_place_tells_otherwise_is_outvoted_and_said(tmp_path, numbers):
    points, analog = numbers
    raw = read_raw(save(tmp_path, File(points, analog, header={"rate": 0.0})))
    assert (raw.rate, raw.analog_rate) == (100.0, 500.0)
    raw = read_raw(save(tmp_path, File(points, analog, header={"rate": 50.0})))
    assert (raw.rate, raw.analog_rate) == (100.0, 500.0)
    assert "50" in raw.warnings[0]
    assert np.isnan(read_raw(save(tmp_path, File(points, rate=0.0))).rate)


@pytest.mark.parametrize(
    "wrong",
    [{"samples": 3}, {"values": 9}, {"points": 4}, {"last": 4}, {"first": 3}, {"samples": 0}, {"start": 1 + 2 + 1}],
)
def test_one_wrong_count_in_the_header_is_outvoted_and_never_shifts_the_numbers(tmp_path, numbers, wrong):
    points = np.tile(numbers[0], (20, 1, 1))
    analog = np.tile(numbers[1], (20, 1))
    try:
        raw = read_raw(save(tmp_path, File(points, analog, header=wrong)))
    except FileRefused as refusal:
        # either is right, a wrong number is not
        assert "contradict" in str(refusal) or "disagree" in str(refusal)  # noqa: PT017
    else:
        np.testing.assert_array_equal(raw.points, points[..., :3])
        np.testing.assert_array_equal(raw.analog, analog)


def test_a_point_count_that_the_parameters_contradict_is_decided_by_the_length(tmp_path):
    points = np.concatenate([np.random.default_rng(1).uniform(0, 900, (200, 4, 3)), np.zeros((200, 4, 1))], axis=2)
    raw = read_raw(save(tmp_path, File(points, parameters={"POINT": {"USED": whole(3)}})))
    np.testing.assert_allclose(raw.points, points[..., :3], rtol=1e-6)
    assert "length decides" in raw.warnings[0]


def test_channels_that_are_declared_but_not_stored(tmp_path):
    points = np.ones((200, 4, 4))
    channels = {"USED": whole(2), "RATE": real(1000.0), "SCALE": real(1, 1), "OFFSET": whole(0, 0)}
    raw = read_raw(save(tmp_path, File(points, header={"samples": 10}, parameters={"ANALOG": channels})))
    assert (raw.points.shape, raw.analog.shape) == ((200, 4, 3), (0, 0))
    assert "length decides" in raw.warnings[0]


def test_a_header_that_is_silent_on_analog_data(tmp_path, numbers):
    points, analog = numbers
    raw = read_raw(
        save(tmp_path, File(np.tile(points, (9, 1, 1)), np.tile(analog, (9, 1)), header={"values": 0, "samples": 0}))
    )
    np.testing.assert_array_equal(raw.analog, np.tile(analog, (9, 1)))


def test_jumps_of_a_metre_are_confirmed_by_the_second_reader_and_said(tmp_path, numbers):
    points, analog = numbers
    points[3, 0, 0] += 5000
    raw = read_raw(save(tmp_path, File(points, analog)))
    assert raw.points[3, 0, 0] == points[3, 0, 0]
    assert "2 places; ezc3d finds the same numbers" in raw.warnings[0]


def damaged(numbers):
    points, analog = numbers
    good = File(points, analog).bytes()
    return {
        "the file is empty": b"",
        "is not a C3D file: it does not begin as one": b"not a c3d file, just some text\n".ljust(2000, b"."),
        "is not a C3D file: it has 700 bytes, and not 1024 at least": good[:700],
        "damaged or was cut off": File(points, parameters={"POINT": {"DESCRIPTIONS": text(*["x" * 200] * 9)}}).bytes()[
            :1500
        ],
        "cut off: it declares 6 frames and holds 4": good[: 1024 + 4 * 88],
        "outside the file": b"\xff" + good[1:],
        "processor type 99": good[:515] + b"\x63" + good[516:],
        "which no lab has": good[:515] + bytes([DEC]) + good[516:],
        "declares no frame": File(
            points,
            analog,
            header={"points": 0, "values": 0},
            parameters={"POINT": {"USED": whole(0)}, "ANALOG": {"USED": whole(0)}},
        ).bytes(),
        "POINT:SCALE is 5": File(points, analog, parameters={"POINT": {"SCALE": real(5.0)}}).bytes(),
        "is there twice": good.replace(b"OFFSET", b"LABELS"),
        "the parameter section is damaged": good.replace(b"SCALE\x0e", b"SCALE\x0c"),
        "contradict": File(points, header={"points": 2}).bytes(),
    }


def test_a_parameter_that_nothing_needs_may_be_there_twice(tmp_path, numbers):
    """A lab's model that ran twice leaves its output twice, once as 0.0 (a real static of a clinic)."""
    sizes = {"PROCESSING": {"GOLEMTHORAXSIZE": real(205.186), "GOLEMTHORAXSIZF": real(0.0), "BODYMASS": real(63.9)}}
    sizes["PROCESSING"] |= {"KNEEWIDTH": real(100.0), "KNEEWIDTI": real(101.0)}
    points, analog = numbers
    content = File(points, analog, parameters=sizes).bytes()
    content = content.replace(b"GOLEMTHORAXSIZF", b"GOLEMTHORAXSIZE").replace(b"KNEEWIDTI", b"KNEEWIDTH")
    raw = read_raw(save(tmp_path, content))
    np.testing.assert_array_equal(raw.points, points[..., :3])
    np.testing.assert_array_equal(raw.analog, analog)
    assert raw.warnings == ()
    taken, left = raw.history
    assert taken == (
        "Parameter PROCESSING:GOLEMTHORAXSIZE is there twice, as 205.18600463867188 and as 0.0; the one that is not "
        "zero was taken."
    )
    assert left == (
        "Parameter PROCESSING:KNEEWIDTH is there twice, as 100.0 and as 101.0; neither was taken, and the file is read "
        "without it."
    )
    np.testing.assert_allclose(raw.parameters["PROCESSING"]["GOLEMTHORAXSIZE"], [205.186], rtol=1e-6)
    assert "KNEEWIDTH" not in raw.parameters["PROCESSING"]


def test_more_frames_than_16_bits_hold_are_all_read(tmp_path):
    """Header, POINT:FRAMES and TRIAL of a recording of 70,000 frames stop at 65,535; a frame has 24 bytes, so that 21
    of them would fit into the zeros of the last block.
    """
    frames = 70_000
    points = np.ones((frames, 1, 4)) * np.array([1.0, 2.0, 3.0, 0.0]) + np.arange(frames)[:, None, None]
    points[..., 3] = 0.0
    analog = np.arange(2.0 * frames).reshape(-1, 1)
    full = real(65535.0)
    trial = {"ACTUAL_START_FIELD": whole(1, 0), "ACTUAL_END_FIELD": whole(65535, 0)}
    changed = {"header": {"last": 65535}, "parameters": {"POINT": {"FRAMES": full}, "TRIAL": trial}}
    raw = read_raw(save(tmp_path, File(points, analog, **changed)))
    np.testing.assert_array_equal(raw.points, points[..., :3])
    np.testing.assert_array_equal(raw.analog, analog)
    (said,) = raw.warnings
    assert said == (
        "Header, POINT:FRAMES and TRIAL stop at 65535 frames, the most that 16 bits hold; the length of the file "
        "decides: 70000 frames were read."
    )
    cut = File(points[:60_000], analog[: 2 * 60_000], **changed).bytes()
    with pytest.raises(FileRefused, match="declares 65535 frames and holds 600"):
        read_raw(save(tmp_path, cut))


def test_segment_poses_are_called_what_they_are(tmp_path):
    """A markerless export: a group ROTATION, no points, no channels; the file is sound."""
    labels = text(*(f"segment{k}_4X4" for k in range(18)))
    parameters = {"ROTATION": {"USED": whole(18), "LABELS": labels, "RATE": real(60.0), "DATA_START": whole(4)}}
    parameters |= {"ANALOG": dict.fromkeys(("USED", "SCALE", "OFFSET", "LABELS", "UNITS", "RATE"))}
    with pytest.raises(FileRefused) as refusal:
        read_raw(save(tmp_path, File(np.empty((5, 0, 4)), parameters=parameters)))
    said = str(refusal.value)
    assert "holds 18 segment poses (segment0, segment1, segment2, segment3 ...)" in said
    assert "no markers. The file is sound, but biodance follows markers and does not read poses" in said
    assert "export the trial again" not in said


@pytest.mark.parametrize("reason", list(damaged((np.ones((FRAMES, POINTS, 4)), np.ones((FRAMES * SAMPLES, CHANNELS))))))
def test_a_damaged_file_is_refused_with_one_sentence(tmp_path, numbers, reason):
    path = save(tmp_path, damaged(numbers)[reason])
    with pytest.raises(FileRefused) as refusal:
        read_raw(path)
    assert reason in str(refusal.value)
    assert str(path) in str(refusal.value)


def test_what_a_step_does_not_need_never_refuses_the_file(tmp_path, numbers):
    points, analog = numbers
    lacking = {
        "GEN_SCALE is missing": ({"GEN_SCALE": None}, np.ones(CHANNELS, dtype=bool)),
        "SCALE has 1 values": ({"SCALE": real(1.0)}, np.arange(CHANNELS) < 1),
        "SCALE has 0 values": ({"SCALE": None}, np.zeros(CHANNELS, dtype=bool)),
        "OFFSET has 0 values": ({"OFFSET": None}, np.ones(CHANNELS, dtype=bool)),
    }
    for said, (missing, known) in lacking.items():
        raw = read_raw(save(tmp_path, File(points, analog, parameters={"ANALOG": missing})))
        assert said in raw.warnings[0]
        np.testing.assert_allclose(raw.points, points[..., :3], rtol=1e-6)
        np.testing.assert_allclose(raw.analog[:, known], analog[:, known], rtol=1e-6)
        assert np.isnan(raw.analog[:, ~known]).all()


def test_a_parameter_twice_with_the_same_value_is_one(tmp_path, numbers):
    points, _ = numbers
    group = {"BODYMASS": real(70.0), "BODYMASX": real(70.0)}
    content = File(points, parameters={"SUBJECTS": group}).bytes().replace(b"BODYMASX", b"BODYMASS")
    raw = read_raw(save(tmp_path, content))
    assert raw.parameters["SUBJECTS"]["BODYMASS"] == 70.0
    assert raw.history == ()


def test_a_needed_parameter_with_two_values_stops_the_file(tmp_path, numbers):
    points, analog = numbers
    group = {"SCALE": real(2.0, 2.0), "SCALF": real(3.0, 3.0)}
    content = File(points, analog, parameters={"ANALOG": group}).bytes().replace(b"SCALF", b"SCALE")
    with pytest.raises(FileRefused, match=r"ANALOG:SCALE is there twice, as 2.0, 2.0 and as 3.0, 3.0, and the file"):
        read_raw(save(tmp_path, content))


def test_a_parameter_of_an_undefined_group_is_kept_aside(tmp_path, numbers):
    points, _ = numbers
    content = File(points, parameters={"MINE": {"NOTE": text("x")}}).bytes()
    at = content.index(b"NOTE")
    raw = read_raw(save(tmp_path, content[: at - 1] + b"\x63" + content[at:]))
    assert raw.parameters["GROUP 99"]["NOTE"] == ["x"]


def test_the_last_pointer_of_a_mips_file_in_the_other_byte_order(tmp_path, numbers):
    points, _ = numbers
    content = bytearray(File(points, processor=MIPS, parameters={"MINE": {"NOTE": text("x")}}).bytes())
    at = content.index(b"NOTE") + 4
    content[at], content[at + 1] = content[at + 1], content[at]
    assert read_raw(save(tmp_path, bytes(content))).parameters["MINE"]["NOTE"] == ["x"]


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(FileRefused, match="no such file"):
        read_raw(tmp_path / "none.c3d")
    with pytest.raises(FileRefused, match="a folder"):
        read_raw(tmp_path)

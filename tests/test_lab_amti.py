"""AMTI's native files, written byte by byte here with known truth: both versions of .bsf, and text with and without
an explanation.
"""

import numpy as np
import pytest

from biodance.errors import FileRefused
from biodance.lab.readers.amti_text import read as read_amti_ascii
from biodance.lab.readers.amti_text import sniff
from biodance.lab.readers.bsf import INSTRUMENT, MAIN
from biodance.lab.readers.bsf import read as read_bsf

POUND, INCH = 4.4482216152605, 0.0254
IMPERIAL = np.array([POUND] * 3 + [POUND * INCH] * 3)
RATE = 200
SENSITIVITY = np.array([0.67, 0.67, 0.17, 0.03, 0.03, 0.06])


def load(seconds=3.0):
    """A person of 600 N on the plate: load ON the plate (S, 6) N, N·m about the surface centre, plate axes (z down),
    and where it presses (x, y).
    """
    time = np.arange(0, seconds, 1 / RATE)
    on = np.clip((time - 0.8) / 0.2, 0, 1)
    force = on[:, None] * np.column_stack([40 * np.sin(3 * time), 25 * np.cos(2 * time), 600 + 50 * np.sin(5 * time)])
    point = np.column_stack([0.05 + 0.02 * np.sin(time), -0.1 + 0.01 * np.cos(time), 0 * time])
    moment = np.cross(point, force)
    moment[:, 2] += 3 * on
    return np.hstack([force, moment]), point


def bsf(kind, loads, *, offset=(0, 0, 0), distance=(0, 0, 0), cut=None, **changes):
    """The bytes of a .bsf file with these plates (N, N·m); ``changes`` spoil fields of the main header."""
    main = np.zeros((), MAIN)
    for key, value in {
        "version": kind, "size": MAIN.itemsize - 4, "plates": len(loads), "seconds": len(loads[0]) / RATE,
        "rate": RATE, "weight": 135.0,
    }.items():  # fmt: skip
        main[key] = value
    for key, value in changes.items():
        main[key] = value
    headers, columns = [], []
    for values in loads:
        header = np.zeros((), INSTRUMENT)
        header["size"], header["channels"], header["model"] = INSTRUMENT.itemsize + 64, 6, b"OR6-7"
        header["length"], header["width"], header["offset"], header["distance"] = 20.0, 18.0, offset, distance
        pounds = values / IMPERIAL
        if kind == 100:
            header["sensitivity"][:6], header["gain"][:6], header["excitation"][:6] = SENSITIVITY, 4000, 10
            header["counts_per_volt"][:6] = 3276.8
            pounds = np.round(pounds * SENSITIVITY * 4000 * 10 * 3276.8 / 1e6)
        headers.append(header.tobytes() + bytes(64))
        columns.append(pounds)
    data = np.hstack(columns).astype("<i2" if kind == 100 else "<f8")
    return (main.tobytes() + b"".join(headers) + data.tobytes())[:cut]


def written(tmp_path, content, name="trial.bsf"):
    path = tmp_path / name
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(("version", "newton", "newton_metre"), [(100, 0.1, 0.015), (105, 1e-9, 1e-9)])
def test_both_versions_give_the_reaction_with_z_up(tmp_path, version, newton, newton_metre):
    truth, point = load()
    trial = read_bsf(written(tmp_path, bsf(version, [truth])), role="check")
    plate = trial.plates[0]
    upright = np.array([1, -1, -1])
    np.testing.assert_allclose(plate.wrench.force, -truth[:, :3] * upright, atol=newton)
    np.testing.assert_allclose(plate.wrench.moment, -truth[:, 3:] * upright, atol=newton_metre)
    cop = plate.wrench.cop(threshold=300)
    loaded = np.isfinite(cop[:, 0])
    np.testing.assert_allclose(cop[loaded], (point * upright)[loaded], atol=1e-4 if version == 100 else 1e-12)
    assert (trial.name, trial.role, trial.markers, plate.type) == ("trial", "check", None, 0)
    assert trial.source.analog_rate == plate.wrench.rate == RATE
    assert trial.measurements["Bodymass"] == pytest.approx(135 * 0.45359237)
    np.testing.assert_allclose(plate.corners[0], [0.2286, -0.254, 0])
    assert any("Lab frame = plate frame turned" in said for said in plate.decisions)


def test_the_depth_of_the_sensor_is_allowed_for(tmp_path):
    truth, _ = load()
    depth = 1.6 * INCH
    about_sensor = truth.copy()
    about_sensor[:, 3:] += np.cross([0, 0, -depth], truth[:, :3])
    for sign in (1, -1):
        trial = read_bsf(written(tmp_path, bsf(105, [about_sensor], offset=(0, 0, sign * 1.6))))
        np.testing.assert_allclose(trial.plates[0].wrench.moment, -truth[:, 3:] * [1, -1, -1], atol=1e-5)


def test_two_plates_lie_apart_and_that_is_said(tmp_path):
    truth, _ = load()
    trial = read_bsf(written(tmp_path, bsf(105, [truth, truth], distance=(20.0, 4.0, 0.0))))
    first, second = trial.plates
    np.testing.assert_allclose(second.centre - first.centre, [20 * INCH, -4 * INCH, 0], atol=1e-7)
    np.testing.assert_allclose(
        second.wrench.moment - first.wrench.moment, np.cross(second.centre, second.wrench.force), atol=1e-6
    )
    assert "Check that" in trial.warnings[0]
    assert "no distance" in read_bsf(written(tmp_path, bsf(105, [truth, truth]))).warnings[0]


def test_a_large_zero_is_taken_off_and_a_small_one_kept(tmp_path):
    truth, _ = load()
    for level, left in ((12.0, 0.0), (3.0, 3.0)):
        trial = read_bsf(written(tmp_path, bsf(105, [truth + np.array([0, 0, level, 0, 0, 0])])))
        np.testing.assert_allclose(trial.plates[0].wrench.force[:, 2] - truth[:, 2], left, atol=1e-9)


def test_a_file_that_holds_the_reaction_is_recognised_by_gravity(tmp_path):
    truth, _ = load()
    trial = read_bsf(written(tmp_path, bsf(105, [-truth])))
    np.testing.assert_allclose(trial.plates[0].wrench.force[:, 2], truth[:, 2], atol=1e-9)
    assert "reaction" in trial.warnings[0]


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "empty"),
        (b"C3D" * 100, "the header of a .bsf file alone"),
        (bsf(105, [load()[0]], cut=-8), "bytes follow"),
        (bsf(105, [load()[0]], cut=1200), "ends inside the header of instrument 1"),
        (bsf(105, [load()[0]], version=104), "no .bsf file of version 100 or 105"),
        (bsf(105, [load()[0]], rate=0), "the rate is 0"),
        (bsf(105, [load()[0]], plates=99), "number of plates is 99"),
        (bsf(105, [load()[0]], size=12), "header size is 12"),
        (bsf(105, [load()[0]], seconds=-1.0), "lasts -1 s"),
        (bsf(105, [load()[0] * np.nan]), "is not a number"),
        (bsf(105, [load()[0]], offset=(0, 0, 40)), "correct its offset"),
        (
            bsf(100, [load()[0]]).replace(np.float32(3276.8).tobytes(), np.float32(0).tobytes()),
            "a calibration value is 0",
        ),
        (bsf(105, [load()[0]]).replace(np.float32(20).tobytes(), np.float32(2000).tobytes(), 1), "legal are sides"),
    ],
)
def test_damaged_files_are_refused_with_a_sentence(tmp_path, content, word):
    with pytest.raises(FileRefused, match=f"(?i){word}"):
        read_bsf(written(tmp_path, content))


def test_any_cut_of_the_file_is_refused(tmp_path):
    content = bsf(105, [load(0.5)[0]])
    for cut in range(0, len(content), 97):
        with pytest.raises(FileRefused):
            read_bsf(written(tmp_path, content[:cut]))


def table(values, *, header="", separator=",", time=True):
    rows = np.column_stack([np.arange(len(values)) / RATE, values]) if time else values
    return (header + "\n".join(separator.join(f"{x:.6f}" for x in row) for row in rows)).encode()


def test_text_without_explanation_is_refused_and_the_message_is_the_cure(tmp_path):
    truth, _ = load()
    path = written(tmp_path, table(truth), "trial.asc")
    with pytest.raises(
        FileRefused, match=r"does not say columns, force_unit, moment_unit, rate_hz, plate_size_m.*trial\.toml"
    ) as refused:
        read_amti_ascii(path)
    path.with_suffix(".toml").write_text(str(refused.value).split("\n", 1)[1])
    trial = read_amti_ascii(path)
    np.testing.assert_allclose(trial.plates[0].wrench.value, -truth * [1, -1, -1, 1, -1, -1], atol=1e-5)
    assert trial.source.analog_rate == RATE


@pytest.mark.parametrize("separator", [",", ";", "\t", "   "])
def test_order_units_and_sign_come_from_the_toml(tmp_path, separator):
    truth, _ = load()
    shuffled = truth[:, [2, 0, 1, 3, 4, 5]] / IMPERIAL[[2, 0, 1, 3, 4, 5]] * -1
    path = written(tmp_path, table(shuffled, separator=separator, time=False), "trial.txt")
    path.with_suffix(".toml").write_text(
        'columns = ["Fz", "Fx", "Fy", "Mx", "My", "Mz"]\nforce_unit = "lbf"\nmoment_unit = "in-lbf"\nrate_hz = 200\n'
        'plate_size_m = [0.4, 0.6]\nacts_on = "subject"\n'
    )
    trial = read_amti_ascii(path)
    np.testing.assert_allclose(trial.plates[0].wrench.value, -truth * [1, -1, -1, 1, -1, -1], atol=1e-4)
    assert trial.warnings == ()


def test_a_header_line_says_order_and_units(tmp_path):
    truth, _ = load()
    header = "NetForce export\nTime (s),Fx (N),Fy (N),Fz (N),Mx (N-m),My (N-m),Mz (N-m)\n"
    path = written(tmp_path, table(truth, header=header), "trial.csv")
    with pytest.raises(FileRefused, match=r"does not say plate_size_m\."):
        read_amti_ascii(path)
    path.with_suffix(".toml").write_text("plate_size_m = [0.4, 0.6]\nsensor_depth_m = 0.05")
    plate = read_amti_ascii(path).plates[0]
    moved = truth[:, 3:] + np.cross(truth[:, :3], [0, 0, -0.05])
    np.testing.assert_allclose(plate.wrench.moment, -moved * [1, -1, -1], atol=1e-4)


@pytest.mark.parametrize(
    ("toml", "word"),
    [
        ("rate = 5", "rate is no key of this file"),
        ("rate_hz = = 5", "not valid TOML"),
        ('columns = ["Fx", "Fy"]', "columns must name 7 columns"),
        ('force_unit = "stone"', "force_unit must be one of"),
        ('moment_unit = "N"', "moment_unit must be a force times a length"),
        ("rate_hz = -1", "rate_hz must be a positive number"),
        ('rate_hz = "fast"', "rate_hz must be a positive number"),
        ("plate_size_m = [0.4]", "plate_size_m must be two sides"),
        ("plate_size_m = 40", "plate_size_m must be two sides"),
        ("plate_size_m = [40, 60]", "plate_size_m must be two sides"),
        ("sensor_depth_m = 40", "sensor_depth_m must be"),
        ('acts_on = "both"', "acts_on must be"),
        ("columns = 5", "columns must name"),
    ],
)
def test_nonsense_in_the_toml_is_refused(tmp_path, toml, word):
    path = written(tmp_path, table(load()[0]), "trial.asc")
    whole = {
        "columns": '["time_s", "Fx", "Fy", "Fz", "Mx", "My", "Mz"]', "force_unit": '"N"', "moment_unit": '"Nm"',
        "rate_hz": "200",
        "plate_size_m": "[0.4, 0.6]",
    }  # fmt: skip
    whole.pop(toml.split(" =")[0], None)
    path.with_suffix(".toml").write_text("\n".join([*(f"{k} = {v}" for k, v in whole.items()), toml]))
    with pytest.raises(FileRefused, match=word):
        read_amti_ascii(path)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"hello\n", "0 rows"),
        (b"1,2,3\n4,5,6\n", "at least 2 rows of 6"),
        (b"1,2,3,4,5,6\n1,2,3,4,5\n", "line 2"),
        (b"1,2,3,4,5,6\n1,2,nan,4,5,6\n", "line 2"),
        (b"1,2,3,4,5,6\n1,2,x,4,5,6\n", "line 2"),
        (b"\x00\x01\x02\x03" * 50, "binary"),
    ],
)
def test_text_that_is_no_table_is_refused(tmp_path, content, word):
    with pytest.raises(FileRefused, match=word):
        read_amti_ascii(written(tmp_path, content, "trial.asc"))


def test_the_real_bsf(data):
    trial = read_bsf(data / "amti" / "AMTIdata.bsf")
    plate = trial.plates[0]
    assert (plate.wrench.rate, plate.wrench.time.size) == (pytest.approx(500), 1000)
    assert plate.wrench.force[:, 2].max() == pytest.approx(738, abs=0.5)
    assert plate.wrench.force[:, 2].mean() == pytest.approx(211.8, abs=0.1)
    cop = plate.wrench.cop(threshold=50)
    assert (np.abs(cop[np.isfinite(cop[:, 0]), :2]) < [0.2, 0.3]).all()


def test_the_real_text(data, tmp_path):
    path = tmp_path / "trial.asc"
    path.write_bytes((data / "amti" / "Trial1-FxFyFzMxMyMz.asc").read_bytes())
    with pytest.raises(FileRefused) as refused:
        read_amti_ascii(path)
    path.with_suffix(".toml").write_text(str(refused.value).split("\n", 1)[1])
    wrench = read_amti_ascii(path).plates[0].wrench
    assert wrench.value.shape == (200, 6)
    assert wrench.rate == pytest.approx(200)
    assert wrench.force[:, 2].max() == pytest.approx(930.4, abs=0.1)


def test_a_table_with_unknown_numbers_is_a_recording_and_not_passed_over():
    assert sniff(b"t Fx Fy Fz Mx My Mz\n0.01 1 2 nan 4 5 6\n0.02 1 2 NaN 4 5 6\n")
    assert sniff(b"t Fx Fy Fz Mx My Mz\n0.01 1 2 nan.06 4 5 6\n0.02 1 2 3 4 5 6\n0.03 1 2 3 4 5 6\n")
    assert not sniff(b"name Fx Fy Fz Mx My Mz\nann 1 2 3 4 5 6\n")

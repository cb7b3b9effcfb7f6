"""Damaged C3D files end in a refusal or in the right numbers: never in a hang, a crash, a foreign error or a wrong
number.
"""

import numpy as np
import pytest
from c3d_files import DEC, MIPS, File, real, whole
from c3d_mutations import DAMAGES, damaged, judge, original
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from biodance.lab.c3d.write import PlateRecording, write_c3d
from biodance.records import Markers

CORNERS = np.array([[0.4, 0.6, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
RELAXED = settings(max_examples=250, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
LEGAL = ("accepted", "refused", "other data")
"""What may become of a damaged file; numbers that differ are an error of `judge`."""
REAL = ("adl_gait/2014001_ST.c3d", "c3d_parser/static/CB_Static0001.c3d", "biomdp/kistler_CMJ_1plate.c3d")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Sound files: one from write_c3d, others laid down byte by byte in the rarer orders and storages."""
    folder = tmp_path_factory.mktemp("sound")
    generator = np.random.default_rng(0)
    xyz = generator.uniform(0.2, 1.5, (1, 6, 3)) + 0.01 * np.sin(np.arange(40) / 5)[:, None, None]
    wrench = generator.normal([0, 0, -700, 0, 0, 0], size=(400, 6))
    plate = PlateRecording(2, CORNERS, [0, 0, -0.04], wrench)
    markers = Markers(tuple(f"Anna:LAB{i}" for i in range(6)), np.arange(40) / 100, xyz)
    said = {"PROCESSING": {"Bodymass": 70.0, "Height": 1750.0}}
    write_c3d(folder / "written.c3d", markers=markers, plates=[plate], analog_rate=1000.0, parameters=said)
    points = np.concatenate([np.round(1000 * xyz), np.zeros((40, 6, 1))], axis=2)
    transform = {"ANALOG": {"OFFSET": whole(*range(1, 7)), "SCALE": real(0.5, 2, 3, 1, 1, 1)}}
    for name, processor, scale in (
        ("dec", DEC, -0.1),
        ("mips", MIPS, -0.1),
        ("integers", MIPS, 0.5),
        ("whole", 84, 0.5),
    ):
        (folder / f"{name}.c3d").write_bytes(
            File(points, np.round(wrench), processor, scale, parameters=transform).bytes()
        )
    return [original(path) for path in sorted(folder.iterdir())]


@pytest.fixture(scope="module")
def recorded(data):
    """Real recordings, where they are at hand."""
    return [original(data / name) for name in REAL]


@RELAXED
@given(which=st.integers(0, 8), damage=DAMAGES)
def test_damage_to_written_files(written, tmp_path_factory, which, damage):
    first = written[which % len(written)]
    assert judge(first, damaged(first, damage), tmp_path_factory.getbasetemp() / "damaged.c3d") in LEGAL


@RELAXED
@given(which=st.integers(0, 8), damage=DAMAGES)
def test_damage_to_real_recordings(recorded, tmp_path_factory, which, damage):
    first = recorded[which % len(recorded)]
    assert judge(first, damaged(first, damage), tmp_path_factory.getbasetemp() / "damaged.c3d") in LEGAL


def test_the_judge_finds_a_wrong_number(written, tmp_path):
    """The check can fail: hold the intact file against an original whose numbers are other ones."""
    first = written[-1]
    assert judge(first, first.content, tmp_path / "intact.c3d") == "accepted"
    first.stored[5, 2] += 1.0
    with pytest.raises(AssertionError):
        judge(first, first.content, tmp_path / "intact.c3d")

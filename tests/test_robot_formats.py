"""A robot's recording in every format that its laboratory may have, and a URDF file with a link that no body can be."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from robot_recordings import FEET, drawing, matched, recorded

from biodance.body.urdf import read_urdf
from biodance.errors import BiodanceError
from biodance.lab.readers import read_trial
from biodance.motion.grounded import onto_plate
from biodance.pipeline.robot import identify_robot, of_file
from biodance.records import CHANNELS
from biodance.spatial import wrench_about_point

_SAID = """columns = ["time_s", "Fx", "Fy", "Fz", "Mx", "My", "Mz"]
force_unit = "N"
moment_unit = "Nm"
plate_size_m = [0.50, 0.46]
acts_on = "plate"
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("robot")
    drawing(folder)
    recorded(folder / "good", seconds=8.0)
    return folder


def as_text_and_parquet(source: Path, target: Path) -> Path:
    """Copy a recording as Parquet and as the text that an AMTI plate exports: load on the plate, z down."""
    target.mkdir()
    pd.read_csv(source / "run_joints.csv").to_parquet(target / "run_joints.parquet")
    plate = read_trial(source / "run_plate.c3d", role="fit").plates[0]
    wrench = wrench_about_point(plate.wrench.value, np.array([0.25, 0.23, 0.0]))
    load = -wrench * [1, -1, -1, 1, -1, -1]
    frame = pd.DataFrame(load, columns=[f"{channel} ({'N' if channel[0] == 'F' else 'Nm'})" for channel in CHANNELS])
    frame.insert(0, "time (s)", plate.wrench.time)
    frame.to_csv(target / "run_plate.csv", index=False)
    return target


def test_parquet_and_text_say_what_csv_and_c3d_say(place: Path, tmp_path: Path) -> None:
    folder = as_text_and_parquet(place / "good", tmp_path / "other")
    with pytest.raises(BiodanceError, match=r"does not say plate_size_m.*run_plate.toml"):
        matched(folder, place / "hoap3.urdf")
    (folder / "run_plate.toml").write_text(_SAID)
    one, other = (matched(run, place / "hoap3.urdf") for run in (place / "good", folder))
    assert [path.suffix for path in other.recorded.files] == [".parquet", ".csv"]
    assert other.plate.delay == pytest.approx(one.plate.delay, abs=0.002)
    assert other.plate.yaw == pytest.approx(one.plate.yaw, abs=0.002)
    seen = [onto_plate(run.fit.wrench.value, run.plate)[run.fit.use] for run in (one, other)]
    np.testing.assert_allclose(seen[1][:, :3], seen[0][:, :3], atol=0.1)


def test_a_plate_of_another_motion_is_refused_and_no_exchange_is_blamed(place: Path, tmp_path: Path) -> None:
    other = recorded(tmp_path / "other", seed=8, seconds=8.0)
    (other / "run_joints.csv").write_bytes((place / "good" / "run_joints.csv").read_bytes())
    with pytest.raises(BiodanceError, match="is not the plate of this motion"):
        identify_robot(other, urdf=place / "hoap3.urdf", feet=FEET)


def test_a_link_that_no_body_can_be_is_refused_by_name_and_mended_on_request(place: Path, tmp_path: Path) -> None:
    text = (place / "hoap3.urdf").read_text()
    before, after = text.split('<link name="left_shank">', 1)
    inertia = re.sub(r'ixx="[^"]+"', 'ixx="5.0"', after, count=1)
    path = tmp_path / "broken.urdf"
    path.write_text(f'{before}<link name="left_shank">{inertia}')
    with pytest.raises(BiodanceError, match=r"left_shank.*--mend"):
        read_urdf(path, feet=FEET)
    drawn, mended = read_urdf(place / "hoap3.urdf", feet=FEET), read_urdf(path, feet=FEET, mend=True)
    np.testing.assert_allclose(mended.sip.mass, drawn.sip.mass)
    shank = mended.segments.index("left_shank")
    mass, *rest = mended.sip.phi[10 * shank : 10 * shank + 10]
    com, about_joint = np.array(rest[:3]) / mass, np.array(rest[3:])[[0, 2, 5]].sum()
    sides = drawn.boxes[shank][1] - drawn.boxes[shank][0]
    assert about_joint - 2 * mass * com @ com == pytest.approx(mass / 6 * sides @ sides)
    (said,) = of_file(tuple(note for note in mended.notes if "Mended" in note))
    assert said.level == "warn"
    assert "left_shank" in said.text

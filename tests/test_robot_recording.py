"""A robot's recording through the front door: masses of a truth made by pinocchio, and bad recordings in a sentence."""

import json
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from accessible import ASKED, complaints, unfold
from browser import Page
from robot_lab import RobotLab, write_robot_trial
from robot_recordings import COVER, FEET, drawing, matched, real_robot, recorded, stepped

from biodance.cli import run
from biodance.errors import BiodanceError
from biodance.motion.grounded import PlateFit, fit_plate, from_plate, onto_plate
from biodance.pipeline.robot import attention_of, identify_robot
from biodance.records import Wrench


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("robot")
    drawing(folder)
    recorded(folder / "good")
    return folder


def table(source: Path, target: Path, change) -> Path:  # type: ignore[no-untyped-def]
    """Copy a recording with another table of encoders."""
    target.mkdir()
    (target / "run_plate.c3d").write_bytes((source / "run_plate.c3d").read_bytes())
    frame = change(pd.read_csv(source / "run_joints.csv"))
    frame.to_csv(target / "run_joints.csv", index=False)
    return target


def refused(folder: Path, place: Path) -> str:
    """Return the sentence with which a recording is refused."""
    with pytest.raises(BiodanceError) as told:
        identify_robot(folder, urdf=place / "hoap3.urdf", feet=FEET)
    return str(told.value)


@pytest.fixture(scope="module")
def told(place: Path) -> tuple[dict[str, Any], Path]:
    """Return what the command prints of the good recording, and its page."""
    asked = ["identify", str(place / "good"), "--urdf", str(place / "hoap3.urdf"), "--feet", ",".join(FEET)]
    with redirect_stdout(StringIO()) as printed:
        assert run([*asked, "--out", str(place / "out"), "--json"]) == 0
    return json.loads(printed.getvalue()), place / "out" / "report.html"


def test_a_missing_cover_is_found_from_files_alone(told: tuple[dict[str, Any], Path]) -> None:
    found, page = told
    truth = real_robot().sip
    rows = found["segments"]
    assert [row["name"] for row in rows] == list(truth.segments)
    mass = np.array([row["mass_kg"] for row in rows])
    sd = np.array([row["mass_sd_kg"] for row in rows])
    drawn = np.array([row["mass_prior_kg"] for row in rows])
    assert drawn.sum() - mass.sum() == pytest.approx(COVER, abs=0.1)
    trunk = truth.segments.index("trunk_head")
    assert abs(mass - truth.mass)[trunk] < 0.25 * COVER
    assert (abs(mass - truth.mass) < 2 * sd).all()
    (one,) = found["validation"]
    assert one["identified"]["rms"][2] < 0.3 < 3 < one["table"]["rms"][2]
    assert max(one["identified"]["rms"][:3]) < 2
    assert max(one["identified"]["rms"][3:]) < 1
    (match,) = found["matched"]
    assert match["delay_s"] == pytest.approx(RobotLab().ahead, abs=0.01)
    assert match["yaw_rad"] == pytest.approx(RobotLab().yaw, abs=0.02)
    assert [stance["foot"] for stance in match["standing"]] == ["left"]
    assert found["added_mass"] is None
    assert any("less than drawn" in said["text"] for said in found["attention"])
    assert "7.94 kg" in page.read_text()
    assert ".curves" in page.read_text()  # the style without which figures are black


@ASKED
def test_nobody_is_shut_out_of_the_page(told: tuple[dict[str, Any], Path]) -> None:
    with Page("about:blank#begin") as browser:
        unfold(browser, told[1].as_uri())
        assert complaints(browser) == []


def test_time_and_place_of_a_plate_follow_from_the_path_alone() -> None:
    rng, time = np.random.default_rng(3), np.arange(0, 12, 0.01)
    path = np.cumsum(rng.normal(size=(2, time.size)), axis=1) * 0.002
    wrench = np.zeros((time.size, 6))
    wrench[:, 2] = 80.0
    wrench[:, 3], wrench[:, 4] = 80 * path[1], -80 * path[0]
    truth = PlateFit(-2.5, (0.3, -0.1), 0.8, 1.0, 1.0)
    seen = Wrench(time + truth.delay, onto_plate(wrench, truth))
    np.testing.assert_allclose(from_plate(seen.value, truth.place, truth.yaw), wrench, atol=1e-12)
    some = np.ones(time.size, dtype=bool)
    some[300:420] = False
    found = fit_plate(Wrench(time, wrench), seen, some)
    assert found.correlation == pytest.approx(1, abs=1e-9)
    assert (found.delay, found.yaw, found.scale) == pytest.approx((truth.delay, truth.yaw, 1.0), abs=1e-4)
    assert found.place == pytest.approx(truth.place, abs=1e-9)


def test_clocks_apart_by_seconds_are_brought_together_and_said(place: Path, tmp_path: Path) -> None:
    folder = table(
        place / "good", tmp_path / "late", lambda frame: frame.assign(**{"time (s)": frame["time (s)"] + 7.25})
    )
    one = matched(folder, place / "hoap3.urdf")
    told = attention_of((one,))
    assert one.plate.delay == pytest.approx(RobotLab().ahead - 7.25, abs=0.01)
    (clocks,) = (said for said in told if said.about == "time_delay")
    assert clocks.level == "warn"
    assert "at t -6.88" in clocks.text


def test_the_plate_says_which_foot_stands_where_the_angles_leave_it_open(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which columns may be exchanged is not asked; that none is blamed, by `test_robot_formats`."""
    monkeypatch.setattr("biodance.pipeline.robot_trials._exchanged", lambda *_: None)
    body = real_robot()
    time, angle, wrench = stepped(body, 0)
    write_robot_trial(
        tmp_path / "run", tuple(joint.name for joint in body.joints), time, angle, wrench, lab=RobotLab(), seed=0
    )
    one = matched(tmp_path, place / "hoap3.urdf")
    assert one.plate.correlation > 0.95
    assert one.plate.delay == pytest.approx(RobotLab().ahead, abs=0.01)
    grounded = one.grounded
    clock = grounded.motion.time
    assert (grounded.foot[(clock > 2.0) & (clock < 14.0)] == 1).all()
    assert (grounded.foot[(clock > 18.0) & (clock < 30.0)] == 0).all()
    assert grounded.unclear[(clock > 5.0) & (clock < 11.0)].mean() > 0.5  # the angles do not tell


def test_a_missing_encoder_is_named_and_a_still_joint_may_be_declared(place: Path, tmp_path: Path) -> None:
    folder = table(place / "good", tmp_path / "lost", lambda frame: frame.drop(columns="left_elbow_pitch (rad)"))
    assert "no encoder for the joint left_elbow_pitch" in refused(folder, place)
    assert "fixed = {left_elbow_pitch" in refused(folder, place)
    (folder / "recording.toml").write_text("[joints]\nfixed = {left_elbow_pitch = -0.3}\n")
    told = attention_of((matched(folder, place / "hoap3.urdf"),))
    assert any("Taken as not moving: left_elbow_pitch" in said.text for said in told)


def test_degrees_are_refused_unless_said(place: Path, tmp_path: Path) -> None:
    def turned(frame: pd.DataFrame) -> pd.DataFrame:
        angles = frame.columns[1:]
        frame[angles] = np.degrees(frame[angles])
        return frame.rename(columns=lambda name: name.replace(" (rad)", ""))

    folder = table(place / "good", tmp_path / "degrees", turned)
    assert "In degrees?" in refused(folder, place)
    (folder / "recording.toml").write_text('angle_unit = "deg"\n')
    told = attention_of((matched(folder, place / "hoap3.urdf"),))
    assert any("converted from degrees" in said.text for said in told)


def test_exchanged_columns_are_named(place: Path, tmp_path: Path) -> None:
    pair = ("right_hip_pitch", "left_hip_pitch")
    one, other = (f"{name} (rad)" for name in pair)
    folder = table(place / "good", tmp_path / "swapped", lambda frame: frame.rename(columns={one: other, other: one}))
    said = refused(folder, place)
    assert "exchanged" in said
    assert pair[0] in said
    assert pair[1] in said


def test_folders_that_are_no_recording_say_what_one_is(place: Path, tmp_path: Path) -> None:
    assert "is no folder" in refused(tmp_path / "nowhere", place)
    (tmp_path / "notes.txt").write_text("nothing")
    assert "no table with encoder columns" in refused(tmp_path, place)
    (tmp_path / "recording.toml").write_text("speed = 3\n")
    assert "speed = 3 is not legal" in refused(tmp_path, place)


def test_a_robot_needs_both_options(place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["identify", str(place / "good"), "--feet", "a,b", "--out", str(tmp_path / "out")]) == 2
    assert "both --urdf FILE and --feet" in capsys.readouterr().err

"""HOAP-3: the maker's mass, lengths and origins come out of the Denavit-Hartenberg rows."""

from pathlib import Path

import numpy as np
import pytest

from biodance.body.human.skeleton import SEGMENTS
from biodance.body.parts import smallest_eigenvalues
from biodance.body.similarity import hoap3
from biodance.body.tables.anthropometry import read_table, row_numbers
from biodance.cli import run
from biodance.identification.base_parameters import structural_base
from biodance.motion.kinematics import poses

BODY = hoap3()


def standing() -> np.ndarray:
    q = BODY.neutral
    return q


def test_it_weighs_what_the_paper_says_and_can_exist() -> None:
    assert BODY.sip.mass.sum() == pytest.approx(7.942, abs=0.001)
    assert smallest_eigenvalues(BODY.sip.phi).min() > 0
    assert np.all(BODY.sip.com > BODY.com_boxes[:, 0])
    assert np.all(BODY.sip.com < BODY.com_boxes[:, 1])
    assert (len(BODY.segments), len(BODY.joints), BODY.nv) == (12, 21, 27)


def test_segment_origins_are_the_makers() -> None:
    pose = poses(BODY, standing()[None])
    for name in SEGMENTS:
        expected = row_numbers(read_table("robots", "hoap3_segments").row(segment=name), "origin_x origin_y origin_z")
        np.testing.assert_allclose(pose.position[0, BODY.segment_index(name)], expected, atol=1e-9, err_msg=name)


def test_centre_of_mass_is_the_table_s() -> None:
    pose = poses(BODY, standing()[None])
    for i, name in enumerate(SEGMENTS):
        row = read_table("robots", "hoap3_segments").row(segment=name)
        expected = np.add(row_numbers(row, "origin_x origin_y origin_z"), row_numbers(row, "com_x com_y com_z"))
        np.testing.assert_allclose(pose.points([i], BODY.sip.com[i : i + 1])[0, 0], expected, atol=1e-9, err_msg=name)


@pytest.mark.parametrize(
    ("joint", "segment", "direction"),
    [
        ("waist_pitch", "trunk_head", [1, 0, 0]),
        ("right_hip_roll", "right_foot", [0, 1, 0]),
        ("right_knee_pitch", "right_foot", [-1, 0, 0]),
        ("left_knee_pitch", "left_foot", [-1, 0, 0]),
    ],
)
def test_signs_fit_the_ranges_of_the_manual(joint: str, segment: str, direction: list[int]) -> None:
    q = np.stack([standing(), standing()])
    q[1, 7 + BODY.joint_index(joint)] = 0.1
    local = BODY.sip.com[[BODY.segment_index(segment)]]
    place = poses(BODY, q).points([BODY.segment_index(segment)], local)[:, 0]
    step = place[1] - place[0]
    assert step @ np.array(direction) > 0.8 * np.linalg.norm(step)


def test_soles_are_flat_and_0_305_m_under_the_pelvis() -> None:
    pose = poses(BODY, standing()[None])
    for side, foot in BODY.feet.items():
        corners = pose.points([foot.segment] * 4, foot.outline)[0]
        np.testing.assert_allclose(corners[:, 2], -0.305, atol=1e-9)
        middle = corners[:, :2].mean(axis=0)
        assert np.sign(middle[1]) == (1 if side == "left" else -1)
        assert np.ptp(corners[:, 0]) == pytest.approx(0.108)
        edges = np.roll(corners, -1, axis=0) - corners
        assert np.all(np.cross(edges, np.roll(edges, -1, axis=0))[:, 2] > 0), "counter-clockwise"


def test_its_base_parameters_are_counted_by_theory() -> None:
    # 7 - 1 joints of two or three axes lose one parameter each (hips, ankles, shoulders), 5 hinges three each (knees,
    # elbows, waist)
    assert structural_base(BODY).count == 120 - 6 - 15


@pytest.mark.parametrize("form", ["urdf", "mjcf"])
def test_it_is_written_from_our_tables_by_export(form: str, tmp_path: Path) -> None:
    asked = ["export", "hoap3", "--format", form, "--out", str(tmp_path / f"hoap3.{form}")]
    assert run(asked) == 0
    assert (tmp_path / f"hoap3.{form}").read_text().count("trunk_head") > 0
    assert run([*asked[:3], "trc", "--out", str(tmp_path / "hoap3.trc")]) == 2

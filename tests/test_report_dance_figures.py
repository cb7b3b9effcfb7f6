"""Figures of a dance: bones join where joints are, every posture is drawn, outlines close."""

import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_dances import small_dance

from biodance.body.human.human import human
from biodance.body.solids import box_solid, shape_parts
from biodance.dance.dance import Dance
from biodance.dance.expectation import Expectation
from biodance.dance.playback import Playback, Rehearsal
from biodance.dance.problem.chain import ROOT
from biodance.dance.problem.stance import stance
from biodance.dance.verify import ZmpPath
from biodance.errors import BiodanceError
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import poses
from biodance.pipeline.still import bone_lines, silhouettes
from biodance.records import Array, Subject
from biodance.report.figures.dance import (
    criterion_figure,
    expectation_figure,
    postures_figure,
    write_film,
    zmp_figure,
)

BODY = human(Subject(65.0, 1.75, "F"))


def postures(count: int) -> np.ndarray:
    q = np.tile(BODY.neutral, (count, 1))
    q[:, 7:] = np.random.default_rng(0).uniform(BODY.limits.lower, BODY.limits.upper, (count, 23)) * 0.6
    return q


def test_bones_join_joint_centres_and_keep_their_lengths() -> None:
    q = postures(4)
    lines, sides = bone_lines(BODY, poses(BODY, q))
    length = np.linalg.norm(lines[:, :, 1] - lines[:, :, 0], axis=2)
    np.testing.assert_allclose(length, np.tile(length[0], (4, 1)), atol=1e-12)
    knee = poses(BODY, q).position[:, BODY.segment_index("right_shank")]
    ends = lines[:, [i for i, side in enumerate(sides) if side == "right"], 1]
    assert np.min(np.linalg.norm(ends - knee[:, None], axis=2), axis=1).max() < 1e-12
    assert sides.count("right") == sides.count("left") == 5


def test_every_posture_is_drawn_once_with_its_title() -> None:
    drawn = postures_figure(BODY, postures(13), tuple(str(i) for i in range(1, 14)))
    titled = [panel.get_title() for panel in drawn.axes if panel.lines]
    assert titled == [str(i) for i in range(1, 14)]


def test_criterion_stays_over_its_bound_line() -> None:
    drawn = criterion_figure(np.array([90.0, 60.0, 50.0]), 34.8)
    assert [float(line.get_ydata()[0]) for line in drawn.axes[0].lines] == [90.0, 34.8]


def test_zmp_has_a_column_for_every_stance_with_closed_outlines_and_every_move_in_both_rows() -> None:
    feet = stance(BODY, "parallel")
    path = 0.05 * np.random.default_rng(0).normal(size=(9, 2))
    drawn = zmp_figure([ZmpPath(k, where, path, 0.5 * path) for k, where in enumerate((feet, feet, feet.on(0)))])
    titles = [axes.get_title() for axes in drawn.axes]
    assert titles == ["parallel", "single right", "", ""]
    for axes, moves in zip(drawn.axes, (2, 1, 2, 1), strict=True):
        assert len(axes.lines) == 2 + moves
        outline = axes.lines[0].get_xydata()
        np.testing.assert_array_equal(outline[0], outline[-1])
    np.testing.assert_array_equal(drawn.axes[1].lines[-1].get_xydata(), 0.5 * path)
    np.testing.assert_array_equal(drawn.axes[3].lines[-1].get_xydata(), path)


def test_expected_accuracy_starts_at_the_table_and_pairs_share_a_line() -> None:
    duration = np.array([0.0, 60.0])
    values = np.tile([[1.0], [0.5]], (1, 12))
    drawn = expectation_figure(Expectation(BODY.segments, duration, values, values, values, 1 - values))
    for axes in drawn.axes:
        assert len(axes.lines) == 7
        assert all(line.get_ydata()[0] == 100.0 and line.get_ydata()[-1] == 50.0 for line in axes.lines)


def test_an_outline_is_that_of_the_solid_of_its_box() -> None:
    q, eye = postures(3), (0.6, -0.8)
    pose, seen = poses(BODY, q), np.array([[0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    drawn = silhouettes(BODY, q, eye)
    assert len(drawn) == len(shape_parts(BODY)) == 13
    for (segment, box), (name, outline, near) in zip(shape_parts(BODY), drawn, strict=True):
        assert name == BODY.segments[segment]
        corners = box_solid(box).vertices
        place = pose.points([segment] * len(corners), corners)
        np.testing.assert_allclose(near, place.mean(axis=1) @ [*eye, 0.0], atol=0.002)
        for angle in np.linspace(0.0, 2 * np.pi, 48, endpoint=False):  # as far in every direction, mesh and polygon
            outward = np.array([np.cos(angle), np.sin(angle)])
            reach = (place @ seen.T @ outward).max(axis=1)
            np.testing.assert_allclose((outline @ outward).max(axis=1), reach, atol=0.003)


def as_planned(dance: Dance) -> Rehearsal:
    motion = dance.motion(100.0)
    wrench, none = predict_wrench(dance.body, motion), np.zeros(motion.time.size)
    angles: Array = np.zeros((motion.time.size, len(dance.body.joints)))
    return Rehearsal(dance, Playback(motion.time, angles, none, none, wrench, wrench, np.nan, motion.q, {}), none)


def test_an_arm_held_far_to_the_side_stays_in_the_picture_of_the_film(tmp_path: Path) -> None:
    image_of = pytest.importorskip("PIL.Image")
    dance = small_dance()
    far = dance.postures.copy()
    far[:, ROOT + dance.body.joint_index("left_shoulder_adduction")] = np.radians(-90.0)
    far[:, ROOT + dance.body.joint_index("left_elbow_flexion")] = 0.0
    dance = replace(dance, postures=far, via=np.tile(far[0], (1, 2, 1)))
    write_film(as_planned(dance), tmp_path / "film.gif")
    with image_of.open(tmp_path / "film.gif") as film:
        picture = np.asarray(film.convert("L"))
    for left in range(0, 4 * 290, 290):
        drawn = np.flatnonzero((picture[60:440, left : left + 290] < 240).any(axis=0))
        assert drawn.min() >= 5, "px that are left beside the person"
        assert drawn.max() <= 284


_FFMPEG = """#!{python}
import pathlib, sys
if {fails}:
    sys.exit("no such encoder")
pathlib.Path(sys.argv[-1]).write_text(f"{{sys.argv}} {{len(sys.stdin.buffer.read())}}")
"""


@pytest.mark.parametrize("fails", [False, True])
def test_pictures_go_to_ffmpeg_and_what_it_says_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, fails: bool
) -> None:
    pytest.importorskip("PIL.Image")
    program, out, found = tmp_path / "ffmpeg", tmp_path / "film.mp4", as_planned(small_dance())
    program.write_text(_FFMPEG.format(python=sys.executable, fails=fails))
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    if fails:
        with pytest.raises(BiodanceError, match="no such encoder"):
            write_film(found, out)
        assert not out.exists()
        return
    write_film(found, out)
    pictures = len(found.playback.time[::4])
    assert out.read_text().endswith(f" {pictures * 1160 * 480 * 3}")
    assert "1160x480" in out.read_text()

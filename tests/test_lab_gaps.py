"""Gaps: what is reported, and that filled positions agree with the truth that was cut out."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from biodance.lab.markers.sets import read_marker_set
from biodance.lab.markers.signals import fill_gaps, report_gaps
from biodance.records import Markers

RATE = 100.0
SEGMENTS = {"A": "pelvis", "B": "pelvis", "C": "pelvis", "D": "pelvis", "E": "left_foot"}
LOCAL = np.array([[0.1, 0.0, 0.12], [0.1, 0.02, -0.12], [-0.1, 0.01, 0.05], [-0.1, 0.0, -0.05], [0.0, -0.8, 0.1]])


def moving(frames: int = 300) -> Markers:
    """Return one rigid cluster that turns and travels as in walking."""
    time = np.arange(frames) / RATE
    angles = np.stack([0.3 * np.sin(6 * time), 0.2 * np.sin(5 * time + 1), 0.2 * np.cos(4 * time)], axis=1)
    turn = Rotation.from_euler("zyx", angles).as_matrix()
    place = np.stack([1.2 * time, 0.05 * np.sin(6 * time), 0.9 + 0.03 * np.sin(12 * time)], axis=1)
    return Markers(tuple(SEGMENTS), time, np.einsum("tij,kj->tki", turn, LOCAL) + place[:, None])


def cut(markers: Markers, *spans: tuple[str, int, int]) -> Markers:
    xyz = markers.xyz.copy()
    for label, start, stop in spans:
        xyz[start:stop, markers.names.index(label)] = np.nan
    return Markers(markers.names, markers.time, xyz)


def errors(filled: Markers, truth: Markers) -> np.ndarray:
    return np.linalg.norm(filled.xyz - truth.xyz, axis=2)


def test_gaps_are_reported() -> None:
    gappy = cut(moving(200), ("A", 0, 10), ("A", 50, 55), ("C", 199, 200))
    report = {gaps.label: gaps for gaps in report_gaps(gappy)}
    assert (report["A"].percent, report["A"].longest) == pytest.approx((7.5, 0.10))
    assert (report["B"].percent, report["B"].longest) == (0.0, 0.0)
    assert report["C"].longest == pytest.approx(0.01)


def test_short_gaps_are_bridged() -> None:
    truth = moving()
    filled, gaps = fill_gaps(cut(truth, ("E", 100, 120), ("A", 40, 45)), SEGMENTS)
    assert {gap.how for gap in gaps} == {"bridged by a spline"}
    error = errors(filled, truth)
    assert error[40:45, 0].max() < 1e-3
    assert 0 < error[100:120, 4].max() < 0.01
    error[100:120, 4] = error[40:45, 0] = 0
    assert error.max() == 0


def test_long_gaps_are_carried_by_the_segment() -> None:
    truth = moving()
    noisy = Markers(truth.names, truth.time, truth.xyz + np.random.default_rng(3).normal(0, 2e-4, truth.xyz.shape))
    filled, gaps = fill_gaps(cut(noisy, ("A", 100, 180)), SEGMENTS)
    assert gaps[0].how.startswith("filled from ")
    assert errors(filled, truth)[100:180, 0].max() < 0.003
    exact, _ = fill_gaps(cut(truth, ("A", 100, 180)), SEGMENTS)
    assert errors(exact, truth).max() < 1e-12


@pytest.mark.parametrize(
    ("spans", "words"),
    [
        ([("E", 100, 130)], "fewer than three"),
        ([("A", 0, 30)], "end of the recording"),
        ([("A", 295, 300)], "end of the recording"),
        ([("A", 100, 130), ("B", 120, 160)], "fewer than three"),
        ([("E", 100, 105), ("E", 108, 112)], "fewer than three"),
    ],
)
def test_what_cannot_be_known_is_left(spans: list[tuple[str, int, int]], words: str) -> None:
    gappy = cut(moving(), *spans)
    filled, gaps = fill_gaps(gappy, SEGMENTS)
    label, start, stop = spans[0]
    assert np.isnan(filled[label][start:stop]).all()
    assert words in next(gap for gap in gaps if gap.label == label).how


def test_a_marker_that_is_not_rigid_with_its_segment_is_left() -> None:
    truth = moving()
    xyz = truth.xyz.copy()
    xyz[:, 0, 2] += 0.03 * np.sin(3 * truth.time)
    filled, gaps = fill_gaps(cut(Markers(truth.names, truth.time, xyz), ("A", 100, 150)), SEGMENTS)
    assert np.isnan(filled["A"][100:150]).all()
    assert "left unseen" in gaps[0].how


def test_a_line_of_neighbours_cannot_carry() -> None:
    truth = moving()
    line = np.array([[0.1, 0.0, 0.1], [0.0, 0.0, 0.0], [0.0, 0.0, 0.1], [0.0, 0.0, -0.1], [0, 0, 0]])
    xyz = truth.xyz[:, :1] - truth.xyz[:, :1] + line + 0.0
    filled, gaps = fill_gaps(
        cut(Markers(truth.names, truth.time, np.broadcast_to(xyz, truth.xyz.shape)), ("A", 100, 150)), SEGMENTS
    )
    assert np.isnan(filled["A"][100:150]).all()
    assert "fewer than three" in gaps[0].how


def test_without_segments_only_short_gaps_are_filled() -> None:
    filled, _ = fill_gaps(cut(moving(), ("A", 100, 150), ("B", 100, 110)), {})
    assert np.isnan(filled["A"]).any()
    assert not np.isnan(filled["B"]).any()


def test_a_marker_never_seen_and_a_single_frame_do_no_harm() -> None:
    filled, gaps = fill_gaps(cut(moving(), ("A", 0, 300)), SEGMENTS)
    assert np.isnan(filled["A"]).all()
    assert len(gaps) == 1
    one = cut(moving(1), ("B", 0, 1))
    assert np.isnan(fill_gaps(one, SEGMENTS)[0]["B"]).all()
    assert report_gaps(one)[1].percent == 100.0


@pytest.mark.parametrize("label", ["LPSI", "T10", "STRN", "LBHD", "RWRA"])
def test_gaps_cut_into_a_real_trial_are_filled_to_ten_millimetres(label: str, data: Path) -> None:
    import ezc3d

    c3d = ezc3d.c3d(str(data / "pycgm" / "Movement_trial.c3d"))
    marker_set = read_marker_set("plug_in_gait")
    match = marker_set.match(c3d["parameters"]["POINT"]["LABELS"]["value"])
    index = [c3d["parameters"]["POINT"]["LABELS"]["value"].index(label) for label in match.values()]
    xyz = np.moveaxis(c3d["data"]["points"][:3, index], (0, 1, 2), (2, 1, 0)) / 1000
    truth = Markers(tuple(match), np.arange(len(xyz)) / 120, xyz)
    segments = {marker.label: marker.segment for marker in marker_set.markers}
    for start in (60, 130, 200):
        filled, gaps = fill_gaps(cut(truth, (label, start, start + 60)), segments)
        assert gaps[0].how.startswith("filled from")
        assert errors(filled, truth).max() < 0.010

"""A trial for the viewer Rerun: what is sent to it, by a stand-in for its library; and the refusal without that."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from lab_sessions import person
from squatting import BODY, TIME, squat

from biodance.errors import FileRefused, MissingLibrary, TrialRefused
from biodance.motion.kinematics import poses
from biodance.pipeline.export import write_rerun
from biodance.pipeline.trial import WrenchComparison


class Columns(SimpleNamespace):
    """What was given to one archetype, and how it was parted."""

    def partition(self, lengths):
        self.lengths = np.asarray(lengths)
        return self


class Stream:
    """Keeps what is sent."""

    def __init__(self, *_, **__):
        self.sent, self.still = {}, {}
        Stream.last = self

    def save(self, path):
        path.touch()

    def log(self, place, what, **_):
        self.still[place] = what

    def send_columns(self, place, indexes, columns):
        self.sent[place] = (indexes[0], columns)

    def flush(self):
        pass


@pytest.fixture
def stream(monkeypatch):
    def kind():
        made = lambda *values, **named: Columns(values=values, **named)  # noqa: E731
        made.columns = Columns
        return made

    names = ("Mesh3D", "Transform3D", "Points3D", "LineStrips3D", "Arrows3D", "Scalars")
    fake = SimpleNamespace(**{name: kind() for name in names})
    fake.RecordingStream, fake.TimeColumn = Stream, lambda name, duration: duration
    fake.ViewCoordinates = SimpleNamespace(RIGHT_HAND_Z_UP="z up")
    monkeypatch.setitem(sys.modules, "rerun", fake)


def test_solids_markers_forces_residual_and_angles_are_sent(stream, tmp_path):
    one = squat()
    measured = one.trial.plates[0].wrench.value
    wrong = measured + np.array([0, 0, 50.0, 0, 0, 0])
    used = TIME < 1.5
    compared = WrenchComparison(TIME, wrong, measured, used, np.zeros(6), np.zeros(6))
    markers = person(frames=TIME.size)
    markers = replace(markers, xyz=np.where(np.arange(TIME.size)[:, None, None] == 5, np.nan, markers.xyz))
    one = replace(one, trial=replace(one.trial, markers=markers), comparison=compared)
    write_rerun(one, BODY, tmp_path / "a.rrd")
    found = Stream.last
    time, moved = found.sent["lab/body/left_thigh"]
    np.testing.assert_array_equal(time, TIME)
    pose = poses(BODY, one.motion.q)
    np.testing.assert_allclose(moved.translation, pose.position[:, BODY.segment_index("left_thigh")])
    assert len(found.still["lab/body/left_thigh"].vertex_positions) > 100
    assert list(found.sent["lab/markers"][1].lengths[4:7]) == [len(markers.names), 0, len(markers.names)]
    force = found.sent["lab/forces/plate1"][1]
    np.testing.assert_allclose(force.vectors * 1000, measured[:, :3])
    residual = found.sent["lab/forces/residual"][1]
    assert residual.lengths.sum() == used.sum() == len(residual.vectors)
    np.testing.assert_allclose(residual.vectors * 1000, np.tile([0, 0, 50.0], (used.sum(), 1)), atol=1e-6)
    knee = found.sent["angles/left_knee_flexion"][1].scalars
    assert np.nanmax(knee) == pytest.approx(95, abs=0.1)


def test_without_the_library_a_motion_or_a_free_name_it_is_refused(stream, monkeypatch, tmp_path):
    (tmp_path / "b.rrd").write_text("mine")
    with pytest.raises(FileRefused, match="not overwritten"):
        write_rerun(squat(), BODY, tmp_path / "b.rrd")
    with pytest.raises(TrialRefused, match="no motion"):
        write_rerun(replace(squat(), motion=None), BODY, tmp_path / "a.rrd")
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingLibrary, match="pip install rerun-sdk"):
        write_rerun(squat(), BODY, tmp_path / "a.rrd")

"""Frames say what was measured, what was filled, and what the markers leave open: by construction, and on the walk and
the stairs on which invented motion was found.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from biodance import read_session, scale
from biodance.body.body import Body
from biodance.errors import TrialRefused
from biodance.lab.markers.signals import fill_gaps
from biodance.lab.prepare import prepare
from biodance.lab.program_tables import read_mot, write_mot
from biodance.motion.track import track
from biodance.pipeline.program_folders import opensim_coordinates, state_notes
from biodance.pipeline.session import examine
from biodance.records import AngleState, LeftOut, Markers, Motion, Trial


@pytest.fixture(scope="module")
def walker(data: Path) -> tuple[Body, Trial]:
    session = read_session(data / "biomechzoo" / "HC030A")
    return scale(session.subject, session["HC030A01"]), session["HC030A05"]


@pytest.fixture(scope="module")
def whole(walker: tuple[Body, Trial]) -> Motion:
    body, trial = walker
    return track(body, prepare(trial))


def hidden(walker: tuple[Body, Trial], first: int, last: int, *labels: str) -> Motion:
    """Track the walk with markers (all without labels) unseen from frame ``first`` to before ``last``."""
    body, trial = walker
    markers = trial.markers
    assert markers is not None
    xyz = markers.xyz.copy()
    xyz[first:last, [markers.names.index(name) for name in labels or markers.names]] = np.nan
    return track(body, prepare(replace(trial, markers=Markers(markers.names, markers.time, xyz))))


@pytest.mark.parametrize(
    ("labels", "last", "far"), [((), 110, 20.0), (("LASI", "RASI", "SACR"), 140, 20.0)], ids=["all", "pelvis"]
)
def test_no_angle_is_shown_that_no_marker_told(walker, whole: Motion, labels, last: int, far: float) -> None:
    """30 frames without any marker, 0.6 s without the pelvis: the guess is up to 33 degrees off."""
    found = hidden(walker, 80, last, *labels)
    error = np.abs(found.angles - whole.angles)
    assert error.max() > far, "the guess is as wrong as ever"
    assert not found.determined[80:last].any()
    assert np.isnan(found.known_angles[80:last]).all()
    assert np.nanmax(np.abs(found.known_angles - whole.known_angles)) < 2.5
    assert found.determined[:60].all()
    assert found.determined[last + 20 :].all()


def test_a_leg_unseen_leaves_the_other_joints_known(walker, whole: Motion) -> None:
    found = hidden(walker, 80, 140, "LKNE", "LTHI", "LTIB", "LANK", "LHEE", "LTOE")
    assert not found.determined[80:140].any(), "the wrench of such a frame is nobody's"
    unknown = {span.joint for span in found.spans() if span.state == AngleState.NOT_DETERMINED}
    assert unknown >= {"left_knee_flexion", "left_hip_flexion", "left_ankle_dorsiflexion"}
    assert "right_elbow_flexion" not in unknown
    assert np.nanmax(np.abs(found.known_angles - whole.known_angles)) < 5.0, "within what the state promises"


def test_a_bridged_gap_is_filled_and_not_measured(walker, whole: Motion) -> None:
    found = hidden(walker, 80, 95)
    assert (found.frame_state[80:95] == AngleState.FILLED).all()
    assert (found.frame_state[:80] == AngleState.MEASURED).all()
    assert found.determined.all()
    assert np.abs(found.known_angles - whole.known_angles)[80:95].max() < 5.0, "within what the state promises"


def test_one_marker_of_a_thigh_is_not_needed(walker, whole: Motion) -> None:
    found = hidden(walker, 80, 120, "LTHI")
    assert found.spans() == whole.spans()


def test_gap_filling_says_what_it_put_in() -> None:
    time = np.arange(40) / 100
    xyz = np.stack([np.stack([time, time**2, 0 * time + k], axis=1) for k in (0.0, 1.0)], axis=1)
    xyz[10:14, 0] = np.nan
    xyz[:3, 1] = np.nan
    filled, _ = fill_gaps(Markers(("A", "B"), time, xyz), {})
    assert np.flatnonzero(filled.filled[:, 0]).tolist() == [10, 11, 12, 13]
    assert not filled.filled[:, 1].any()
    assert not filled.measured[11, 0]
    assert filled.select(["A"]).filled.sum() == 4


def test_coordinates_for_opensim_hold_no_invented_row(walker, tmp_path: Path) -> None:
    body, _ = walker
    found = hidden(walker, 80, 110)
    path = write_mot(tmp_path / "walk.mot", opensim_coordinates(body, found), notes=state_notes(found))
    table = read_mot(path)
    assert len(table.time) == found.determined.sum() < len(found.time) - 30
    assert not ((table.time > found.time[79]) & (table.time < found.time[110])).any()
    assert f"Left out, because the markers do not determine the posture: {found.time[75]:.3f}" in path.read_text()


def test_a_motion_without_any_determined_frame_has_no_coordinates(walker, whole: Motion) -> None:
    nothing = replace(whole, determined=np.zeros(len(whole.time), dtype=bool))
    with pytest.raises(TrialRefused, match="no frame's markers determine"):
        opensim_coordinates(walker[0], nothing)


def test_forces_are_held_against_no_posture_that_only_fillings_fix(data: Path) -> None:
    session = read_session(data / "biomechzoo" / "HC030A")
    walk = session["HC030A05"]
    assert walk.markers is not None
    xyz = walk.markers.xyz.copy()
    xyz[60:75, [walk.markers.names.index(name) for name in ("RKNE", "RTIB")]] = np.nan
    gappy = replace(walk, markers=Markers(walk.markers.names, walk.markers.time, xyz))
    found = examine(replace(session, trials=(session["HC030A01"], gappy)))["HC030A05"]
    assert found.motion is not None
    assert found.contact is not None
    assert found.comparison is not None
    filled = found.motion.frame_state == AngleState.FILLED
    assert np.flatnonzero(filled).tolist() == list(range(60, 75))
    assert found.contact.measured[filled].all(), "the plates measured them"
    assert not found.comparison.used[filled].any()
    assert found.comparison.used[~filled].sum() > 50
    assert found.left_out[LeftOut.POSTURE_OPEN] == pytest.approx(0.15)

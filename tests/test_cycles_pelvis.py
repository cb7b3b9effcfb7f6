"""The pelvis by its own markers, beside a tracked one that is turned off them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from squatting import BODY, squat

from biodance.body.parts import SegmentMarkers
from biodance.cycles.pelvis import with_own_pelvis
from biodance.motion.kinematics import poses
from biodance.records import Markers

PLACES = np.array([[0.1, 0.05, 0.12], [0.1, 0.05, -0.12], [-0.1, 0.05, 0.0]])
NAMES = ("RASI", "LASI", "SACR")
PULLED = Rotation.from_euler("zx", [4.0, -2.0], degrees=True)
"""By which the tracked pelvis is turned off its markers, in its own frame."""


def recorded(count=3):
    """A squat with markers on the pelvis, its body, and the motion that a stiff trunk has pulled."""
    one = squat()
    true, q = one.motion, one.motion.q.copy()
    own = SegmentMarkers(NAMES[:count], (0,) * count, PLACES[:count], np.ones(count))
    body = replace(BODY, markers=own)
    markers = Markers(NAMES[:count], true.time, poses(body, true.q).points([0] * count, PLACES[:count]))
    turned = Rotation.from_quat(q[:, 3:7]) * PULLED
    q[:, 3:7] = turned.as_quat()
    return replace(one.trial, markers=markers), body, replace(true, q=q), true


def angles(body, motion, name):
    return motion.angles[:, body.joint_index(name)]


def test_the_pelvis_stands_as_its_markers_and_what_hangs_on_it_stays():
    trial, body, pulled, true = recorded()
    shown = with_own_pelvis(trial, body, pulled)
    before, after, right = (poses(body, one.q).rotation for one in (pulled, shown, true))
    assert after[:, 0] == pytest.approx(right[:, 0], abs=1e-6)
    assert after[:, 1:] == pytest.approx(before[:, 1:], abs=1e-6)
    for name in ("right_knee_flexion", "left_ankle_dorsiflexion"):
        assert (angles(body, shown, name) == angles(body, pulled, name)).all()
    # Flexion is told against a pelvis that leans 4 degrees less far back.
    apart = angles(body, shown, "right_hip_flexion") - angles(body, pulled, "right_hip_flexion")
    assert apart == pytest.approx(np.full(apart.size, 4.0), abs=0.2)
    assert (shown.v == pulled.v).all()


def test_a_gap_goes_straight_from_before_to_after():
    trial, body, pulled, true = recorded()
    xyz = trial.markers.xyz.copy()
    xyz[60:75, 1] = np.nan
    shown = with_own_pelvis(replace(trial, markers=replace(trial.markers, xyz=xyz)), body, pulled)
    assert poses(body, shown.q).rotation[:, 0] == pytest.approx(poses(body, true.q).rotation[:, 0], abs=1e-6)


def test_too_few_markers_leave_the_pelvis_as_it_was_tracked():
    trial, body, pulled, _ = recorded(2)
    assert with_own_pelvis(trial, body, pulled) is pulled
    assert with_own_pelvis(replace(trial, markers=None), body, pulled) is pulled


def test_unseen_markers_and_a_short_trial_leave_it_as_well():
    trial, body, pulled, _ = recorded()
    unseen = replace(trial.markers, xyz=np.full_like(trial.markers.xyz, np.nan))
    assert with_own_pelvis(replace(trial, markers=unseen), body, pulled) is pulled
    few = slice(0, 4)
    short = Markers(NAMES, trial.markers.time[few], trial.markers.xyz[few])
    assert (with_own_pelvis(replace(trial, markers=short), body, pulled.at(few)).q == pulled.q[few]).all()

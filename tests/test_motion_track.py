"""From a trial to a motion: a simulated session is followed, and the trial's own shortcomings are said."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from marker_trials import noisy_dance, points
from perfect_recordings import PERFECT_INSTRUMENTS
from standing_markers import PERSON

from biodance.body.human.human import human
from biodance.body.human.skeleton import with_tracking_limits
from biodance.errors import TrialRefused
from biodance.lab.session.read import read_session
from biodance.motion.kinematics import poses
from biodance.motion.track import track, upright_trunk
from biodance.records import Markers, Source, Subject, Trial
from biodance.settings import Settings
from biodance.virtual_lab.movement import read_protocol
from biodance.virtual_lab.person import make_person
from biodance.virtual_lab.simulate import simulate_session
from biodance.virtual_lab.visit import Laboratory, LabVisit, perform_in, set_up

WOMAN = human(Subject(58.3, 1.64, "F", 31.0))
LEFT_LEG = ("LTHI", "LKNE", "LTIB", "LANK", "LHEE", "LTOE")


def trial_of(markers: Markers | None) -> Trial:
    return Trial("walk", "fit", markers, (), Source(Path("walk.c3d"), "", "c3d"))


@pytest.fixture(scope="module")
def markers() -> Markers:
    return noisy_dance(WOMAN, 120, seed=0, reach=0.5, sd=0.002)[1]


def test_a_simulated_squat_is_followed(tmp_path):
    subject, visit = Subject(58.0, 1.66, "F", 28.0, "S07"), LabVisit(0, Laboratory(bits=32), PERFECT_INSTRUMENTS)
    protocol = read_protocol("short")
    squat = next(plan for plan in protocol.trials if plan.role == "validate")
    static = next(plan for plan in protocol.trials if plan.role == "static")
    session = read_session(
        simulate_session(subject, replace(protocol, trials=(static, squat)), tmp_path / "S", seed=3, visit=visit)
    )
    trial = session.of_role("validate")[0]
    person = make_person(subject, 3, tolerances=visit.tolerances)
    truth = perform_in(set_up(person, visit), person, squat).motion(trial.markers.time)
    motion = track(human(subject), trial)
    assert motion.determined.all()
    assert np.sqrt(np.nanmean(motion.residual**2)) < 0.04  # a body of the stature alone
    true = poses(person.body, truth.q).position[:, person.body.segment_index("pelvis")]
    found = motion.q[:, :3]
    np.testing.assert_allclose(found - found[0], true - true[0], atol=0.03)
    assert np.ptp(true[:, 2]) > 0.1  # it does squat


def test_the_notes_say_how_well_the_markers_fit(markers):
    motion = track(WOMAN, trial_of(markers))
    assert motion.marker_names == WOMAN.markers.names
    rms = 1e3 * np.sqrt((motion.residual**2).mean())
    assert motion.notes[0].startswith(
        f"Inverse kinematics: 120 frames, 39 markers, RMS distance {rms:.1f} mm, largest "
    )
    assert len(motion.notes) == 1
    assert 1.5 < rms < 3.5


def test_absent_markers_and_leaning_frames_are_named(markers):
    xyz = markers.xyz.copy()
    xyz[50:55, [markers.names.index(name) for name in LEFT_LEG]] = np.nan
    some = replace(markers, xyz=xyz).select(name for name in markers.names if name not in ("LFHD", "T10"))
    motion = track(WOMAN, trial_of(some))
    assert "Markers of the body that the trial does not have: T10, LFHD." in motion.notes
    assert any(
        note.startswith("5 of 120 frames lean on their neighbours") and f"first: at {markers.time[50]:.2f} s" in note
        for note in motion.notes
    )
    assert np.array_equal(np.flatnonzero(~motion.determined), np.arange(45, 60)), "and half a period of 10 Hz"
    assert np.isfinite(np.hstack([motion.q, motion.v, motion.a])).all()
    whole = track(WOMAN, trial_of(markers))
    assert np.abs(points(WOMAN, motion.q) - points(WOMAN, whole.q)).max() < 0.05


def test_the_low_pass_is_the_one_asked_for(markers):
    soft, hard = (
        track(WOMAN, replace(trial_of(markers), settings=Settings().changed({"filter.cutoff": cutoff})))
        for cutoff in (10.0, 3.0)
    )
    assert np.array_equal(soft.residual, hard.residual)
    assert np.abs(hard.a[30:-30, :6]).mean() < 0.7 * np.abs(soft.a[30:-30, :6]).mean()


def test_a_trial_that_cannot_be_followed_is_refused_by_name(markers):
    with pytest.raises(TrialRefused, match="Trial walk: no markers were recorded"):
        track(WOMAN, trial_of(None))
    legless = markers.select(name for name in markers.names if name not in LEFT_LEG)
    with pytest.raises(TrialRefused, match=r"Trial walk: No frame shows enough markers .*left_knee_flexion.*LKNE"):
        track(WOMAN, trial_of(legless))
    short = Markers(markers.names, markers.time[:8], markers.xyz[:8])
    with pytest.raises(TrialRefused, match="Trial walk: 8 frames at 100 Hz are too few"):
        track(WOMAN, trial_of(short))


def test_a_static_of_one_frame_is_a_pose_at_rest(markers):
    motion = track(WOMAN, trial_of(Markers(markers.names, [0.0], markers.xyz[:1])))
    assert not motion.v.any()
    assert motion.determined.all()
    assert motion.residual.max() < 0.02


def test_an_unseen_trunk_stays_upright_over_a_swinging_pelvis() -> None:
    from scipy.spatial.transform import Rotation

    body = with_tracking_limits(human(PERSON))
    held = body.holding({"trunk"}, body.neutral)
    assert held.free.sum() == len(body.joints) - 3
    q = np.tile(body.neutral, (200, 1))
    swing = 0.15 * np.sin(2 * np.pi * np.arange(200) / 100)
    upright = Rotation.from_quat(q[:, 3:7])
    q[:, 3:7] = (Rotation.from_euler("xyz", np.stack([swing, 0.5 * swing, swing], axis=1)) * upright).as_quat()
    trunk = poses(held, upright_trunk(held, q, 100.0)).rotation[:, body.segments.index("trunk_head")]
    assert np.abs(trunk[:, 2, 1] - 1.0).max() < 1e-9
    assert np.array_equal(upright_trunk(body, q, 100.0), q)

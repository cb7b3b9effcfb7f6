"""A session as a BIDS dataset: what a stranger's tools read back is what was recorded and found."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lab_sessions import person, plate

from biodance.body.human.human import human
from biodance.errors import SessionRefused, TrialRefused
from biodance.pipeline.program_folders import write_bids_folder
from biodance.pipeline.trial import TrialResult
from biodance.records import Motion, Session, Source, Subject, Trial

SUBJECT = Subject(62.0, 1.70, "F", name="S 01")
BODY = human(SUBJECT)
MARKERS = person(frames=50)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    markers = replace(MARKERS, xyz=np.where(np.arange(50)[:, None, None] == 7, np.nan, MARKERS.xyz))
    source = Source(Path("walk_1.trc"), "", "TRC", 100.0, 1000.0)
    trial = Trial("walk_1", "fit", markers, (plate(frames=500),), source)
    session = Session(SUBJECT, (trial,), Path("/lab/S01"))
    q = np.tile(BODY.neutral, (50, 1))
    q[:, 7 + BODY.joint_index("left_knee_flexion")] = 0.5
    names = tuple(joint.name for joint in BODY.joints)
    motion = Motion(MARKERS.time, q, *np.zeros((2, 50, BODY.nv)), joint_names=names)
    folder = tmp_path_factory.mktemp("bids") / "dataset"
    bare = replace(trial, plates=())
    assert write_bids_folder(session, (TrialResult(bare, (), motion=motion),), BODY, folder) == ("walk_1",)
    return session, folder


def read(folder, stem):
    """Return numbers, channels and description."""
    channels = pd.read_csv(folder / f"{stem}_channels.tsv", sep="\t", keep_default_na=False)
    values = pd.read_csv(folder / f"{stem}_motion.tsv", sep="\t", header=None, na_values="n/a").to_numpy()
    return values, channels, json.loads((folder / f"{stem}_motion.json").read_text())


def test_markers_and_forces_come_back(dataset):
    session, folder = dataset
    values, channels, about = read(folder / "sub-S01/motion", "sub-S01_task-walk1_tracksys-optical")
    recorded = session["walk_1"].markers
    np.testing.assert_allclose(values.reshape(recorded.xyz.shape), recorded.xyz, rtol=1e-6)
    assert list(channels["tracked_point"][::3]) == list(recorded.names)
    assert set(channels["units"]) == {"m"}
    assert (about["SamplingFrequency"], about["POSChannelCount"]) == (100.0, 3 * len(recorded.names))
    values, channels, about = read(folder / "sub-S01/motion", "sub-S01_task-walk1_tracksys-forceplates")
    np.testing.assert_allclose(values, session["walk_1"].plates[0].wrench.value, rtol=1e-5, atol=1e-6)
    assert list(channels["units"]) == ["N"] * 3 + ["N m"] * 3
    assert np.shape(about["Plates"][0]["Corners_m"]) == (4, 3)


def test_angles_and_events_are_a_derivative(dataset):
    _, folder = dataset
    derived = folder / "derivatives/biodance"
    values, channels, _ = read(derived / "sub-S01/motion", "sub-S01_task-walk1_tracksys-optical_desc-joints")
    knee = channels.index[channels["name"] == "left_knee_flexion"][0]
    np.testing.assert_allclose(values[:, knee], np.degrees(0.5), rtol=1e-6)
    assert channels["type"][knee] == "JNTANG"
    events = pd.read_csv(next(derived.glob("sub-S01/motion/*_events.tsv")), sep="\t")
    assert list(events.columns) == ["onset", "duration", "trial_type"]
    about = json.loads((derived / "dataset_description.json").read_text())
    assert (about["DatasetType"], about["GeneratedBy"][0]["Name"]) == ("derivative", "biodance")
    people = pd.read_csv(folder / "participants.tsv", sep="\t", keep_default_na=False)
    assert (people["participant_id"][0], people["age"][0]) == ("sub-S01", "n/a")


def test_nothing_is_overwritten_and_without_markers_there_is_nothing(dataset, tmp_path):
    session, folder = dataset
    with pytest.raises(SessionRefused, match="holds files already"):
        write_bids_folder(session, (), BODY, folder)
    bare = replace(session, trials=tuple(replace(trial, markers=None) for trial in session.trials))
    with pytest.raises(TrialRefused, match="no trial has markers"):
        write_bids_folder(bare, (), BODY, tmp_path / "none")


def test_a_guess_is_not_told_to_others(dataset, tmp_path):
    session, _ = dataset
    write_bids_folder(
        replace(session, subject=replace(session.subject, guessed=("sex", "stature"))), (), BODY, tmp_path / "b"
    )
    people = pd.read_csv(tmp_path / "b/participants.tsv", sep="\t", keep_default_na=False)
    assert (people["sex"][0], people["height_m"][0]) == ("n/a", "n/a")
    assert float(people["mass_kg"][0]) == session.subject.mass

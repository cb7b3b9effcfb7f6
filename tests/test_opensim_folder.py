"""The folder for OpenSim: its own InverseDynamicsTool finds our torques in it."""

import os

import numpy as np
import pytest
from squatting import BODY, squat

from biodance.errors import SessionRefused, TrialRefused
from biodance.lab.program_tables import read_mot
from biodance.lab.readers.mot import plates_of
from biodance.pipeline.program_folders import write_opensim_folder
from biodance.pipeline.trial import TrialResult


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("lab") / "opensim"
    (one,) = write_opensim_folder((squat(),), BODY, out, source="The table.")
    assert one.dynamics == pytest.approx((0, 1.99))
    return out


def test_opensim_s_inverse_dynamics_finds_our_torques_within_one_percent(folder, monkeypatch):
    opensim = pytest.importorskip("opensim")
    opensim.Logger.removeFileSink()
    opensim.Logger.setLevelString("Off")
    monkeypatch.chdir(folder)
    assert opensim.InverseDynamicsTool("squat_InverseDynamics.xml").run()
    theirs, ours = read_mot("squat_opensim_torques.sto"), read_mot("squat_torques.sto")
    inner = slice(15, -15)  # splines and differences both bend at the ends
    for name in ours.columns:
        found = np.interp(ours.time, theirs.time, theirs[name])[inner]
        largest = np.abs(ours[name]).max()
        assert np.abs(found - ours[name][inner]).max() < max(0.01 * largest, 0.02), name
    assert np.abs(ours["right_knee_flexion_moment"]).max() > 30


def test_the_forces_of_both_feet_are_what_the_plate_measured(folder):
    plates, _, _ = plates_of(read_mot(folder / "squat_forces.mot"), where="squat_forces.mot")
    total = np.sum([plate.wrench.value for plate in plates], axis=0)
    np.testing.assert_allclose(total, squat().trial.plates[0].wrench.value, atol=1e-6)


def test_the_model_has_a_mesh_for_every_segment(folder):
    meshes = {path.name.rpartition(BODY.name)[2].strip("_") for path in (folder / "Geometry").iterdir()}
    assert len(meshes) == len(BODY.segments)
    assert all(name in (folder / "model.osim").read_text() for name in os.listdir(folder / "Geometry"))


def test_nothing_is_overwritten_and_without_a_motion_nothing_is_written(folder, tmp_path):
    with pytest.raises(SessionRefused, match="holds files already"):
        write_opensim_folder((squat(),), BODY, folder, source="")
    still = TrialResult(squat().trial, ())
    with pytest.raises(TrialRefused, match="no trial gives a motion"):
        write_opensim_folder((still,), BODY, tmp_path / "none", source="")
    assert not (tmp_path / "none").exists()

"""Markers and forces recorded apart, put together again: known truth by construction, and what must be refused.

The forces of a simulated trial are turned, moved and delayed here with complex numbers and another algebra than the
package's, and written as OpenSim's table, which knows neither the plate's place nor the markers' clock.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from lab_sessions import table_of

import biodance
from biodance.cli import run
from biodance.errors import SessionRefused, TrialRefused
from biodance.lab.c3d.write import write_c3d
from biodance.lab.program_tables import write_mot
from biodance.records import Markers, Plate, Subject, Wrench
from biodance.registration import write_registered

YAW, SHIFT, LATE = 2.0, (1.3, -2.1), 0.7345
"""rad, m, s: frame of the force file in the room; the force file's clock less the markers'."""


def elsewhere(plate, late=LATE):
    """Return a plate as a laboratory records it that knows nothing of the room: a frame and a clock of its own."""
    back = np.exp(-1j * YAW)

    def turned(x, y):
        z = back * (x + 1j * y)
        return z.real, z.imag

    force, moment = plate.wrench.force, plate.wrench.moment
    near_x = moment[:, 0] - SHIFT[1] * force[:, 2]
    near_y = moment[:, 1] + SHIFT[0] * force[:, 2]
    near_z = moment[:, 2] - (SHIFT[0] * force[:, 1] - SHIFT[1] * force[:, 0])
    value = np.stack([*turned(force[:, 0], force[:, 1]), force[:, 2], *turned(near_x, near_y), near_z], axis=1)
    x, y = turned(plate.corners[:, 0] - SHIFT[0], plate.corners[:, 1] - SHIFT[1])
    return Plate(plate.name, 2, np.stack([x, y, plate.corners[:, 2]], axis=1), Wrench(plate.wrench.time + late, value))


def force_file(folder, trial, name, **kind):
    """Write the forces of a trial alone, in their own frame and clock; return the file."""
    return write_mot(folder / f"{name}.mot", table_of(tuple(elsewhere(plate, **kind) for plate in trial.plates)))


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("register")


@pytest.fixture(scope="module")
def visit(place):
    return biodance.simulate(Subject(63.0, 1.73, "M", 30.0), "short", place / "visit", seed=3)


@pytest.fixture(scope="module")
def dance(visit):
    return biodance.read_trial(visit / "dance_1.c3d")


@pytest.fixture(scope="module")
def registered(visit, dance, place):
    """What is found of a dance whose forces lie elsewhere, and the session that was written."""
    forces = force_file(place, dance, "forces")
    return biodance.register(visit / "dance_1.c3d", forces, place / "session"), place / "session"


def test_pose_and_delay_are_those_that_were_hidden(registered):
    found, _ = registered
    assert found.status == "registered"
    assert found.pose.delay == pytest.approx(LATE, abs=0.002)
    assert np.angle(np.exp(1j * (found.pose.yaw - YAW))) == pytest.approx(0.0, abs=np.radians(0.5))
    assert np.abs(found.pose.shift[:2] - SHIFT).max() < 0.030  # the file's origin lies 2.5 m from the plate
    assert abs(found.pose.shift[2]) < 0.02


def test_intervals_hold_the_truth(registered):
    found, _ = registered
    turned = np.angle(np.exp(1j * (found.pose.yaw - YAW)))
    assert abs(turned) < 3 * found.plates[0].yaw_sd
    assert abs(found.pose.delay - LATE) < 3 * found.delay_sd
    back = (found.plates[0].position[:2] - found.pose.shift[:2]) @ [1, 1j] * np.exp(-1j * found.pose.yaw)
    true = np.exp(1j * YAW) * back + complex(*SHIFT)
    off = np.abs(found.plates[0].position[:2] - [true.real, true.imag])
    assert (off < 3 * found.plates[0].sd[:2]).all()
    assert (off < 0.010).all()


def test_the_session_written_reads_like_one_that_was_recorded_together(registered, dance):
    _, folder = registered
    session = biodance.read_session(folder)
    assert {trial.name: trial.role for trial in session} == {"dance_1": "fit", "static": "static"}
    assert session.subject.mass == 63.0
    trial = session["dance_1"]
    assert trial.markers.names == dance.markers.names
    start = trial.markers.time[0] - trial.plates[0].wrench.time[0]
    assert start == pytest.approx(0.0, abs=1e-9)
    skipped = dance.markers.time.size - trial.markers.time.size
    then = np.searchsorted(dance.plates[0].wrench.time, dance.markers.time[skipped])
    theirs, ours = dance.plates[0].wrench, trial.plates[0].wrench
    last = min(theirs.time.size - then, ours.time.size)
    apart = ours.cop()[:last:50, :2] - theirs.cop()[then : then + last : 50, :2]
    assert np.abs(apart).max() < 0.012
    assert np.abs(ours.force[:last:50] - theirs.force[then : then + last : 50]).max() < 15.0


def test_age_and_gender_are_written_as_they_are_and_lengths_in_mm(visit, dance, place):
    measured = replace(dance, measurements={"Bodymass": 31.0, "Height": 1.4, "age": 9.5, "gender": 1.0})
    path = write_registered(place / "child", biodance.read_session(visit), measured, dance.plates, said={})
    assert biodance.read_trial(path).measurements == pytest.approx(dict(measured.measurements))


def test_nothing_of_an_earlier_session_is_overwritten(registered, visit, place):
    with pytest.raises(SessionRefused, match="earlier registration"):
        biodance.register(visit / "dance_1.c3d", place / "forces.mot", place / "session")
    with pytest.raises(SessionRefused, match="did not write"):
        biodance.register(visit / "dance_1.c3d", place / "forces.mot", visit, force=True)


def still(trial, seconds=4.0):
    """Return a trial whose person stands as in its first frame, with the forces of one who does."""
    time = np.arange(round(100 * seconds)) / 100.0
    rng = np.random.default_rng(1)
    xyz = trial.markers.xyz[0] + rng.normal(0.0, 1e-4, (time.size, *trial.markers.xyz.shape[1:]))
    fine = np.arange(round(1000 * seconds)) / 1000.0
    value = trial.plates[0].wrench.value[:50].mean(axis=0) + rng.normal(0.0, 0.3, (fine.size, 6))
    plate = replace(trial.plates[0], wrench=Wrench(fine, value))
    return replace(trial, markers=Markers(trial.markers.names, time, xyz), plates=(plate,))


def test_quiet_standing_tells_no_yaw(visit, dance, place):
    quiet = still(dance)
    (place / "quiet").mkdir()
    write_c3d(place / "quiet" / "stand.c3d", markers=quiet.markers)
    for name in ("static.c3d", "session.toml"):
        (place / "quiet" / name).write_bytes((visit / name).read_bytes())
    found = biodance.register(place / "quiet" / "stand.c3d", force_file(place / "quiet", quiet, "f", late=0.1))
    assert found.status == "refused"
    assert "yaw" in found.reason


def test_the_forces_of_another_movement_are_refused(visit, place, capsys):
    squat = biodance.read_trial(visit / "squat_1.c3d")
    forces = force_file(place, squat, "other")
    out = place / "never"
    code = run(["register", str(visit / "dance_1.c3d"), str(forces), "--out", str(out), "--json"])
    told = capsys.readouterr()
    said = json.loads(told.out)
    assert code == 1
    assert said["status"] == "refused"
    assert said["reason"] in told.err
    assert {"delay_s", "delay_sd_s", "plates"} <= set(said)
    assert not out.exists()


def test_the_command_tells_a_person_where_the_session_lies(registered, monkeypatch, capsys):
    found, place = registered
    monkeypatch.setattr("biodance.pipeline.front.register", lambda *_, **__: found)
    command = ["register", "markers.c3d", "forces.mot", "--out", str(place)]
    assert run(command) == 0
    told = capsys.readouterr()
    assert place.name in told.out + told.err
    assert run([*command, "--json"]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out) == json.loads(json.dumps(found.document()))
    assert told.err == ""


def test_a_file_without_plates_is_refused(visit, place):
    write_c3d(place / "bare.c3d", markers=biodance.read_trial(visit / "static.c3d").markers)
    with pytest.raises(TrialRefused, match="no force plate"):
        biodance.register(visit / "dance_1.c3d", place / "bare.c3d")

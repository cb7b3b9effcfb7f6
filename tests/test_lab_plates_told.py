"""What the analyst says of force plates in session.toml comes before what the files say, or is refused aloud."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from c3d_files import File, real, text, whole
from lab_sessions import MASS, PLUG_IN_GAIT, person, write_trial
from plate_emulator import RATE, Emulated, channels, raw_file, step, yaw
from walkers import WEIGHT, Stand, plate, walker

from biodance.errors import SessionRefused
from biodance.lab.inspect import init_session, inspect_paths
from biodance.lab.plates import Told, ToldPlate
from biodance.lab.plates.read import as_told, read_plates
from biodance.lab.session.file import read_session_file
from biodance.lab.session.read import read_session
from biodance.motion.contact import ground_contact
from biodance.records import Plate, Source, Trial, Wrench
from biodance.registration import write_registered

PAGE = Path(__file__).parents[1] / "docs" / "session_folder.md"
LABELS = [f"AMTI_{number}.{name}" for number in (1, 2) for name in ("FX", "FY", "FZ", "MX", "MY", "MZ")]


def example() -> str:
    """Return the tables of plates in the documentation of session.toml, as they stand there."""
    (found,) = re.findall(r"```toml\n(\[plates\.plate1\].*?)```", PAGE.read_text(), flags=re.DOTALL)
    return found


def amti(folder: Path, *, groups: dict | None = None) -> np.ndarray:
    """Write a session of one file whose twelve channels (V) no plate group describes; return the wrench (S, 6) on its
    first plate about the lab origin.
    """
    truth, _ = step(np.random.default_rng(4), Emulated())
    volts = channels(Emulated(), truth) / np.array(tomllib.loads(example())["plates"]["plate1"]["sensitivity"])
    seen = person(frames=len(truth) // 5, rate=RATE / 5)
    points = np.concatenate([1000 * (seen.xyz + np.array([5.0, 0, 0])), np.zeros((*seen.xyz.shape[:2], 1))], axis=2)
    analog = np.hstack([volts, np.random.default_rng(5).normal(0, 1e-3, volts.shape)])
    said = {"POINT": {"LABELS": text(*PLUG_IN_GAIT)}, "ANALOG": {"LABELS": text(*LABELS)}} | (groups or {})
    (folder / "walk.c3d").write_bytes(File(points, analog, rate=RATE / 5, parameters=said).bytes())
    return truth


def test_channels_without_a_plate_group_are_seen(tmp_path: Path) -> None:
    amti(tmp_path)
    (record,) = inspect_paths([tmp_path])
    assert record["status"] == "warning"
    assert record["reason"].startswith(
        "12 channels (AMTI_1.FX ... AMTI_2.MZ, in V) look like two force plates, which the file does not describe: no "
        "plate was read. Give geometry, channels and sensitivity in session.toml: corners_m, channels and sensitivity"
    )


def test_the_example_of_the_documentation_describes_them(tmp_path: Path) -> None:
    """The example is for this file: label by label, its sensitivity, its corners and its origin."""
    truth = amti(tmp_path)
    (tmp_path / "session.toml").write_text(example(), encoding="utf-8")
    (trial,) = read_session(tmp_path).trials
    (read,) = trial.plates
    np.testing.assert_allclose(read.wrench.value, truth, atol=2e-3)
    assert read.foot == "left"
    said = "corners_m, type, channels, sensitivity, origin_m, foot as session.toml says."
    assert f"plate1: {said}" in trial.history
    assert f"C{said[1:]}" in read.decisions
    assert not [line for line in trial.warnings if "plate" in line.lower()]
    (record,) = inspect_paths([tmp_path])
    assert record["plates"][0]["corners_m"] == tomllib.loads(example())["plates"]["plate1"]["corners_m"]


def test_init_begins_the_tables_and_what_it_writes_is_right_without_its_marks(tmp_path: Path) -> None:
    amti(tmp_path)
    init_session(tmp_path)
    written = (tmp_path / "session.toml").read_text()
    assert '# channels = ["AMTI_2.FX", "AMTI_2.FY", "AMTI_2.FZ", "AMTI_2.MX", "AMTI_2.MY", "AMTI_2.MZ"]' in written
    (tmp_path / "session.toml").unlink()
    corners = 1000 * Emulated().corners
    group = {
        "USED": whole(1),
        "TYPE": whole(2),
        "ZERO": whole(1, 0),
        "CHANNEL": whole(*range(1, 7), shape=(6, 1)),
        "ORIGIN": real(1.0, -2.0, -40.0, shape=(3, 1)),
        "CORNERS": real(*corners.ravel(), shape=(3, 4, 1)),
    }
    units = {"LABELS": text(*LABELS), "UNITS": text(*(["N"] * 3 + ["Nmm"] * 3) * 2)}
    amti(tmp_path, groups={"FORCE_PLATFORM": group, "ANALOG": units})
    before = read_session(tmp_path).trials[0].plates[0]
    init_session(tmp_path)
    lines = (tmp_path / "session.toml").read_text().splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith("# [plates.plate1]"))
    table = [line.removeprefix("# ") for line in lines[start : start + 5]]
    assert [line.split(" ")[0] for line in table] == ["[plates.plate1]", "corners_m", "type", "channels", "sensitivity"]
    (tmp_path / "session.toml").write_text("\n".join(table))
    (after,) = read_session(tmp_path).trials[0].plates
    np.testing.assert_allclose(after.wrench.value, before.wrench.value, atol=1e-6 * np.abs(before.wrench.value).max())


def test_what_is_told_comes_before_the_file() -> None:
    """Two plates whose corners the file has wrong by 0.3 m, one of them not to be used."""
    true = Emulated()
    truth, _ = step(np.random.default_rng(0), true)
    moved = true.corners + np.array([0.3, 0.0, 0.0])
    raw = raw_file([true, true], [channels(true, truth)] * 2, CORNERS=np.stack([moved.T, moved.T], axis=2) / 0.001)
    told = {"plate1": ToldPlate(corners=true.corners, foot="right"), "plate2": ToldPlate(use=False)}
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = {**told, "plate1": replace(told["plate1"], corners=true.corners @ turn.T)}
    for said, way in ((told, np.eye(3)), (turned, turn)):
        plates, warnings, history, _ = read_plates(raw, metres=0.001, turn=way, told=said)
        (read,) = plates
        np.testing.assert_allclose(read.wrench.force, truth[:, :3] @ way.T, atol=1e-6)
        np.testing.assert_allclose(read.wrench.moment, truth[:, 3:] @ way.T, atol=1e-6)
        assert (read.foot, warnings) == ("right", ())
        expected = ("plate2 was left out, as session.toml says.", "plate1: corners_m, foot as session.toml says.")
        assert history == expected


def test_a_matrix_and_a_type_are_told() -> None:
    """Eight channels that the file calls six: the type, the channels and the sensitivity of each are told."""
    true = Emulated(3, origin=np.array([0.12, 0.2, -0.05]))
    truth, _ = step(np.random.default_rng(2), true)
    signal = channels(true, truth) @ np.diag(1 / np.arange(2.0, 10.0))
    raw = raw_file([true], [signal], TYPE=np.array([2]), units=[([1.0] * 8, ["V"] * 8)])
    told = ToldPlate(type=3, channels=tuple(range(3, 11)), sensitivity=np.diag(np.arange(2.0, 10.0)))
    (read,), *_ = read_plates(raw, metres=0.001, told={"plate1": told})
    np.testing.assert_allclose(read.wrench.value, truth, atol=1e-6)
    mixed = np.linalg.qr(np.random.default_rng(3).normal(size=(6, 6)))[0] + 3 * np.eye(6)
    raw = raw_file([Emulated()], [channels(Emulated(), truth) @ np.linalg.inv(mixed).T], units=[([1.0] * 6, ["V"] * 6)])
    (read,), *_ = read_plates(raw, metres=0.001, told={"plate1": ToldPlate(sensitivity=mixed)})
    np.testing.assert_allclose(read.wrench.value, truth, atol=1e-6)


def test_a_channel_that_is_not_there_is_named_with_the_legal_ones() -> None:
    truth, _ = step(np.random.default_rng(0), Emulated())
    raw = raw_file([Emulated()], [channels(Emulated(), truth)])
    wrong = ToldPlate(channels=("P1.0", "P1.1", "P1.2", "P1.3", "P1.4", "P1.55"))
    assert read_plates(raw, metres=0.001, told={"plate1": wrong})[1] == (
        "Plate 1 was left out, and what it carried is missing from the total: session.toml names channel 'P1.55', "
        "which the file does not have. Did you mean 'P1.5'? Legal: EMG, EMG, P1.0, P1.1, P1.2, P1.3, P1.4, P1.5.",
    )
    assert (
        "legal: 1 to 8" in read_plates(raw, metres=0.001, told={"plate1": ToldPlate(channels=(1, 2, 3, 4, 5, 9))})[1][0]
    )
    assert "Plate 2 of session.toml is none of the file's 1 plates" in " ".join(
        read_plates(raw, metres=0.001, told={"plate2": ToldPlate(corners=Emulated().corners)})[1]
    )


CORNERS = "corners_m = [[0.5, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.5, 0], [0.5, 0.5, 0]]"


@pytest.mark.parametrize(
    ("said", "word"),
    [
        ("[plates.left]\nuse = false", r"\[plates.left\] is no plate. Legal names are plate1, plate2"),
        (
            "[plates.plate1]\ncorner = 1",
            r"unknown key 'corner'. Did you mean 'corners_m'\? Legal: corners_m, type, cha",
        ),
        (
            "[plates.plate1]\ncorners_m = [1, 2, 3]",
            r"corners_m has the shape \(3,\). Write four points \[x, y, z\] in m",
        ),
        ("[plates.plate1]\n" + CORNERS.replace("0.5", "500").replace("0.1", "100"), "sides of 400 to 600 m; legal are"),
        (
            "[plates.plate1]\n" + CORNERS.replace("[0.1, 0.5, 0], [0.5, 0.5, 0]", "[0.5, 0.5, 0], [0.1, 0.5, 0]"),
            "bow-tie",
        ),
        ("[plates.plate1]\ncorners_m = 'there'", "is not legal. Write four points"),
        ("[plates.plate1]\ntype = 9", "type = 9.0 is not legal. Legal are the TYPEs 1, 2, 3, 4, 5, 6, 7 of the C3D"),
        ("[plates.plate1]\nchannels = [1, 2, 3]", "names 3 channels; a plate has 6 or 8 or 12"),
        ("[plates.plate1]\ntype = 2\nchannels = [1, 2, 3, 4, 5, 5]", "names 5 channels; a plate of TYPE 2 has 6"),
        ("[plates.plate1]\nchannels = [0, 1, 2, 3, 4, 5]", "is not legal. Write labels or numbers of analog channels"),
        (
            "[plates.plate1]\nsensitivity = [1, 2, 3]",
            r"has the shape \(3,\); a plate needs one number for each channel",
        ),
        ("[plates.plate1]\nsensitivity = [1, 1, 0, 1, 1, 1]", "holds a row of zeros"),
        ("[plates.plate1]\norigin_m = [0, 0, 40]", "origin_m = .* is not legal. Write .* z up to 0.3 m"),
        ("[plates.plate1]\nfoot = 'both'", 'foot = \'both\' in .* Write "left" or "right"'),
        ("[plates.plate1]\nuse = 'no'", "use = 'no' in .* Write false to leave the plate out"),
    ],
)
def test_wrong_values_are_refused_with_what_is_legal(tmp_path: Path, said: str, word: str) -> None:
    (tmp_path / "session.toml").write_text(said)
    with pytest.raises(SessionRefused, match=word) as refusal:
        read_session_file(tmp_path)
    assert str(tmp_path / "session.toml") in str(refusal.value)


def test_the_visit_fills_in_what_it_does_not_say_from_the_person(tmp_path: Path) -> None:
    visit = tmp_path / "visit"
    visit.mkdir()
    (tmp_path / "session.toml").write_text(f"[plates.plate1]\n{CORNERS}\nfoot = 'left'")
    (visit / "session.toml").write_text("[plates.plate1]\nfoot = 'right'\n[subject]\nmass_kg = 70")
    told = read_session_file(visit).told
    assert (told.plates["plate1"].foot, told.mass) == ("right", 70.0)
    assert told.plates["plate1"].corners is not None


def test_plates_of_a_table_get_their_place_and_one_is_left_out(tmp_path: Path) -> None:
    folder = tmp_path / "visit"
    write_trial(folder, "static01")
    (before,) = read_session(folder).trials[0].plates
    assert not before.placed
    where = CORNERS.replace("0.5", "0.7")
    said = f"{where}\ntype = 2\nfoot = 'left'\n[plates.plate7]\nuse = true"
    (folder / "session.toml").write_text(f"[plates.plate1]\n{said}")
    session = read_session(folder)
    (trial,), (after,) = session.trials, session.trials[0].plates
    assert (after.placed, after.foot) == (True, "left")
    np.testing.assert_allclose(after.corners[0], [0.7, -0.1, 0.0])
    np.testing.assert_array_equal(after.wrench.value, before.wrench.value)
    assert "plate1: corners_m, foot as session.toml says." in trial.history
    assert "plate1: type of session.toml can be followed in C3D files only." in trial.warnings
    assert any("[plates.plate7] fits no plate of the session. The plates read are plate1." in n for n in session.notes)
    (folder / "session.toml").write_text(f"[subject]\nmass_kg = {MASS}\n[plates.plate1]\nuse = false")
    (trial,) = read_session(folder).trials
    assert trial.plates == ()
    assert "plate1 was left out, as session.toml says." in trial.history


def test_a_registered_session_says_nothing_of_plates_as_they_were(tmp_path: Path) -> None:
    folder = tmp_path / "visit"
    write_trial(folder, "static01")
    lines = CORNERS.replace("], [", "],\n[")
    table = f"[plates.plate1]\n{lines}\nchannels = [\n'a', 'b', 'c', 'd', 'e', 'f']\n"
    (folder / "session.toml").write_text(f"[subject]\nmass_kg = 62\n{table}[trials.static01]\nrole = 'static'\n")
    session = read_session(folder)
    moved = [replace(one, corners=one.corners + np.array([1.0, 0, 0])) for one in session.trials[0].plates]
    write_registered(tmp_path / "out", session, session.trials[0], moved, said={})
    copied = tomllib.loads((tmp_path / "out" / "session.toml").read_text())
    assert copied == {"subject": {"mass_kg": 62}, "trials": {"static01": {"role": "static"}}}
    (after,) = read_session(tmp_path / "out").trials[0].plates
    np.testing.assert_allclose(after.centre, moved[0].centre, atol=1e-6)


def test_a_plate_in_a_frame_of_its_own_is_moved_with_what_it_measures() -> None:
    """An AMTI file knows no laboratory: told where the plate lies, the load lies there, too."""
    own = Emulated(centre=np.zeros(3))
    there = Emulated(rotation=yaw(0.7) @ np.diag([1.0, -1.0, -1.0]), centre=np.array([2.0, 1.0, 0.1]))
    truth, _ = step(np.random.default_rng(1), there)
    local = channels(there, truth)
    lab = np.hstack([local[:, :3] @ own.rotation.T, local[:, 3:] @ own.rotation.T])
    lab[:, 3:] += np.cross(lab[:, :3], own.rotation @ there.origin)
    recorded = Plate("plate1", 0, own.corners, Wrench(np.arange(len(lab)) / RATE, lab))
    trial = Trial("t", "fit", None, (recorded,), Source(Path("t.bsf"), "", "AMTI"))
    (read,) = as_told(trial, Told({"plate1": ToldPlate(corners=there.corners)})).plates
    np.testing.assert_allclose(read.wrench.value, truth, atol=1e-9)


def test_the_foot_that_is_told_stands_on_the_plate() -> None:
    """The corners of two plates are 0.6 m off; told which foot stands on which, each is measured all the same."""
    plates = [plate("plate1", (0.0, 0.5), (-0.3, 0.3)), plate("plate2", (0.5, 1.0), (-0.3, 0.3))]
    trial, soles, *_ = walker([Stand(0, 1, (0.6, -0.1, 0))], [Stand(0, 1, (0.1, 0.1, 0))], plates, duration=1.0)
    wrong = tuple(replace(one, corners=one.corners + np.array([0.0, 0.6, 0.0])) for one in trial.plates)
    assert not ground_contact(replace(trial, plates=wrong), soles, mass=WEIGHT / 9.80665).measured.any()
    feet = tuple(replace(one, foot=foot) for one, foot in zip(wrong, ("left", "right"), strict=True))
    contact = ground_contact(replace(trial, plates=feet), soles, mass=WEIGHT / 9.80665)
    assert contact.measured.all()
    np.testing.assert_array_equal(contact.on_plate[50], [[False, True], [True, False]])

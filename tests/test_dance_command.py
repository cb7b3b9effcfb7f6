"""The command dance: one tiny dance from the terminal to every file, read back by other code; refusals; folders that
are respected.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from small_dances import without_pictures

from biodance.body.parts import TENSOR
from biodance.cli import run
from biodance.dance.dance import Dance
from biodance.dance.problem.excitation import excitation_blocks
from biodance.dance.problem.plan import read_plan
from biodance.dance.verify import broken, dance_metrics, verify
from biodance.errors import BiodanceError
from biodance.lab.inspect import inspect_file
from biodance.lab.readers import read_trial
from biodance.motion.kinematics import poses, segment_motion
from biodance.pipeline.dance import UNFINISHED, dance_folder, dancer
from biodance.records import Subject

WHO = ["--sex", "F", "--height", "1.75", "--mass", "65"]
PROTOCOL = 'name = "tiny"\nmove_s = 2.0\nhold_s = 1.0\nfree = true\n[postures]\nparallel = 2\n'


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, int]:
    place = tmp_path_factory.mktemp("dance")
    protocol = place / "tiny.toml"
    protocol.write_text(PROTOCOL)
    code = run(["dance", *WHO, "--protocol", str(protocol), "--out", str(place / "out"), "--seed", "3"])
    return place / "out", protocol, code


def test_results_json_keeps_its_promise(made: tuple[Path, Path, int]) -> None:
    folder, _, code = made
    found = json.loads((folder / "results.json").read_text())
    assert code == 0
    assert found["feasible"] is True
    assert found["reason"] == ""
    assert (found["protocol"], found["postures"], found["transitions"]) == ("tiny", 2, 1)
    assert found["duration_s"] == pytest.approx(Dance.load(folder / "dance.npz").duration)
    assert found["duration_s"] >= 4.0
    assert set(found["criterion"]) >= {"static", "static_bound", "dynamic"}
    assert len(found["criterion"]["dynamic"]) == 1
    assert found["criterion"]["static"] >= found["criterion"]["static_bound"] == pytest.approx(65.0, abs=0.01)
    assert {m["limit"] for m in found["margins"]} >= {
        "joint_range",
        "joint_torque",
        "balance",
        "friction",
        "self_collision",
    }
    assert all(m["worst"] >= 0 and {"where_s", "unit"} <= set(m) for m in found["margins"])
    assert len(found["expected_sd"]) == 12
    assert all(0 < row["mass_kg"] <= row["mass_table_kg"] for row in found["expected_sd"])
    assert found["compute_s"] > 0
    soles = np.concatenate([stance.soles.reshape(-1, 3) for stance in Dance.load(folder / "dance.npz").stances])
    np.testing.assert_allclose(found["room_on_plates_m"], np.ptp(soles, axis=0)[[1, 0]] + 0.05)
    assert found["plate_m"] == [0.4, 0.6]
    assert all(
        "made for a plate of 0.40 m by 0.60 m" in (folder / name).read_text() for name in ("cues.md", "cues.html")
    )
    assert not (folder / UNFINISHED).exists()


def test_the_dance_on_disk_keeps_every_limit(made: tuple[Path, Path, int]) -> None:
    folder, protocol, _ = made
    dance = Dance.load(folder / "dance.npz")
    assert not broken(verify(dancer(Subject(65.0, 1.75, "F"), read_plan(protocol)), dance, read_plan(protocol).limits))


def test_virtual_markers_are_what_cameras_would_see(made: tuple[Path, Path, int]) -> None:
    folder, _, _ = made
    record = inspect_file(folder / "dance.c3d")
    assert (record["status"], record["marker_set"]) == ("ok", "plug_in_gait")
    trial, dance = read_trial(folder / "dance.c3d"), Dance.load(folder / "dance.npz")
    motion, markers = dance.motion(100.0), dance.body.markers
    places = poses(dance.body, motion.q).points(list(markers.segment), markers.position)
    np.testing.assert_allclose(trial.markers.select(markers.names).xyz, places, atol=1e-6)


def test_figures_cues_and_margins_are_there(made: tuple[Path, Path, int]) -> None:
    folder, _, _ = made
    for name in ("postures", "criterion", "zmp", "expectation"):
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    cues = (folder / "cues.md").read_text()
    assert cues.count("**1.**") == cues.count("**2.**") == 1
    assert "feet side by side" in cues
    assert "| balance |" in (folder / "margins.md").read_text()


def test_the_same_seed_gives_the_same_dance(made: tuple[Path, Path, int], tmp_path: Path) -> None:
    folder, protocol, _ = made
    with without_pictures():
        assert run(["dance", *WHO, "--protocol", str(protocol), "--out", str(tmp_path / "again"), "--seed", "3"]) == 0
    one, two = (Dance.load(place / "dance.npz") for place in (folder, tmp_path / "again"))
    for name in ("postures", "via", "move", "hold"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


def test_an_earlier_dance_is_not_overwritten(made: tuple[Path, Path, int], capsys: pytest.CaptureFixture[str]) -> None:
    folder, protocol, _ = made
    before = (folder / "results.json").read_bytes()
    assert run(["dance", *WHO, "--protocol", str(protocol), "--out", str(folder)]) == 2
    assert "--force" in capsys.readouterr().err
    assert (folder / "results.json").read_bytes() == before


def test_a_dance_that_cannot_exist_is_refused_with_what_forbids_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "tiny.toml").write_text(PROTOCOL)
    (tmp_path / "person.toml").write_text("[range_deg]\nankle_dorsiflexion = [-35, -30]\n")
    arguments = ["--protocol", str(tmp_path / "tiny.toml"), "--limits", str(tmp_path / "person.toml"), "--json"]
    assert run(["dance", *WHO, *arguments, "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert found["feasible"] is False
    assert "ankle dorsiflexion" in found["reason"]
    assert "ankle dorsiflexion" in said.err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["results.json"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (["--height", "175"], "1.2 to 2.2 m"),
        (["--mass", "0.65"], "30 to 200 kg"),
        (["--protocol", "fulll"], "Did you mean 'full'"),
        (["--limits", "nowhere.toml"], "nowhere.toml"),
    ],
)
def test_wrong_words_are_one_sentence(
    change: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = dict(zip(WHO[::2], WHO[1::2], strict=True)) | {change[0]: change[1]}
    arguments = [word for pair in words.items() for word in pair]
    assert run(["dance", *arguments, "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_folders_that_hold_other_things_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("hello")
    with pytest.raises(BiodanceError, match=r"mine\.txt"):
        dance_folder(tmp_path, force=True)
    with pytest.raises(BiodanceError, match="is a file"):
        dance_folder(tmp_path / "mine.txt")
    (tmp_path / "begun" / UNFINISHED).mkdir(parents=True)
    assert dance_folder(tmp_path / "begun") == tmp_path / "begun"


def test_the_criterion_of_a_motion_is_that_of_the_dance(made: tuple[Path, Path, int]) -> None:
    folder, protocol, _ = made
    dance = Dance.load(folder / "dance.npz")
    parts, motion = excitation_blocks(dance.body), dance.motion(50.0)
    seen = segment_motion(dance.body, motion)
    w, dw = (np.einsum("tnji,tnj->tni", seen.rotation, x) for x in (seen.angular_velocity, seen.angular_acceleration))
    units = np.zeros((6, 3, 3))
    for k, (i, j) in enumerate(TENSOR):
        units[k, i, j] = units[k, j, i] = 1.0
    K = np.stack([dw @ unit + np.cross(w, w @ unit) for unit in units], axis=-1)
    grams = np.einsum("tnik,tnil->nkl", K, K) / motion.rate + 0.01 * np.eye(6)
    picked = zip(parts.weight, parts.second, grams, strict=True)
    dynamic = sum(m * np.sqrt(np.linalg.cond(gram[np.ix_(pick, pick)])) for m, pick, gram in picked if pick)
    assert dynamic == pytest.approx(dance_metrics(dance, read_plan(protocol)).dynamic[-1], rel=2e-3)

"""A laboratory with labels of its own: plug-in gait under other names, read by a file or a map, from the command
line to the page.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from lab_sessions import person
from perfect_recordings import PLATE, SUBJECT, arm_swing, recorded
from second_package import renamed_set

from biodance.body.human.human import human
from biodance.cli import run
from biodance.errors import BiodanceError
from biodance.lab.c3d.write import PlateRecording, write_c3d
from biodance.lab.markers.sets import LANDMARKS, MARKED_SEGMENTS, read_marker_set, segment_of
from biodance.lab.readers import read_trial
from biodance.lab.readers.trc import write_trc
from biodance.lab.session.read import read_session
from biodance.observations import recording
from biodance.pipeline.session import examine
from biodance.records import Markers

SUBJECT_TOML = '[subject]\nmass_kg = 62.0\nheight_m = 1.70\nsex = "F"\nage = 30\n'
PLUG_IN_GAIT = read_marker_set("plug_in_gait")
RENAMED = {label: f"M{i:02d}" for i, label in enumerate(PLUG_IN_GAIT.labels)}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a session whose markers carry the laboratory's own labels: a static and a movement of a body known
    exactly.
    """
    session, body = tmp_path / "S01" / "visit", human(SUBJECT)
    session.mkdir(parents=True)
    for name, motion in (
        ("static", arm_swing(body, frames=100, angle=0.0)),
        ("swing", arm_swing(body, frames=200, angle=1.0)),
    ):
        trial = recorded(body, name, motion)
        names = tuple(RENAMED[label] for label in trial.markers.names)
        value = trial.plates[0].wrench.value
        value = np.concatenate([value, np.repeat(value[-1:], 10 * len(trial.markers.time) - len(value), axis=0)])
        down = np.diag([1.0, -1.0, -1.0])
        plate = PlateRecording(
            2, PLATE[[1, 0, 3, 2]], np.zeros(3), np.hstack([value[:, :3] @ down, value[:, 3:] @ down])
        )
        markers = Markers(names, trial.markers.time, trial.markers.xyz)
        write_c3d(session / f"{name}.c3d", markers=markers, plates=[plate], analog_rate=1000.0)
    (session / "session.toml").write_text(SUBJECT_TOML)
    return session


def own_file(place: Path) -> Path:
    """Write the set as a user would: plug-in gait with other labels."""
    (place / "mine.toml").write_text(renamed_set(RENAMED))
    return place / "mine.toml"


def own_map() -> str:
    """Return the [markers] map of the same set: landmarks where one label marks one, else the segment."""
    marked = {names[0]: mark for mark, (names, *_) in PLUG_IN_GAIT.landmarks.items() if len(names) == 1}
    places = {own: marked.get(label, PLUG_IN_GAIT.marker(label).segment) for label, own in RENAMED.items()}
    return "\n[markers]\nmap = {" + ", ".join(f'{own} = "{place}"' for own, place in places.items()) + "}\n"


def test_without_a_word_the_set_is_unknown_and_the_advice_can_be_followed(folder: Path) -> None:
    result = examine(read_session(folder))
    assert result.body is None
    assert all(
        "--markers FILE, or say [markers] file or map in session.toml" in trial.reason for trial in result.trials
    )


@pytest.mark.parametrize("way", ["option", "file", "map"])
def test_own_labels_are_followed(folder: Path, way: str) -> None:
    mine = own_file(folder.parent)
    said = {"option": "", "file": '\n[markers]\nfile = "../mine.toml"\n', "map": own_map()}[way]
    (folder / "session.toml").write_text(SUBJECT_TOML + said)
    result = examine(read_session(folder, markers=mine if way == "option" else None))
    assert result.body is not None
    assert result.placed.source.startswith("Scaled on the static trial")
    for trial in result.trials:
        assert trial.fit is not None, trial.reasons
        assert trial.fit.total_rms < (0.002 if way != "map" else 0.004)
        assert trial.comparison is None or np.nanmax(trial.comparison.rms[:3]) < 10.0


def test_the_option_reaches_every_command(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = str(own_file(tmp_path))
    run(["inspect", str(folder), "--markers", mine, "--json"])
    assert {record["marker_set"] for record in json.loads(capsys.readouterr().out)} == {mine}
    run(["report", str(folder), "--out", str(tmp_path / "report"), "--markers", mine, "--json"])
    found = json.loads(capsys.readouterr().out)
    assert {trial["marker_set"] for trial in found["trials"]} == {mine}
    assert all(trial["marker_rms_m"] < 0.002 for trial in found["trials"])
    run(["export", str(folder), "--format", "csv", "--out", str(tmp_path / "body.csv"), "--markers", mine])
    assert "right_thigh" in (tmp_path / "body.csv").read_text()
    asked = []

    def stopping(*_: object, markers: str | None = None, **__: object) -> None:
        asked.append(markers)
        raise BiodanceError("far enough")

    monkeypatch.setattr("biodance.lab.session.read.read_session", stopping)
    for command in ("identify", "diagnose"):
        run([command, str(folder), "--out", str(tmp_path / command), "--markers", mine])
    assert asked == [mine, mine]


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (
            '[markers]\nmap = {M01 = "left_hip_bone"}\n',
            r"map says M01 = 'left_hip_bone', which is no landmark and no segment. Legal are landmarks",
        ),
        ('[markers]\nmap = {M01 = "left_asis", M02 = "left_asis"}\n', "gives left_asis to M01 and to M02. Keep one"),
        ('[markers]\nmap = {M01 = "left_asis"}\nfile = "x.toml"\n', "has both file and map. Keep one of the two"),
        ("[markers]\nmap = {}\n", r"\[markers\] has no map. Write map ="),
        (
            '[markers]\nfile = "absent.toml"\n',
            "absent.toml: cannot be opened, there is no such marker set. Check the path; sets known by name are "
            "isb_landmarks",
        ),
        ('[markers]\nfile = "plug_in_gate"\n', "Did you mean 'plug_in_gait'.*A file of your own is given by its path"),
        (
            '[markers]\nfiles = "a.toml"\n',
            r"\[markers\] has the unknown key 'files'. Did you mean 'file'. Legal: file, map",
        ),
    ],
)
def test_a_mistake_in_the_markers_is_refused(folder: Path, said: str, words: str) -> None:
    (folder / "session.toml").write_text(SUBJECT_TOML + said)
    with pytest.raises(BiodanceError, match=words):
        read_session(folder)


def test_a_set_that_was_not_worn_is_said(folder: Path) -> None:
    session = read_session(folder, markers="plug_in_gait")
    assert all(
        "The markers are not of the chosen set plug_in_gait: " in " ".join(trial.warnings) for trial in session.trials
    )


@pytest.mark.parametrize("landmark", LANDMARKS)
def test_every_landmark_has_its_segment(landmark: str) -> None:
    assert segment_of(landmark) in MARKED_SEGMENTS
    side = landmark.partition("_")[0]
    assert not (
        side in ("left", "right") and any(limb in segment_of(landmark) for limb in ("thigh", "arm", "foot"))
    ) or segment_of(landmark).startswith(side)


RUNNER = {
    f"{side[0]}.{label}": f"{side.lower()}_{place}"
    for side in ("Right", "Left")
    for label, place in {
        "ASIS": "asis", "PSIS": "psis", "Knee": "knee_lateral", "Knee.Medial": "knee_medial", "Ankle": "ankle_lateral",
        "Ankle.Medial": "ankle_medial", "Heel.Bottom": "heel", "MT1": "toe_medial", "MT5": "toe_lateral",
    }.items()
}  # fmt: skip
"""A runner's labels in the static trial; the runs lack those of knees and ankles."""


def test_a_set_of_ones_own_is_worn_by_trials_that_lack_what_only_the_static_has(data: Path, tmp_path: Path) -> None:
    """Dropped in silence it was: no set in the runs, and witnesses without feet."""
    for file in ("static.c3d", "runT25.c3d"):
        (tmp_path / file).symlink_to(data / "rbds/S003" / file)
    required = ", ".join(f'"{label}"' for label in RUNNER)
    rows = "\n".join(f'"{label}" = "{place}"' for label, place in RUNNER.items())
    (tmp_path / "own.toml").write_text(f'name = "own"\nrequired = [{required}]\n[map]\n{rows}\n')
    (tmp_path / "session.toml").write_text('[markers]\nfile = "own.toml"\n')
    static, run = (read_session(tmp_path)[name] for name in ("static", "runT25"))
    assert {trial.marker_set for trial in (static, run)} == {str(tmp_path.resolve() / "own.toml")}
    assert not any("chosen set" in warning for warning in (*static.warnings, *run.warnings))
    assert {step.side for step in recording(run).steps} == {"right", "left"}


def test_witnesses_look_for_feet_by_the_set_of_the_user_alone(tmp_path: Path) -> None:
    """Who says that LTOE is no toe has no feet, though plug-in gait would know them."""
    markers = person()
    said = "\n".join(f'{label} = "{segment}"' for label, segment in (("LASI", "left_asis"), ("LTOE", "left_foot")))
    (tmp_path / "session.toml").write_text(f"[markers.map]\n{said}\n")
    write_trc(tmp_path / "static.trc", markers)
    assert len(recording(read_trial(tmp_path / "static.trc")).feet) == 2
    assert recording(read_session(tmp_path).trials[0]).feet == ()

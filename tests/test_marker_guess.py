"""Any marker set: what labels say, the guess on a standing person, one set for a session, parts of a body, init."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from lab_sessions import two_trials, write_trial

from biodance.body.human.human import human
from biodance.body.human.limits import with_tracking_limits
from biodance.body.human.standing import standing
from biodance.cli import run
from biodance.errors import FileRefused, SessionRefused
from biodance.lab.inspect import inspect_paths
from biodance.lab.markers.dress import dress
from biodance.lab.markers.guess import guess_set
from biodance.lab.markers.names import joints_from_video, meanings, meanings_of
from biodance.lab.markers.sets import read_marker_set
from biodance.lab.markers.spelling import plain_labels
from biodance.lab.markers.upright import axis_to_head
from biodance.lab.opensim.trc import write_trc
from biodance.lab.read import read_trial
from biodance.lab.session.read import read_session
from biodance.lab.session.write import init_session
from biodance.motion.kinematics import poses
from biodance.motion.track import upright_trunk
from biodance.records import Markers, Source, Subject, Trial

PERSON = Subject(62.0, 1.70, "F", name="S01")


@pytest.mark.parametrize(
    ("labels", "place"),
    [
        ("RASI R_IAS r.ASIS RightAsis r.ASIS_study ASIS_R EIASD RFWT right_asis", "right_asis"),
        ("LKNE L_FLE LLFC LeftKneeOut l_knee LLEK Left_Lateral_Femoral_Epicondyle", "left_knee_lateral"),
        ("RMed_ank R_TAM r_mankle RMMAL RMED", "right_ankle_medial"),
        ("LMT5 L_FM5 L_5meta LForefoot5 LLA_TOE", "left_toe_lateral"),
        ("C7 CV7 C7_study", "c7"),
        ("RTH1 r_thigh2 RTROC", "right_thigh"),
    ],
)
def test_many_spellings_are_one_thing(labels: str, place: str) -> None:
    assert {meanings(label)[0].place for label in labels.split()} == {place}


def test_words_that_name_no_place_mean_nothing() -> None:
    assert [meanings(label) for label in ("M01", "Unlabeled7", "RBALL", "PELO")] == [(), (), (), ()]


def stand(names: dict[str, str], *, flip: bool = False) -> Markers:
    """Return a generic person standing for 3 frames, landmark -> label; ``flip`` gives every label to the other
    side.
    """
    body = human(PERSON)
    pose = poses(body, body.neutral)
    place = pose.points(body.markers.segment, body.markers.position)[0] + [0.0, 0.0, 0.96]
    pig = read_marker_set("plug_in_gait").landmarks
    points = []
    for landmark in names:
        other = {"right": "left", "left": "right"}.get(landmark.split("_")[0])
        wanted = f"{other}_{landmark.split('_', 1)[1]}" if flip and other else landmark
        points.append(np.mean([place[body.markers.names.index(label)] for label in pig[wanted][0]], axis=0))
    return Markers(tuple(names.values()), np.arange(3) / 100, np.tile(points, (3, 1, 1)))


SIDED = {"asis": "Waist_Front", "psis": "Waist_Back", "knee_lateral": "Outer_Knee", "heel": "HeelBack"} | {
    "ankle_lateral": "Outer_Malleolus",
    "toe": "Met2",
    "acromion": "Acromion",
}
OWN = {f"{side}_{place}": f"{name} {side[0].upper()}" for place, name in SIDED.items() for side in ("right", "left")}


def test_an_undescribed_set_is_guessed_on_the_standing_person() -> None:
    guess = guess_set(stand(OWN))
    assert guess.map == {label: place for place, label in OWN.items()}
    worn = read_marker_set(guess.name)
    assert worn.title == "guessed"
    assert worn.landmarks["mid_psis"] == ((OWN["left_psis"], OWN["right_psis"]),)


def test_a_guess_that_the_person_contradicts_is_none() -> None:
    exchanged = guess_set(stand(OWN, flip=True))
    assert exchanged.name == ""
    assert "right where the person has the left" in exchanged.doubts[0]
    upside = OWN | {"right_asis": OWN["right_heel"], "right_heel": OWN["right_asis"]}
    assert guess_set(stand(upside)).name == ""


def test_posture_names_what_no_label_says() -> None:
    numbered = {place: f"M{k:02d}" for k, place in enumerate(OWN)}
    guess = guess_set(stand(numbered))
    assert guess.map == {label: place for place, label in numbered.items()}
    assert guess.name
    assert len(guess.doubts) == len(OWN)
    half = stand({place: label for place, label in numbered.items() if not place.endswith("knee_lateral")})
    assert guess_set(half).name == ""


def test_a_refused_set_is_told_what_it_lacks() -> None:
    no_knee = {place: label for place, label in OWN.items() if "knee" not in place}
    few = guess_set(stand(no_knee | {"right_asis": OWN["right_heel"], "right_heel": OWN["right_asis"]}))
    assert few.name == ""
    assert few.doubts[0].startswith("No marker could be taken for: ")
    assert "right knee lateral" in few.doubts[0]
    assert f"elsewhere: {OWN['right_heel']}" in few.doubts[0] or OWN["right_asis"] in few.doubts[0]


@pytest.mark.parametrize(
    ("labels", "joints"),
    [
        ("RHip LHip RKnee LKnee RAnkle LAnkle Nose Neck RBigToe RHeel", True),
        ("P07:left_hip P07:right_hip P07:left_knee P07:right_knee P07:left_ankle P07:right_ankle", True),
        ("HipLeft HipRight KneeLeft KneeRight AnkleLeft AnkleRight", True),
        ("RHip LHip RKnee LKnee RAnkle LAnkle RASI LASI", False),
        ("R.Hip L.Hip R.Knee.Medial L.Knee.Medial R.Knee L.Knee R.Ankle L.Ankle", False),
        ("RHip LHip RKnee LKnee RAnkle", False),
    ],
)
def test_joints_from_video_are_told_from_markers(labels: str, joints: bool) -> None:
    assert len(joints_from_video(labels.split())) == 6 * joints


def test_a_skeleton_from_video_is_refused_as_joints() -> None:
    bare = {"knee_lateral": "Knee", "ankle_lateral": "Ankle", "asis": "Hip", "acromion": "Shoulder"}
    names = {f"{side}_{place}": side[0].upper() + name for place, name in bare.items() for side in ("right", "left")}
    guess = guess_set(stand(names))
    assert guess.name == ""
    assert "not markers on the skin: RHip, LHip, RKnee" in guess.doubts[0]


def test_a_tongue_nobody_knows_is_learned_from_the_mirror_images() -> None:
    strange = {place: f"{'Zil' if place.startswith('right') else 'Vob'} {label[:-2]}" for place, label in OWN.items()}
    assert guess_set(stand(strange)).map == {label: place for place, label in strange.items()}


def test_words_nobody_knows_are_told_by_where_the_markers_are() -> None:
    words = {"knee": "Qux", "toe": "Zeb", "heel": "Plo"}
    odd = {place: f"{words.get(place.split('_')[1], label[:-2])} {label[-1]}" for place, label in OWN.items()}
    guess = guess_set(stand(odd))
    assert guess.map == {label: place for place, label in odd.items()}
    assert "Qux R stands where people have the right knee lateral" in guess.doubts[0]


def test_the_only_way_to_stand_is_up() -> None:
    numbered = {place: f"M{k:02d}" for k, place in enumerate((*OWN, "c7", "jugular_notch"))}
    upright = stand(numbered)
    assert axis_to_head(upright) == pytest.approx([0.0, 0.0, 1.0])
    lying = Markers(upright.names, upright.time, upright.xyz[..., [1, 2, 0]])
    assert axis_to_head(lying) == pytest.approx([0.0, 1.0, 0.0])


SPEAKERS = {
    "French, side last": "{}D {}G EIAS EIPS GENE MALE TALON MT2 ACR",
    "German": "{}_rechts {}_links SIAS SIPS Knie_aussen Knoechel_aussen Ferse MT2 Schulter",
    "Italian": "{}-dx {}-sx SIAS SIPS GinocchioEst MalleoloEst Tallone MT2 Spalla",
    "Spanish": "{}_der {}_izq EIAS EIPS Rodilla_ext Tobillo_ext Talon MT2 Hombro",
    "a subject and a shared letter": "Ann:pRight{} Ann:pLeft{} ASI PSI KneeLat AnkleLat Heel MT2 Acromion",
    "condyles": "R_{} L_{} ASIS PSIS LFC LMAL CALC MT2 ACRO",
}
"""How a laboratory says right and left, and what it calls the landmarks of SPOKEN."""
SPOKEN = ("asis", "psis", "knee_lateral", "ankle_lateral", "heel", "toe", "acromion")


@pytest.mark.parametrize("words", SPEAKERS.values(), ids=SPEAKERS)
def test_a_set_tells_its_own_language_and_sides(words: str) -> None:
    right, left, *names = words.split()
    spoken = {
        f"{side}_{place}": way.format(name)
        for place, name in zip(SPOKEN, names, strict=True)
        for side, way in (("right", right), ("left", left))
    }
    guess = guess_set(stand(spoken))
    assert guess.map == {label: place for place, label in spoken.items()}, guess.doubts


def test_computed_and_unlabelled_points_and_bone_axes_mark_nothing() -> None:
    computed = ["*13", "Unlabeled 7", "RHJC", "L_knee_centre", "MidASIS", "virtual_toe", "PELO", "PELA", "PELL", "PELP"]
    labels = ["S01:RKNE", "S01:LKNE", *(f"S01:{label}" for label in computed)]
    assert plain_labels(labels) == {"S01:RKNE": "RKNE", "S01:LKNE": "LKNE"}


def test_a_side_is_said_as_the_whole_set_says_it() -> None:
    french = meanings_of(["CLD", "CLG", "EIASD", "EIASG", "MLD", "MLG"])
    assert {label: ways[0].place for label, ways in french.items() if label[0] == "E"} == {
        "EIASD": "right_asis",
        "EIASG": "left_asis",
    }
    assert "left_knee_lateral" in {one.place for one in french["CLG"]}


def test_an_unnamed_marker_at_the_mirror_image_is_taken_and_said() -> None:
    typo = OWN | {"left_knee_lateral": "Quter Xnee L", "right_heel": "R strap"}
    guess = guess_set(stand(typo))
    assert guess.map["Quter Xnee L"] == "left_knee_lateral"
    assert guess.map["R strap"] == "right_heel"
    assert "mirror image" in " ".join(guess.doubts)
    gone = guess_set(stand({place: label for place, label in OWN.items() if place != "left_knee_lateral"}))
    assert (gone.name, gone.doubts[0]) == ("", "No marker could be taken for: left knee lateral.")


def trial_of(markers: Markers, role: str, name: str) -> Trial:
    return Trial(name, role, markers, (), Source(Path(f"{name}.c3d"), "", "C3D", 100.0), marker_set="")


def test_a_session_wears_the_set_of_its_static_trial() -> None:
    whole = stand(OWN)
    fewer = whole.select([label for label in whole.names if not label.startswith(("Acromion", "Waist_Back R"))])
    trials, notes = dress([trial_of(fewer, "fit", "walk"), trial_of(whole, "static", "still")])
    assert trials[0].marker_set == trials[1].marker_set != ""
    assert {trial.worn for trial in trials} == {"guessed"}
    assert "the map was guessed from names and posture" in notes[0]


def test_a_knee_alignment_device_stands_in_for_the_knee_marker() -> None:
    pig = {f"{side}_{place}": f"{side[0].upper()}{name}" for side in ("right", "left") for place, name in LEGS.items()}
    markers = stand(pig)
    knee = markers["RKNE"][0]
    arms = np.linalg.qr(np.array([[1.0, 2.0, -1.0], [0.5, -1.0, 1.0], [2.0, 1.0, 1.0]]))[0]
    out = np.sign(arms @ [0.0, -1.0, 0.0])[:, None] * arms  # away from the body, which is on the left of the knee
    xyz = np.concatenate([markers.xyz, np.tile(knee + 0.08 * out, (3, 1, 1))], axis=1)
    device = Markers((*markers.names, "RKAX", "RKD1", "RKD2"), markers.time, xyz)
    posture = standing(
        Trial(
            "static",
            "static",
            device.select([name for name in device.names if name != "RKNE"]),
            (),
            Source(Path("static.c3d"), "", "C3D", 100.0),
            marker_set="plug_in_gait",
        )
    )
    assert posture.landmarks["right_knee_lateral"] == pytest.approx(knee, abs=1e-9)
    assert posture.landmarks["right_knee_axis"] == pytest.approx(device["RKAX"][0])


LEGS = {"asis": "ASI", "psis": "PSI", "knee_lateral": "KNE", "ankle_lateral": "ANK", "heel": "HEE", "toe": "TOE"}


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


def test_init_writes_its_guesses_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = two_trials(tmp_path)
    before = {trial.name: trial.role for trial in read_session(folder).trials}
    assert run(["init", str(folder), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {trial["name"]: trial["role"] for trial in found["trials"]} == before
    after = read_session(folder)
    assert {trial.name: trial.role for trial in after.trials} == before
    assert after.subject.mass == pytest.approx(found["subject"]["mass_kg"])
    text = (folder / "session.toml").read_text()
    with pytest.raises(SessionRefused, match="nothing of yours is overwritten"):
        init_session(folder)
    assert (folder / "session.toml").read_text() == text


def test_init_begins_a_map_where_none_can_be_guessed(tmp_path: Path) -> None:
    numbered = {place: f"M{k:02d}" for k, place in enumerate(OWN)}
    still = stand(numbered | {"left_toe": "gone"})
    write_trc(tmp_path / "static.trc", still.select([label for label in still.names if label != "gone"]))
    init_session(tmp_path)
    text = (tmp_path / "session.toml").read_text()
    assert "# [markers.map]" in text
    assert all(f'# "{label}" = ' in text for label in numbered.values() if label in still.names)
    assert '# "M00" = "right_asis"' in text


def test_inspect_honours_the_markers_of_the_session_file(tmp_path: Path) -> None:
    file = write_trial(tmp_path, "static1")
    (tmp_path / "session.toml").write_text('[markers]\nfile = "opencap"\n')
    (record,) = [one for one in inspect_paths([tmp_path]) if one["file"] == str(file)]
    assert "The markers are not of the chosen set opencap" in " ".join(record["warnings"])
    (tmp_path / "session.toml").write_text("[markers]\nfiles = 1\n")
    (record,) = [one for one in inspect_paths([tmp_path]) if one["file"] == str(file)]
    assert "unknown key 'files'" in " ".join(record["warnings"])


def test_segment_poses_without_points_are_refused_in_one_sentence(tmp_path: Path) -> None:
    import ezc3d

    file = ezc3d.c3d()
    file["parameters"]["POINT"]["LABELS"]["value"] = ["dummy"]
    file["parameters"]["POINT"]["RATE"]["value"] = [85.0]
    points = np.full((4, 1, 20), np.nan)
    points[3] = 1
    file["data"]["points"] = points
    file["data"]["rotations"] = np.tile(np.eye(4)[:, :, None, None], (1, 1, 2, 20))
    file.add_parameter("ROTATION", "LABELS", ["pelvis_4X4", "l_thigh_4X4"])
    file.add_parameter("ROTATION", "RATE", [85.0])
    file.add_parameter("ROTATION", "USED", [2])
    file.write(str(tmp_path / "theia.c3d"))
    with pytest.raises(FileRefused, match=r"holds the poses of 2 segments \(pelvis, l_thigh .*no points"):
        read_trial(tmp_path / "theia.c3d")


@pytest.mark.skipif("BIODANCE_DATA" not in os.environ, reason="BIODANCE_DATA is not set: no real recordings")
def test_the_guess_agrees_with_a_known_set_on_a_real_person() -> None:
    trial = read_trial(Path(os.environ["BIODANCE_DATA"]) / "pycgm/Static_trial.c3d")
    known = read_marker_set("plug_in_gait").landmarks
    truth = {ways[0][0]: place for place, ways in known.items() if len(ways[0]) == 1}
    guess = guess_set(trial.markers).map
    assert {label: guess[label] for label in truth if label in trial.markers.names} == {
        label: place for label, place in truth.items() if label in trial.markers.names
    }

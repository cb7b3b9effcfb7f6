"""What the label of a marker says by itself, and beside the other labels of its set."""

import pytest

from biodance.lab.markers.names import joints_from_video, meanings, meanings_of, plain_labels


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

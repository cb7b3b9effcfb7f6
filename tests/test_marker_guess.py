"""Marker sets that nobody described are guessed on the standing person: by names, by posture, or not at all; one set
for a session.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from standing_markers import OWN, stand

from biodance.lab.markers.guess import guess_set
from biodance.lab.markers.sets import read_marker_set
from biodance.lab.markers.upright import axis_to_head
from biodance.lab.readers import read_trial
from biodance.lab.session.read import dress
from biodance.records import Markers, Source, Trial


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


@pytest.mark.parametrize("place", ["asis", "knee_lateral", "heel"])
def test_two_labels_on_each_others_side_are_what_they_lie_on_and_that_is_said(place: str) -> None:
    right, left = OWN[f"right_{place}"], OWN[f"left_{place}"]
    guess = guess_set(stand(OWN | {f"right_{place}": left, f"left_{place}": right}))
    assert guess.name
    assert (guess.map[left], guess.map[right]) == (f"right_{place}", f"left_{place}")
    assert any("lie on each other's sides" in doubt and right in doubt and left in doubt for doubt in guess.doubts)


def test_posture_names_what_no_label_says() -> None:
    numbered = {place: f"M{k:02d}" for k, place in enumerate(OWN)}
    guess = guess_set(stand(numbered))
    assert guess.map == {label: place for place, label in numbered.items()}
    assert guess.name
    assert len(guess.doubts) == len(OWN)
    half = stand({place: label for place, label in numbered.items() if not place.endswith("knee_lateral")})
    assert guess_set(half).name == ""


def test_of_two_nameless_markers_as_near_to_a_joint_none_is_taken() -> None:
    numbered = {place: f"M{k:02d}" for k, place in enumerate(OWN)}
    still = stand(numbered)
    knees = [numbered[f"{side}_knee_lateral"] for side in ("right", "left")]
    columns = [still.names.index(label) for label in knees]
    xyz = np.concatenate([still.xyz, still.xyz[:, columns] - [0.0, 0.0, 0.025]], axis=1)
    xyz[:, columns, 2] += 0.025
    both = Markers((*still.names, "M90", "M91"), still.time, xyz)
    guess = guess_set(both)
    assert guess.name == ""
    assert "right knee lateral" in guess.doubts[0]
    assert not {"M90", "M91", *knees} & guess.map.keys()


def test_a_refused_set_is_told_what_it_lacks() -> None:
    no_knee = {place: label for place, label in OWN.items() if "knee" not in place}
    few = guess_set(stand(no_knee | {"right_asis": OWN["right_heel"], "right_heel": OWN["right_asis"]}))
    assert few.name == ""
    assert few.doubts[0].startswith("No marker could be taken for: ")
    assert "right knee lateral" in few.doubts[0]
    assert f"elsewhere: {OWN['right_heel']}" in few.doubts[0] or OWN["right_asis"] in few.doubts[0]


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
    assert axis_to_head(upright, None) == pytest.approx([0.0, 0.0, 1.0])
    lying = Markers(upright.names, upright.time, upright.xyz[..., [1, 2, 0]])
    assert axis_to_head(lying, None) == pytest.approx([0.0, 1.0, 0.0])


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


@pytest.mark.skipif("BIODANCE_DATA" not in os.environ, reason="BIODANCE_DATA is not set: no real recordings")
def test_the_guess_agrees_with_a_known_set_on_a_real_person() -> None:
    trial = read_trial(Path(os.environ["BIODANCE_DATA"]) / "pycgm/Static_trial.c3d")
    known = read_marker_set("plug_in_gait").landmarks
    truth = {ways[0][0]: place for place, ways in known.items() if len(ways[0]) == 1}
    guess = guess_set(trial.markers).map
    assert {label: guess[label] for label in truth if label in trial.markers.names} == {
        label: place for label, place in truth.items() if label in trial.markers.names
    }


def test_the_arm_of_a_knee_alignment_device_is_no_knee(data: Path) -> None:
    """LKAX, outside the knee, was taken for the lateral marker and LKNE for the medial one."""
    guess = guess_set(read_trial(data / "biomechzoo/HC030A/HC030A01.c3d").markers)
    assert (guess.map["RKNE"], guess.map["LKNE"]) == ("right_knee_lateral", "left_knee_lateral")
    assert "LKAX" not in guess.map


def test_of_two_markers_at_the_fifth_metatarsal_none_is_the_first(data: Path) -> None:
    guess = guess_set(read_trial(data / "opensim_models/raj_walk/static.trc").markers)
    assert guess.name
    assert (guess.map["R.MT5"], guess.map["L.MT5"]) == ("right_toe_lateral", "left_toe_lateral")
    assert "right_toe_medial" not in guess.map.values()

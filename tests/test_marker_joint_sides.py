"""Several labels for one joint: which marker is its outer and which its inner one, told by where they are; and words
that end every label of a set.
"""

import numpy as np
import pytest
from standing_markers import OWN, stand

from biodance.lab.markers.guess import guess_set
from biodance.lab.markers.names import meanings_of, plain_labels
from biodance.records import Markers

DEEP = 0.09
"""m: the medial marker of a knee lies so far inside the lateral one."""


def with_inner(markers: Markers, joint: str, shares: dict[str, float]) -> Markers:
    """Return the markers with more of them on both sides: label with {} for the side -> share of `DEEP` by which it
    lies inside the marker of the ``joint``.
    """
    columns, names = [markers.xyz], list(markers.names)
    for side, sign in (("right", 1.0), ("left", -1.0)):
        outer = markers.xyz[:, names.index(OWN[f"{side}_{joint}"])]
        across = markers.xyz[:, names.index(OWN["right_asis"])] - markers.xyz[:, names.index(OWN["left_asis"])]
        inward = -sign * across / np.linalg.norm(across, axis=1, keepdims=True)
        for label, share in shares.items():
            columns.append((outer + share * DEEP * inward)[:, None])
            names.append(label.format(side[0].upper()))
    return Markers(tuple(names), markers.time, np.concatenate(columns, axis=1))


def renamed(markers: Markers, words: dict[str, str]) -> Markers:
    """Return the markers with words of their labels replaced."""
    names = list(markers.names)
    for old, new in words.items():
        names = [name.replace(old, new) for name in names]
    return Markers(tuple(names), markers.time, markers.xyz)


def test_the_middle_of_a_joint_is_not_its_outer_marker() -> None:
    three = with_inner(stand(OWN), "knee_lateral", {"Knee {}": 0.5, "KneeMed {}": 1.0})
    guess = guess_set(renamed(three, {"Outer_Knee": "KneeLat"}))
    assert guess.name
    assert [guess.map[f"KneeLat {side}"] for side in "RL"] == ["right_knee_lateral", "left_knee_lateral"]
    assert [guess.map[f"KneeMed {side}"] for side in "RL"] == ["right_knee_medial", "left_knee_medial"]
    assert [guess.map[f"Knee {side}"] for side in "RL"] == ["right_thigh", "left_thigh"]


def test_of_two_markers_called_medial_the_outer_one_is_lateral() -> None:
    both = renamed(with_inner(stand(OWN), "knee_lateral", {"InnerKnee {}": 1.0}), {"Outer_Knee": "KneeM"})
    guess = guess_set(both)
    assert guess.name
    assert [guess.map[f"KneeM {side}"] for side in "RL"] == ["right_knee_lateral", "left_knee_lateral"]
    assert [guess.map[f"InnerKnee {side}"] for side in "RL"] == ["right_knee_medial", "left_knee_medial"]


def test_the_only_marker_of_a_joint_is_its_outer_one_and_that_is_said() -> None:
    guess = guess_set(renamed(stand(OWN), {"Outer_Malleolus": "AnkleM"}))
    assert guess.name
    assert [guess.map[f"AnkleM {side}"] for side in "RL"] == ["right_ankle_lateral", "left_ankle_lateral"]
    assert "AnkleM R is the only marker there: taken for the right ankle lateral, against its name." in guess.doubts


@pytest.mark.parametrize("said", ["Knee {}", "KneeMed {}"])
def test_a_marker_with_a_nameless_one_across_the_joint_outside_is_the_inner_one(said: str) -> None:
    both = renamed(with_inner(stand(OWN), "knee_lateral", {said: 1.0}), {"Outer_Knee": "Gx"})
    guess = guess_set(both)
    assert guess.name
    assert [guess.map[f"Gx {side}"] for side in "RL"] == ["right_knee_lateral", "left_knee_lateral"]
    assert [guess.map[said.format(side)] for side in "RL"] == ["right_knee_medial", "left_knee_medial"]
    assert any(doubt.startswith("Gx R lies across the right knee from Knee") for doubt in guess.doubts)


@pytest.mark.parametrize("share", [0.15, 2.5])
def test_a_nameless_marker_nearer_or_farther_than_a_joint_is_wide_is_no_end_of_it(share: float) -> None:
    both = renamed(with_inner(stand(OWN), "knee_lateral", {"Plate {}": -share}), {"Outer_Knee": "Knee"})
    guess = guess_set(both)
    assert [guess.map[f"Knee {side}"] for side in "RL"] == ["right_knee_lateral", "left_knee_lateral"]
    assert "Plate R" not in guess.map


def test_a_known_word_is_not_cut_into_letters() -> None:
    names = ("OLE1D", "OLE1G", "EIASD", "EIASG", "CALCD", "CALCG")
    assert [one.place for one in meanings_of(names)["OLE1D"]] == ["right_forearm_hand"]


def test_a_word_that_ends_every_label_says_nothing() -> None:
    names = ["r_asis_pt", "l_asis_pt", "r_psis_pt", "cervicale_pt", "r_digit2_pt"]
    assert list(plain_labels(names).values()) == ["r_asis", "l_asis", "r_psis", "cervicale", "r_digit2"]
    assert list(plain_labels(["KNE_R", "KNE_L", "ANK_R", "ANK_L"]).values()) == ["KNE_R", "KNE_L", "ANK_R", "ANK_L"]
    guess = guess_set(renamed(stand(OWN), {" R": " R_pt", " L": " L_pt"}))
    assert guess.map == {f"{label}_pt": place for place, label in OWN.items()}

"""Marker sets: recognition by label, renaming, landmarks, and refusal of every broken set file."""

from pathlib import Path

import numpy as np
import pytest

from biodance.errors import BiodanceError, TrialRefused, UnknownName
from biodance.lab.markers.sets import (
    FOLDER,
    LANDMARKS,
    MARKED_SEGMENTS,
    canonical,
    landmark,
    read_marker_set,
    recognise,
)
from biodance.library import names
from biodance.records import Markers

PLUG_IN_GAIT = read_marker_set("plug_in_gait")
NO_ARM_WANDS = {"LUPA", "RUPA", "LFRM", "RFRM"}
FULL = tuple(marker.label for marker in PLUG_IN_GAIT.markers if marker.offset is not None)


def some_markers(labels: tuple[str, ...], frames: int = 4) -> Markers:
    rng = np.random.default_rng(7)
    return Markers(labels, np.arange(frames) / 100, rng.normal(size=(frames, len(labels), 3)))


@pytest.mark.parametrize("name", names(FOLDER))
def test_every_shipped_set_is_sound(name: str) -> None:
    marker_set = read_marker_set(name)
    assert len(set(marker_set.labels)) == len(marker_set.labels) > 30
    assert {m.segment for m in marker_set.markers} == set(MARKED_SEGMENTS)
    assert set(marker_set.landmarks) <= set(LANDMARKS)
    assert marker_set.source
    for marker in marker_set.markers:
        assert (marker.offset is None) == (marker.normaliser == "")
        assert marker.offset is None or (marker.origin == "mid_shoulder") == (marker.segment == "trunk_head")


@pytest.mark.parametrize("name", names(FOLDER))
def test_left_and_right_mirror_each_other(name: str) -> None:
    marker_set = read_marker_set(name)
    place = {m.label: m for m in marker_set.markers}
    for landmark_name, alternatives in marker_set.landmarks.items():
        if not landmark_name.startswith("right_"):
            continue
        mirrored = marker_set.landmarks[landmark_name.replace("right_", "left_")]
        for right, left in zip(sum(alternatives, ()), sum(mirrored, ()), strict=True):
            assert place[left].segment == place[right].segment.replace("right_", "left_")
            if place[right].offset is not None:
                assert place[left].offset == pytest.approx(np.multiply(place[right].offset, [1, 1, -1]))


@pytest.mark.parametrize(
    ("dropped", "added", "count"),
    [
        (set(), (), 39),
        ({"LFRM", "RFRM"}, (), 37),
        (NO_ARM_WANDS, (), 35),
        (NO_ARM_WANDS | {"LPSI", "RPSI"}, ("SACR",), 34),
        ({"LFRM", "RFRM"}, ("LFRA", "RFRA"), 39),
    ],
)
def test_plug_in_gait_variants_are_recognised_by_label(dropped: set[str], added: tuple[str, ...], count: int) -> None:
    labels = (*(label for label in FULL if label not in dropped), *added, "*115", "LFOO", "T2")
    found = recognise(labels)
    assert found is not None
    assert found.name == "plug_in_gait"
    assert len(canonical(some_markers(labels), found).names) == count


def test_aliases_are_renamed_and_strangers_dropped() -> None:
    labels = (*(label for label in FULL if label not in ("LFRM", "RFRM")), "LFRA", "RFRA", "PELO")
    markers = some_markers(labels)
    chosen = canonical(markers, PLUG_IN_GAIT)
    assert set(chosen.names) == set(FULL)
    assert np.array_equal(chosen["LFRM"], markers["LFRA"])
    assert np.array_equal(chosen["C7"], markers["C7"])


def test_the_exact_label_wins_over_its_alias() -> None:
    markers = some_markers((*FULL, "LFRA"))
    assert np.array_equal(canonical(markers, PLUG_IN_GAIT)["LFRM"], markers["LFRM"])


def test_letter_case_is_forgiven_where_it_is_unambiguous() -> None:
    lower = tuple(label.lower() for label in FULL)
    assert recognise(lower) == PLUG_IN_GAIT
    twice = ("lasi", "Lasi", *(label for label in FULL if label != "LASI"))
    assert recognise(twice) is None


@pytest.mark.parametrize(
    "labels", [(), ("A", "B"), ("RACROM", "LACROM", "T2", "SACR", "RASI", "LASI", "RKNE", "LKNE", "RANK", "LANK")]
)
def test_unknown_sets_are_none(labels: tuple[str, ...]) -> None:
    assert recognise(labels) is None


def test_the_set_with_most_matched_markers_wins() -> None:
    small = read_marker_set("opencap")
    both = (*FULL, *small.required)
    assert recognise(both, candidates=(small, PLUG_IN_GAIT)) == PLUG_IN_GAIT


def test_canonical_refuses_markers_of_another_set() -> None:
    with pytest.raises(TrialRefused, match=r"plug_in_gait: LASI, .*RTOE are not"):
        canonical(some_markers(tuple(label for label in FULL if label not in PLUG_IN_GAIT.required)), PLUG_IN_GAIT)


def test_a_moving_trial_may_lack_required_labels() -> None:
    without = tuple(label for label in FULL if label != "LASI")
    assert canonical(some_markers(without), PLUG_IN_GAIT).names == without


def test_landmarks_take_the_first_alternative_that_was_recorded() -> None:
    markers = some_markers(FULL)
    assert landmark(markers, PLUG_IN_GAIT, "mid_psis") == pytest.approx((markers["LPSI"] + markers["RPSI"]) / 2)
    sacral = some_markers(("SACR", "LPSI"))
    assert landmark(sacral, PLUG_IN_GAIT, "mid_psis") == pytest.approx(sacral["SACR"])
    assert landmark(markers, PLUG_IN_GAIT, "right_knee_medial") is None
    assert landmark(markers, PLUG_IN_GAIT, "right_hip_centre") is None
    with pytest.raises(UnknownName, match="right_heel"):
        landmark(markers, PLUG_IN_GAIT, "right_hel")


def test_landmarks_are_not_seen_where_one_marker_is_not() -> None:
    markers = some_markers(FULL)
    xyz = markers.xyz.copy()
    xyz[2, FULL.index("LPSI")] = np.nan
    found = landmark(Markers(FULL, markers.time, xyz), PLUG_IN_GAIT, "mid_psis")
    assert found is not None
    assert np.isnan(found).any(axis=1).tolist() == [False, False, True, False]


GOOD = """
required = ["A"]
[aliases]
B = "A"
[markers]
A = { segment = "pelvis", offset = [0, 1, 0], normaliser = "stature" }
[landmarks]
c7 = [["A"]]
"""


def test_a_users_own_set_is_read_by_path_and_found_again_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(GOOD)
    mine = read_marker_set(path)
    assert read_marker_set(mine.name) == mine
    assert mine.marker("A").offset == (0.0, 1.0, 0.0)
    assert recognise(("B",), candidates=[mine]) == mine


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"pelvis"', '"hip"', "marker A has the segment 'hip'"),
        ('segment = "pelvis", ', "", "marker A has no segment"),
        ("c7 =", "c8 =", "'c8' is not a landmark"),
        ('[["A"]]', '[["Z"]]', "landmark c7 names 'Z'"),
        ('[["A"]]', '["A"]', "landmark c7 is"),
        ('required = ["A"]', 'required = ["Q"]', "required names 'Q'"),
        ('required = ["A"]', "", "'required' is empty"),
        ('required = ["A"]', 'required = "A"', "expected a list"),
        ('B = "A"', 'B = "C"', "names 'C'"),
        ('B = "A"', 'A = "A"', "under .aliases. and under"),
        ("[0, 1, 0]", "[0, 1]", "expected three numbers"),
        (', normaliser = "stature"', "", "offset without normaliser"),
        ('"stature"', '"height"', "the normaliser 'height'"),
        ('normaliser = "stature"', 'normaliser = "stature", weight = -1', "the weight -1"),
        ('normaliser = "stature"', 'normaliser = "stature", wait = 1', "unknown key 'wait'"),
        ("[landmarks]", "[landmark]", "'landmark' is not a key"),
        ("[aliases]", "[aliases", "not valid TOML"),
    ],
)
def test_a_broken_set_file_is_refused_with_its_name(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "broken.toml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(BiodanceError, match=rf"broken\.toml: .*{words}"):
        read_marker_set(path)


def test_missing_files_and_unknown_names_are_said(tmp_path: Path) -> None:
    with pytest.raises(BiodanceError, match="cannot be opened"):
        read_marker_set(tmp_path / "no.toml")
    with pytest.raises(UnknownName, match="plug_in_gait"):
        read_marker_set("plugin_gait")
    with pytest.raises(UnknownName, match="LASI"):
        PLUG_IN_GAIT.marker("LAS")


@pytest.mark.parametrize(
    ("file", "name", "count"),
    [
        ("pycgm/Movement_trial.c3d", "plug_in_gait", 39),
        ("pycgm/Static_trial.c3d", "plug_in_gait", 39),
        ("biomechzoo/HC030A/HC030A05.c3d", "plug_in_gait", 34),
        ("biomechzoo/HC032A/HC032A01.c3d", "plug_in_gait", 38),
        ("adl_gait/2014001_ST.c3d", "isb_landmarks", 52),
        ("c3d_parser/static/CB_Static0001.c3d", None, 0),
    ],
)
def test_real_files_are_recognised(file: str, name: str | None, count: int, data: Path) -> None:
    import ezc3d

    point = ezc3d.c3d(str(data / file))["parameters"]["POINT"]
    labels = [*point["LABELS"]["value"], *point.get("LABELS2", {"value": []})["value"]]
    found = recognise(labels)
    assert (found.name if found else None) == name
    assert found is None or len(found.match(labels)) == count

"""Stature told by markers, against what 25 people declared, and where arms are lifted."""

from pathlib import Path

import numpy as np
import pytest
from lab_sessions import person

from biodance import read_session
from biodance.lab.markers.sets import recognise
from biodance.lab.readers import read_trial
from biodance.lab.session.subject import stature_of_markers, stature_of_movement
from biodance.records import Markers, Source, Trial

RUNNERS = {"S001": 1.81, "S003": 1.77, "S005": 1.69, "S009": 1.732, "S012": 1.786, "S016": 1.675, "S017": 1.835,
           "S018": 1.845, "S020": 1.745, "S024": 1.819}  # fmt: skip
CHILDREN = ("HC030A", "HC031A", "HC032A", "HC038A", "HC044A", "HC050A", "HC055A")


def test_declared_statures_are_told_within_their_standard_deviations(data: Path, tmp_path: Path) -> None:
    """Shod runners were 4.5 % too tall on average by the height of their iliac spines over the floor."""
    found = {}
    for name, stature in RUNNERS.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "static.c3d").symlink_to(data / "rbds" / name / "static.c3d")
        found[name] = (*stature_of_markers(read_session(tmp_path / name).trials[0])[:2], stature)
    for name in CHILDREN:
        trial = read_trial(data / "biomechzoo" / name / f"{name}01.c3d", role="static")
        found[name] = (*stature_of_markers(trial)[:2], trial.measurements["Height"])
    told, sd, true = np.array(list(found.values())).T
    assert np.sqrt(np.mean((told / true - 1)[len(RUNNERS) :] ** 2)) < 0.015
    assert np.sqrt(np.mean((told / true - 1)[: len(RUNNERS)] ** 2)) < 0.03
    assert abs(np.mean((told / true - 1)[: len(RUNNERS)])) < 0.02
    assert 0.5 < np.sqrt(np.mean(((told - true) / sd) ** 2)) < 1.3
    assert np.abs((told - true) / sd).max() < 2.5


def test_arms_out_and_shoes_make_nobody_tall(data: Path, tmp_path: Path) -> None:
    """The acromia alone, over the floor, say 1.89, 1.91 and 1.91 m of three men with arms out and shoes."""
    for name, at_most in (("gait10/subject01_static", 1.87), ("raj_walk/static", 1.82), ("raj_run/static", 1.86)):
        folder = tmp_path / name.partition("/")[0]
        folder.mkdir()
        (folder / "static.trc").symlink_to(data / f"opensim_models/{name}.trc")
        stature, sd, by = stature_of_markers(read_session(folder).trials[0])
        assert stature < at_most, name
        assert 0.015 < sd / stature + 0.005 < 0.03, name
        assert "the acromia" in by


def standing(change) -> Trial:
    """Return a static trial with ``change(label, xyz)`` done to its markers."""
    markers = person(frames=20)
    xyz = np.stack([change(label, markers[label]) for label in markers.names], axis=1)
    worn = recognise(markers.names)
    assert worn is not None
    source = Source(Path("static.trc"), "", "TRC", rate=100.0)
    return Trial("static", "static", Markers(markers.names, markers.time, xyz), (), source, worn.name)


def test_soles_do_not_count() -> None:
    bare, shod = standing(lambda _, xyz: xyz), standing(lambda _, xyz: xyz + np.array([0, 0, 0.03]))
    assert stature_of_markers(shod)[0] == pytest.approx(stature_of_markers(bare)[0])


def test_fewer_landmarks_are_less_certain_and_none_is_nan() -> None:
    def legs(label: str, xyz: np.ndarray) -> np.ndarray:
        return xyz if label[1:] in ("ASI", "KNE", "ANK") else np.full_like(xyz, np.nan)

    whole, part = stature_of_markers(standing(lambda _, xyz: xyz)), stature_of_markers(standing(legs))
    assert part[1] > 1.5 * whole[1]
    assert abs(part[0] - whole[0]) < 2 * part[1]
    no_ankle = standing(lambda label, xyz: np.full_like(xyz, np.nan) if "ANK" in label else xyz)
    assert np.isnan(stature_of_markers(no_ankle)[0])


@pytest.mark.parametrize(
    ("files", "static"),
    [
        (("biomechzoo/HC032A/HC032A18.c3d",), "biomechzoo/HC032A/HC032A01.c3d"),
        (("laas_human/c3d/march.c3d", "laas_human/c3d/squats.c3d"), "laas_human/c3d/static.c3d"),
    ],
)
def test_who_moves_is_as_tall_as_who_stands(data: Path, files: tuple[str, ...], static: str) -> None:
    stands = stature_of_markers(read_trial(data / static, role="static"))[0]
    moves, sd, _ = max(stature_of_movement(read_trial(data / file)) for file in files)
    assert abs(moves - stands) < 2 * sd
    assert 0.012 < sd / moves < 0.03


def test_a_session_without_a_static_trial_says_how_tall_somebody_is(data: Path, tmp_path: Path) -> None:
    (tmp_path / "march.c3d").symlink_to(data / "laas_human" / "c3d" / "march.c3d")
    session = read_session(tmp_path)
    assert session.subject.stature == pytest.approx(1.81, abs=0.04)
    assert any("while the person is upright in march: no static trial tells it" in note for note in session.notes)


def test_who_never_stands_upright_tells_nothing() -> None:
    names = ("RANK", "LANK", "RASI", "LASI")
    markers = Markers(names, np.arange(5) / 100, np.random.default_rng(1).uniform(0.05, 1.0, (5, 4, 3)))
    trial = Trial("stairs", "fit", markers, (), Source(Path("stairs.c3d"), "", "C3D"), "plug_in_gait")
    assert np.isnan(stature_of_movement(trial)[0])

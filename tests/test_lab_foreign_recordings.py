"""What lies in a session's folder and does not belong there: a file twice, and another person's recording."""

import shutil
from pathlib import Path

import pytest
from lab_sessions import person, roles, said, write_trial

from biodance.errors import SessionRefused
from biodance.lab.c3d.write import write_c3d
from biodance.lab.session.read import read_session
from biodance.records.attention import AnotherPerson

TYPED = "[subject]\nmass_kg = 61\nheight_m = 1.7\n"


def recorded(folder: Path, name: str, mass: float, stature: float = 1.7, speed: float = 1.0, seed: int = 1) -> None:
    """Write a C3D file that declares a person of some mass (kg) and stature (m)."""
    folder.mkdir(exist_ok=True)
    write_c3d(
        folder / f"{name}.c3d",
        markers=person(speed=speed, seed=seed),
        parameters={"PROCESSING": {"Bodymass": mass, "Height": 1000 * stature}},
    )


def test_a_copy_counts_once_and_is_said(tmp_path: Path) -> None:
    write_trial(tmp_path, "static01")
    write_trial(tmp_path, "walk", speed=1.2, mass=None)
    shutil.copy(tmp_path / "walk.trc", tmp_path / "walk (1).trc")
    session = read_session(tmp_path)
    assert roles(session) == {"static01": "static", "walk": "fit"}
    assert "Warning: walk (1).trc holds the same bytes as walk.trc and was left aside" in said(session)


def test_of_a_static_and_its_copy_the_static_stays(tmp_path: Path) -> None:
    write_trial(tmp_path, "static_of_today", mass=None)
    shutil.copy(tmp_path / "static_of_today.trc", tmp_path / "a.trc")
    assert roles(read_session(tmp_path)) == {"static_of_today": "static"}


@pytest.mark.parametrize(
    ("mass", "stature", "stranger"), [(46.0, 1.7, True), (62.0, 1.5, True), (64.0, 1.72, False), (70.0, 1.7, True)]
)
def test_a_recording_of_somebody_else_is_refused(tmp_path: Path, mass: float, stature: float, stranger: bool) -> None:
    recorded(tmp_path, "static", 62.0, speed=0.0)
    recorded(tmp_path, "walk1", 62.0, seed=2)
    recorded(tmp_path, "walk2", mass, stature, seed=3)
    session = read_session(tmp_path)
    assert list(session.refused) == ["walk2.c3d"] * stranger
    assert ("walk2" in roles(session)) is not stranger
    assert all("in the static trial static" in why for why in session.refused.values())
    assert all(isinstance(why, AnotherPerson) for why in session.refused.values())


def test_what_session_toml_says_is_believed_of_every_recording(tmp_path: Path) -> None:
    recorded(tmp_path, "static", 62.0, speed=0.0)
    recorded(tmp_path, "walk", 46.0, 1.5, seed=2)
    assert list(read_session(tmp_path).refused) == ["walk.c3d"]
    (tmp_path / "session.toml").write_text(TYPED)
    assert not read_session(tmp_path).refused


def test_what_session_toml_says_is_believed_of_every_part(tmp_path: Path) -> None:
    for part, mass, stature in (("Straight", 62.0, 1.7), ("Turn", 46.0, 1.5)):
        (tmp_path / part).mkdir()
        recorded(tmp_path / part, f"walk_{part}", mass, stature)
    with pytest.raises(SessionRefused, match="hold several people"):
        read_session(tmp_path)
    (tmp_path / "session.toml").write_text(TYPED)
    assert len(read_session(tmp_path).trials) == 2

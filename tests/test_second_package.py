"""A second package adds one effect, limit, reader, segment table, marker set and model format; nothing of biodance
is changed.
"""

import importlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from diagnosed_sessions import body, known, pull, windows
from inferred_sessions import inferred
from perfect_recordings import SUBJECT, arm_swing, recorded
from second_package import ENTRY_POINTS, LIMIT_POINT, RENAMED, install

import biodance.dance.limits as limits_room
from biodance.body.human.human import human
from biodance.body.tables.choice import table_names
from biodance.effects import effects
from biodance.errors import BiodanceError
from biodance.records import Subject


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Install the package for this test alone."""
    place = install(tmp_path / "site")
    monkeypatch.syspath_prepend(str(place))
    yield place
    forget()


def forget() -> None:
    importlib.invalidate_caches()
    for name in [name for name in sys.modules if name.partition(".")[0] == "tiny_lab"]:
        del sys.modules[name]


def tiny_session(folder: Path) -> Path:
    """Write a session in the package's own format, under its own labels."""
    folder.mkdir()
    one = human(SUBJECT)
    for name, motion in (
        ("static", arm_swing(one, frames=60, angle=0.0)),
        ("swing", arm_swing(one, frames=60, angle=1.0)),
    ):
        markers = recorded(one, name, motion).markers
        rows = np.column_stack([markers.time, markers.xyz.reshape(len(markers.time), -1)])
        lines = [" ".join(f"{x:.6f}" for x in row) for row in rows]
        (folder / f"{name}.tiny").write_text(
            "\n".join([" ".join(["TINY", *(RENAMED[label] for label in markers.names)]), *lines])
        )
    (folder / "session.toml").write_text('[subject]\nmass_kg = 62.0\nheight_m = 1.70\nsex = "F"\nage = 30\n')
    return folder


def test_reader_marker_set_and_export_from_the_command_line(tmp_path: Path) -> None:
    place, session = install(tmp_path / "site"), tiny_session(tmp_path / "S01")
    paths = [str(place), str(Path(__file__).parent.parent)]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}

    def biodance(*words: str) -> str:
        return subprocess.run(
            [sys.executable, "-m", "biodance", *words],
            env=env,
            capture_output=True,
            text=True,
            check=False,
            cwd=tmp_path,
        ).stdout

    records = json.loads(biodance("inspect", str(session), "--json"))
    assert {(Path(one["file"]).name, one["format"], one["marker_set"]) for one in records} == {
        ("static.tiny", "TINY", "tiny_set"),
        ("swing.tiny", "TINY", "tiny_set"),
    }
    biodance("export", str(session), "--format", "tiny", "--out", str(tmp_path / "masses.txt"))
    masses = dict(line.split() for line in (tmp_path / "masses.txt").read_text().splitlines())
    assert len(masses) == 12
    assert sum(map(float, masses.values())) == pytest.approx(62.0, abs=0.01)


def test_effect_is_fitted_like_any_other(installed: Path) -> None:
    assert list(effects())[-1] == "cable"
    found = inferred(
        body(),
        windows(1, hidden=pull),
        tolerances=known(),
        effects=("cable", "plate_gain", "plate_offset", "time_delay"),
    )
    (finding,) = found.diagnosis.findings
    assert (finding.effect, finding.advice) == ("cable", "Take the cable off the person.")
    assert finding.parameters[0].value == pytest.approx(8.0, rel=0.1)


def test_segment_table_makes_a_body(installed: Path) -> None:
    assert "tiny_study" in table_names("F")
    one = human(Subject(64.0, 1.70, "F", 30.0), table="tiny_study")
    assert one.sip.of("right_thigh")[0] == pytest.approx(8.0, rel=0.01)
    assert human(Subject(64.0, 1.70, "F", 30.0)).sip.covariance == pytest.approx(human_without(installed)), (
        "it changes nobody else's prior"
    )


def human_without(place: Path) -> np.ndarray:
    sys.path.remove(str(place))
    try:
        return human(Subject(64.0, 1.70, "F", 30.0)).sip.covariance
    finally:
        sys.path.insert(0, str(place))


@pytest.mark.skipif(
    not hasattr(limits_room, "FAMILY"), reason="the family of limits is not open to other packages here"
)
def test_limit_is_one_of_the_family(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(install(tmp_path / "site", points=LIMIT_POINT)))
    assert "low_hands" in [one.name for one in limits_room.family()]
    forget()


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (
            ENTRY_POINTS.replace("cable:Cable", "cabel:Cable"),
            r"The effect 'cable' of the installed package tiny-lab 0\.1 \(.*\) cannot be imported",
        ),
        (
            ENTRY_POINTS.replace("tiny_lab.cable:Cable", "tiny_lab.tiny_format"),
            r"tiny-lab 0\.1 .*: lacks the base class Effect or DiscreteEffect",
        ),
        (
            "[biodance.effects]\na = tiny_lab.cable:Cable\nb = tiny_lab.cable:Cable\n",
            "the effect 'cable' is the effect 'a' of the installed package tiny-lab 0.1 .* and again the effect 'b'",
        ),
    ],
)
def test_a_package_that_is_broken_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, points: str, words: str
) -> None:
    monkeypatch.syspath_prepend(str(install(tmp_path / "site", points=points)))
    with pytest.raises(BiodanceError, match=words):
        effects()
    forget()


@pytest.mark.parametrize(
    ("room", "family"),
    [("effects", "effect"), ("lab.readers", "reader"), ("body.export", "model format"), ("observations", "observer")],
)
def test_a_stray_file_in_a_folder_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, room: str, family: str
) -> None:
    package = importlib.import_module(f"biodance.{room}")
    (tmp_path / "notes.py").write_text("PAGES = 3\n")
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
    with pytest.raises(BiodanceError, match=rf"notes\.py: .*so it is no {family}"):
        package.FAMILY.members()
    sys.modules.pop(f"biodance.{room}.notes", None)


def test_a_table_of_a_package_says_where_its_numbers_come_from(installed: Path) -> None:
    (installed / "tiny_lab" / "tiny_study.toml").unlink()
    with pytest.raises(
        BiodanceError,
        match=r"tiny_study\.csv: has no tiny_study\.toml beside it, which says where its numbers come from",
    ):
        table_names("F")


def test_nothing_is_imported_before_a_family_is_asked(tmp_path: Path) -> None:
    place = install(tmp_path / "site")
    code = (
        "import sys, biodance, biodance.cli; print([m for m in sys.modules if m.startswith(('tiny_lab', "
        "'biodance.effects', 'numpy'))])"
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(place), str(Path(__file__).parent.parent)])}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

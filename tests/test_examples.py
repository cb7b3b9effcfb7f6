"""Every example runs alone, says something and makes one figure."""

import os
import runpy
import sys
import tempfile
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples"
EXAMPLES = [*sorted(FOLDER.glob("[0-9]*.py")), *sorted((FOLDER / "planar").glob("[0-9]*.py"))]
SHORTEST, LONGEST = 5, 60


def test_there_are_examples_and_they_are_short() -> None:
    assert len(EXAMPLES) >= 12
    for path in EXAMPLES:
        assert SHORTEST < len(path.read_text().splitlines()) <= LONGEST, path.name


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs_alone_and_makes_one_figure(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if "BIODANCE_DATA" in path.read_text() and not os.environ.get("BIODANCE_DATA"):
        pytest.skip("this example reads a real recording: BIODANCE_DATA is not set")
    here, temporary = tmp_path / "here", tmp_path / "temporary"
    here.mkdir()
    temporary.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    monkeypatch.setattr(sys, "argv", [str(path)])
    runpy.run_path(str(path), run_name="__main__")
    assert list(here.iterdir()) == [], "an example leaves nothing in the folder where it is run"
    made = [found for found in temporary.iterdir() if found.is_file()]
    assert [found.name for found in made] == [f"{path.stem}.png"]
    assert made[0].read_bytes().startswith(b"\x89PNG")
    assert made[0].stat().st_size > 5000
    assert len(capsys.readouterr().out.splitlines()) >= 2

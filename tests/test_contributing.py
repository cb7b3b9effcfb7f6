"""The worked example of CONTRIBUTING.md is an effect that works, found like any other by putting its file into the
folder.
"""

import importlib
import re
import sys
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest
from effect_cases import CASES

import biodance.effects as family
from biodance.effects import CheckKind

PAGE = Path(__file__).parent.parent / "CONTRIBUTING.md"


@pytest.fixture
def example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Put the example beside the other effects (in a folder of its own) and return its name."""
    code = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert len(code) == 1, "CONTRIBUTING.md holds exactly one worked example"
    (tmp_path / "shaking_floor.py").write_text(code[0], encoding="utf-8")
    monkeypatch.setattr(family, "__path__", [*family.__path__, str(tmp_path)])
    importlib.invalidate_caches()
    yield "shaking_floor"
    sys.modules.pop("biodance.effects.shaking_floor", None)


def test_one_file_is_enough(example: str) -> None:
    assert example in family.effects()
    case = CASES[1]
    found = family.effect(example).at("", case)
    columns = found.columns(case)
    added = found.transform(case, found.typical).residual - case.residual
    np.testing.assert_allclose(added, columns[:, :, 0] * found.typical[0], atol=1e-9)
    assert np.abs(added[:, 2]).max() > 1.0
    assert all(astuple(found.about))
    assert found.parameters[0].least_at("") < found.parameters[0].usual_at("") < found.typical[0]
    assert CheckKind.FORCES in found.explains


def test_what_is_one_file_each_is_there() -> None:
    table = PAGE.read_text(encoding="utf-8").partition("## One file each")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (.*) \| (.*) \| `(.*)::(.*)` \|$", table, flags=re.MULTILINE)
    assert len(rows) == 6
    for _, where, file, test in rows:
        assert f"def {test}(" in (PAGE.parent / file).read_text(encoding="utf-8")
        (path,) = re.findall(r"`(\w+/[\w/]+\.\w+)`", where)
        assert (PAGE.parent / path).parent.is_dir()
        assert (PAGE.parent / path).is_file() or path.rpartition("/")[2].startswith("NAME.")


def test_without_its_file_it_is_gone() -> None:
    assert "shaking_floor" not in family.effects()

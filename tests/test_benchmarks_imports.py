"""Benchmarks are run by hand and seldom: what they import of the package must still be there under its name, and the
one runner knows them all.
"""

import ast
import importlib.util
from pathlib import Path

import pytest

from benchmarks.__main__ import main, names

BENCHMARKS = sorted(Path(__file__).resolve().parents[1].joinpath("benchmarks").rglob("*.py"))
HELPERS = {"people", "foreign_dance"}
"""Files of benchmarks/ that are not run by their name."""


@pytest.mark.parametrize("path", BENCHMARKS, ids=lambda path: path.stem)
def test_what_a_benchmark_imports_exists(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in ("biodance", "benchmarks"):
            module = importlib.import_module(str(node.module))
            for name in (one.name for one in node.names):
                there = hasattr(module, name) or importlib.util.find_spec(f"{node.module}.{name}")
                assert there, f"{node.module} has no {name} (line {node.lineno})"


def test_the_runner_lists_every_benchmark_with_a_sentence_and_refuses_others(capsys: pytest.CaptureFixture) -> None:
    files = {path.stem for path in BENCHMARKS if path.parent.name == "benchmarks" and not path.stem.startswith("_")}
    assert set(names()) == files - HELPERS
    assert main([]) == 0
    assert all(f"{name} " in capsys.readouterr().out or told for name, told in names().items())
    assert main(["bench_of_nothing"]) == 2
    assert "There is no benchmark 'bench_of_nothing'." in capsys.readouterr().out


def test_benchmarks_stay_one_runner_and_few_files() -> None:
    assert sum(len(path.read_text(encoding="utf-8").splitlines()) for path in BENCHMARKS) <= 5000

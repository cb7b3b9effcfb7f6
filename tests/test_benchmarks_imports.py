"""Benchmarks are run by hand and seldom: what they import of the package must still be there under its name."""

import ast
import importlib.util
from pathlib import Path

import pytest

BENCHMARKS = sorted(Path(__file__).resolve().parents[1].joinpath("benchmarks").glob("*.py"))


@pytest.mark.parametrize("path", BENCHMARKS, ids=lambda path: path.stem)
def test_what_a_benchmark_imports_of_the_package_exists(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "biodance":
            module = importlib.import_module(node.module)
            for name in (one.name for one in node.names):
                there = hasattr(module, name) or importlib.util.find_spec(f"{node.module}.{name}")
                assert there, f"{node.module} has no {name} (line {node.lineno})"

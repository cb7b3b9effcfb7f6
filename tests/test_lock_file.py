"""What is installed is locked with hashes, as constraints.txt says, told in a bill of materials, and documented."""

import importlib.util
import json
import re
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def sbom() -> ModuleType:
    spec = importlib.util.spec_from_file_location("sbom", ROOT / ".ci" / "sbom.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def packages(sbom: ModuleType) -> dict[str, tuple[str, str, list[str]]]:
    return sbom.locked((ROOT / "locked.txt").read_text())


def direct(extras: tuple[str, ...]) -> set[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    named = [*project["dependencies"], *(one for name in extras for one in project["optional-dependencies"][name])]
    return {re.sub(r"[-_.]+", "-", re.split(r"[<>=\[;~! ]", one)[0]).lower() for one in named}


def test_every_package_is_locked_with_hashes(packages) -> None:
    assert len(packages) > 100
    assert all(
        hashes and all(re.fullmatch("[0-9a-f]{64}", one) for one in hashes) for _, _, hashes in packages.values()
    )
    assert direct(("test", "lint", "peers", "docs", "pictures")) <= packages.keys()


def test_lock_and_constraints_name_the_same_versions(packages) -> None:
    pins = dict(
        line.strip().split("==") for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line
    )
    known = {re.sub(r"[-_.]+", "-", name).lower(): version for name, version in pins.items()}
    assert {name: known[name] for name in packages if name in known} == {
        name: version for name, (version, _, _) in packages.items() if name in known
    }
    assert len(packages.keys() - known.keys()) < 10, "what only another machine or an old Python needs"


def test_the_bill_of_materials_holds_every_package(sbom: ModuleType, packages) -> None:
    bill = sbom.document(packages, direct(()), "1.0")
    assert bill == json.loads(json.dumps(sbom.document(packages, direct(()), "1.0"))), "the same again"
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.6")
    assert re.fullmatch(r"urn:uuid:[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}", bill["serialNumber"])
    assert {one["name"] for one in bill["components"]} == packages.keys()
    assert {one["name"] for one in bill["components"] if one.get("scope") == "required"} == direct(())


def test_the_documentation_says_what_each_dependency_is_for() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text()
    told = set(re.findall(r"^\| `([a-z0-9-]+)` \|", text[text.index("## What is installed") :], re.MULTILINE))
    assert direct(()) <= told
    assert direct(("dask", "rerun", "pictures", "peers")) <= told

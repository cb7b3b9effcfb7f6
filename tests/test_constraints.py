"""What constraints.txt pins can be installed with every Python that the README promises."""

import re
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

from packaging.specifiers import SpecifierSet
from packaging.version import Version

PINS = Path(__file__).parents[1] / "constraints.txt"
PROMISED = ("3.11.0", "3.11.2", "3.12.0", "3.13.0")
"""The first of each, and the Python of Debian 12."""


def pinned() -> dict[str, str]:
    """Package -> the one release that is installed."""
    return dict(re.fullmatch(r"([^=]+)==(\S+)", line).groups() for line in PINS.read_text().splitlines())


def left_out(python: str) -> list[str]:
    """The pins that refuse a version of Python, among those that are installed in just that release."""
    found = []
    for name, release in pinned().items():
        try:
            about = metadata(name)
        except PackageNotFoundError:
            continue
        if Version(about["Version"]) == Version(release) and "Requires-Python" in about:
            asked = SpecifierSet(about["Requires-Python"])
            found += [] if asked.contains(python) else [f"{name}=={release} asks for {asked}"]
    return found


def test_every_pin_can_be_installed_with_every_python_of_the_readme() -> None:
    assert {python: left_out(python) for python in PROMISED} == {python: [] for python in PROMISED}


def test_a_python_too_old_is_seen() -> None:
    assert len(left_out("3.6.0")) > 50

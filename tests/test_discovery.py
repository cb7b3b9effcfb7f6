"""Every family is found in its folder, in other packages and among arguments; whatever is no member is refused in a
sentence.
"""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import pytest

from biodance.discovery import DataFamily, Family, missing_of
from biodance.errors import BiodanceError, UnknownName


class Shape(Protocol):
    """What a member of the example family has."""

    name: str

    def area(self) -> float: ...


class Given:
    """A shape that a user wrote."""

    def __init__(self, name: str) -> None:
        self.name = name

    def area(self) -> float:
        return 2.0


SHAPES: "Family[Shape]" = Family(
    "shape", "biodance.shapes", "shapes", "SHAPE", missing_of(Shape), lambda shape: shape.name
)
SQUARE = "class Square:\n    name = 'square'\n    def area(self): return 1.0\nSHAPE = Square()\n"


@pytest.fixture
def shapes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return the folder of a family with one member and one helper."""
    folder = tmp_path / "place" / "shapes"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    (folder / "_helper.py").write_text("raise RuntimeError('a helper is not looked at')\n")
    (folder / "square.py").write_text(SQUARE)
    monkeypatch.syspath_prepend(str(folder.parent))
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] in ("shapes", "elsewhere")]:
        del sys.modules[name]


def install(place: Path, code: str, group: str, points: str) -> None:
    """Write an installed package ``elsewhere`` 1.2 with one module and its entry points into ``place``, as pip
    leaves it.
    """
    place.mkdir(exist_ok=True)
    (place / "elsewhere.py").write_text(code)
    info = place / "elsewhere_dist-1.2.dist-info"
    info.mkdir(exist_ok=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: elsewhere-dist\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text(f"[{group}]\n{points}\n")
    importlib.invalidate_caches()


def test_members_of_folder_other_packages_and_arguments(
    shapes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert list(SHAPES.members()) == ["square"]
    install(tmp_path / "other", SQUARE.replace("square", "circle"), "biodance.shapes", "circle = elsewhere\n")
    monkeypatch.syspath_prepend(str(tmp_path / "other"))
    assert list(SHAPES.members()) == ["square", "circle"]
    own = Given("own")
    assert SHAPES.members([own])["own"] is own
    assert list(SHAPES.choose(["circle", own])) == ["circle", "own"]
    assert list(SHAPES.choose([own])) == ["square", "circle", "own"], "objects join the family where no name is given"
    assert list(SHAPES.choose([])) == [], "nothing is a selection, too"
    assert SHAPES.choose({"one": own}) == {"one": own}, "a selection is returned as it is"
    with pytest.raises(UnknownName, match=r"'squre' is not a shape\. Did you mean 'square'"):
        SHAPES.choose(["squre"])


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (
            "x = 1\n",
            r"shapes/notes\.py: defines no SHAPE, so it is no shape\. Define it, .*start with '_'.*move the file away",
        ),
        (
            "import nothing_like_this\n",
            r"shapes/notes\.py: cannot be imported \(ModuleNotFoundError.*\)\. Correct the file or move it",
        ),
        ("this is a note\n", r"shapes/notes\.py: cannot be imported \(SyntaxError"),
        ("SHAPE = 3\n", r"shapes/notes\.py: lacks name, area, so it is no shape"),
        (SQUARE, r"the shape 'square' is shapes/notes\.py and again shapes/square\.py\. Rename one"),
    ],
)
def test_a_stray_file_is_refused(shapes: Path, code: str, words: str) -> None:
    (shapes / "notes.py").write_text(code)
    with pytest.raises(BiodanceError, match=words):
        SHAPES.members()


@pytest.mark.parametrize(
    ("code", "point", "words"),
    [
        (
            "import nothing_like_this\n",
            "elsewhere",
            r"The shape 'circle' of the installed package elsewhere-dist 1\.2 \(elsewhere\) cannot be",
        ),
        (
            "x = 1\n",
            "elsewhere:Circle",
            r"elsewhere-dist 1\.2 \(elsewhere:Circle\) cannot be imported \(AttributeError.*Repair or uninstall",
        ),
        ("x = 1\n", "elsewhere:x", r"elsewhere-dist 1\.2 \(elsewhere:x\): lacks name, area, so it is no shape"),
        (
            SQUARE,
            "elsewhere",
            r"'square' is shapes/square\.py and again the shape 'circle' of the installed package elsewhere-dist",
        ),
    ],
)
def test_a_broken_entry_point_is_refused(
    shapes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, point: str, words: str
) -> None:
    install(tmp_path / "other", code, "biodance.shapes", f"circle = {point}")
    monkeypatch.syspath_prepend(str(tmp_path / "other"))
    with pytest.raises(BiodanceError, match=words):
        SHAPES.members()


def test_objects_that_are_no_members_or_have_one_name_are_refused(shapes: Path) -> None:
    with pytest.raises(BiodanceError, match=r"The object given \(.*Path\): lacks area"):
        SHAPES.choose([Path("x")])  # type: ignore[list-item]
    assert list(SHAPES.judged([Given("own")])) == ["own"]
    with pytest.raises(
        BiodanceError, match=r"the shape 'own' is the object given .*Given.* and again the object given"
    ):
        SHAPES.choose([Given("own"), Given("own")])
    with pytest.raises(BiodanceError, match=r"'square' is shapes/square\.py and again the object given"):
        SHAPES.members([Given("square")])


def test_a_family_of_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sets = DataFamily("marker set", "biodance.marker_sets", "anthropometry/marker_sets", ".toml")
    shipped = list(sets.files())
    assert "plug_in_gait" in shipped
    own = tmp_path / "other" / "own.toml"
    install(tmp_path / "other", f"OWN = {str(own)!r}\n", "biodance.marker_sets", "own = elsewhere:OWN")
    monkeypatch.syspath_prepend(str(tmp_path / "other"))
    with pytest.raises(
        BiodanceError, match=r"marker set 'own' of the installed package elsewhere-dist 1\.2 .* points at .*own\.toml"
    ):
        sets.files()
    own.write_text("")
    assert list(sets.files()) == [*shipped, "own"]
    assert sets.locate("own") == own
    assert sets.locate("x/y.toml") == Path("x/y.toml")
    with pytest.raises(
        UnknownName, match=r"'onw' is not a marker set\. Did you mean 'own'.*A file of your own is given by its path"
    ):
        sets.locate("onw")
    sys.modules.pop("elsewhere", None)

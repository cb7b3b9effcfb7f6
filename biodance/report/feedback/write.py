"""Write the page that leads a person through a dance: one file, no network, opened from disk."""

import json
import re
import zipfile
from importlib.resources import files
from pathlib import Path

from biodance.dance.dance import Dance
from biodance.errors import BiodanceError
from biodance.report.feedback.scene import scene_of
from biodance.version import __version__

_LIBRARY = re.compile(r"<script>(/\*\*\s*\* @license[^/]*\*/\n[^\n]{100000,})\n")
"""The first script of trimesh's viewer: the licence, and on one line the library."""


def write_feedback(dance: Dance, path: Path, *, force: bool = False) -> None:
    """Write the page of a dance to ``path``.

    Raises
    ------
    BiodanceError
        There is a file of that name and ``force`` was not given, the folder is missing, the dance is that of a robot
        without solids, or the drawing library is missing.
    """
    if path.exists() and not force:
        raise BiodanceError(f"{path}: exists and nothing is overwritten. Choose another --out, or --force.")
    if not path.parent.is_dir():
        raise BiodanceError(f"{path.parent}: there is no such folder. Make it, or choose another --out.")
    page = feedback_page(dance)
    part = path.with_name(f".{path.name}.part")
    part.write_text(page, encoding="utf-8", newline="\n")
    part.replace(path)


def feedback_page(dance: Dance) -> str:
    """Return the page of a dance as HTML text."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    folder = files("biodance.report") / "templates"

    def text(name: str) -> Markup:
        return Markup((folder / name).read_text(encoding="utf-8"))

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    scene = json.dumps(scene_of(dance), separators=(",", ":")).replace("</", "<\\/")
    return environment.from_string(text("feedback.html.j2")).render(
        name=dance.protocol.replace("_", " "),
        version=__version__,
        style=text("feedback.css"),
        program=text("feedback.js"),
        three=Markup(three_js()),
        scene=Markup(scene),
    )


def three_js() -> str:
    """Return the text of three.js with its licence notice, as trimesh carries it for its own viewer.

    Raises
    ------
    BiodanceError
        The installed trimesh carries none.
    """
    import trimesh

    place = Path(trimesh.__file__).parent / "resources" / "templates" / "viewer.zip"
    try:
        with zipfile.ZipFile(place) as packed:
            page = packed.read("viewer.html.template").decode("utf-8")
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise BiodanceError(
            f"{place}: trimesh lacks its viewer ({error}). Install trimesh anew: see README."
        ) from error
    found = _LIBRARY.search(page)
    if found is None or "</script" in found.group(1):
        raise BiodanceError(f"{place}: holds no three.js. Install the trimesh of constraints.txt.")
    return found.group(1)

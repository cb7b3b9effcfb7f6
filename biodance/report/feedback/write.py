"""Write the page that leads a person through a dance: one file, no network, opened from disk."""

import json
from importlib.resources import files
from pathlib import Path

from biodance.dance.dance import Dance
from biodance.errors import BiodanceError
from biodance.report.feedback.scene import scene_of
from biodance.report.three import three_js
from biodance.version import __version__


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

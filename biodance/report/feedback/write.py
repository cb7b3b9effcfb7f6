"""Write the page that leads a person through a dance: one file, no network, opened from disk."""

import json
from base64 import b64encode
from importlib.resources import files
from pathlib import Path
from typing import Any

from biodance.dance.dance import Dance
from biodance.errors import BiodanceError
from biodance.report.feedback.follow import follow_scene
from biodance.report.feedback.scene import scene_of
from biodance.report.three import three_js
from biodance.version import __version__

_BUNDLE = {"program": "pose.js", "kernels": "pose.wasm", "model": "movenet.json", "weights": "movenet.bin"}
"""What follows a person: parts of the bundle that `make bundle` writes beside this module."""


def write_feedback(dance: Dance, path: Path, *, force: bool = False) -> bool:
    """Write the page of a dance to ``path`` and return whether it follows the person (see `bundle`).

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
    scene, carried = scene_of(dance), bundle()
    scene["follow"] = follow_scene(dance) if carried else None
    page = feedback_page(dance.protocol, scene, carried if scene["follow"] else None)
    part = path.with_name(f".{path.name}.part")
    part.write_text(page, encoding="utf-8", newline="\n")
    part.replace(path)
    return scene["follow"] is not None


def bundle() -> dict[str, str] | None:
    """Return what follows a person, in base64, with its ``notices``; None where it was not built."""
    folder = files("biodance.report.feedback") / "bundle"
    if not all((folder / name).is_file() for name in (*_BUNDLE.values(), "NOTICES.txt")):
        return None
    parts = {key: b64encode((folder / name).read_bytes()).decode("ascii") for key, name in _BUNDLE.items()}
    return parts | {"notices": (folder / "NOTICES.txt").read_text(encoding="utf-8").replace("--", "- -")}


def feedback_page(name: str, scene: dict[str, Any], carried: dict[str, str] | None) -> str:
    """Return the page of a dance as HTML text: what it shows (`scene_of`), and what follows the person, or None."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    folder = files("biodance.report") / "templates"

    def text(name: str) -> Markup:
        return Markup((folder / name).read_text(encoding="utf-8"))

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    text_of_scene = json.dumps(scene, separators=(",", ":")).replace("</", "<\\/")
    return environment.from_string(text("feedback.html.j2")).render(
        name=name.replace("_", " "),
        version=__version__,
        style=text("feedback.css"),
        program=text("feedback.js"),
        three=Markup(three_js()),
        scene=Markup(text_of_scene),
        bundle={key: Markup(value) for key, value in carried.items()} if carried else None,
        following=text("follow_body.js") + text("follow.js"),
    )

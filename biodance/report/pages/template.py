"""How a template becomes a page: one environment, one style, scripts that the page's policy allows by their hash."""

import functools
import json
import os
import re
import zipfile
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from biodance.errors import BiodanceError
from biodance.report.tables.schema import Row, Schema, plain_values
from biodance.report.wording import format_number, millimetres, moment
from biodance.version import __version__

if TYPE_CHECKING:
    from jinja2 import Template
    from markupsafe import Markup


_LIBRARY = re.compile(r"<script>(/\*\*\s*\* @license[^/]*\*/\n[^\n]{100000,})\n")
"""The first script of trimesh's viewer: the licence, and on one line the library."""


@cache
def three_js() -> str:
    """Return the text of three.js with its licence notice, as trimesh carries it for its own viewer. Raises
    BiodanceError: the installed trimesh carries none.
    """
    found = find_spec("trimesh")
    place = Path(found.origin if found and found.origin else "trimesh").parent / "resources/templates/viewer.zip"
    try:
        with zipfile.ZipFile(place) as packed:
            page = packed.read("viewer.html.template").decode("utf-8")
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise BiodanceError(
            f"{place}: trimesh lacks its viewer ({error}). Install trimesh anew: see README."
        ) from error
    text = _LIBRARY.search(page)
    if text is None or "</script" in text.group(1):
        raise BiodanceError(f"{place}: holds no three.js. Install the trimesh of constraints.txt.")
    return text.group(1)


def script_json(document: object) -> str:
    """Return a document as JSON that may stand in a ``<script>`` of a page: no text in it can end or open one."""
    return json.dumps(plain_values(document), separators=(",", ":")).replace("<", "\\u003c")


def template_text(name: str) -> str:
    """Return a file of the templates' folder."""
    return (files("biodance.report") / "templates" / name).read_text(encoding="utf-8")


def html_table(
    schema: Schema, rows: Iterable[Row], caption: str = "", *, only: Iterable[str] | None = None, narrow: bool = True
) -> "Markup":
    """Return rows as an HTML table, as their schema shows them, ``only`` some columns; ``narrow`` as their text."""
    from markupsafe import Markup

    headings = list(schema.columns if only is None else only)
    head = "".join(Markup('<th scope="col">{}</th>').format(heading) for heading in headings)
    body = []
    for row in rows:
        first, *others = schema.cells(row, headings)
        cells = (
            Markup('<td class="n">{}</td>' if _NUMBER.match(cell) else "<td>{}</td>").format(cell) for cell in others
        )
        body.append(Markup('<tr><th scope="row">{}</th>{}</tr>\n').format(first, Markup("").join(cells)))
    told = Markup("<caption>{}</caption>\n").format(caption) if caption else ""
    kind = ' class="narrow"' if narrow else ""
    return Markup(
        f'<div class="wide" tabindex="0"><table{kind}>\n{told}<thead><tr>{head}</tr></thead>\n<tbody>\n'
        f"{Markup('').join(body)}</tbody>\n</table></div>"
    )


_NUMBER = re.compile(r"[±+−–<]? ?\d|–$")  # How a cell begins that is a number, or one that is not known


def render(
    template: str, /, *, filters: dict[str, Any] | None = None, scripts: Sequence[str] = (), **values: Any
) -> str:
    """Return a template filled with ``values`` as HTML text; the same arguments give the same characters.

    Every template knows ``style`` (of the analyst's page, unless another one is among the values), ``policy`` (what its
    page may do: nothing of the network, and only ``scripts``), ``scripts``, ``version`` (of biodance), the function
    ``table`` (`html_table`), and the filters ``number``, ``mm`` and ``moment``.
    """
    from markupsafe import Markup

    style = template_text("page.css") + template_text("curves.css")
    hashes = " ".join(f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in scripts)
    allowed = f"script-src {hashes}; " if scripts else ""
    policy = f"default-src 'none'; {allowed}style-src 'unsafe-inline'; img-src data:"
    given = {"style": Markup(style), "policy": policy, "scripts": [Markup(text) for text in scripts]}
    return _compiled(template, tuple((filters or {}).items())).render(**{"version": __version__, **given, **values})


@functools.cache
def _compiled(name: str, filters: tuple[tuple[str, Any], ...]) -> "Template":
    from jinja2 import Environment, FileSystemBytecodeCache, FunctionLoader, StrictUndefined

    kept = Path(__file__).parent / "__pycache__"  # what Python itself keeps of modules, jinja keeps of templates
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=FunctionLoader(template_text),
        bytecode_cache=FileSystemBytecodeCache(str(kept)) if os.access(kept, os.W_OK) else None,
    )
    environment.globals["table"] = html_table
    environment.filters.update(number=format_number, mm=millimetres, moment=moment, **dict(filters))
    return environment.get_template(name)


def print_sheet(title: str, visit: Mapping[str, str], created: str) -> "Markup":
    """Return the style of a printed page's margins: title, visit, when (``created``) and by what made, page number."""
    from markupsafe import Markup

    about = " · ".join(f"{what} {said}" for what, said in visit.items() if said)
    boxes = {
        "top-left": _css_text(title),
        "top-right": _css_text(about),
        "bottom-left": _css_text(f"biodance {__version__}, {moment(created)} · for research use"),
        "bottom-right": '"page " counter(page) " of " counter(pages)',
    }
    return Markup(f"@page {{ {' '.join(f'@{where} {{ content: {text}; }}' for where, text in boxes.items())} }}")


def _css_text(text: str) -> str:
    """Return text as a string of a style sheet; nothing in it can end the string or the sheet."""
    return '"' + "".join(c if c.isalnum() or c in " .,:-·" else f"\\{ord(c):x} " for c in text) + '"'

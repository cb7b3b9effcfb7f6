"""The drawing library of the pages that move: three.js, as the installed trimesh carries it."""

import re
import zipfile
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from biodance.errors import BiodanceError

_LIBRARY = re.compile(r"<script>(/\*\*\s*\* @license[^/]*\*/\n[^\n]{100000,})\n")
"""The first script of trimesh's viewer: the licence, and on one line the library."""


@cache
def three_js() -> str:
    """Return the text of three.js with its licence notice, as trimesh carries it for its own viewer.

    Raises
    ------
    BiodanceError
        The installed trimesh carries none.
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

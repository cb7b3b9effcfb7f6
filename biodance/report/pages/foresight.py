"""The page of what a planned movement will see: a summary, what to change, and every cause."""

from typing import Any

from biodance.pipeline.provenance import now
from biodance.report.pages.template import render
from biodance.report.wording import size_seen
from biodance.version import __version__

_NAMED = 6
"""Targets of a cause that are listed by name."""


def foresight_page(document: dict[str, Any], name: str) -> str:
    """Return the page (HTML) of what `foresight_document` says of the movement ``name``."""
    return render(
        "foresight.html.j2",
        found=document,
        movement=name,
        version=__version__,
        created=now(),
        words=_words,
        some=_some,
        size_seen=size_seen,
    )


def _some(causes: list[str]) -> str:
    """Return causes by effect, the first targets of each by name: "marker misplaced (C7, CLAV and 3 more)"."""
    targets: dict[str, list[str]] = {}
    for effect, _, target in (cause.partition(" ") for cause in causes):
        targets.setdefault(effect, []).append(_words(target))
    out = []
    for effect, of in targets.items():
        more = f" and {len(of) - _NAMED} more" if len(of) > _NAMED else ""
        out.append(_words(effect) + (f" ({', '.join(of[:_NAMED])}{more})" if of[0] else ""))
    return "; ".join(out)


def _words(cause: str) -> str:
    return cause.replace("_", " ").replace("->", "→")

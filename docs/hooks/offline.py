"""Refuse a built page that would load a script, style, font or picture over the network."""

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import Abort

LOADED = (
    re.compile(r"<(?:script|img|iframe|source|video)\b[^>]*\bsrc=[\"']?((?:https?:)?//[^\"'\s>]+)"),
    re.compile(
        r"<link\b(?=[^>]*\brel=[\"']?(?:stylesheet|preconnect|preload|icon|manifest))"
        r"[^>]*\bhref=[\"']?((?:https?:)?//[^\"'\s>]+)"
    ),
    re.compile(r"url\([\"']?((?:https?:)?//[^\"')]+)"),
    re.compile(r"@import\s+[\"']((?:https?:)?//[^\"']+)"),
)
"""What makes a browser fetch something; a link that a person may follow is allowed."""


def on_post_build(*, config: MkDocsConfig) -> None:
    """Stop the build if a page is not complete by itself."""
    found = [
        f"{path}: {address}"
        for path in sorted(Path(config.site_dir).rglob("*.*ml"))
        for address in fetched(path.read_text())
    ]
    found += [
        f"{path}: {address}"
        for path in sorted(Path(config.site_dir).rglob("*.css"))
        for address in fetched(path.read_text())
    ]
    if found:
        raise Abort(f"{len(found)} times something would be loaded over the network: " + "; ".join(found[:5]))


def fetched(text: str) -> list[str]:
    """Return the addresses that a page or style sheet fetches from elsewhere."""
    return [match for pattern in LOADED for match in pattern.findall(text)]

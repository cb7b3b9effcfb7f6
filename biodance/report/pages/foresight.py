"""The page of what a planned movement will see: a summary, what to change, and every cause."""

from typing import Any

from biodance.pipeline.provenance import now
from biodance.report.pages.template import render
from biodance.report.tables.diagnosis import CONFUSION_ROW, LIMIT_ROW
from biodance.report.wording import causes_by_effect
from biodance.version import __version__


def foresight_page(document: dict[str, Any], name: str) -> str:
    """Return the page (HTML) of what `foresight_document` says of the movement ``name``."""
    return render(
        "foresight.html.j2",
        found=document,
        movement=name,
        version=__version__,
        created=now(),
        schemas={"limit": LIMIT_ROW, "confusion": CONFUSION_ROW},
        some=lambda causes: causes_by_effect(cause.partition(" ")[::2] for cause in causes),
    )

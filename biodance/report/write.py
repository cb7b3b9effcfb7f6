"""Write what was found into a folder: the page for the analyst and the numbers for programs."""

from pathlib import Path
from typing import Any

from biodance.pipeline.provenance import now, provenance
from biodance.pipeline.results import SessionResult
from biodance.report.page import page
from biodance.report.results_json import document, plain, to_text
from biodance.report.solid import still_address

PAGE, NUMBERS = "report.html", "results.json"


def write_report(result: SessionResult, folder: Path) -> dict[str, Any]:
    """Write ``report.html`` and ``results.json`` into ``folder`` (which exists) and return the content of the latter.

    Each file is written under another name first and then renamed, so that a stopped run leaves no half file.
    """
    made = provenance(result, created=now())
    found = document(result, made)
    still = still_address(result.still) if result.still else ""
    for name, text in ((NUMBERS, to_text(found)), (PAGE, page(result, made, still=still))):
        part = folder / f".{name}.part"
        part.write_text(text, encoding="utf-8", newline="\n")
        part.replace(folder / name)
    return dict(plain(found))

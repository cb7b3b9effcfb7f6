"""The page of a laboratory's plates: what changed when, what is wrong, who stands out."""

from importlib.resources import files
from pathlib import Path
from typing import Any

from biodance.diagnosis.archive.findings import said
from biodance.pipeline.plates import PlatesJudged
from biodance.pipeline.provenance import now
from biodance.report.documents.plates import plates_document
from biodance.report.documents.session import plain_values, to_text
from biodance.report.figures.plates import QUANTITY_TITLES, condition_figure, plate_figure
from biodance.report.figures.style import svg_address
from biodance.version import __version__


def plates_page(found: PlatesJudged, document: dict[str, Any]) -> str:
    """Return the page as HTML text."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    judged = found.judgement
    count = len(judged.findings)
    folder = files("biodance.report") / "templates"
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string((folder / "plates.html.j2").read_text(encoding="utf-8")).render(
        style=Markup((folder / "page.css").read_text(encoding="utf-8")),
        name=document["archive"],
        version=__version__,
        created=now(),
        answer=f"{count} finding{'s' if count != 1 else ''}" if count else "nothing wrong to be seen",
        judged=judged,
        dates=_dates(found),
        persons=document["persons"],
        figures={card.plate: svg_address(plate_figure(card.plate, judged.histories)) for card in judged.plates},
        conditions=[(one, svg_address(condition_figure(one))) for one in judged.conditions],
        said=said,
        words=QUANTITY_TITLES.__getitem__,
        notes=found.notes,
        refused=found.refused,
    )


def _dates(found: PlatesJudged) -> str:
    """Return from when to when the visits are; "" where that is not known."""
    dates = sorted(visit.date[:10] for visit in found.judgement.visits if visit.date)
    return f", {dates[0]} to {dates[-1]}" if dates and len(dates) == len(found.judgement.visits) else ""


def write_plates(found: PlatesJudged, folder: Path) -> dict[str, Any]:
    """Write ``report.html``, ``results.json`` and ``plates.csv`` into ``folder`` (which exists) and return the
    numbers.
    """
    document = plates_document(found)
    texts = {
        "results.json": to_text(document),
        "report.html": plates_page(found, document),
        "plates.csv": found.table().to_csv(index=False, lineterminator="\n"),
    }
    for name, text in texts.items():
        part = folder / f".{name}.part"
        part.write_text(text, encoding="utf-8", newline="\n")
        part.replace(folder / name)
    return dict(plain_values(document))

"""The page of a diagnosis for the analyst: what is wrong, how we know, how big, how sure, what else, what to do, what changes, what stays unseen."""

from importlib.resources import files

from biodance.pipeline.diagnosis import SessionDiagnosis
from biodance.pipeline.provenance import Provenance
from biodance.pipeline.results import SessionResult
from biodance.records import CHANNELS
from biodance.report.wording import millimetres, number


def diagnosis_page(result: SessionResult, found: SessionDiagnosis, provenance: Provenance) -> str:
    """Return the page as HTML text; the same arguments give the same characters."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters.update(number=number, mm=millimetres)
    folder = files("biodance.report") / "templates"
    return environment.from_string((folder / "diagnosis.html.j2").read_text(encoding="utf-8")).render(
        style=Markup((folder / "page.css").read_text(encoding="utf-8")),
        result=result,
        found=found,
        one=found.diagnosis,
        provenance=provenance,
        channels=list(zip(CHANNELS, ("N",) * 3 + ("N·m",) * 3, strict=True)),
    )

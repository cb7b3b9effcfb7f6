"""The analyst's page: one HTML file that holds all it shows and asks nothing of the network."""

import math
from dataclasses import dataclass
from importlib.resources import files

from biodance.lab.gaps import MarkerGaps
from biodance.pipeline.provenance import Provenance
from biodance.pipeline.results import SessionResult, TrialResult
from biodance.records import CHANNELS
from biodance.report.marker_figure import marker_figure
from biodance.report.standing_figure import standing_figure
from biodance.report.still import still_figure
from biodance.report.style import svg_address
from biodance.report.wrench_figure import wrench_figure

STATUS_WORDS = {"ok": "done", "warning": "look here", "refused": "refused"}


def number(value: float | None, digits: int = 1) -> str:
    """Return a number as text with a true minus sign; "–" where it is unknown."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}f}"
    return text.replace("-", "−") if float(text) else text.lstrip("-")


def millimetres(value: float | None, digits: int = 1) -> str:
    """Return metres as text in millimetres."""
    return number(None if value is None else 1000 * value, digits)


@dataclass(frozen=True)
class TrialPart:
    """One trial with its drawn figures as image addresses; "" where there is nothing to draw."""

    result: TrialResult
    markers: str
    wrench: str

    @property
    def gaps(self) -> list[MarkerGaps]:
        """The markers with a gap, the worst first."""
        return sorted((gap for gap in self.result.gaps if gap.percent > 0), key=lambda gap: -gap.percent)

    @property
    def said(self) -> list[str]:
        """What was decided when the trial was read and prepared, each sentence once."""
        trial = self.result.trial
        plates = [
            f"{plate.name}: {line}" for plate in trial.plates for line in plate.decisions if not any(line in h for h in trial.history)
        ]
        return [*trial.history, *plates]

    @property
    def channels(self) -> list[tuple[str, str, float, float]]:
        """Channel, unit, RMS and correlation of the wrench comparison."""
        comparison = self.result.comparison
        if comparison is None:
            return []
        units = ("N",) * 3 + ("N·m",) * 3
        return list(zip(CHANNELS, units, comparison.rms.tolist(), comparison.correlation.tolist(), strict=True))


def _trial_part(result: TrialResult) -> TrialPart:
    return TrialPart(
        result,
        svg_address(marker_figure(result.fit)) if result.fit else "",
        svg_address(wrench_figure(result.comparison)) if result.comparison else "",
    )


def _attention(result: SessionResult) -> list[tuple[str, str]]:
    """Return (where, sentence) of all that a person must look at: files refused, steps refused, warnings, checks outside their limit."""
    found = [(file, why) for file, why in result.session.refused.items()]
    found += [("Session", step.text) for step in result.steps if step.status != "done"]
    found += [("Body", text.removeprefix("Warning: ")) for text in result.doubts]
    for trial in result.trials:
        found += [(f"Trial {trial.trial.name}", text) for text in trial.reasons]
    outside = [check for check in result.checks if not check.inside]
    return found + [(f"{check.what}, {check.where}", f"{check.value}, should be {check.limit}. {check.advice}") for check in outside]


def page(result: SessionResult, provenance: Provenance) -> str:
    """Return the page of ``result`` as HTML text; the same result and provenance give the same characters."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters.update(number=number, mm=millimetres)
    folder = files("biodance.report") / "templates"
    return environment.from_string((folder / "page.html.j2").read_text(encoding="utf-8")).render(
        style=Markup((folder / "page.css").read_text(encoding="utf-8")),
        attention=_attention(result),
        result=result,
        provenance=provenance,
        parts=[_trial_part(trial) for trial in result.trials],
        standing=svg_address(standing_figure(result.standing)) if result.standing else "",
        still=svg_address(still_figure(result.still)) if result.still else "",
        words=STATUS_WORDS,
    )

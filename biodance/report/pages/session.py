"""The analyst's page: one HTML file that holds all it shows and asks nothing of the network."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

from biodance.diagnosis.diagnosis import ABOUT
from biodance.lab.markers.gaps import MarkerGaps
from biodance.pipeline.attention import session_attention
from biodance.pipeline.provenance import Provenance
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import Check, TrialResult
from biodance.records import CHANNELS
from biodance.records.attention import Attention
from biodance.report.figures.session import marker_figure, standing_figure, wrench_figure
from biodance.report.figures.style import svg_address
from biodance.report.pages.identification import identification_section
from biodance.report.wording import format_number, millimetres, trial_and_subject

STATUS_WORDS = {"ok": "done", "warning": "look here", "refused": "refused"}


def check_table(result: SessionResult) -> tuple[list[tuple[str, str]], list[tuple[str, list[Check | None]]]]:
    """Return the trials' checks as a table: its columns (what, limit), and per trial its name and one check or None
    a column.
    """
    columns = list(dict.fromkeys((check.what, check.limit) for trial in result.trials for check in trial.checks))
    rows = []
    for trial in result.trials:
        found = {(check.what, check.limit): check for check in trial.checks}
        rows.append((trial.trial.name, [found.get(column) for column in columns]))
    return columns, rows


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
            f"{plate.name}: {line}"
            for plate in trial.plates
            for line in plate.decisions
            if not any(line in h for h in trial.history)
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


def page(
    result: SessionResult,
    provenance: Provenance,
    *,
    attention: Sequence[Attention] | None = None,
    stills: Sequence[str] = (),
    diagnosis: str = "",
) -> str:
    """Return the page of ``result`` as HTML text; ``attention`` what a person must see (by default
    `session_attention`), ``stills`` the addresses of its 3-D images (`still`, then `more_stills`), ``diagnosis`` the
    section on what the simulation gets wrong, "" for none.

    The same arguments give the same characters.
    """
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    said = session_attention(result) if attention is None else attention
    first = sorted(said, key=lambda one: one.about != ABOUT)
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters.update(number=format_number, mm=millimetres)
    folder = files("biodance.report") / "templates"
    return environment.from_string((folder / "page.html.j2").read_text(encoding="utf-8")).render(
        style=Markup((folder / "page.css").read_text(encoding="utf-8")),
        attention=[(trial_and_subject(one), one.text) for one in first],
        check_table=check_table(result),
        result=result,
        provenance=provenance,
        parts=[_trial_part(trial) for trial in result.trials],
        standing=svg_address(standing_figure(result.standing)) if result.standing else "",
        still=stills[0] if stills else "",
        more_stills=list(zip(stills[1:], result.more_stills, strict=True)) if stills else [],
        diagnosis=Markup(diagnosis),
        identification=Markup(identification_section(result.identification)) if result.identification else "",
        words=STATUS_WORDS,
    )

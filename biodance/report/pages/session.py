"""The analyst's page: one HTML file that holds all it shows and asks nothing of the network."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from biodance.diagnosis.diagnosis import ABOUT
from biodance.identification.validation import TrialValidation
from biodance.lab.markers.gaps import MarkerGaps
from biodance.pipeline.attention import session_attention
from biodance.pipeline.provenance import Provenance
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import Check, TrialResult
from biodance.records import CHANNELS
from biodance.records.attention import Attention
from biodance.report.figures.session import (
    marker_figure,
    place_words,
    standing_figure,
    validation_figure,
    wrench_figure,
)
from biodance.report.figures.still import still_figure
from biodance.report.pages.identification import identification_section
from biodance.report.pages.template import render, template_text
from biodance.report.wording import trial_and_subject

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
    """One trial with its figures as HTML; "" where there is nothing to draw."""

    result: TrialResult
    markers: str
    wrench: str
    validation: TrialValidation | None = None

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


def _trial_part(result: TrialResult, validated: Mapping[str, TrialValidation]) -> TrialPart:
    name = result.trial.name
    if name in validated:
        wrench = validation_figure(validated[name])
    else:
        wrench = wrench_figure(result.comparison, name) if result.comparison else ""
    return TrialPart(result, marker_figure(result.fit) if result.fit else "", wrench, validated.get(name))


def page(
    result: SessionResult,
    provenance: Provenance,
    *,
    attention: Sequence[Attention] | None = None,
    diagnosis: str = "",
    movement: str = "",
) -> str:
    """Return the page of ``result`` as HTML text; ``attention`` what a person must see (by default
    `session_attention`); ``diagnosis`` and ``movement`` the sections on what the simulation gets wrong and on what
    moved, "" for none.

    The same arguments give the same characters.
    """
    from markupsafe import Markup

    said = session_attention(result) if attention is None else attention
    first = sorted(said, key=lambda one: one.about != ABOUT)
    found = result.identification
    validated = {one.name: one for one in (*found.validations, *found.fitted)} if found else {}
    return render(
        "page.html.j2",
        filters={"place": place_words},
        scripts=[template_text("curves.js")],
        attention=[(trial_and_subject(one), one.text) for one in first],
        check_table=check_table(result),
        result=result,
        provenance=provenance,
        parts=[_trial_part(trial, validated) for trial in result.trials],
        standing=Markup(standing_figure(result.standing)) if result.standing else "",
        still=Markup(still_figure(result.still)) if result.still else "",
        more_stills=[(Markup(still_figure(one)), one) for one in result.more_stills],
        diagnosis=Markup(diagnosis),
        movement=Markup(movement),
        identification=Markup(identification_section(result.identification)) if result.identification else "",
        words=STATUS_WORDS,
    )

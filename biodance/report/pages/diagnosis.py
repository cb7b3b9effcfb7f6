"""The pages on causes for the analyst: of a diagnosis, and of what a planned movement will see."""

from html import escape
from typing import Any

import numpy as np

from biodance.diagnosis.accept import Residuals
from biodance.diagnosis.consequence import LIMIT, Adequacy, Unobservable
from biodance.diagnosis.diagnosis import Estimate, Finding
from biodance.diagnosis.reasons import DiagnosisStatus
from biodance.diagnosis.witness_evidence import ObservedEvidence, cause_visibilities
from biodance.display import BLACK, BLUE, GREY, cause_in_words, spaced
from biodance.pipeline.results import SessionDiagnosis, SessionResult
from biodance.pipeline.saved_results import now
from biodance.pipeline.words import first_upper
from biodance.records import CHANNEL_TITLES, CHANNELS, grouped
from biodance.report import wording
from biodance.report.figures import vector as svg
from biodance.report.pages.template import print_sheet, render, template_text
from biodance.report.tables.diagnosis import (
    CONFUSION_ROW,
    FIRST,
    LIMIT_ROW,
    OBSERVED_ROW,
    VISIBILITY_ROW,
    observed_rows,
    seen_causes,
)
from biodance.report.tables.schema import Row, Schema


def left_figure(left: tuple[Residuals, Residuals]) -> str:
    """Return measured minus simulated wrench of the first kept trial, six channels: as it is, and with the findings."""
    before, after = (one.left[0] for one in left)
    rate, use = left[0].rate[0], left[0].use[0]
    time = np.arange(len(before)) / rate
    drawn = (("as it is", before, svg.TABLE), ("findings accepted", after, svg.IDENTIFIED))
    cells = []
    for k in (0, 3, 1, 4, 2, 5):
        curves = [svg.Curve(name, np.where(use, value[:, k], np.nan), look) for name, value, look in drawn]
        cells.append([svg.Strip(CHANNEL_TITLES[k], curves)])
    about = "Measured minus simulated wrench; the numbers are in the table above"
    return svg.CurveFigure(time, cells, about, use).html()


def adequacy_table(rows: tuple[Adequacy, ...]) -> str:
    """Return what is left by channel and band, in sd of sessions without fault, the darker the further."""
    bands = sorted({row.band_hz for row in rows})
    value = {(row.channel, row.band_hz): row.z for row in rows}
    head = "".join(f'<th scope="col">{"rest" if low == 0 else f"{low:g}–{high:g} Hz"}</th>' for low, high in bands)
    lines = []
    for channel in CHANNELS:
        cells = []
        for one in bands:
            z = value.get((channel, one), float("nan"))
            if not np.isfinite(z):
                cells.append("<td>–</td>")
                continue
            # white at 0 sd, darkest at twice the limit and above
            grey, said = round(255 - 185 * min(max(z, 0.0) / (2 * LIMIT), 1.0)), wording.format_number(z, 0)
            cells.append(
                f'<td class="n" style="background:rgb({grey},{grey},{grey});color:{"#fff" if grey < 130 else "#000"}">'
                f"{f'<strong>{said}</strong>' if z > LIMIT else said}</td>"
            )
        lines.append(f'<tr><th scope="row">{escape(channel)}</th>{"".join(cells)}</tr>')
    caption = "Standard deviations of sessions without a fault"
    return (
        f'<table class="narrow heat"><caption>{caption}</caption><thead><tr><th scope="col">channel</th>{head}</tr>'
        f"</thead><tbody>{''.join(lines)}</tbody></table>"
    )


def limits_figure(rows: tuple[Unobservable, ...]) -> str:
    """Return by cause from which size on it is seen, in typical sizes: the best and worst of its places."""
    kinds = grouped((row.effect, row.limit / row.typical) for row in rows)
    order = sorted(kinds, key=lambda name: -np.median(kinds[name]))
    words = ((0.01, "1 %"), (0.1, "a tenth"), (1.0, "typical size"), (10.0, "ten times"))
    x = svg.Axis(0.008, 30.0, "smallest size that this session would have seen, in typical sizes", words, log=True)
    y = svg.Axis(-0.6, len(order) - 0.4, "", tuple((float(i), spaced(name)) for i, name in enumerate(order)))
    marks = [svg.rule(x, 1.0, upright=True, look=svg.Stroke(BLACK, "", 0.9))]
    for i, name in enumerate(order):
        # "never" is infinite, and a logarithmic axis has an end: drawn at the edge
        value = np.clip(np.array(kinds[name]), 0.01, 30.0)
        marks.append(svg.segments(x, y, np.array([[value.min(), i], [value.max(), i]]), svg.Stroke(GREY, "", 2.5)))
        marks.append(svg.points(x, y, np.median(value), i, svg.Stroke(BLUE)))
    about = "per kind of cause the smallest size that this session would have seen"
    drawn = svg.panel(x, y, marks, about, frame=svg.Frame(480.0, 16.0 * len(order), left=130.0, above=4.0))
    return f'<div class="single">{drawn}</div>'


def estimated(one: Estimate) -> str:
    """Return a parameter with its 95 % interval."""
    if one.sd != one.sd:
        return wording.sized(one.value, one.unit)
    value, low, high = (wording.sized(size, one.unit) for size in (one.value, *one.interval))
    return f"{value} (95 % interval {low} to {high})"


def odds(log_bayes_factor: float) -> str:
    """Return evidence against "nothing wrong" as odds in words."""
    if log_bayes_factor != log_bayes_factor or log_bayes_factor == float("inf"):
        return "a check of the recording shows it"
    if log_bayes_factor > 14.0:  # odds of more than a million are not printed
        return "more than a million times as probable as nothing wrong"
    return f"{wording.format_number(2.718281828**log_bayes_factor, 0)} times as probable as nothing wrong"


_ENDINGS = {
    DiagnosisStatus.CLEAN: "nothing is wrong in what was judged",
    DiagnosisStatus.NAMED: "the cause named, or one that looks like it, is there",
    DiagnosisStatus.UNKNOWN: "something is wrong that is not named",
    DiagnosisStatus.CANNOT_TELL: "nobody can tell",
}
"""What the probability of a diagnosis is the probability of."""


def probable(probability: float) -> str:
    """Return a probability as text, such as "P = 0.97"; near 0 and 1 by its bound."""
    if 0.005 <= probability < 0.995:
        return f"P = {wording.format_number(probability, 2)}"
    return "P > 0.99" if probability > 0.5 else "P < 0.01"


def how_sure(one: Finding) -> str:
    """Return how sure a finding is: its probability and its odds against nothing wrong, or that a check shows it."""
    said = odds(one.log_bayes_factor)
    if not np.isfinite(one.log_bayes_factor):
        return f"{first_upper(said)}."
    return f"{probable(one.probability)}; {said}."


def diagnosis_section(found: SessionDiagnosis) -> str:
    """Return the section of the session's report on what the simulation gets wrong, as HTML text."""
    rows = [
        (
            cause_in_words(one.effect, one.target),
            "; ".join(f"{spaced(size.name)} {estimated(size)}" for size in one.parameters),
            one.advice,
        )
        for one in found.diagnosis.findings
    ]
    return render("wrong.html.j2", failures=found.failures, rows=rows)


def diagnosis_page(result: SessionResult, found: SessionDiagnosis, provenance: Row) -> str:
    """Return the page as HTML text; the same arguments give the same characters."""
    from markupsafe import Markup

    one = found.diagnosis
    others, noted = wording.loud_and_noted(one.attention)
    witnesses = _witnesses(one.witnesses)
    witnessed = {(row["effect"], row["target"]) for row in witnesses["seen"]} if witnesses else set()
    blind = LIMIT_ROW.rows(row for row in one.unobservable if (row.effect, row.target) not in witnessed)
    # what no observation sees either, apart by whether any size of it would be seen
    never = [row for row in blind if wording.size_seen(row["limit"], row["typical"], row["unit"]) == wording.NEVER]
    return render(
        "diagnosis.html.j2",
        filters={
            "sized": wording.sized,
            "estimated": estimated,
            "how_sure": how_sure,
            "probable": probable,
            "share": wording.share_of,
            "first_upper": first_upper,
            "spaced": spaced,
        },
        scripts=[template_text("curves.js")],
        sheet=print_sheet(f"Session {result.session.folder.name}", provenance["visit"], provenance["created_utc"]),
        named=cause_in_words,
        schemas={
            "limit": LIMIT_ROW,
            "observed": OBSERVED_ROW,
            "visibility": VISIBILITY_ROW,
            "mass": _MASS,
        },
        unseen=[row for row in blind if row not in never],
        never=wording.causes_by_effect((row["effect"], row["target"]) for row in never),
        result=result,
        one=one,
        ending=_ENDINGS[one.status],
        headline=wording.headline_of(one.attention),
        others=others,
        noted=noted,
        failures={**result.failures, **found.failures},
        provenance=provenance,
        channels=CHANNEL_TITLES,
        masses=_masses(found),
        left=Markup(left_figure(found.left)) if found.left else "",
        adequacy=Markup(adequacy_table(one.adequacy)) if one.adequacy else "",
        limits=Markup(limits_figure(one.limits)) if one.limits else "",
        gain=found.gain,
        witnesses=witnesses,
    )


def _masses(found: SessionDiagnosis) -> list[Row]:
    """Return each segment's mass before and after the findings are accepted; none without both."""
    if not (found.before and found.accepted):
        return []
    then, accepted = (
        dict(zip(one.sip.segments, one.sip.mass.tolist(), strict=True)) for one in (found.before, found.accepted)
    )
    return [{"segment": name, "before": then.get(name), "after": mass} for name, mass in accepted.items()]


def _witnesses(evidence: ObservedEvidence | None) -> dict[str, Any] | None:
    """Return the causes with the observers that respond to them, the others in words, and all observations."""
    if evidence is None:
        return None
    rows = VISIBILITY_ROW.rows(cause_visibilities(evidence))
    blind = (row for row in rows if not row["witnesses"])
    unseen = grouped((" ".join(row["would_be_seen_by"]), cause_in_words(row["effect"], row["target"])) for row in blind)
    return {
        "seen": [row for row in rows if row["witnesses"]],
        "unseen": [("; ".join(causes), would) for would, causes in unseen.items()],
        "observations": [
            row if row["counts"] else row | {"what": f"{row['what']} (shown only)"}
            for row in sorted(observed_rows(evidence), key=lambda one: -abs(one["z"]))
        ],
    }


_MASS = Schema("", shown="segment: {segment:name} | as it is (kg): {before:2} | accepted (kg): {after:2}")


def foresight_page(document: dict[str, Any], name: str) -> str:
    """Return the page (HTML) of what `foresight_document` says of the movement ``name``."""
    return render(
        "foresight.html.j2",
        found=document,
        movement=name,
        created=now(),
        schemas={"limit": LIMIT_ROW, "confusion": CONFUSION_ROW},
        first=FIRST,
        seen=wording.causes_by_effect(seen_causes(document)),
        hidden=wording.causes_by_effect((row["effect"], row["target"]) for row in document["unobservable"]),
        some=lambda causes: wording.causes_by_effect(cause.partition(" ")[::2] for cause in causes),
    )
